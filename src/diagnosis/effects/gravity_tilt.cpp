// SPDX-License-Identifier: Apache-2.0
// The base is not upright: gravity turned about a horizontal axis.
#include <cmath>

#include "dynid/effect/derived.hpp"
#include "effects.hpp"

namespace dynid::detail {
namespace {

class GravityTilt : public Hypothesis {
 public:
  std::string name() const override { return "gravity_tilt"; }
  Scope scope() const override { return Scope::arm; }
  ColumnBlock columns(const GapMotion& motion, int, const Eigen::VectorXd&) const override {
    // c: the horizontal part of the true gravity's direction; the vertical part is of second order.
    const Eigen::Vector3d g = motion.robot().gravity;
    const Eigen::Matrix<double, 3, 2> horizontal = across_gravity(g);
    return all_channels({motion.gravity_columns(g.norm() * horizontal.col(0)),
                         motion.gravity_columns(g.norm() * horizontal.col(1))});
  }
  std::vector<NamedValue> parameters(const Robot&, int, const Eigen::VectorXd& c,
                                     const Eigen::VectorXd&) const override {
    // Gravity is turned about a horizontal axis, whose azimuth is a quarter turn behind where it leans to.
    return {
        {"angle_deg", "deg", Eigen::VectorXd::Constant(1, std::asin(std::min(1.0, c.norm())) * 180 / M_PI),
         false},
        {"direction_deg", "deg", Eigen::VectorXd::Constant(1, std::atan2(-c[0], c[1]) * 180 / M_PI), false}};
  }
  void restore(const Robot&, const Effect& effect, int, Eigen::VectorXd& c,
               Eigen::VectorXd& shape) const override {
    const double angle = arm_value(effect, "angle_deg", 1)[0] * M_PI / 180;
    const double direction = arm_value(effect, "direction_deg", 1)[0] * M_PI / 180;
    c = std::sin(angle) * Eigen::Vector2d(-std::sin(direction), std::cos(direction));
    shape.resize(0);
  }
};

}  // namespace

std::unique_ptr<Hypothesis> make_gravity_tilt() { return std::make_unique<GravityTilt>(); }

}  // namespace dynid::detail
