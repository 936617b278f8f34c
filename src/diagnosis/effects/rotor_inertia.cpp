// SPDX-License-Identifier: Apache-2.0
// Ia ddq.
#include "effects.hpp"

namespace dynid::detail {
namespace {

class RotorInertia : public OwnTorque {
 public:
  RotorInertia() : OwnTorque("rotor_inertia", {{"armature", "kg m^2"}}) {}

  bool plausible(const Robot& robot, int unit, const Eigen::VectorXd& c,
                 const Eigen::VectorXd&) const override {
    return c[0] + robot.joints[static_cast<std::size_t>(unit)].rotor_inertia > 0.0;
  }
  double prior(const Robot& nominal) const override {
    return without_rotors(nominal) ? of_what_all_have : 1.0;
  }

 protected:
  Eigen::MatrixXd own(const GapMotion& motion, int j, const Eigen::VectorXd&) const override {
    return motion.ddq.col(j);
  }
};

}  // namespace

std::unique_ptr<Hypothesis> make_rotor_inertia() { return std::make_unique<RotorInertia>(); }

}  // namespace dynid::detail
