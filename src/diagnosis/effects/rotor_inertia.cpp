// SPDX-License-Identifier: Apache-2.0
// Ia ddq.
#include "effects.hpp"

namespace dynid::detail {
namespace {

class RotorInertia : public OwnTorque {
 public:
  RotorInertia() : OwnTorque("rotor_inertia", {{"armature", "kg m^2"}}) {}

 protected:
  Eigen::MatrixXd own(const GapMotion& motion, int j, const Eigen::VectorXd&) const override {
    return motion.ddq.col(j);
  }
};

}  // namespace

std::unique_ptr<Hypothesis> make_rotor_inertia() { return std::make_unique<RotorInertia>(); }

}  // namespace dynid::detail
