// SPDX-License-Identifier: Apache-2.0
#include "dynid/identification/regression.hpp"

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>

#include "dynid/dynamics/model.hpp"
#include "dynid/dynamics/regressor.hpp"
#include "dynid/dynamics/workspace.hpp"

namespace dynid {
namespace {

constexpr double edge_periods = 1.0;  // of the cut-off

DecimatingFilter row_filter(const Segment& segment, double cutoff) {
  const auto factor =
      std::max<Eigen::Index>(1, static_cast<Eigen::Index>(std::floor(segment.rate / (2.5 * cutoff))));
  return {ZeroPhaseButterworth(cutoff, segment.rate).half_kernel(), factor};
}

}  // namespace

RegressionRows::RegressionRows(const Robot& robot, const BaseParameters& base, const PreparedLog& log) {
  const int n = robot.size(), r = base.size();
  parts_.push_back(0);
  for (const Segment& segment : log.segments) {
    const DecimatingFilter filter = row_filter(segment, log.cutoff);
    // Beyond the ends of a recording the filter has to invent the motion: rows that feel it are left out.
    const auto edge = static_cast<Eigen::Index>(std::ceil(edge_periods * segment.rate / log.cutoff));
    Eigen::Index first = 0, last = filter.outputs(segment.t.size()) - 1;
    while (first <= last && filter.centre(first) < edge) ++first;
    while (last >= first && filter.centre(last) > segment.t.size() - 1 - edge) --last;
    filters_.push_back(filter);
    first_output_.push_back(first);
    parts_.push_back(parts_.back() + last - first + 1);
    dq_.push_back(segment.dq);
  }
  const Eigen::Index rows = parts_.back();
  t_.resize(rows);
  tau_.resize(rows, n);
  rigid_.assign(static_cast<std::size_t>(n), Eigen::MatrixXd(rows, r));

  const Model<> model(robot);
  for (std::size_t p = 0; p < filters_.size(); ++p) {
    const Segment& segment = log.segments[p];
    const DecimatingFilter& filter = filters_[p];
    const Eigen::Index samples = segment.t.size(), first_row = parts_[p], count = parts_[p + 1] - first_row;
    const Eigen::Index first_output = first_output_[p];
    if (count == 0) continue;
    const Eigen::Index step = filter.centre(1) - filter.centre(0);
    overlap_ = std::max(overlap_,
                        static_cast<Eigen::Index>(std::ceil(2.0 * segment.rate / log.cutoff / double(step))));
    tau_.middleRows(first_row, count) = filter.apply(segment.tau).middleRows(first_output, count);
    for (Eigen::Index k = 0; k < count; ++k) t_[first_row + k] = segment.t[filter.centre(first_output + k)];

    // Blocks of outputs, each evaluating the samples it depends on: no full-rate regressor is ever kept.
    constexpr Eigen::Index grain = 128;
    tbb::parallel_for(
        tbb::blocked_range<Eigen::Index>(0, (count + grain - 1) / grain, 1), [&](const auto& blocks) {
          Workspace<> workspace(model);
          Eigen::MatrixXd Y(n, 10 * n), full;
          Eigen::VectorXd q(n), dq(n), ddq(n);
          for (Eigen::Index b = blocks.begin(); b != blocks.end(); ++b) {
            const Eigen::Index k0 = first_output + b * grain,
                               k1 = first_output + std::min(count, (b + 1) * grain) - 1;
            const Eigen::Index from = std::max<Eigen::Index>(0, filter.centre(k0) - filter.reach());
            const Eigen::Index to = std::min(samples - 1, filter.centre(k1) + filter.reach());
            full.resize(to - from + 1, n * r);
            for (Eigen::Index i = from; i <= to; ++i) {
              q = segment.q.row(i);
              dq = segment.dq.row(i);
              ddq = segment.ddq.row(i);
              regressor(model, workspace, q, dq, ddq, Y);
              for (int c = 0; c < r; ++c) {
                const int column = base.columns[static_cast<std::size_t>(c)];
                for (int j = 0; j < n; ++j)
                  full(i - from, j * r + c) = column < base.standard        ? Y(j, column)
                                              : column - base.standard == j ? ddq[j]
                                                                            : 0.0;
              }
            }
            for (Eigen::Index k = k0; k <= k1; ++k) {
              const Eigen::RowVectorXd out = filter.output(k, full, from, samples);
              for (int j = 0; j < n; ++j)
                rigid_[static_cast<std::size_t>(j)].row(first_row + k - first_output) = out.segment(j * r, r);
            }
          }
        });
  }
}

Eigen::MatrixXd RegressionRows::velocity_columns(int j, int columns,
                                                 const std::function<Eigen::RowVectorXd(double)>& row) const {
  Eigen::MatrixXd out(size(), columns);
  for (std::size_t p = 0; p < filters_.size(); ++p) {
    Eigen::MatrixXd full(dq_[p].rows(), columns);
    for (Eigen::Index i = 0; i < full.rows(); ++i) full.row(i) = row(dq_[p](i, j));
    out.middleRows(parts_[p], parts_[p + 1] - parts_[p]) =
        filters_[p].apply(full).middleRows(first_output_[p], parts_[p + 1] - parts_[p]);
  }
  return out;
}

Eigen::VectorXd RegressionRows::velocity(int j) const {
  return velocity_columns(j, 1, [](double dq) { return Eigen::RowVectorXd::Constant(1, dq); });
}

}  // namespace dynid
