// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>

#include "dynid/model/friction_parameters.hpp"

namespace dynid {

/// A friction law fitted to the differences of Section IV-B, Delta tau_j = tau_j - tau_hat_j, of one joint.
struct FrictionFit {
  JointFriction friction;
  double sum_squares = 0.0;  ///< [(N m)^2] of what is left, over the samples given
  int evaluations = 0;       ///< of the law over all samples
};

/// Eq. (24) by least squares. `dq` [rad/s] and `difference` [N m]: N samples each; `velocity_scale` as in
/// LinearFriction. Throws Error when N < 3, sizes differ, a value is not finite or the velocities do not
/// determine it.
FrictionFit fit_linear_friction(const Eigen::VectorXd& dq, const Eigen::VectorXd& difference,
                                double velocity_scale = 0.0);

/// Eq. (25) by Nelder-Mead from `start`, as the letter does it: finds the optimum that the start leads to.
FrictionFit fit_sigmoid_friction_nelder_mead(const Eigen::VectorXd& dq, const Eigen::VectorXd& difference,
                                             const SigmoidFriction& start);

/// Eq. (25) from no start at all: phi1 is solved for (the law is linear in it), (phi2, phi3) is scanned on a
/// grid over the velocities seen, and the best cells are refined by Levenberg-Marquardt with exact
/// derivatives. At least as low as the optimum that Nelder-Mead reaches from any start.
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
