// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "dynid/identification/base_parameters.hpp"
#include "dynid/identification/remark.hpp"
#include "dynid/identification/triangular_factor.hpp"
#include "dynid/model/coefficient.hpp"
#include "dynid/signal/log.hpp"
#include "dynid/signal/prepare.hpp"

namespace dynid {

enum class Method {
  ols,   ///< every row counts alike, eq. (8)
  wls,   ///< each joint by the inverse of its residual's standard deviation, iterated
  irls,  ///< wls, and rows beyond 1.345 robust standard deviations count less (Huber), iterated
};

struct IdentifyOptions {
  PrepareOptions prepare;
  FrictionLaw friction = FrictionLaw::linear;
  bool rotor_inertia = false;
  Method method = Method::ols;
  double velocity_scale = 0.02;  ///< v_s [rad/s] of the smoothed sign in eq. (24); 0: the exact sign
  /// Coefficients whose standard deviation by the textbook formula, every sample counted as independent, is
  /// above this many per cent (the letter's rule) and which are below sqrt(2) honest standard deviations are
  /// dropped one by one, the worst first; 0: none.
  double prune_percent = 30.0;
  bool validate = true;  ///< without validation logs: make the second fit that `validation` needs
  RemarkCriteria remarks;
  /// Called with what is being done and how far it is, 0..1.
  std::function<void(const std::string& stage, double fraction)> progress;
};

/// How well a model predicts rows: torque low-passed at the cut-off, as the fit sees it.
struct FitQuality {
  std::string source;     ///< which rows
  Eigen::Index rows = 0;  ///< a joint
  Eigen::VectorXd rmse;   ///< n [N m]
  double relative_error_percent =
      0.0;  ///< 100 |s - Y pi| / |s| over all joints (eq. (84) of Sousa and Cortesao 2014)
};

/// Held-out error of both friction laws on one joint [N m rms], where `--friction sigmoid` made the choice.
struct FrictionComparison {
  int joint = 0;  ///< from 1
  double linear = 0.0, sigmoid = 0.0;
  FrictionLaw chosen = FrictionLaw::linear;
};

struct Identification {
  Robot robot;          ///< with the parameters nearest the given ones that have the coefficients
  BaseParameters base;  ///< of the rigid body (and rotor inertia)
  std::vector<Coefficient> coefficients;  ///< rigid body, rotor inertia, then friction joint by joint
  Eigen::VectorXd values;                 ///< of the coefficients, 0 where dropped
  Eigen::VectorXd variance;               ///< of the values, correlated residuals honoured; 0 where dropped
  Eigen::MatrixXd covariance;     ///< of the rigid body's values (base.size() squared); zeros where dropped
  int rank = 0;                   ///< columns identified, before pruning
  double condition_number = 0.0;  ///< of the unweighted regressor with `rank` columns
  FitQuality fit;
  std::optional<FitQuality> validation;
  std::string validation_note;  ///< why there is no validation, if so
  std::vector<FrictionComparison> friction;
  Eigen::VectorXd noise;        ///< n [N m]: standard deviation of the residual
  Eigen::VectorXd correlation;  ///< n: rows that one independent row is worth
  TriangularFactor factor;      ///< of the unweighted rows, all `rank` columns, what one-step retrieval needs
  double cutoff = 0.0;          ///< [Hz]
  std::vector<Remark> remarks;  ///< joint by joint, errors last; empty where nothing is odd
  std::vector<PreparedLog> logs;  ///< checks and choices made for each log; their segments are released
};

/// The classical route of Section III: tau = Y_R pi_R + friction over the logs, eqs. (5)-(9).
///
/// Friction `linear` adds fv, fc, fo of eq. (24) to each joint. `sigmoid` offers each joint eq. (25) together
/// with the viscous term and offset that the letter found negligible on its robot; a joint takes it when it
/// predicts held-out blocks better than eq. (24) by 2 % at least. As in Section IV-B it is fitted joint by
/// joint to the differences that the rigid body leaves, so no other joint is touched by the choice.
///
/// Standard deviations count independent rows only, see covariance(). `validation` logs are never fitted;
/// without any, a second fit leaves out two of ten contiguous blocks of every log and is judged on them.
/// `remarks` names every significant coefficient of a sign that no robot has: a base parameter that no
/// physically consistent links make negative (zz1 where it is the inertia about joint 1), rotor inertia,
/// viscous and Coulomb friction; and an error that alone says that log and model do not belong together.
/// Throws Error: unusable logs, a number of joints other than the robot's, a motion that does not excite.
Identification identify(const Robot& robot, const std::vector<Log>& logs,
                        const std::vector<Log>& validation = {}, const IdentifyOptions& options = {});

/// Section IV-B on top of a model from elsewhere (such as reverse engineering): the differences between the
/// measured torques, low-passed, and the robot's torques without friction are fitted joint by joint. Returns
/// the robot with the friction of `law`.
struct TwoStageFriction {
  Robot robot;
  FitQuality before, after;
  std::vector<FrictionComparison> comparison;  ///< laws by held-out blocks
};
TwoStageFriction identify_friction(const Robot& robot, const std::vector<Log>& logs, FrictionLaw law,
                                   const IdentifyOptions& options = {});

}  // namespace dynid
