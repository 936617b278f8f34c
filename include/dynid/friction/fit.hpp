// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <functional>
#include <limits>
#include <string>
#include <vector>

#include "dynid/friction/joint_friction.hpp"

namespace dynid {

/// What friction is fitted to: the differences of Section IV-B, Delta tau_j = tau_j - tau_hat_j, of one
/// joint.
struct FrictionSamples {
  Eigen::VectorXd dq;          ///< [rad/s] N
  Eigen::VectorXd difference;  ///< [N m] N
  /// N factors of the residuals (roots of weights); 0 leaves a sample out. Empty: all are one.
  Eigen::VectorXd weight;
  /// Where `difference` went through a filter: the same filter on functions of the velocity before it.
  /// `row(dq)` has `columns` entries; returns N x columns. Empty: each row is of the sample's own dq.
  std::function<Eigen::MatrixXd(int columns, const std::function<Eigen::RowVectorXd(double)>& row)> filtered;
};

/// A parameter that a fit looks for, by the key that it has in a model file.
struct FrictionUnknown {
  std::string key;
  /// Of a nonlinear one: limits besides its range, which are kept.
  double least = -std::numeric_limits<double>::infinity();
  double most = std::numeric_limits<double>::infinity();
};

/// Every parameter of a law that is not given, without limits.
template <class Law>
std::vector<FrictionUnknown> unknowns_of() {
  std::vector<FrictionUnknown> unknowns;
  for (const auto& parameter : Law::parameters())
    if (parameter.role != FrictionRole::given) unknowns.push_back({parameter.key});
  return unknowns;
}

namespace detail {

/// A sum of laws as the fit sees it: all parameters that are not given, in order.
class FrictionModel {
 public:
  struct Parameter {
    std::string key;
    FrictionRole role;
    int speed_power;
    double least, most;
    FrictionSpacing spacing;
    int count;
  };

  virtual ~FrictionModel() = default;
  const std::vector<Parameter>& parameters() const { return parameters_; }
  virtual Eigen::VectorXd values() const = 0;
  virtual void set(const Eigen::VectorXd& values) = 0;
  /// Torque at dq, then its derivatives with respect to all parameters.
  virtual void row(double dq, double* out) const = 0;

 protected:
  std::vector<Parameter> parameters_;
};

template <class Friction>
class FrictionModelOf final : public FrictionModel {
 public:
  explicit FrictionModelOf(const Friction& friction) : friction_(friction) {
    for_each_parameter(friction_, [this](const auto&, const auto& p) {
      if (p.role != FrictionRole::given)
        parameters_.push_back({p.key, p.role, p.speed_power, p.least, p.most, p.spacing, p.count});
    });
  }

  const Friction& friction() const { return friction_; }

  Eigen::VectorXd values() const override {
    Eigen::VectorXd out(static_cast<Eigen::Index>(parameters_.size()));
    Eigen::Index k = 0;
    for_each_parameter(friction_, [&](const auto& law, const auto& p) {
      if (p.role != FrictionRole::given) out[k++] = law.*p.value;
    });
    return out;
  }

  void set(const Eigen::VectorXd& values) override {
    Eigen::Index k = 0;
    for_each_parameter(friction_, [&](auto& law, const auto& p) {
      if (p.role != FrictionRole::given) law.*p.value = values[k++];
    });
  }

  void row(double dq, double* out) const override {
    double* next = out + 1;
    const auto add = [&](const auto& law) {
      out[0] += law.torque(dq);
      const auto derivatives = law.regressor(dq);
      for (Eigen::Index k = 0; k < derivatives.size(); ++k) *next++ = derivatives[k];
    };
    out[0] = 0.0;
    std::apply([&add](const auto&... law) { (add(law), ...); }, friction_.laws());
  }

 private:
  Friction friction_;
};

struct FrictionEstimate {
  Eigen::MatrixXd information;
  double sum_squares = 0.0;
  int evaluations = 0;
};

/// Leaves the solution in `model`.
FrictionEstimate fit_friction(const FrictionSamples& samples, FrictionModel& model,
                              const std::vector<FrictionUnknown>& unknowns);

}  // namespace detail

/// Friction laws fitted to samples of one joint.
template <class Friction>
struct FrictionFitOf {
  Friction friction;
  double sum_squares = 0.0;     ///< [(N m)^2] of what is left, weighted, over the samples given
  int evaluations = 0;          ///< of the laws over all samples
  Eigen::MatrixXd information;  ///< J^T J of the unknowns in the order given: its inverse times the
                                ///< residual's variance is their covariance
};
using FrictionFit = FrictionFitOf<JointFriction>;

/// The one fit of all laws: least squares over `unknowns`, the other parameters being those of `given`.
///
/// Linear parameters alone are solved for. With nonlinear ones no start is needed: a grid over their ranges
/// is scanned on the samples gathered by velocity, the linear ones being solved for in each cell (variable
/// projection), and the best cells are refined by Levenberg-Marquardt with exact derivatives. The optimum is
/// at least as low as the one that the Nelder-Mead search of the letter reaches from any start.
/// Deterministic; allocates.
///
/// `Friction`: JointFriction, or any struct that has laws() as it has. Throws Error on fewer than 3 samples,
/// on sizes that differ, on a sample that is not finite, on a key that is no parameter, and where the
/// velocities do not determine linear parameters that are fitted alone.
template <class Friction>
FrictionFitOf<Friction> fit_friction(const FrictionSamples& samples, const Friction& given,
                                     const std::vector<FrictionUnknown>& unknowns) {
  detail::FrictionModelOf<Friction> model(given);
  detail::FrictionEstimate estimate = detail::fit_friction(samples, model, unknowns);
  return {model.friction(), estimate.sum_squares, estimate.evaluations, std::move(estimate.information)};
}

/// Eq. (24) alone. `dq` [rad/s] and `difference` [N m]: N samples each; `velocity_scale` as in
/// LinearFriction.
FrictionFit fit_linear_friction(const Eigen::VectorXd& dq, const Eigen::VectorXd& difference,
                                double velocity_scale = 0.0);

/// Eq. (25) alone.
FrictionFit fit_sigmoid_friction(const Eigen::VectorXd& dq, const Eigen::VectorXd& difference);

/// Which law predicts samples that it was not fitted on, [N m] rms over `folds` contiguous blocks.
struct FrictionChoice {
  FrictionLaw law = FrictionLaw::none;  ///< the one with the least held-out error
  double none = 0.0, linear = 0.0, sigmoid = 0.0;
  FrictionFit fit;  ///< of the law chosen, on all samples
};
FrictionChoice choose_friction_law(const Eigen::VectorXd& dq, const Eigen::VectorXd& difference,
                                   double velocity_scale = 0.0, int folds = 5);

}  // namespace dynid
