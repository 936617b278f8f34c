// SPDX-License-Identifier: Apache-2.0
// Late torque in its other form: each joint's channel has a delay of its own, or none.
#include "dynid/signal/filter.hpp"
#include "effects.hpp"

namespace dynid::detail {
namespace {

class TimeDelayOfChannels : public OwnTorque {
 public:
  TimeDelayOfChannels() : OwnTorque("time_delay", {}) {}
  std::string form() const override { return "channel_delay_s"; }
  double prior(const Robot&) const override { return 0.4; }
  bool shape_only() const override { return true; }
  double lateness(const Eigen::VectorXd& shape) const override { return shape[0]; }
  std::vector<ShapeParameter> shape() const override {
    return {{"channel_delay_s", "s", -0.05, 0.05, 21, true}};
  }
  std::vector<ShapeParameter> shape_on(const JointScale& s) const override {
    const double latest = latest_of_sweep * s.duration();
    return {{"channel_delay_s", "s", -latest, latest, 21, true}};
  }

 protected:
  Eigen::MatrixXd own(const GapMotion& motion, int j, const Eigen::VectorXd& shape) const override {
    return interpolate(motion.t, motion.nominal.col(j), motion.t.array() - shape[0]) - motion.nominal.col(j);
  }
};

}  // namespace

std::unique_ptr<Hypothesis> make_time_delay_of_channels() { return std::make_unique<TimeDelayOfChannels>(); }

}  // namespace dynid::detail
