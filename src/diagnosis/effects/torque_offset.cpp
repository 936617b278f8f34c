// SPDX-License-Identifier: Apache-2.0
// A constant.
#include "effects.hpp"

namespace dynid::detail {
namespace {

class TorqueOffset : public OwnTorque {
 public:
  TorqueOffset() : OwnTorque("torque_offset", {{"offset", "N m"}}) {}

 protected:
  Eigen::MatrixXd own(const GapMotion& motion, int, const Eigen::VectorXd&) const override {
    return Eigen::VectorXd::Ones(motion.samples());
  }
};

}  // namespace

std::unique_ptr<Hypothesis> make_torque_offset() { return std::make_unique<TorqueOffset>(); }

}  // namespace dynid::detail
