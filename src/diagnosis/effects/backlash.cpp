// SPDX-License-Identifier: Apache-2.0
// Play between motor and link: a spring that transmits no torque inside the gap. The link crosses it on a
// path of its own, driven by gravity, its neighbours and its friction, and meets the other end with a blow.
#include <algorithm>
#include <cmath>

#include "dynid/friction/friction.hpp"
#include "effects.hpp"

namespace dynid::detail {
namespace {

constexpr double damping_ratio = 0.4;  // of the link on the spring: what the motor behind it takes of a blow
constexpr double least = 0.002;        // [rad]
constexpr double fastest = 60.0;       // [Hz] of the link on the spring: beyond, all springs look alike

/// How far the link is behind the measured motor, and what its friction differs for that: N [rad], N [N m].
struct Play {
  Eigen::VectorXd behind, friction;
};
Play play(const GapMotion& motion, int joint, double gap, double spring) {
  const Eigen::Index N = motion.samples();
  const Eigen::VectorXd inertia = motion.inertia(joint).cwiseMax(1e-6);
  const Eigen::VectorXd load = motion.rigid.col(joint) - inertia.cwiseProduct(motion.ddq.col(joint));
  const Eigen::VectorXd motor = motion.speed.col(joint), torque = motion.nominal.col(joint);
  const JointFriction& friction = motion.robot().joints[static_cast<std::size_t>(joint)].friction;
  const double lightest = inertia.minCoeff();
  const double stiffness = std::min(spring, lightest * std::pow(2.0 * M_PI * fastest, 2));
  const double dt = 1.0 / motion.rate;
  const int steps = std::max(2, static_cast<int>(std::ceil(dt * std::sqrt(stiffness / lightest) / 0.4)));
  Play out{Eigen::VectorXd(N), Eigen::VectorXd(N)};
  double x = std::copysign(0.5 * gap, torque[0]) + torque[0] / stiffness, link = motor[0];
  for (Eigen::Index i = 0; i < N; ++i) {
    const Eigen::Index next = std::min(i + 1, N - 1);
    out.behind[i] = x;
    out.friction[i] = friction_torque(friction, link) - friction_torque(friction, motor[i]);
    const double damping = 2.0 * damping_ratio * std::sqrt(stiffness * inertia[i]);
    for (int k = 0; k < steps; ++k) {
      const double part = (k + 1.0) / steps, speed = motor[i] + part * (motor[next] - motor[i]);
      const double pressed = x - std::clamp(x, -0.5 * gap, 0.5 * gap);
      double transmitted = pressed == 0.0 ? 0.0 : stiffness * pressed + damping * (speed - link);
      if (transmitted * pressed < 0.0) transmitted = 0.0;  // an end pushes, it does not hold
      link += dt / steps / inertia[i] *
              (transmitted - load[i] - part * (load[next] - load[i]) - friction_torque(friction, link));
      x += dt / steps * (speed - link);
    }
  }
  return out;
}

class Backlash : public OwnTorque {
 public:
  Backlash() : OwnTorque("backlash", {}) {}
  std::string form() const override { return "gap"; }
  bool shape_only() const override { return true; }
  std::vector<ShapeParameter> shape() const override {
    return {{"gap", "rad", least, 0.06, 10, true}, {"stiffness", "N m/rad", 200.0, 30000.0, 3, true}};
  }
  ColumnBlock columns(const GapMotion& motion, int unit, const Eigen::VectorXd& shape) const override {
    const Play p = play(motion, unit, shape[0], shape[1]);
    Eigen::MatrixXd torque = motion.shifted(unit, -p.behind);
    torque.col(unit) += p.friction;
    return all_channels({torque});
  }
  double prior() const override { return 0.4; }
  bool plausible(const Robot&, int, const Eigen::VectorXd&, const Eigen::VectorXd& shape) const override {
    return shape[0] > 1.5 * least;  // less is a spring's alone: joint_elasticity
  }

 protected:
  Eigen::MatrixXd own(const GapMotion&, int, const Eigen::VectorXd&) const override { return {}; }
};

}  // namespace

std::unique_ptr<Hypothesis> make_backlash() { return std::make_unique<Backlash>(); }

}  // namespace dynid::detail
