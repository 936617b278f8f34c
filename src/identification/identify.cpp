// SPDX-License-Identifier: Apache-2.0
#include "dynid/identification/identify.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "dynid/base/error.hpp"
#include "fit_problem.hpp"
#include "friction_choice.hpp"
#include "log_rows.hpp"
#include "remarks.hpp"

namespace dynid {
namespace {

using detail::FitProblem;
using detail::RegressionFit;
using detail::RowWeights;

constexpr int held_out_folds = 10;
bool held_out(int block) { return block == 3 || block == 8; }

/// On `validation`, which the fit never saw.
FitQuality quality_on(const std::vector<Log>& validation, const FitProblem& problem, const RegressionFit& fit,
                      const Robot& robot, Identification& out) {
  const std::vector<RegressionRows> rows =
      detail::rows_of_logs(robot, out.base, validation, problem.options(), out.cutoff, out.logs);
  std::string source;
  for (const Log& log : validation) source += (source.empty() ? "" : ", ") + log.source;
  return problem.quality(fit, rows, detail::all_rows(rows), source);
}

/// On two blocks of ten, which a second fit leaves out.
FitQuality quality_on_blocks(const FitProblem& problem) {
  const RowWeights everything = detail::all_rows(problem.rows());
  const RowWeights inside = detail::without(problem.rows(), everything, held_out_folds, held_out);
  const RegressionFit second = detail::fit_with_choice(problem, inside, nullptr);
  return problem.quality(second, problem.rows(),
                         detail::only(problem.rows(), everything, held_out_folds, held_out),
                         "a fifth of the logs (blocks 4 and 9 of ten), left out of a second fit");
}

/// One entry of Identification::coefficients with what goes beside it.
struct Entry {
  std::string name, expression;
  double value = 0.0, variance = 0.0;  ///< in the model: 0 where dropped
  double reported = 0.0,
         reported_variance = 0.0;  ///< as it was before anything was dropped
  bool kept = true;
};

/// The columns of the linear fit, but for the friction of joints that have eq. (25), then these.
std::vector<Entry> entries_of(const FitProblem& problem, const RegressionFit& fit, const BaseParameters& base,
                              const Eigen::MatrixXd& covariance) {
  const auto [unpruned, unpruned_covariance] = detail::unpruned(fit);
  const std::vector<std::string> names = problem.names();
  const int r = base.size();
  std::vector<Entry> entries;
  for (int k = 0; k < problem.columns(); ++k) {
    const int j = k < r ? -1 : (k - r) / 3;
    if (j >= 0 && fit.sigmoid[static_cast<std::size_t>(j)]) continue;
    const bool kept = std::binary_search(fit.kept.begin(), fit.kept.end(), k);
    const std::string& name = names[static_cast<std::size_t>(k)];
    entries.push_back({name, k < r ? base.expressions[static_cast<std::size_t>(k)] : name, fit.x[k],
                       covariance(k, k), kept ? fit.x[k] : unpruned[k],
                       kept ? covariance(k, k) : unpruned_covariance(k, k), kept});
  }
  for (int j = 0; j < problem.joints(); ++j) {
    const auto& sigmoid = fit.sigmoid[static_cast<std::size_t>(j)];
    if (!sigmoid) continue;
    const JointFriction& f = sigmoid->friction;
    const double x[5] = {f.linear.viscous, f.linear.offset, f.sigmoid.phi1, f.sigmoid.phi2, f.sigmoid.phi3};
    const char* symbols[5] = {"fv", "fo", "phi1_", "phi2_", "phi3_"};
    for (int k = 0; k < 5; ++k) {
      const std::string name = detail::tag(symbols[k], j);
      const double variance = sigmoid->covariance(k, k);
      entries.push_back({name, name, x[k], variance, x[k], variance, true});
    }
  }
  return entries;
}

void report_coefficients(const FitProblem& problem, const RegressionFit& fit, Identification& out) {
  Eigen::MatrixXd covariance = Eigen::MatrixXd::Zero(problem.columns(), problem.columns());
  covariance(fit.kept, fit.kept) = fit.covariance;
  const std::vector<Entry> entries = entries_of(problem, fit, out.base, covariance);
  out.rank = static_cast<int>(entries.size());
  out.values.resize(out.rank);
  out.variance.resize(out.rank);
  for (int k = 0; k < out.rank; ++k) {
    const Entry& entry = entries[static_cast<std::size_t>(k)];
    out.values[k] = entry.value;
    out.variance[k] = entry.variance;
    const double percent =
        100.0 * std::sqrt(entry.reported_variance) / std::max(std::abs(entry.reported), 1e-300);
    out.coefficients.push_back({entry.name, entry.expression, entry.reported, percent, entry.kept});
  }
  const int r = out.base.size();
  out.covariance = covariance.topLeftCorner(r, r);
}

/// `robot` with the parameters nearest its own that have the coefficients, and the friction of the fit.
Robot identified_robot(const Robot& robot, const FitProblem& problem, const RegressionFit& fit,
                       const Identification& id) {
  const IdentifyOptions& options = problem.options();
  const Eigen::VectorXd pi =
      nearest_parameters(id.base, id.values.head(id.base.size()), parameter_vector(robot, id.base));
  Robot out = robot;
  out.set_parameters(pi.head(id.base.standard));
  for (int j = 0; j < problem.joints(); ++j) {
    Joint& joint = out.joints[static_cast<std::size_t>(j)];
    joint.rotor_inertia = options.rotor_inertia ? pi[id.base.standard + j] : 0.0;
    JointFriction f;
    if (const auto& sigmoid = fit.sigmoid[static_cast<std::size_t>(j)]) {
      f = sigmoid->friction;
    } else if (options.friction != FrictionLaw::none) {
      const int first = problem.first(j);
      f.linear = {fit.x[first], fit.x[first + 1], fit.x[first + 2], options.velocity_scale};
    }
    joint.friction = f;
  }
  return out;
}

}  // namespace

Identification identify(const Robot& robot, const std::vector<Log>& logs, const std::vector<Log>& validation,
                        const IdentifyOptions& options) {
  if (logs.empty()) throw Error("identification: no log was given");
  Identification out;
  out.base = base_parameters(robot, options.rotor_inertia);
  std::vector<RegressionRows> rows =
      detail::rows_of_logs(robot, out.base, logs, options, out.cutoff, out.logs);
  Eigen::Index samples = 0;
  for (const PreparedLog& log : out.logs) samples += log.report.samples;
  const FitProblem problem(out.base, std::move(rows), samples, options);
  const RowWeights everything = detail::all_rows(problem.rows());
  if (options.progress) options.progress("fitting", 0.0);
  RegressionFit fit;
  try {
    fit = detail::fit_with_choice(problem, everything, &out.friction);
  } catch (const Error& error) {
    throw Error(logs.front().source + ": " + error.what());
  }
  out.condition_number = condition_number(fit.unweighted);
  out.factor = fit.unweighted;
  out.fit = problem.quality(fit, problem.rows(), everything, "fit");
  out.noise = fit.noise;
  out.correlation = fit.correlation;
  if (!validation.empty()) {
    out.validation = quality_on(validation, problem, fit, robot, out);
  } else if (options.validate) {
    try {
      out.validation = quality_on_blocks(problem);
    } catch (const Error& error) {
      out.validation_note = std::string("no part could be held out: ") + error.what();
    }
  }
  report_coefficients(problem, fit, out);
  out.robot = identified_robot(robot, problem, fit, out);
  out.remarks = detail::remarks_on(out, robot, options.remarks);
  return out;
}

}  // namespace dynid
