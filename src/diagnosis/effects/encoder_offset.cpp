// SPDX-License-Identifier: Apache-2.0
// (d tau / d q_j) dq0_j: the joint stands dq0 further than its encoder says.
#include "effects.hpp"

#include <cmath>

namespace dynid::detail {
namespace {

// [rad] 20 deg, up to where the columns of the encoder's own zero will do: to first order, a sixth is
// missing.
constexpr double largest = 0.35;

class EncoderOffset : public OwnTorque {
 public:
  EncoderOffset() : OwnTorque("encoder_offset", {{"offset", "rad"}}) {}
  ColumnBlock columns(const GapMotion& motion, int unit, const Eigen::VectorXd&) const override {
    return all_channels({motion.shifted(unit, Eigen::VectorXd::Ones(motion.samples()))});
  }

  bool reachable(const std::vector<JointRange>& ranges, int unit, const Eigen::VectorXd& c,
                 const Eigen::VectorXd&) const override {
    const JointScale& scale = ranges[static_cast<std::size_t>(unit)].scale;
    return std::abs(c[0]) < (scale.type == JointType::prismatic ? scale.travel : largest);
  }

 protected:
  Eigen::MatrixXd own(const GapMotion&, int, const Eigen::VectorXd&) const override { return {}; }
};

}  // namespace

std::unique_ptr<Hypothesis> make_encoder_offset() { return std::make_unique<EncoderOffset>(); }

}  // namespace dynid::detail
