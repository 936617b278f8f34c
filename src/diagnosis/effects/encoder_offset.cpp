// SPDX-License-Identifier: Apache-2.0
// (d tau / d q_j) dq0_j: the joint stands dq0 further than its encoder says.
#include "effects.hpp"

#include <cmath>

namespace dynid::detail {
namespace {

constexpr double largest = 0.15;  // [rad]: a tooth, not a turn

class EncoderOffset : public OwnTorque {
 public:
  EncoderOffset() : OwnTorque("encoder_offset", {{"offset", "rad"}}) {}
  ColumnBlock columns(const GapMotion& motion, int unit, const Eigen::VectorXd&) const override {
    return all_channels({motion.shifted(unit, Eigen::VectorXd::Ones(motion.samples()))});
  }

  bool plausible(const Robot&, int, const Eigen::VectorXd& c, const Eigen::VectorXd&) const override {
    return std::abs(c[0]) < largest;
  }

 protected:
  Eigen::MatrixXd own(const GapMotion&, int, const Eigen::VectorXd&) const override { return {}; }
};

}  // namespace

std::unique_ptr<Hypothesis> make_encoder_offset() { return std::make_unique<EncoderOffset>(); }

}  // namespace dynid::detail
