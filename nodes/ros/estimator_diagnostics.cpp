// SPDX-License-Identifier: Apache-2.0
#include "ros/estimator_diagnostics.hpp"

#include <diagnostic_msgs/DiagnosticStatus.h>

#include <algorithm>
#include <cmath>

#include "dynid/base/number.hpp"
#include "dynid/base/text.hpp"

namespace dynid {

namespace {

using Level = diagnostic_msgs::DiagnosticStatus;

}  // namespace

std::string describe(Status status) {
  static constexpr struct {
    Status flag;
    const char* name;
  } flags[] = {{Status::restarted, "restarted"},
               {Status::bad_input, "bad_input"},
               {Status::stale, "stale"},
               {Status::time_went_back, "time_went_back"},
               {Status::gap, "gap"},
               {Status::limits_exceeded, "limits_exceeded"},
               {Status::near_singular, "near_singular"},
               {Status::model_changed, "model_changed"}};
  std::vector<std::string> names;
  for (const auto& one : flags)
    if (has(status, one.flag)) names.emplace_back(one.name);
  return names.empty() ? "ok" : join(names);
}

std::string EstimatorDiagnostics::joint(int index) const {
  return index >= 0 && index < static_cast<int>(joints_.size()) ? joints_[static_cast<std::size_t>(index)]
                                                                : "";
}

std::uint64_t EstimatorDiagnostics::since(Withheld why) const {
  const auto at = static_cast<std::size_t>(why);
  return now_.withheld[at] - before_.withheld[at];
}

void EstimatorDiagnostics::begin(const EstimatorRecord& record, double now, int publishers) {
  before_ = time_ < 0.0 ? record : now_;
  if (time_ < 0.0) {
    before_ = EstimatorRecord();
    last_message_ = now;
  }
  now_ = record;
  elapsed_ = time_ < 0.0 ? 0.0 : now - time_;
  time_ = now;
  publishers_ = publishers;
  if (now_.messages != before_.messages) last_message_ = now;
}

void EstimatorDiagnostics::input(Wrapper& status) const {
  const std::uint64_t messages = now_.messages - before_.messages,
                      answered = now_.answered - before_.answered;
  // With several publishers the numbers of their messages say nothing.
  const std::uint64_t dropped = publishers_ > 1 ? 0 : now_.dropped - before_.dropped;
  std::uint64_t refused = 0;
  std::string why;
  for (std::size_t k = 1; k < withheld_count; ++k) {
    const auto reason = static_cast<Withheld>(k);
    if (reason == Withheld::other_joints || reason == Withheld::settling || since(reason) == 0) continue;
    refused += since(reason);
    why += (why.empty() ? "" : ", ") + std::string(describe(reason));
    if (now_.last_withheld == reason && now_.last_joint >= 0) why += " (" + joint(now_.last_joint) + ")";
  }
  const double silent = time_ - last_message_;
  // A packet lost now and then, on the robot's own side, is how robots are.
  const std::uint64_t repeated = since(Withheld::repeated);
  if (refused == repeated && repeated * 20 <= messages) refused = 0;

  if (now_.messages == 0 && now_.withheld[static_cast<std::size_t>(Withheld::other_joints)] > 0)
    status.summary(Level::ERROR, topic_ + " has none of the robot's joints");
  else if (now_.messages == 0)
    status.summary(Level::ERROR, "no message on " + topic_ + " yet");
  else if (messages == 0 && silent >= silence_)
    status.summaryf(Level::ERROR, "no message on %s for %.1f s", topic_.c_str(), silent);
  else if (messages > 0 && answered == 0 && refused > 0)
    status.summary(Level::ERROR, "no message answered: " + why);
  else if (refused > 0)
    status.summaryf(Level::WARN, "%llu messages not answered: %s", static_cast<unsigned long long>(refused),
                    why.c_str());
  else if (dropped > 0)
    status.summaryf(Level::WARN, "%llu messages lost on the way", static_cast<unsigned long long>(dropped));
  else if (messages > 0 && answered == 0)
    status.summary(Level::WARN, "settling after a start");
  else
    status.summaryf(Level::OK, repeated > 0 ? "answering, but for %llu samples repeated" : "answering",
                    static_cast<unsigned long long>(repeated));

  const EstimatorRecord::Window& window = now_.window;
  const double steps = static_cast<double>(std::max<std::uint64_t>(window.steps, 1));
  const double mean = window.sum / steps;
  status.add("topic", topic_);
  status.add("publishers", publishers_);
  status.addf("rate [Hz]", "%.1f", elapsed_ > 0.0 ? static_cast<double>(messages) / elapsed_ : 0.0);
  status.addf("mean dt [ms]", "%.4f", 1e3 * mean);
  status.addf("jitter of dt [ms]", "%.4f",
              1e3 * std::sqrt(std::max(window.sum_of_squares / steps - mean * mean, 0.0)));
  status.addf("longest dt [ms]", "%.4f", 1e3 * window.longest);
  status.addf("oldest message [ms]", "%.3f", 1e3 * window.oldest);
  status.add("messages", now_.messages);
  status.add("answered", now_.answered);
  status.add("lost", now_.dropped);
  status.add("starts", now_.starts);
  for (std::size_t k = 1; k < withheld_count; ++k)
    status.add(describe(static_cast<Withheld>(k)), now_.withheld[k]);
  if (now_.last_withheld != Withheld::none)
    status.add("last not answered", std::string(describe(now_.last_withheld)) +
                                        (now_.last_joint >= 0 ? " (" + joint(now_.last_joint) + ")" : ""));
}

void EstimatorDiagnostics::output(Wrapper& status, const Eigen::VectorXd& contact_threshold) const {
  status.summary(Level::OK, now_.contact ? "contact" : "no contact");
  if (now_.beyond_limits != before_.beyond_limits)
    status.summary(Level::WARN, "the robot is beyond a limit of the model");
  if (now_.rest_time > 0.5)
    for (Eigen::Index i = 0; i < now_.rest.size() && i < contact_threshold.size(); ++i)
      if (std::abs(now_.rest[i]) > 0.5 * contact_threshold[i])
        status.mergeSummaryf(Level::WARN,
                             "residual of %.2f N m at rest on %s: the model or the payload is not right, or "
                             "someone leans on the arm",
                             now_.rest[i], joint(static_cast<int>(i)).c_str());
  status.addf("worst compute time [us]", "%.1f", 1e6 * now_.window.worst_compute);
  status.addf("worst compute time since the start [us]", "%.1f", 1e6 * now_.worst_compute);
  status.add("residual at rest [N m]", now_.rest.size() > 0 ? fixed_row(now_.rest, 3, " ") : "");
  status.addf("resting for [s]", "%.1f", now_.rest_time);
  status.add("contact thresholds [N m]", fixed_row(contact_threshold, 3, " "));
  status.add("last status", describe(now_.last_status));
  status.add("near a singularity", now_.near_singular);
  status.add("beyond a limit", now_.beyond_limits);
}

void EstimatorDiagnostics::model(Wrapper& status, const EstimatorModel& model, const LinkInertia& payload,
                                 const std::string& trouble) {
  status.summary(Level::OK, "in use");
  if (!model.broken.empty())
    status.summary(Level::WARN, "not physically consistent: " + dynid::describe(model.broken.front()));
  if (!model.uncompensated.empty())
    status.mergeSummary(Level::WARN, "not compensated: " + join(model.uncompensated));
  if (!trouble.empty()) status.mergeSummary(Level::WARN, "last change refused: " + trouble);
  status.add("file", model.path);
  status.add("robot", model.file.robot.name);
  status.add("note", model.file.note);
  status.add("physically consistent", model.broken.empty() ? "yes" : "no");
  for (const Inconsistency& broken : model.broken) status.add("broken", dynid::describe(broken));
  status.addf("payload mass [kg]", "%g", payload.mass);
  status.add("payload com [m]", number_row(payload.com, 6, " "));
}

void EstimatorDiagnostics::frames(Wrapper& status, const EstimatorFrames& frames) {
  status.summary(Level::OK, "known");
  if (!frames.gravity_known()) status.summary(Level::WARN, "gravity: " + frames.gravity_text());
  if (!frames.wrench_frame().known) status.mergeSummary(Level::WARN, "wrench: " + frames.wrench_text());
  status.add("gravity [m/s^2]", fixed_row(frames.gravity(), 4, " "));
  status.add("gravity from", frames.gravity_text());
  status.add("wrench frame", frames.wrench_text());
}

void EstimatorDiagnostics::reading(Wrapper& status, const ReadingWatch& watch, bool assumed, double window) {
  if (assumed)
    status.summary(Level::OK, "read as assumed");
  else if (!watch.text().empty())
    status.summary(Level::ERROR, watch.text());
  else if (watch.asked())
    status.summary(Level::OK, "the messages say nothing against being read as they stand");
  else
    status.summary(Level::OK, window > 0.0 ? "not enough motion yet" : "not asked");
  for (const Convention& c : watch.report().conventions) {
    status.addf(c.name + ": explained as it stands [%]", "%.0f", 100.0 * c.explained_before);
    status.addf(c.name + ": explained so [%]", "%.0f", 100.0 * c.explained_after);
  }
}

}  // namespace dynid
