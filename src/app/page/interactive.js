// SPDX-License-Identifier: Apache-2.0
// Draws the plots of a page from its data (#plot-data), over gnuplot's drawings, which stay for print: zoom and cursor
// go together within a group; joints go on and off; everything with the keyboard too.
(function () {
  "use strict";
  var height = 230;

  function style(property) {
    return getComputedStyle(document.documentElement).getPropertyValue(property).trim();
  }
  function element(name, attributes, text) {
    var e = document.createElement(name);
    Object.keys(attributes || {}).forEach(function (key) { e.setAttribute(key, attributes[key]); });
    if (text) e.textContent = text;
    return e;
  }
  function unpacked(column) {
    return column.values.map(function (x) { return x === null ? null : x * column.unit; });
  }
  function shortNumber(x) {
    return x === null || x === undefined ? "–" : String(Number(x.toPrecision(3))).replace("-", "−");
  }

  function start(group) {
    var folder = document.querySelector('.plots[data-group="' + group.id + '"]');
    if (!folder) return;
    var t = unpacked(group.t), columns = group.columns.map(unpacked), drawn = [], zooming = false;
    var whole = { min: t[0], max: t[t.length - 1] }, range = whole;

    function values(line) {
      if (line.less < 0) return columns[line.column];
      return columns[line.column].map(function (x, i) {
        return x === null ? null : Math.max(0.01, 1e3 * Math.abs(x - columns[line.less][i]));
      });
    }

    function zoom(min, max) {
      if (zooming) return;
      var least = (whole.max - whole.min) / 1000;
      if (!(max - min >= least)) return;
      zooming = true;
      range = { min: Math.max(whole.min, min), max: Math.min(whole.max, max) };
      drawn.forEach(function (u) { u.setScale("x", range); });
      zooming = false;
    }

    // Behind the lines: what was held out, and the band of the noise.
    function background(u, plot) {
      var c = u.ctx, box = u.bbox;
      function fill(x0, x1, y0, y1, colour, opacity) {
        var left = Math.max(box.left, u.valToPos(x0, "x", true)),
          right = Math.min(box.left + box.width, u.valToPos(x1, "x", true)),
          top = Math.max(box.top, u.valToPos(y1, "y", true)),
          bottom = Math.min(box.top + box.height, u.valToPos(y0, "y", true));
        if (right <= left || bottom <= top) return;
        c.save();
        c.globalAlpha = opacity;
        c.fillStyle = style(colour);
        c.fillRect(left, top, right - left, bottom - top);
        c.restore();
      }
      if (plot.band > 0) fill(whole.min, whole.max, -plot.band, plot.band, "--floor", 0.28);
      group.shaded.forEach(function (s) { fill(s[0], s[1], plot.range[0], plot.range[1], "--after", 0.07); });
    }

    function draw(plot, figure) {
      var frame = element("div", { class: "plot", tabindex: "0", role: "group", "aria-roledescription": "plot",
        "aria-label": plot.label + " Left and right arrow keys read values, plus and minus zoom, 0 shows the whole range." });
      var readout = element("p", { class: "readout" });
      figure.appendChild(frame);
      figure.appendChild(readout);
      figure.classList.add("live");
      function axis(label, size) {
        return { label: label, labelSize: 18, labelGap: 0, gap: 3, labelFont: "13px system-ui, sans-serif", font: "12px system-ui, sans-serif", size: size,
          stroke: function () { return style("--soft"); }, grid: { stroke: function () { return style("--grid"); }, width: 1 },
          ticks: { stroke: function () { return style("--rule"); }, width: 1, size: 5 } };
      }
      var y = axis(plot.axis, 46);
      if (plot.log)
        y.values = function (u, splits) {
          return splits.map(function (x) { return Math.abs(Math.log10(x) % 1) < 1e-9 ? String(Number(x.toPrecision(1))) : ""; });
        };
      var u = new uPlot({
        width: frame.clientWidth || 400, height: height,
        legend: { show: false },
        cursor: { sync: { key: group.id, setSeries: false }, drag: { x: true, y: false, dist: 4 }, points: { size: 7 } },
        scales: {
          x: { time: false, range: function (u, min, max) { return min === null ? [whole.min, whole.max] : [min, max]; } },
          y: { distr: plot.log ? 3 : 1, range: function () { return plot.range; } }
        },
        axes: [axis("t [s]", 28), y],
        series: [{}].concat(plot.lines.map(function (line) {
          return { label: line.name, width: line.width, stroke: function () { return style(line.colour); },
            points: { show: false } };
        })),
        hooks: {
          drawClear: [function (u) { background(u, plot); }],
          setScale: [function (u, key) { if (key === "x") zoom(u.scales.x.min, u.scales.x.max); }],
          setCursor: [function (u) {
            var i = u.cursor.idx;
            if (i === null || i === undefined || u.cursor.left < 0) { readout.textContent = ""; return; }
            readout.textContent = "t " + shortNumber(u.data[0][i]) + " s: " + plot.lines.map(function (line, k) {
              return line.name + " " + shortNumber(u.data[k + 1][i]);
            }).join(", ");
          }]
        }
      }, [t].concat(plot.lines.map(values)), frame);
      frame.plot = u;
      drawn.push(u);
      if (range !== whole) u.setScale("x", range);
      // Read aloud only where the keyboard moves the cursor.
      frame.addEventListener("blur", function () { readout.removeAttribute("aria-live"); });
      frame.addEventListener("keydown", function (event) {
        var span = range.max - range.min, middle, i = u.cursor.idx;
        if (event.ctrlKey || event.metaKey || event.altKey) return;
        if (event.key === "ArrowLeft" || event.key === "ArrowRight") {
          var at = u.cursor.left >= 0 && i !== null && i !== undefined ? t[i] : (range.min + range.max) / 2;
          at += (event.key === "ArrowLeft" ? -1 : 1) * span / (event.shiftKey ? 10 : 50);
          if (at < range.min) zoom(Math.max(whole.min, at - span / 10), Math.max(whole.min, at - span / 10) + span);
          if (at > range.max) zoom(Math.min(whole.max, at + span / 10) - span, Math.min(whole.max, at + span / 10));
          readout.setAttribute("aria-live", "polite");
          u.setCursor({ left: u.valToPos(Math.min(range.max, Math.max(range.min, at)), "x"), top: u.over.clientHeight / 2 }, true, true);
        } else if (event.key === "+" || event.key === "=" || event.key === "-") {
          middle = u.cursor.left >= 0 && i !== null && i !== undefined ? t[i] : (range.min + range.max) / 2;
          span *= event.key === "-" ? 1 : 0.25;
          zoom(middle - span, middle + span);
        } else if (event.key === "0" || event.key === "Escape") {
          zoom(whole.min, whole.max);
        } else {
          return;
        }
        event.preventDefault();
      });
      new ResizeObserver(function () {
        if (frame.clientWidth > 0 && frame.clientWidth !== u.width) u.setSize({ width: frame.clientWidth, height: height });
      }).observe(frame);
    }

    function show(plot, figure, on) {
      figure.hidden = !on;
      if (on && !figure.classList.contains("live")) draw(plot, figure);
    }

    var figures = group.plots.map(function (plot) { return folder.querySelector('figure[data-plot="' + plot.id + '"]'); });
    var tools = element("div", { class: "tools" }), joints = element("fieldset", {});
    joints.appendChild(element("legend", {}, "Joints shown"));
    group.plots.map(function (plot) { return plot.joint; }).filter(function (joint, k, all) {
      return all.indexOf(joint) === k;
    }).forEach(function (joint) {
      var label = element("label", {}), box = element("input", { type: "checkbox", value: String(joint) });
      box.checked = group.plots.some(function (plot, k) { return plot.joint === joint && !figures[k].hidden; });
      box.addEventListener("change", function () {
        group.plots.forEach(function (plot, k) { if (plot.joint === joint) show(plot, figures[k], box.checked); });
      });
      label.appendChild(box);
      label.appendChild(document.createTextNode(String(joint)));
      joints.appendChild(label);
    });
    var reset = element("button", { type: "button" }, "Whole range");
    reset.addEventListener("click", function () { zoom(whole.min, whole.max); });
    tools.appendChild(joints);
    tools.appendChild(reset);
    tools.appendChild(element("span", { class: "note" }, "Drag across a plot to zoom, double-click for the whole range."));
    folder.parentNode.insertBefore(tools, folder);
    group.plots.forEach(function (plot, k) { if (!figures[k].hidden) show(plot, figures[k], true); });
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", function () {
      drawn.forEach(function (u) { u.redraw(false, true); });
    });
  }

  // What scrolls can be scrolled with the keyboard.
  document.querySelectorAll(".scroll, pre").forEach(function (e) {
    if (e.scrollWidth > e.clientWidth) e.setAttribute("tabindex", "0");
  });
  JSON.parse(document.getElementById("plot-data").textContent).groups.forEach(start);
})();
