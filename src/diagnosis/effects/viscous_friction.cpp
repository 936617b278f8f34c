// SPDX-License-Identifier: Apache-2.0
// Fv dq.
#include "effects.hpp"

namespace dynid::detail {
namespace {

class ViscousFriction : public OwnTorque {
 public:
  ViscousFriction() : OwnTorque("viscous_friction", {{"coefficient", "N m s/rad"}}) {}

  bool plausible(const Robot& robot, int unit, const Eigen::VectorXd& c,
                 const Eigen::VectorXd&) const override {
    return hinders(robot, unit, usual_speed(robot, unit), c[0]);
  }
  double prior(const Robot& nominal) const override {
    return without_friction(nominal) ? of_what_all_have : 1.0;
  }

 protected:
  Eigen::MatrixXd own(const GapMotion& motion, int j, const Eigen::VectorXd&) const override {
    return motion.speed.col(j);
  }
};

}  // namespace

std::unique_ptr<Hypothesis> make_viscous_friction() { return std::make_unique<ViscousFriction>(); }

}  // namespace dynid::detail
