// SPDX-License-Identifier: Apache-2.0
// Joint elasticity in its other form: a link light enough, or a spring soft enough, that it swings within the
// motion's band, on a path of its own.
#include <cmath>

#include "../spring_in_joint.hpp"
#include "effects.hpp"

namespace dynid::detail {
namespace {

class JointElasticitySwinging : public OwnTorque {
 public:
  JointElasticitySwinging() : OwnTorque("joint_elasticity", {}) {}
  std::string form() const override { return "damping"; }
  bool shape_only() const override { return true; }
  std::vector<ShapeParameter> shape() const override {
    return {{"stiffness", "N m/rad", 10.0, 20000.0, 16, true}, {"damping", "1", 0.02, 0.5, 3, true}};
  }
  std::vector<ShapeParameter> shape_on(const JointScale& s) const override {
    return {{"stiffness", "N m/rad", s.inertia * std::pow(8.0 / s.duration(), 2),
             s.inertia * std::pow(300.0 / s.duration(), 2), 16, true},
            shape().back()};
  }
  bool approximate() const override { return true; }
  double prior(const Robot&) const override { return 0.4; }
  ColumnBlock columns(const GapMotion& motion, int unit, const Eigen::VectorXd& shape) const override {
    return all_channels({spring_torque(motion, unit, {shape[0], 0.0, shape[1]})});
  }

 protected:
  Eigen::MatrixXd own(const GapMotion&, int, const Eigen::VectorXd&) const override { return {}; }
};

}  // namespace

std::unique_ptr<Hypothesis> make_joint_elasticity_swinging() {
  return std::make_unique<JointElasticitySwinging>();
}

}  // namespace dynid::detail
