// SPDX-License-Identifier: Apache-2.0
#include "ros/reading_watch.hpp"

#include <utility>

namespace dynid {
namespace {

// Of a window. Samples so far apart carry motions of up to a hundred periods in it.
constexpr double step = 1.0 / 3000.0, first_look = 0.25;

}  // namespace

std::string misread_text(const ConventionReport& report) {
  std::string text;
  for (const Convention& c : report.conventions) text += (text.empty() ? "" : "; ") + c.text;
  if (text.empty()) return text;
  for (const std::string& other : report.equivalents) text += " (or it is " + other + ", no log can tell)";
  return text + ": give ~assume " + report.assume;
}

ReadingWatch::ReadingWatch(int joints, double window)
    : joints_(joints), window_(window), next_(first_look * window) {}

void ReadingWatch::restart() {
  t_.clear();
  rows_.clear();
  next_ = first_look * window_;
}

void ReadingWatch::add(const JointSample& sample) {
  if (!(window_ > 0.0) || sample.q.size() != joints_) return;
  if (!sample.q.allFinite() || !sample.dq.allFinite() || !sample.tau.allFinite()) return;
  if (!t_.empty()) {
    const double since = sample.t - t_.back();
    if (since < 0.0 || since > window_)
      restart();
    else if (since < step * window_)
      return;
  }
  Eigen::VectorXd row(3 * joints_);
  row << sample.q, sample.dq, sample.tau;
  t_.push_back(sample.t);
  rows_.push_back(std::move(row));
}

bool ReadingWatch::ask(const Robot& nominal) {
  if (!due()) return false;
  Log log;
  log.source = "joint states";
  const auto samples = static_cast<Eigen::Index>(t_.size());
  log.t.resize(samples);
  for (Eigen::MatrixXd* x : {&log.q, &log.dq, &log.tau}) x->resize(samples, joints_);
  for (Eigen::Index i = 0; i < samples; ++i) {
    const Eigen::VectorXd& row = rows_[static_cast<std::size_t>(i)];
    log.t[i] = t_[static_cast<std::size_t>(i)] - t_.front();
    log.q.row(i) = row.head(joints_).transpose();
    log.dq.row(i) = row.segment(joints_, joints_).transpose();
    log.tau.row(i) = row.tail(joints_).transpose();
  }
  report_ = find_conventions(nominal, {log});
  text_ = misread_text(report_);
  asked_ = true;
  if (next_ < window_)
    next_ *= 2.0;
  else
    restart(), next_ = window_;
  return true;
}

}  // namespace dynid
