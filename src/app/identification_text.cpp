// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cstdio>
#include <iomanip>
#include <ostream>
#include <sstream>

#include "app/words.hpp"
#include "dynid/app/choices.hpp"
#include "dynid/app/report.hpp"
#include "dynid/app/text.hpp"
#include "dynid/base/number.hpp"
#include "dynid/base/text.hpp"

namespace dynid {
namespace {

void print_consistency(std::ostream& out, const std::string& source, bool consistent) {
  out << "The standard parameters nearest " << source << " that have these coefficients are "
      << (consistent ? "physically consistent.\n" : "not physically consistent: see dynid retrieve.\n");
}

void print_issues(std::ostream& out, const std::vector<PreparedLog>& logs, int joints) {
  for (const PreparedLog& log : logs)
    for (const DataIssue& issue : log.report.issues) {
      out << "  " << log.source << ": " << issue.name << ": " << issue.text;
      if (!issue.joints.empty() && static_cast<int>(issue.joints.size()) < joints) {
        out << " (joints";
        for (const int joint : issue.joints) out << " " << joint;
        out << ")";
      }
      out << "\n";
    }
}

void print_conventions(std::ostream& out, const ConventionReport& report, bool applied) {
  for (const Convention& c : report.conventions)
    out << (applied ? "Read as assumed: " : "Warning: ") << c.text
        << (applied ? "" : ": give --assume " + report.assume) << "\n";
  for (const std::string& other : report.equivalents)
    out << "  (the log does not tell this from " << other << ")\n";
  if (!report.undecided_text.empty()) out << "Note: " << report.undecided_text << "\n";
}

}  // namespace

std::string in_a_row(const Eigen::Ref<const Eigen::VectorXd>& x, int digits) {
  std::ostringstream text;
  text << std::setprecision(digits);
  for (Eigen::Index i = 0; i < x.size(); ++i) text << (i > 0 ? "  " : "") << x[i];
  return text.str();
}

void print(std::ostream& out, const std::vector<Coefficient>& coefficients) {
  std::size_t width = 11;
  for (const Coefficient& c : coefficients) width = std::max(width, c.name.size());
  out << "  " << std::left << std::setw(static_cast<int>(width)) << "coefficient" << std::right
      << std::setw(13) << "value" << std::setw(10) << "std %"
      << "  groups\n";
  for (const Coefficient& c : coefficients) {
    char numbers[64];
    std::snprintf(numbers, sizeof numbers, "%13.6g%10.3g", c.value, c.std_percent);
    out << "  " << std::left << std::setw(static_cast<int>(width)) << c.name << std::right << numbers
        << (c.kept ? "  " : "  (dropped) ") << (c.expression == c.name ? "" : c.expression) << "\n";
  }
}

void print(std::ostream& out, const InfoReport& report) {
  const Robot& robot = report.robot;
  out << robot.name << ": " << robot.size() << " joints, " << robot.base_link << " to " << robot.tip_link
      << ", moving mass " << report.total_mass << " kg\n";
  for (std::size_t j = 0; j < robot.joints.size(); ++j) {
    const Joint& joint = robot.joints[j];
    out << "  " << j + 1 << "  " << joint.name << "  " << detail::word_for(joint.type) << "  ["
        << joint.limits.lower << ", " << joint.limits.upper << "], velocity " << joint.limits.velocity
        << ", torque " << joint.limits.torque << "\n";
  }
  for (const Identifiable kind : {Identifiable::alone, Identifiable::in_combination, Identifiable::no}) {
    out << "Identifiable " << detail::word_for(kind) << ":";
    if (kind == Identifiable::no) out << " (no influence on any torque)";
    for (std::size_t k = 0; k < report.parameters.size(); ++k)
      if (report.parameters[k] == kind) out << " " << parameter_name(static_cast<int>(k), robot.size());
    out << "\n";
  }
  const BaseParameters& base = report.base;
  out << base.size() << " base parameters:\n";
  for (std::size_t i = 0; i < base.names.size(); ++i)
    out << "  " << base.names[i] << " = " << base.expressions[i] << "\n";
  if (report.broken.empty()) out << "Every link is physically consistent.\n";
}

void print(std::ostream& out, const IdentifyReport& report) {
  const Identification& id = report.identification;
  const std::string unit = detail::torque_units(id.robot);
  out << "Identified " << id.rank << " coefficients of " << id.robot.name << " from " << id.fit.rows
      << " rows a joint, low-passed at " << id.cutoff << " Hz\n"
      << "  condition number " << id.condition_number << ", relative error " << id.fit.relative_error_percent
      << " %\n"
      << "  rms [" << unit << "]            " << in_a_row(id.fit.rmse) << "\n";
  if (id.validation)
    out << "  rms held out [" << unit << "]   " << in_a_row(id.validation->rmse) << "  ("
        << id.validation->source << ")\n";
  else
    out << "  " << id.validation_note << "\n";
  print_issues(out, id.logs, id.robot.size());
  for (const FrictionComparison& c : id.friction)
    out << "  joint " << c.joint << ": " << word_for(friction_laws(), c.chosen) << " friction (held-out rms "
        << c.linear << " linear, " << c.sigmoid << " sigmoid)\n";
  print(out, id.coefficients);
  print_conventions(out, report.conventions, report.conventions_applied);
  for (const Remark& r : id.remarks) out << "Warning: " << r.text << "\n";
  print_consistency(out, report.source, report.physically_consistent);
}

void print(std::ostream& out, const FrictionReport& report) {
  const std::string unit = detail::torque_units(report.friction.robot);
  out << "Friction on top of " << report.source << " (Section IV-B), "
      << word_for(friction_laws(), report.law) << " law\n"
      << "  rms before [" << unit << "]: " << in_a_row(report.friction.before.rmse) << "\n"
      << "  rms after  [" << unit << "]: " << in_a_row(report.friction.after.rmse) << "\n";
  print_conventions(out, report.conventions, report.conventions_applied);
}

void print(std::ostream& out, const ReverseReport& report) {
  const ReverseIdentification& id = report.identification;
  out << "Reverse engineered " << id.rank << " coefficients of " << id.robot.name << " (Section IV-A)\n"
      << "  condition number " << id.condition_number << ", relative error " << id.relative_error_percent
      << " % (held out " << id.validation_relative_error_percent << " %)\n"
      << "  rms of gravity torques [" << detail::torque_units(id.robot) << "]     " << in_a_row(id.rmse)
      << "\n"
      << "  rms of inertia rows [kg m^2]     " << in_a_row(id.rmse_inertia) << "\n";
  print(out, id.coefficients);
  print_consistency(out, report.source, report.physically_consistent);
}

void print(std::ostream& out, const TorqueReport& report, const std::string& written_to) {
  out << "Torques of " << report.robot << " at " << report.samples() << " samples written to " << written_to
      << "\n";
  if (report.rms_difference.size() > 0)
    out << "  rms difference to the log's tau, unfiltered [N m]: " << in_a_row(report.rms_difference) << "\n";
}

void print(std::ostream& out, const DemoReport& report) {
  const Identification& id = report.identification;
  const Diagnosis& d = report.diagnosis.diagnosis;
  std::vector<std::string> hidden;
  for (const Effect& effect : report.hidden) hidden.push_back(with_spaces(effect.name));
  out << "1 excite    a Panda follows the letter's motion for 21 s: " << report.log.source << "\n2 identify  "
      << id.rank << " coefficients, relative error " << short_number(id.fit.relative_error_percent, 3)
      << " %\n            rms [N m]           " << in_a_row(id.fit.rmse) << "\n";
  if (id.validation) out << "            rms held out [N m]  " << in_a_row(id.validation->rmse) << "\n";
  out << "3 feasible  links that a body can have, " << short_number(report.retrieval.result.total_mass, 3)
      << " kg in all\n4 hide      " << (hidden.empty() ? "nothing" : list_in_words(hidden)) << ": "
      << list_in_words(report.diagnosis.logs) << "\n5 diagnose  gap [N m rms]        " << in_a_row(d.rms)
      << "\n";
  if (!d.effects.empty()) out << "            with the effects    " << in_a_row(d.shrink.after) << "\n";
  out << verdict_sentence(d) << "\n";
}

}  // namespace dynid
