// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <memory>
#include <vector>

#include "dynid/dynamics/model.hpp"
#include "dynid/dynamics/packet.hpp"
#include "dynid/dynamics/workspace.hpp"
#include "dynid/identification/excite.hpp"
#include "exciting_clearance.hpp"

namespace dynid::detail {

/// What the search minimises, with its gradient: a smooth stand-in for the criterion plus the limits'
/// penalty.
///
/// Unknowns: coefficients (2 L x n, joint by joint; what of them moves the ends is projected away), offsets
/// (n), and, where the base frequency is free, its logarithm. One object a thread; `base` and `robot` are the
/// caller's and outlive it.
class ExciteObjective {
 public:
  ExciteObjective(const Robot& robot, const BaseParameters& base, const CollisionModel& collision,
                  const ExciteOptions& options, const MotionShape& shape, bool free_frequency);

  int size() const noexcept { return size_; }  ///< unknowns
  /// How close the stand-in is to the condition number (a power mean's exponent), and how stiff the penalty.
  void set_stage(int exponent, double stiffness) noexcept { exponent_ = exponent, stiffness_ = stiffness; }
  double operator()(const Eigen::Ref<const Eigen::VectorXd>& x, double* gradient);

  MotionShape shape(const Eigen::Ref<const Eigen::VectorXd>& x) const;
  ExcitingMotion motion(const Eigen::Ref<const Eigen::VectorXd>& x) const;
  Eigen::VectorXd unknowns(const Eigen::MatrixXd& coefficients, const Eigen::VectorXd& offset) const;

 private:
  /// A motion at N instants, or the derivatives of a value by it.
  struct States {
    Eigen::MatrixXd q, dq, ddq, jerk;  // N x n
    void set_zero(Eigen::Index samples, int n);
  };
  struct Grid {
    Eigen::VectorXd t;
    States at, slope;
  };
  using Packets = Eigen::Matrix<Packet8, Eigen::Dynamic, 1>;

  double criterion(Grid& grid);
  double limits(Grid& grid);
  double torque(Grid& grid, Eigen::Index first);
  double clearance(Grid& grid, Eigen::Index sample);
  void load(const States& at, Eigen::Index first);
  void pull(const Grid& grid, const MotionBasis& basis, const Eigen::MatrixXd& projection,
            Eigen::Ref<Eigen::MatrixXd> coefficients, Eigen::Ref<Eigen::VectorXd> offset) const;

  const Robot& robot_;
  const BaseParameters& base_;
  const ExciteOptions& options_;
  MotionShape shape_;
  bool free_frequency_;
  int n_, size_, columns_;
  int exponent_ = 4;
  double stiffness_ = 10.0;

  Model<> model_;
  Workspace<Eigen::Dynamic, Packet8> packets_;
  Workspace<> workspace_;
  Packets q_, dq_, ddq_, tau_, tau_other_;
  Eigen::Matrix<Packet8, Eigen::Dynamic, Eigen::Dynamic> Y_, Y_other_;
  Eigen::VectorXd friction_scale_, weight_;
  bool has_torque_ = false;
  std::vector<std::vector<int>> support_;   // columns of the reduced regressor that joint j's rows have
  std::vector<std::vector<int>> standard_;  // the same, as columns of Y, without friction
  std::vector<Eigen::MatrixXd> rows_, pulled_;

  Grid coarse_, fine_;
  Clearances clearances_;
  double clearance_;
  std::vector<Eigen::Isometry3d> poses_;
  std::vector<Proximity> near_;
};

/// What the search keeps to of a joint's limits: `margin` is the share left free.
struct Aim {
  double lower, upper, velocity, acceleration, jerk;
};
Aim aim(const JointLimits& limits, double margin);

}  // namespace dynid::detail
