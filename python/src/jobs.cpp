// SPDX-License-Identifier: Apache-2.0
//
// The use cases. Each returns (JSON text, summary, extras): the text is what the program writes, byte for
// byte.
#include <nanobind/eigen/dense.h>
#include <nanobind/stl/function.h>
#include <nanobind/stl/optional.h>
#include <nanobind/stl/pair.h>
#include <nanobind/stl/shared_ptr.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/tuple.h>
#include <nanobind/stl/vector.h>

#include <algorithm>
#include <limits>
#include <mutex>
#include <sstream>

#include "app/serialise.hpp"
#include "binding.hpp"
#include "dynid/app/choices.hpp"
#include "dynid/app/option_error.hpp"
#include "dynid/app/text.hpp"
#include "dynid/base/error.hpp"
#include "dynid/base/file.hpp"
#include "dynid/effect/catalogue.hpp"
#include "log.hpp"
#include "python_effect.hpp"

namespace dynid::python {
namespace {

using nb::literals::operator""_a;
using Logs = std::vector<PyLog>;

template <class Report>
nb::dict answer(const Report& report) {
  nb::dict out;
  out["json"] = to_json(report).dump(2) + "\n";
  std::ostringstream text;
  if constexpr (!std::is_same_v<Report, ExportReport> && !std::is_same_v<Report, SimulateReport> &&
                !std::is_same_v<Report, TorqueReport> && !std::is_same_v<Report, ExciteReport>)
    print(text, report);
  out["text"] = text.str();
  return out;
}

template <class T>
T chosen(const Choices<T>& choices, const std::string& word, const char* option) {
  const auto found = choices.find(word);
  if (found != choices.end()) return found->second;
  std::string words;
  for (const auto& entry : choices) words += (words.empty() ? "" : ", ") + entry.first;
  throw OptionError(option, "'" + word + "' is none of " + words);
}

nb::object robot_object(const ModelFile& model, const std::string& source) {
  return nb::cast(PyRobot(model, source));
}

nb::dict table_object(const Table& table) {
  nb::dict out;
  out["names"] = table.names;
  out["values"] = table.values;
  return out;
}

nb::dict motion_object(const Trajectory& motion) {
  nb::dict out;
  out["t"] = motion.t;
  out["q"] = motion.q;
  out["dq"] = motion.dq;
  out["ddq"] = motion.ddq;
  return out;
}

nb::dict identify(const PyRobot& robot, const Logs& logs, const Logs& validation, const std::string& assume,
                  const std::string& friction, bool rotor_inertia, const std::string& method, double cutoff,
                  double prune, nb::handle progress) {
  IdentifyJob job;
  job.options.friction = chosen(friction_laws(), friction, "friction");
  job.options.method = chosen(methods(), method, "method");
  job.options.rotor_inertia = rotor_inertia;
  job.options.prepare.cutoff = cutoff;
  job.options.prune_percent = prune;
  job.assume = assume;
  check_options(job);
  job.robot = robot.model.robot;
  job.source = robot.source;
  job.logs = logs_of(logs, true, true);
  job.validation = logs_of(validation, true, true);
  const IdentifyReport report = run_job(std::move(job), progress);
  nb::dict out = answer(report);
  out["robot"] = robot_object(report.model(), "identified");
  return out;
}

nb::dict identify_servo(const std::optional<PyRobot>& robot, const Logs& logs, nb::handle progress) {
  IdentifyServosJob job;
  if (robot) job.robot = robot->model.robot;
  job.logs = logs_of(logs, false, false);
  const IdentifyServosReport report = run_job(std::move(job), progress);
  nb::dict out = answer(report);
  out["robot"] = robot_object(report.model(), "identified");
  return out;
}

nb::dict reverse(const PyRobot& robot, const Eigen::MatrixXd& q, const Eigen::MatrixXd& s,
                 const std::string& source, double prune, nb::handle progress) {
  ReverseJob job;
  job.options.prune_percent = prune;
  check_options(job);
  job.robot = robot.model.robot;
  job.source = robot.source;
  const Eigen::Index n = job.robot.size();
  if (q.cols() != n || s.rows() != q.rows() || s.cols() != n * (n + 1) / 2 + n)
    throw Error(source + ": q has n columns, the values n (n + 1) / 2 + n: the lower triangle of M, then g");
  job.samples = {source, q, s};
  const ReverseReport report = run_job(std::move(job), progress);
  nb::dict out = answer(report);
  out["robot"] = robot_object(report.model(), "reversed");
  return out;
}

nb::dict torque(const PyRobot& robot, const PyLog& log, double cutoff, nb::handle progress) {
  TorqueJob job;
  job.cutoff = cutoff;
  check_options(job);
  job.robot = robot.model.robot;
  job.log = *log;
  const TorqueReport report = run_job(std::move(job), progress);
  nb::dict out = answer(report);
  out["table"] = table_object(report.table());
  return out;
}

nb::dict replay(const PyRobot& robot, const PyLog& log, nb::handle progress) {
  ReplayJob job;
  job.robot = robot.model.robot;
  job.log = *log;
  if (job.log.u.size() == 0) throw Error(log->source + ": column u1 is missing");
  const ReplayReport report = run_job(std::move(job), progress);
  nb::dict out = answer(report);
  out["table"] = table_object(report.table());
  return out;
}

/// The first thing that a constraint raised on some thread of the optimiser, through which nothing may be
/// thrown.
struct RaisedInConstraint {
  std::mutex mutex;
  std::string text;
};

Constraint python_constraint(const std::string& name, const nb::callable& value,
                             const std::shared_ptr<RaisedInConstraint>& raised) {
  // Shared by the runs' threads, and given back under the lock.
  const std::shared_ptr<nb::callable> held(new nb::callable(value), [](nb::callable* p) {
    const nb::gil_scoped_acquire acquire;
    delete p;
  });
  Inequality h;
  h.value = [held, name, raised](const Eigen::VectorXd& p) {
    const nb::gil_scoped_acquire acquire;
    try {
      return nb::cast<double>((*held)(p));
    } catch (std::exception& error) {
      std::string said = error.what();
      if (const auto* python = dynamic_cast<nb::python_error*>(&error))
        said = nb::cast<std::string>(nb::str(python->value()));
      const std::lock_guard<std::mutex> lock(raised->mutex);
      if (raised->text.empty()) raised->text = "constraint '" + name + "': " + said;
      return std::numeric_limits<double>::quiet_NaN();
    }
  };
  return make_constraint(name, h);
}

nb::dict retrieve(const PyRobot& model, const std::string& bounds, const Logs& logs,
                  const std::optional<PyRobot>& prior,
                  const std::vector<std::pair<std::string, nb::callable>>& constraints, int runs, int steps,
                  unsigned long seed, int threads, int agree, bool weighted, double cutoff,
                  nb::handle progress) {
  RetrieveJob job;
  job.options.runs = runs;
  job.options.steps = steps;
  job.options.seed = seed;
  job.options.threads = threads;
  job.options.agreeing_runs = agree;
  job.weighted = weighted;
  job.cutoff = cutoff;
  check_options(job);
  job.model = model.model;
  job.source = model.source;
  job.logs = logs_of(logs, true, true);
  job.bounds = read_bounds(bounds);
  const auto raised = std::make_shared<RaisedInConstraint>();
  for (const auto& [name, value] : constraints) {
    job.bounds.constraints.push_back(python_constraint(name, value, raised));
    // What is wrong with it is wrong here as well, before the search for minutes.
    job.bounds.constraints.back().margin(0.5 * (job.bounds.lower + job.bounds.upper));
    if (!raised->text.empty()) throw Error(raised->text);
  }
  if (prior) job.prior = prior->model.robot;
  const RetrieveReport report = run_job(std::move(job), progress);
  if (!raised->text.empty()) throw Error(raised->text);
  nb::dict out = answer(report);
  out["robot"] = robot_object(report.model(), "retrieved");
  out["feasible"] = report.succeeded();
  return out;
}

nb::dict excite(const PyRobot& robot, const std::string& collision, int harmonics, double period, double rate,
                unsigned long seed, int starts, int effort, int threads, double margin, bool rotor_inertia,
                nb::handle progress) {
  ExciteJob job;
  job.options.harmonics = harmonics;
  job.options.duration = period;
  job.options.seed = seed;
  job.options.starts = starts;
  job.options.effort = effort;
  job.options.threads = threads;
  job.options.margin = margin;
  job.options.regressor.rotor_inertia = rotor_inertia;
  job.rate = rate;
  check_options(job);
  job.robot = robot.model.robot;
  job.collision = collision_model(collision, robot.source, job.robot);
  const ExciteReport report = run_job(std::move(job), progress);
  nb::dict out = answer(report);
  out["feasible"] = report.succeeded();
  out["motion"] = motion_object(report.motion);
  return out;
}

nb::dict simulate(const PyRobot& robot, const std::optional<Eigen::MatrixXd>& motion, double duration,
                  const std::vector<std::string>& effects, unsigned long seed, std::optional<double> noise,
                  bool clean, double rate, double spread, nb::handle progress) {
  SimulateJob job;
  job.duration = duration;
  job.seed = seed;
  job.noise = noise;
  job.clean = clean;
  job.rate = rate;
  job.spread = spread;
  check_options(job);
  job.robot = robot.model.robot;
  job.effects = parse_effects(effects, job.robot);
  if (motion) {
    const Eigen::Index n = job.robot.size();
    if (motion->cols() != 1 + 3 * n || motion->rows() < 2)
      throw Error("motion: columns t, q, dq, ddq are expected");
    job.motion = Trajectory{"motion", motion->col(0), motion->middleCols(1, n), motion->middleCols(1 + n, n),
                            motion->middleCols(1 + 2 * n, n)};
  }
  SimulateReport report = run_job(std::move(job), progress);
  nb::dict out = answer(report);
  out["labels"] = labels_json(report).dump(2) + "\n";
  auto log = std::make_shared<Log>(std::move(report.run.log));
  if (log->source.empty()) log->source = "simulated";
  out["log"] = log;
  return out;
}

/// The model with the effects found, but for those of the caller's own, which no model file can say.
std::optional<ModelFile> patch_of(const DiagnoseReport& report) {
  DiagnoseReport sayable = report;
  auto& effects = sayable.diagnosis.effects;
  effects.erase(std::remove_if(effects.begin(), effects.end(),
                               [](const FoundEffect& found) {
                                 return find_effect_schema(found.effect.name) == nullptr;
                               }),
                effects.end());
  return sayable.patch();
}

nb::dict diagnose(const PyRobot& model, const Logs& logs, const PyLog& reference,
                  const std::vector<std::string>& withhold, const std::string& assume, double cutoff,
                  double tolerance, unsigned seed, bool replay, const std::vector<nb::object>& effects,
                  nb::handle progress) {
  DiagnoseJob job;
  job.options.cutoff = cutoff;
  job.options.tolerance = tolerance;
  job.options.seed = seed;
  job.options.replay = replay;
  job.withhold = withhold;
  job.assume = assume;
  check_options(job);
  job.nominal = model.model.robot;
  job.logs = logs_of(logs, true, true);
  if (reference) job.reference = logs_of({reference}, true, true).front();
  const auto own = std::make_shared<std::vector<std::unique_ptr<Hypothesis>>>(python_effects(effects));
  for (const auto& effect : *own) job.options.extra.push_back(effect.get());
  // The job may be left behind by Ctrl-C: what it uses goes with it.
  job.options.progress = [own](const std::string&, double) {};
  const auto report = std::make_shared<DiagnoseReport>(run_job(std::move(job), progress));
  nb::dict out = answer(*report);
  out["succeeded"] = report->succeeded();
  out["patch"] = nb::none();
  if (const auto patch = patch_of(*report)) out["patch"] = robot_object(*patch, "patched");
  out["next_motion"] = motion_object(report->diagnosis.next.motion);
  DiagnoseCommand command;
  command.model = model.source;
  command.logs = report->logs;
  if (reference) command.reference = reference->source;
  command.withhold = withhold;
  command.assume = assume;
  command.cutoff = cutoff;
  command.tolerance = tolerance;
  command.seed = seed;
  out["html"] = nb::cpp_function([report, command] { return report->html(command.line(), DYNID_VERSION); });
  return out;
}

nb::dict export_model(const PyRobot& model, const std::string& format, const std::string& into,
                      nb::handle progress) {
  ExportJob job;
  job.model = model.model;
  job.format = chosen(export_formats(), format, "format");
  if (!into.empty()) job.into = ExportJob::Into{read_file(into), into};
  check_options(job);
  const ExportReport report = run_job(std::move(job), progress);
  nb::dict out = answer(report);
  out["text"] = report.text;
  out["not_expressed"] = report.not_expressed;
  return out;
}

}  // namespace

void bind_jobs(nb::module_& m) {
  m.def("identify", &identify, "robot"_a, "logs"_a, "validation"_a, "assume"_a, "friction"_a,
        "rotor_inertia"_a, "method"_a, "cutoff"_a, "prune"_a, "progress"_a.none());
  m.def("identify_servo", &identify_servo, "robot"_a.none(), "logs"_a, "progress"_a.none());
  m.def("reverse", &reverse, "robot"_a, "q"_a, "values"_a, "source"_a, "prune"_a, "progress"_a.none());
  m.def("torque", &torque, "robot"_a, "log"_a, "cutoff"_a, "progress"_a.none());
  m.def("replay", &replay, "robot"_a, "log"_a, "progress"_a.none());
  m.def("retrieve", &retrieve, "model"_a, "bounds"_a, "logs"_a, "prior"_a.none(), "constraints"_a, "runs"_a,
        "steps"_a, "seed"_a, "threads"_a, "agree"_a, "weighted"_a, "cutoff"_a, "progress"_a.none());
  m.def("excite", &excite, "robot"_a, "collision"_a, "harmonics"_a, "period"_a, "rate"_a, "seed"_a,
        "starts"_a, "effort"_a, "threads"_a, "margin"_a, "rotor_inertia"_a, "progress"_a.none());
  m.def("simulate", &simulate, "robot"_a, "motion"_a.none(), "duration"_a, "effects"_a, "seed"_a,
        "noise"_a.none(), "clean"_a, "rate"_a, "spread"_a, "progress"_a.none());
  m.def("diagnose", &diagnose, "model"_a, "logs"_a, "reference"_a.none(), "withhold"_a, "assume"_a,
        "cutoff"_a, "tolerance"_a, "seed"_a, "replay"_a, "effects"_a, "progress"_a.none());
  m.def("export", &export_model, "model"_a, "format"_a, "into"_a, "progress"_a.none());
}

}  // namespace dynid::python
