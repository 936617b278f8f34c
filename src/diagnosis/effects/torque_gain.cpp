// SPDX-License-Identifier: Apache-2.0
// G tau: the sensor reads (1 + G) tau.
#include "effects.hpp"

namespace dynid::detail {
namespace {

class TorqueGain : public OwnTorque {
 public:
  TorqueGain() : OwnTorque("torque_gain", {{"gain", "1"}}) {}
  bool plausible(const Robot&, int, const Eigen::VectorXd& c, const Eigen::VectorXd&) const override {
    return c[0] > -0.9 && c[0] < 9.0;  // a tenth or ten times what is meant is no gain
  }

 protected:
  Eigen::MatrixXd own(const GapMotion& motion, int j, const Eigen::VectorXd&) const override {
    return motion.nominal.col(j);
  }
};

}  // namespace

std::unique_ptr<Hypothesis> make_torque_gain() { return std::make_unique<TorqueGain>(); }

}  // namespace dynid::detail
