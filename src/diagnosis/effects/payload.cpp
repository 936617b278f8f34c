// SPDX-License-Identifier: Apache-2.0
// A rigid body at the flange: ten columns of the last link. Its coefficients are about the flange, in the
// axes of the last link: what no torque of the log shows of it is then that of a body at the flange, and not
// of one in the last joint. What is said of it (com, inertia) is in the last link's frame.
#include <algorithm>

#include "../body.hpp"
#include "effects.hpp"

namespace dynid::detail {
namespace {

// In parts of the arm's reach: a ring around the flange; how far from it a load is carried; a flange that the
// model leaves at the last joint.
constexpr double behind_the_flange = 0.03, farthest = 0.7, no_flange = 0.01;

class Payload : public Hypothesis {
 public:
  std::string name() const override { return "payload"; }
  Scope scope() const override { return Scope::arm; }
  ColumnBlock columns(const GapMotion& motion, int, const Eigen::VectorXd&) const override {
    ColumnBlock block;
    block.values = motion.link_columns(motion.joints() - 1);
    const Matrix10 from_flange = shift(motion.robot().tip.translation());
    for (Eigen::MatrixXd& columns : block.values) columns *= from_flange;
    for (int j = 0; j < motion.joints(); ++j) block.channels.push_back(j);
    return block;
  }
  std::vector<NamedValue> parameters(const Robot& robot, int, const Eigen::VectorXd& c,
                                     const Eigen::VectorXd&) const override {
    const LinkInertia body = from_standard(StandardParameters(shift(robot.tip.translation()) * c));
    Eigen::VectorXd inertia(6);
    inertia << body.inertia(0, 0), body.inertia(0, 1), body.inertia(0, 2), body.inertia(1, 1),
        body.inertia(1, 2), body.inertia(2, 2);
    return {{"mass", "kg", Eigen::VectorXd::Constant(1, body.mass), false},
            {"com", "m", body.com, false},
            {"inertia", "kg m^2", inertia, false}};
  }
  void restore(const Robot& robot, const Effect& effect, int, Eigen::VectorXd& c,
               Eigen::VectorXd& shape) const override {
    c = shift(-robot.tip.translation()) * to_standard(body(effect));
    shape.resize(0);
  }
  bool plausible(const Robot& robot, int, const Eigen::VectorXd& c, const Eigen::VectorXd&) const override {
    if (!(c[0] > 0.0)) return false;
    const double reach = arm_reach(robot);
    const Eigen::Vector3d flange = robot.tip.translation(), com = c.segment<3>(1) / c[0];
    if (com.norm() > farthest * reach) return false;
    // Where the model says where the flange is, what it carries is in front of it: along the flange's own
    // axis z or, where that points elsewhere, on the side away from the last link.
    if (flange.norm() < no_flange * reach) return true;
    const StandardParameters& link = robot.joints.back().parameters;
    const Eigen::Vector3d away =
        link[0] > 0.0 ? Eigen::Vector3d(flange - link.segment<3>(1) / link[0]) : flange;
    return std::max(com.dot(robot.tip.linear().col(2)), com.dot(away.normalized())) >
           -behind_the_flange * reach;
  }
  Eigen::VectorXd nominal(const Robot&, int) const override { return Eigen::VectorXd::Zero(10); }
  bool possible(const Eigen::VectorXd& c) const override { return is_body(c); }
  Eigen::VectorXd nearest_possible(const Eigen::VectorXd& c,
                                   const Eigen::MatrixXd& information) const override {
    return nearest_body(c, information);
  }

 private:
  using Matrix10 = Eigen::Matrix<double, 10, 10>;
  /// Standard parameters about a point, from those about one that lies at `by` [m] from it.
  static Matrix10 shift(const Eigen::Vector3d& by) {
    Eigen::Matrix4d move = Eigen::Matrix4d::Identity();
    move.topRightCorner<3, 1>() = by;
    Matrix10 out;
    for (int k = 0; k < 10; ++k)
      out.col(k) = from_pseudo_inertia(move * pseudo_inertia(StandardParameters::Unit(k)) * move.transpose());
    return out;
  }
  static LinkInertia body(const Effect& effect) {
    LinkInertia b;
    b.mass = arm_value(effect, "mass", 1)[0];
    b.com = arm_value(effect, "com", 3);
    const Eigen::VectorXd i = arm_value(effect, "inertia", 6);
    b.inertia << i[0], i[1], i[2], i[1], i[3], i[4], i[2], i[4], i[5];
    return b;
  }
};

}  // namespace

std::unique_ptr<Hypothesis> make_payload() { return std::make_unique<Payload>(); }

}  // namespace dynid::detail
