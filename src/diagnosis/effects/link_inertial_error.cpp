// SPDX-License-Identifier: Apache-2.0
// A change of the ten standard parameters of one link.
#include <cmath>

#include "../body.hpp"
#include "effects.hpp"

namespace dynid::detail {
namespace {

class LinkInertialError : public Hypothesis {
 public:
  std::string name() const override { return "link_inertial_error"; }
  Scope scope() const override { return Scope::link; }
  // On the last link it is a payload where that is a body.
  double prior(const Robot&) const override { return 0.2; }
  ColumnBlock columns(const GapMotion& motion, int unit, const Eigen::VectorXd&) const override {
    ColumnBlock block;
    block.values = motion.link_columns(unit);
    for (int j = 0; j <= unit; ++j) block.channels.push_back(j);
    return block;
  }
  std::vector<NamedValue> parameters(const Robot&, int unit, const Eigen::VectorXd& c,
                                     const Eigen::VectorXd&) const override {
    return {{"link", "1", Eigen::VectorXd::Constant(1, unit + 1), false},
            {"mass", "kg", Eigen::VectorXd::Constant(1, c[0]), false},
            {"first_moment", "kg m", c.segment(1, 3), false},
            {"inertia_about_origin", "kg m^2", c.tail(6), false}};
  }
  void restore(const Robot&, const Effect& effect, int, Eigen::VectorXd& c,
               Eigen::VectorXd& shape) const override {
    c = change(effect);
    shape.resize(0);
  }
  // The link with its error is a body; where the model's own is none (base parameters alone were identified),
  // nothing is asked of it.
  Eigen::VectorXd nominal(const Robot& robot, int unit) const override {
    const StandardParameters& link = robot.joints[static_cast<std::size_t>(unit)].parameters;
    return is_body(link) && link[0] > 0.0 ? Eigen::VectorXd(link) : Eigen::VectorXd();
  }
  bool possible(const Eigen::VectorXd& whole) const override { return is_body(whole); }
  Eigen::VectorXd nearest_possible(const Eigen::VectorXd& whole,
                                   const Eigen::MatrixXd& information) const override {
    return nearest_body(whole, information);
  }
  // A model that has a link at all seldom has another multiple of its mass: heavy tails, for a tool that was
  // forgotten. On the last link, what adds far more than the link is is rather a payload.
  double surprise(const Robot& robot, int unit, const Eigen::VectorXd& c) const override {
    const double mass = robot.joints[static_cast<std::size_t>(unit)].parameters[0];
    return mass > 0.0 ? std::log1p(c[0] * c[0] / (mass * mass)) : 0.0;
  }

 private:
  static Eigen::VectorXd change(const Effect& effect) {
    Eigen::VectorXd c(10);
    c << arm_value(effect, "mass", 1), arm_value(effect, "first_moment", 3),
        arm_value(effect, "inertia_about_origin", 6);
    return c;
  }
};

}  // namespace

std::unique_ptr<Hypothesis> make_link_inertial_error() { return std::make_unique<LinkInertialError>(); }

}  // namespace dynid::detail
