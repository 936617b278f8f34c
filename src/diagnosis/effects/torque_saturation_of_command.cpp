// SPDX-License-Identifier: Apache-2.0
// Saturation in its other form: the log has the torque that was asked for, the joint got no more than
// +-limit.
#include <cmath>

#include "effects.hpp"

namespace dynid::detail {
namespace {

constexpr double near = 0.15;  // to the limit, relatively: what the joint gets while more is asked for
constexpr double doubt = 6.0;  // standard deviations of its noise that a torque has to be beyond the limit
constexpr double clear = 5.0;  // times that: of a lower limit all torques are near

Eigen::ArrayXd beyond(const Eigen::ArrayXd& tau, double limit) { return tau - tau.max(-limit).min(limit); }

/// Of white noise, from third differences: N m.
double noise_of(const Eigen::ArrayXd& tau) {
  const Eigen::Index size = tau.size() - 3;
  if (size < 1) return 0.0;
  return std::sqrt((tau.tail(size) - 3.0 * tau.segment(2, size) + 3.0 * tau.segment(1, size) - tau.head(size))
                       .square()
                       .mean() /
                   20.0);
}

class TorqueSaturationOfCommand : public OwnTorque {
 public:
  TorqueSaturationOfCommand() : OwnTorque("torque_saturation", {}) {}
  std::string form() const override { return "command_limit"; }
  std::vector<ShapeParameter> shape() const override {
    return {{"command_limit", "N m", 0.03, 120.0, 33, true}};
  }
  std::vector<ShapeParameter> shape_on(const JointScale& s) const override {
    return {{"command_limit", "N m", 0.03 * s.torque, 8.0 * s.torque, 33, true}};
  }
  bool shape_only() const override { return true; }
  bool approximate() const override { return true; }
  double prior(const Robot&) const override { return 0.4; }

  bool reachable(const std::vector<JointRange>& ranges, int unit, const Eigen::VectorXd&,
                 const Eigen::VectorXd& shape) const override {
    // More is asked for than the drive gives, but a joint that got less than a fifth would not follow.
    constexpr double least_given = 0.2;
    return shape[0] > least_given * ranges[static_cast<std::size_t>(unit)].torque;
  }

 protected:
  Eigen::MatrixXd own(const GapMotion& motion, int j, const Eigen::VectorXd& shape) const override {
    // What was asked for and not got, the motion does not know: it is in the measured torque alone, with the
    // noise that is in the gap too and must not be explained by itself. What the joint did get is at the
    // limit meanwhile, and never beyond.
    const Eigen::ArrayXd asked = beyond(motion.tau.col(j), shape[0]), got = motion.nominal.col(j).array();
    const double least = doubt * noise_of(motion.tau.col(j)) + 1e-9;
    if (shape[0] < clear * least) return Eigen::ArrayXd::Zero(asked.size());
    const Eigen::ArrayXd off = (got.abs() - shape[0]) / (near * shape[0] + least);
    return asked.cube() / (asked.square() + least * least) / (1.0 + off.square().square()) +
           beyond(got, shape[0]);
  }
};

}  // namespace

std::unique_ptr<Hypothesis> make_torque_saturation_of_command() {
  return std::make_unique<TorqueSaturationOfCommand>();
}

}  // namespace dynid::detail
