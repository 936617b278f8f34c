// SPDX-License-Identifier: Apache-2.0
#include "dynid/app/info.hpp"

namespace dynid {
namespace {

Identifiable identifiable(const BaseParameters& base, int parameter) {
  Identifiable answer = Identifiable::no;
  for (int i = 0; i < base.size(); ++i) {
    if (base.K(i, parameter) == 0.0) continue;
    if ((base.K.row(i).array() != 0.0).count() == 1) return Identifiable::alone;
    answer = Identifiable::in_combination;
  }
  return answer;
}

}  // namespace

InfoReport run(const InfoJob& job, const Context& context) {
  context.check();
  InfoReport report;
  report.robot = job.robot;
  report.base = base_parameters(job.robot, job.rotor_inertia);
  for (int k = 0; k < report.base.parameters(); ++k)
    report.parameters.push_back(identifiable(report.base, k));
  report.broken = inconsistencies(job.robot);
  for (const Joint& joint : job.robot.joints) report.total_mass += joint.parameters[0];
  return report;
}

}  // namespace dynid
