// SPDX-License-Identifier: Apache-2.0
#include "dynid/app/export.hpp"

#include "dynid/app/option_error.hpp"
#include "dynid/model/export.hpp"
#include "dynid/model/urdf.hpp"
#include "dynid/model/yaml.hpp"

namespace dynid {
namespace {

ExportText exported(const ExportJob& job) {
  const Robot& robot = job.model.robot;
  switch (job.format) {
    case ExportFormat::mjcf:
      return to_mjcf(robot);
    case ExportFormat::sdf:
      return to_sdf(robot);
    case ExportFormat::yaml:
      return {to_yaml(job.model), {}};
    case ExportFormat::header:
      return to_header(robot);
    case ExportFormat::franka:
      return to_franka_inertials(robot);
    case ExportFormat::urdf:
      break;
  }
  const UrdfText urdf = job.into ? update_urdf(job.into->text, job.into->source, robot) : to_urdf(robot);
  return {urdf.text, urdf.not_expressed};
}

}  // namespace

void check_options(const ExportJob& job) {
  if (job.into && job.format != ExportFormat::urdf)
    throw OptionError("into", "goes with --format urdf alone");
}

ExportReport run(const ExportJob& job, const Context& context) {
  check_options(job);
  context.check();
  ExportText text = exported(job);
  return {job.model.robot.name, job.format, std::move(text.text), std::move(text.not_expressed)};
}

}  // namespace dynid
