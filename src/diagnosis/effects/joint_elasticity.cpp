// SPDX-License-Identifier: Apache-2.0
// A spring between the measured position and the link: the link swings on it, by the whole arm's dynamics.
#include "../spring_in_joint.hpp"
#include "effects.hpp"

namespace dynid::detail {
namespace {

constexpr double damping_ratio = 0.1;  // gears have little

class JointElasticity : public OwnTorque {
 public:
  JointElasticity() : OwnTorque("joint_elasticity", {}) {}
  bool shape_only() const override { return true; }
  std::vector<ShapeParameter> shape() const override {
    return {{"stiffness", "N m/rad", 10.0, 50000.0, 20, true}};
  }
  ColumnBlock columns(const GapMotion& motion, int unit, const Eigen::VectorXd& shape) const override {
    return all_channels({spring_torque(motion, unit, {shape[0], 0.0, damping_ratio})});
  }

 protected:
  Eigen::MatrixXd own(const GapMotion&, int, const Eigen::VectorXd&) const override { return {}; }
};

}  // namespace

std::unique_ptr<Hypothesis> make_joint_elasticity() { return std::make_unique<JointElasticity>(); }

}  // namespace dynid::detail
