// SPDX-License-Identifier: Apache-2.0
#include "dynid/app/retrieve.hpp"

#include <algorithm>
#include <utility>

#include "app/check.hpp"
#include "app/job.hpp"
#include "dynid/base/error.hpp"
#include "dynid/identification/base_parameters.hpp"
#include "dynid/identification/identify.hpp"

namespace dynid {
namespace {

/// Eq. (29) over the rigid-body coefficients that the model keeps.
Objective two_step(const ModelFile& model, const std::string& source, bool weighted) {
  const bool rotor = std::any_of(model.coefficients.begin(), model.coefficients.end(),
                                 [](const Coefficient& c) { return c.name.compare(0, 2, "ia") == 0; });
  const BaseParameters base = base_parameters(model.robot, rotor);
  const Eigen::VectorXd pi = parameter_vector(model.robot, base);
  std::vector<int> rows;
  std::vector<double> values, deviations;
  for (int i = 0; i < base.size(); ++i) {
    const std::string& name = base.names[static_cast<std::size_t>(i)];
    const auto c = std::find_if(model.coefficients.begin(), model.coefficients.end(),
                                [&](const Coefficient& k) { return k.name == name; });
    if (c == model.coefficients.end())
      throw Error(source + ": coefficients: " + name +
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
      throw Error(source + ": coefficients: --weighted needs a standard deviation for each of them");
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

/// The objective of the logs; the robot takes the friction that they show.
Objective of_logs(const RetrieveJob& job, Robot& robot, const Context& context) {
  detail::JobProgress progress(context, 0.6);
  IdentifyOptions options;
  options.prepare.cutoff = job.cutoff;
  options.validate = false;
  options.progress = std::ref(progress);
  const Identification id = identify(robot, job.logs, {}, options);
  for (std::size_t j = 0; j < robot.joints.size(); ++j) {
    robot.joints[j].friction = id.robot.joints[j].friction;
    robot.joints[j].rotor_inertia = 0.0;
  }
  return one_step(id);
}

Prior prior_of(const Robot& robot) {
  Prior prior;
  for (const Joint& joint : robot.joints) prior.links.push_back(from_standard(joint.parameters));
  return prior;
}

/// The robot with what was found.
void adopt(const RetrievalResult& result, Robot& robot) {
  robot.set_parameters(standard_parameters(result.p));
  if (result.linear_unknowns.size() != 3 * robot.size()) return;
  for (Eigen::Index j = 0; j < robot.size(); ++j) {
    LinearFriction& f = robot.joints[static_cast<std::size_t>(j)].friction.linear;
    f.viscous = result.linear_unknowns[3 * j];
    f.coulomb = result.linear_unknowns[3 * j + 1];
    f.offset = result.linear_unknowns[3 * j + 2];
  }
}

}  // namespace

void check_options(const RetrieveJob& job) {
  detail::check_positive("runs", job.options.runs);
  detail::check_positive("steps", job.options.steps);
  detail::check_not_negative("threads", job.options.threads);
  detail::check_not_negative("agree", job.options.agreeing_runs);
  detail::check_not_negative("cutoff", job.cutoff);
}

RetrieveReport run(const RetrieveJob& job, const Context& context) {
  check_options(job);
  context.check();
  RetrieveReport report;
  report.robot = job.model.robot;
  RetrievalProblem problem;
  problem.bounds = job.bounds;
  validate(problem.bounds);
  if (problem.bounds.links() != report.robot.size())
    throw Error(job.bounds.source + ": links: " + std::to_string(problem.bounds.links()) +
                " links, the robot has " + std::to_string(report.robot.size()));
  const bool in_one_step = !job.logs.empty();
  problem.objective = in_one_step ? of_logs(job, report.robot, context.part(0.0, 0.3))
                                  : two_step(job.model, job.source, job.weighted);
  if (job.prior) problem.prior = prior_of(*job.prior);

  const Context search = in_one_step ? context.part(0.3, 1.0) : context;
  detail::JobProgress progress(search);
  RetrievalOptions options = job.options;
  options.stop = context.stop;
  options.progress = [&progress](int done, int of, double) {
    progress.tell("run " + std::to_string(done) + " of " + std::to_string(of), double(done) / of);
  };
  report.result = retrieve(problem, options);
  if (!job.keep_best_when_stopped) context.check();
  if (report.result.feasible) adopt(report.result, report.robot);
  report.note = "feasible parameters retrieved from " + (in_one_step ? job.logs.front().source : job.source) +
                " within " + job.bounds.source;
  if (report.result.interrupted) report.note += "; interrupted: the best of the runs until then";
  return report;
}

ModelFile RetrieveReport::model() const { return {robot, {}, note}; }

}  // namespace dynid
