// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <atomic>
#include <csignal>
#include <iostream>

#include "cli/command.hpp"
#include "cli/commands.hpp"
#include "dynid/base/error.hpp"
#include "dynid/identification/identify.hpp"
#include "dynid/model/yaml.hpp"
#include "dynid/retrieval/mpi.hpp"
#include "dynid/retrieval/retrieval.hpp"

namespace dynid {
namespace {

struct Arguments {
  Output output;
  RobotOption model;
  LogOption input;
  std::vector<std::string> logs;
  std::string robot, bounds, out, prior;
  double cutoff = 0.0;
  bool weighted = false;
  RetrievalOptions options;
};

std::atomic<bool> interrupted{false};
void (*before_interrupt)(int) = SIG_DFL;
extern "C" void on_interrupt(int signal) {
  interrupted = true;
  if (before_interrupt != SIG_DFL && before_interrupt != SIG_IGN) before_interrupt(signal);
}

/// Ctrl-C asks for the best set so far, while this lives; who listened to it before hears it too.
class InterruptGuard {
 public:
  InterruptGuard() {
    interrupted = false;
    before_interrupt = std::signal(SIGINT, on_interrupt);
  }
  ~InterruptGuard() { std::signal(SIGINT, before_interrupt); }
  InterruptGuard(const InterruptGuard&) = delete;
  InterruptGuard& operator=(const InterruptGuard&) = delete;
};

/// Eq. (29) over the rigid-body coefficients that the model file keeps.
Objective two_step(const ModelFile& model, const std::string& path, bool weighted) {
  const bool rotor = std::any_of(model.coefficients.begin(), model.coefficients.end(),
                                 [](const Coefficient& c) { return c.name.compare(0, 2, "ia") == 0; });
  const BaseParameters base = base_parameters(model.robot, rotor);
  const Eigen::VectorXd pi = parameter_vector(model.robot, base);
  std::vector<int> rows;
  std::vector<double> values, deviations;
  for (int i = 0; i < base.size(); ++i) {
    const auto c =
        std::find_if(model.coefficients.begin(), model.coefficients.end(),
                     [&](const Coefficient& k) { return k.name == base.names[static_cast<std::size_t>(i)]; });
    if (c == model.coefficients.end())
      throw Error(path + ": coefficients: " + base.names[static_cast<std::size_t>(i)] +
                  " is missing (the file must come from dynid identify or dynid reverse)");
    if (!c->kept || base.columns[static_cast<std::size_t>(i)] >= base.standard) continue;
    rows.push_back(i);
    // Rotor inertias are not a body's: the model's own are taken off the coefficients that hold them.
    values.push_back(c->value - base.K.row(i).tail(base.parameters() - base.standard) *
                                    pi.tail(base.parameters() - base.standard));
    deviations.push_back(std::abs(c->value) * c->std_percent / 100.0);
  }
  const Eigen::MatrixXd K = base.K(rows, Eigen::all).leftCols(base.standard);
  const auto count = static_cast<Eigen::Index>(values.size());
  Eigen::VectorXd weights;
  if (weighted) {
    weights = Eigen::Map<Eigen::VectorXd>(deviations.data(), count);
    if (!weights.allFinite() || weights.minCoeff() <= 0.0)
      throw Error(path + ": coefficients: --weighted needs a standard deviation for each of them");
    weights = weights.cwiseInverse() * (weights.squaredNorm() / weights.sum());  // about one
  }
  return Objective::two_step(K, Eigen::Map<Eigen::VectorXd>(values.data(), count), weights);
}

/// |Y pi(p) - tau|^2 with eq. (24), on the triangular factor of the logs.
Objective one_step(const Identification& id) {
  const int rigid = id.base.size(), friction = id.factor.columns() - rigid;
  const Eigen::MatrixXd R = id.factor.R();
  Eigen::MatrixXd A(R.rows(), id.base.standard + friction);
  A << R.leftCols(rigid) * id.base.K, R.rightCols(friction);
  return Objective::one_step(A, id.factor.z(), id.factor.residual(), id.base.standard);
}

std::vector<LinkInertia> links_of(const Robot& robot) {
  std::vector<LinkInertia> links;
  for (const Joint& joint : robot.joints) links.push_back(from_standard(joint.parameters));
  return links;
}

nlohmann::json link_json(const LinkInertia& link) {
  nlohmann::json inertia = nlohmann::json::array();
  for (int i = 0; i < 3; ++i) inertia.push_back({link.inertia(i, 0), link.inertia(i, 1), link.inertia(i, 2)});
  return {{"mass", link.mass}, {"com", to_json(link.com)}, {"inertia", inertia}};
}

nlohmann::json result_json(const RetrievalResult& result) {
  nlohmann::json constraints = nlohmann::json::array(), runs = nlohmann::json::array(),
                 links = nlohmann::json::array(), trade_off = nlohmann::json::array();
  for (const ConstraintMargin& c : result.constraints)
    constraints.push_back({{"name", c.name}, {"margin", c.margin}, {"active", c.active}});
  for (const RetrievalRun& run : result.runs)
    runs.push_back({{"seed", run.seed},
                    {"objective", run.objective},
                    {"penalty", run.penalty},
                    {"seconds", run.seconds}});
  for (const LinkInertia& link : result.links) links.push_back(link_json(link));
  for (const PriorTradeOff& t : result.trade_off)
    trade_off.push_back({{"weight", t.weight}, {"objective", t.objective}, {"distance", t.distance}});
  return {{"objective", result.objective},
          {"penalty", result.penalty},
          {"feasible", result.feasible},
          {"interrupted", result.interrupted},
          {"total_mass", result.total_mass},
          {"constraints", constraints},
          {"runs", runs},
          {"seconds", result.seconds},
          {"links", links},
          {"spread", to_json(result.spread)},
          {"trade_off", trade_off}};
}

void print(const RetrievalResult& result, const Robot& robot) {
  std::cout << (result.feasible ? "Feasible parameters of " : "No feasible parameters of ") << robot.name
            << " after " << result.runs.size() << " runs" << (result.interrupted ? " (interrupted)" : "")
            << ", " << result.seconds << " s\n  phi " << result.objective << ", total mass "
            << result.total_mass << " kg\n";
  for (std::size_t i = 0; i < result.links.size(); ++i) {
    const LinkInertia& link = result.links[i];
    std::cout << "  " << robot.joints[i].link_name << ": mass " << link.mass << " +- "
              << result.spread[static_cast<Eigen::Index>(10 * i)] << " kg, com [" << link.com.transpose()
              << "] m\n";
  }
  std::cout << "  active constraints:";
  for (const ConstraintMargin& c : result.constraints)
    if (c.active) std::cout << " " << c.name << ",";
  std::cout << "\n";
  for (const ConstraintMargin& c : result.constraints)
    if (c.margin < 0.0) std::cout << "  violated: " << c.name << ", margin " << c.margin << "\n";
}

int run(const Arguments& a) {
  const MpiRanks ranks;
  const bool first = ranks.rank() == 0;
  Output output = a.output;
  if (!first) output.quiet = true;
  output.check({a.out});
  if (a.logs.empty() == a.model.path.empty() && a.robot.empty())
    throw Error("retrieve: --model with coefficients, or --log with --robot, is needed");
  if (!a.logs.empty() && a.robot.empty() && a.model.path.empty())
    throw Error("retrieve: --log needs --robot, for the kinematics");

  RobotOption source = a.model;
  if (source.path.empty()) source.path = a.robot;
  source.allow_inconsistent = true;  // to make it consistent is what is asked for
  Output silent = output;
  silent.quiet = true;
  ModelFile model = source.read(silent);
  RetrievalProblem problem;
  problem.bounds = read_bounds(a.bounds);
  validate(problem.bounds);
  if (problem.bounds.links() != model.robot.size())
    throw Error(a.bounds + ": links: " + std::to_string(problem.bounds.links()) + " links, the robot has " +
                std::to_string(model.robot.size()));
  Progress progress(output);
  if (a.logs.empty()) {
    problem.objective = two_step(model, a.model.path, a.weighted);
  } else {
    std::vector<Log> logs;
    for (const std::string& log : a.logs) {
      progress("reading " + log);
      logs.push_back(a.input.read(log, model.robot));
    }
    IdentifyOptions identify_options;
    identify_options.prepare.cutoff = a.cutoff;
    identify_options.validate = false;
    identify_options.progress = [&progress](const std::string& stage, double fraction) {
      progress(stage, fraction);
    };
    const Identification id = identify(model.robot, logs, {}, identify_options);
    problem.objective = one_step(id);
    for (std::size_t j = 0; j < model.robot.joints.size(); ++j) {
      model.robot.joints[j].friction = id.robot.joints[j].friction;
      model.robot.joints[j].rotor_inertia = 0.0;
    }
  }
  if (!a.prior.empty()) {
    Prior prior;
    prior.links = links_of(read_robot(a.prior, a.model.base, a.model.tip));
    problem.prior = prior;
  }

  const InterruptGuard guard;
  RetrievalOptions options = a.options;
  options.stop = &interrupted;
  options.progress = [&progress](int done, int of, double) {
    progress("run " + std::to_string(done) + " of " + std::to_string(of), double(done) / of);
  };
  ranks.share(options);
  const RetrievalResult result = retrieve(problem, options);
  if (!first) return result.feasible ? 0 : 1;

  if (result.feasible && !a.out.empty()) {
    const Eigen::VectorXd pi = standard_parameters(result.p);
    model.robot.set_parameters(pi);
    for (Eigen::Index j = 0;
         j < model.robot.size() && result.linear_unknowns.size() == 3 * model.robot.size(); ++j) {
      LinearFriction& f = model.robot.joints[static_cast<std::size_t>(j)].friction.linear;
      f.viscous = result.linear_unknowns[3 * j];
      f.coulomb = result.linear_unknowns[3 * j + 1];
      f.offset = result.linear_unknowns[3 * j + 2];
    }
    std::string note = "feasible parameters retrieved from " +
                       (a.logs.empty() ? a.model.path : a.logs.front()) + " within " + a.bounds;
    if (result.interrupted) note += "; interrupted: the best of the runs until then";
    write_model(a.out, {model.robot, {}, note});
  }
  output.write(result_json(result));
  if (output.summary()) {
    print(result, model.robot);
    if (result.feasible && !a.out.empty()) std::cout << "Model written to " << a.out << "\n";
  }
  return result.feasible ? 0 : 1;
}

}  // namespace

void add_retrieve(CLI::App& app, int& status) {
  auto a = std::make_shared<Arguments>();
  CLI::App* command = app.add_subcommand(
      "retrieve", "Feasible masses, centres of mass and inertias from coefficients or a log");
  a->model.add_to(*command, "--model", false);
  command->add_option("--log", a->logs, "One step: fit feasible parameters and eq. (24) to these logs")
      ->type_name("FILE...");
  a->input.add_to(*command);
  command->add_option("--robot", a->robot, "Kinematics for --log (URDF or YAML)")->type_name("FILE");
  command->add_option("--bounds", a->bounds, "Bounds and constraints (YAML, dynid-bounds-1)")
      ->required()
      ->type_name("FILE");
  command->add_option("--out", a->out, "Model to write (YAML)")->type_name("FILE");
  command->add_option("--runs", a->options.runs, "Q: independent runs of Algorithm 1")
      ->check(CLI::PositiveNumber)
      ->capture_default_str();
  command->add_option("--steps", a->options.steps, "kappa: steps of a run")
      ->check(CLI::PositiveNumber)
      ->capture_default_str();
  command->add_option("--seed", a->options.seed, "Seed of the first run")->capture_default_str();
  command->add_option("--threads", a->options.threads, "0: all cores")
      ->check(CLI::NonNegativeNumber)
      ->capture_default_str();
  command
      ->add_option("--agree", a->options.agreeing_runs,
                   "Stop once this many runs agree on the objective; 0: never")
      ->check(CLI::NonNegativeNumber)
      ->capture_default_str();
  command->add_flag("--weighted", a->weighted, "Weight the coefficients by their standard deviations");
  command->add_option("--prior", a->prior, "Known parameters to stay close to among equals (URDF or YAML)")
      ->type_name("FILE");
  command->add_option("--cutoff", a->cutoff, "With --log: cut-off of the low-pass filter [Hz]")
      ->check(CLI::PositiveNumber);
  a->output.add_to(*command);
  command->footer(
      "Example: dynid retrieve --model reversed.yaml --bounds config/panda_bounds.yaml --out feasible.yaml");
  command->callback([a, &status] { status = run(*a); });
}

}  // namespace dynid
