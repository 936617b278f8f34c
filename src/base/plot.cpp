// SPDX-License-Identifier: Apache-2.0
#include "base/plot.hpp"

#include <stdlib.h>  // mkstemp, which is POSIX's; NOLINT(modernize-deprecated-headers)
#include <unistd.h>

#include <cstdio>
#include <filesystem>

namespace dynid {
namespace {

void replace_all(std::string& text, const std::string& from, const std::string& to) {
  for (std::size_t at = 0; (at = text.find(from, at)) != std::string::npos; at += to.size())
    text.replace(at, from.size(), to);
}

/// Removes from each `first` to the `last` after it.
void cut_all(std::string& text, const std::string& first, const std::string& last) {
  for (std::size_t at = 0; (at = text.find(first, at)) != std::string::npos;) {
    const std::size_t end = text.find(last, at);
    if (end == std::string::npos) return;
    text.erase(at, end + last.size() - at);
  }
}

}  // namespace

std::string plot_svg(const std::string& commands, const std::string& name) {
  std::string script = (std::filesystem::temp_directory_path() / "dynid-plot-XXXXXX").string();
  const int file = mkstemp(script.data());
  if (file < 0) return "";
  const bool written = write(file, commands.data(), commands.size()) == static_cast<ssize_t>(commands.size());
  close(file);
  std::string svg;
  bool made = false;
  if (written) {
    if (FILE* const pipe = popen(("gnuplot '" + script + "' 2>/dev/null").c_str(), "r")) {
      char buffer[65536];
      for (std::size_t size; (size = std::fread(buffer, 1, sizeof buffer, pipe)) > 0;)
        svg.append(buffer, size);
      made = pclose(pipe) == 0;
    }
  }
  std::filesystem::remove(script);
  const std::size_t begin = svg.find("<svg"), end = svg.rfind("</svg>");
  if (!made || begin == std::string::npos || end == std::string::npos) return "";
  svg = svg.substr(begin, end + 6 - begin);
  // Marks for points that nothing here draws, and groups left empty: most of the text.
  cut_all(svg, "<defs>", "</defs>\n");
  cut_all(svg, "<desc>", "</desc>\n");
  cut_all(svg, "<title>gnuplot_plot", "</title>");  // a name that nobody gave, and that a mouse shows
  for (std::size_t at = 0; (at = svg.find("<g ", at)) != std::string::npos;) {
    const std::size_t close_tag = svg.find('>', at);
    if (svg.compare(close_tag, 6, ">\n</g>") == 0)
      svg.erase(at, close_tag + 6 - at);
    else
      at = close_tag;
  }
  replace_all(svg, "id=\"gnuplot_canvas\"", "id=\"" + name + "_canvas\"");
  replace_all(svg, "id=\"gnuplot_plot", "id=\"" + name + "_plot");
  while (svg.find("\n\n") != std::string::npos) replace_all(svg, "\n\n", "\n");
  return svg;
}

}  // namespace dynid
