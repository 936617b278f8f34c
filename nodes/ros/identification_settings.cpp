// SPDX-License-Identifier: Apache-2.0
#include "ros/identification_settings.hpp"

#include "dynid/app/choices.hpp"
#include "dynid/app/option_error.hpp"
#include "dynid/base/error.hpp"
#include "ros/text_parameters.hpp"

namespace dynid {
namespace {

void read_log_options(TextParameters& in, IdentificationSettings& s) {
  in.read("columns", s.columns);
  in.read("log_rate", s.log_rate);
  in.read("gravity", s.gravity);
  if (s.columns.empty()) return;
  try {
    parse_columns(s.columns);
  } catch (const Error& error) {
    throw OptionError("columns", error.what());
  }
}

void read_identify(TextParameters& in, IdentificationSettings& s) {
  IdentifyOptions& o = s.job.identify.options;
  in.read("cutoff", o.prepare.cutoff);
  in.read("friction", o.friction, friction_laws());
  in.read("rotor_inertia", o.rotor_inertia);
  in.read("method", o.method, methods());
  in.read("motion", o.prepare.source, motion_sources());
  in.read("prune", o.prune_percent);
  in.read("validate", s.validation);
}

void read_retrieve(TextParameters& in, IdentificationSettings& s) {
  RetrieveJob retrieve;
  RetrievalOptions& o = retrieve.options;
  in.read("bounds", s.bounds);
  in.read("prior", s.prior);
  in.read("runs", o.runs);
  in.read("steps", o.steps);
  in.read("agree", o.agreeing_runs);
  in.read("weighted", retrieve.weighted);
  in.read("seed", o.seed);
  in.read("threads", o.threads);
  if (!s.bounds.empty()) s.job.retrieve = retrieve;
}

void read_diagnose(TextParameters& in, IdentificationSettings& s) {
  DiagnoseJob diagnose;
  bool wanted = true;
  std::string withhold;
  in.read("diagnose", wanted);
  in.read("reference", s.reference);
  in.read("tolerance", diagnose.options.tolerance);
  in.read("seed", diagnose.options.seed);
  in.read("withhold", withhold);
  if (!withhold.empty()) diagnose.withhold = {withhold};
  check_options(diagnose);
  if (wanted) s.job.diagnose = diagnose;
}

void read_excite(TextParameters& in, IdentificationSettings& s) {
  ExciteOptions& o = s.excite.options;
  in.read("harmonics", o.harmonics);
  in.read("period", o.duration);
  in.read("base_period", o.base_period);
  in.read("rate", s.excite.rate);
  in.read("kind", o.kind, motion_kinds());
  in.read("ramp", o.ramp);
  in.read("criterion", o.criterion, excitation_criteria());
  in.read("collision", s.collision);
  in.read("margin", o.margin);
  in.read("starts", o.starts);
  in.read("effort", o.effort);
  in.read("rotor_inertia", o.regressor.rotor_inertia);
  in.read("seed", o.seed);
  in.read("threads", o.threads);
}

}  // namespace

IdentificationSettings identification_settings(const std::map<std::string, std::string>& parameters,
                                               std::vector<std::string>& unknown) {
  TextParameters in(parameters);
  IdentificationSettings s;
  try {
    in.read("model", s.model);
    in.read("base", s.base);
    in.read("tip", s.tip);
    in.read("allow_inconsistent", s.allow_inconsistent);
    in.read("output_directory", s.folder);
    in.read("topic", s.topic);
    in.read("command_topic", s.command_topic);
    read_log_options(in, s);
    read_identify(in, s);
    read_retrieve(in, s);
    read_diagnose(in, s);
    read_excite(in, s);
    in.read("assume", s.job.identify.assume);
    if (s.job.diagnose) s.job.diagnose->assume = s.job.identify.assume;
    check_options(s.job);
    check_options(s.excite);
  } catch (const OptionError& error) {
    throw Error("~" + std::string(error.what()));
  }
  unknown = in.unread();
  return s;
}

}  // namespace dynid
