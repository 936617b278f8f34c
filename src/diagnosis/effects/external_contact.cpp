// SPDX-License-Identifier: Apache-2.0
// -J^T F at a point of one link in a window of time, by the stamps of its log: F, in the axes of the base
// frame, is held between a straight rise and a straight fall.
#include <algorithm>
#include <vector>

#include "effects.hpp"

namespace dynid::detail {
namespace {

constexpr double farthest_point =
    0.4;  // of the arm's reach: the point from the link's origin, along each axis
constexpr double quickest_rise = 0.002, slowest_rise = 0.15;  // rise, in parts of a sweep of the joints

class ExternalContact : public Hypothesis {
 public:
  std::string name() const override { return "external_contact"; }
  Scope scope() const override { return Scope::window; }
  bool approximate() const override { return true; }
  bool once() const override { return true; }
  std::vector<ShapeParameter> shape() const override { return shape_on(JointScale()); }
  std::vector<ShapeParameter> shape_on(const JointScale& arm) const override {
    const double far = farthest_point * arm.travel, sweep = arm.duration();
    return {{"start", "s", -1e12, 1e12, 1, false},
            {"duration", "s", 0.0, 1e12, 1, false},
            {"rise_time", "s", quickest_rise * sweep, slowest_rise * sweep, 1, true},
            {"x", "m", -far, far, 1, false},
            {"y", "m", -far, far, 1, false},
            {"z", "m", -far, far, 1, false}};
  }
  ColumnBlock columns(const GapMotion& motion, int unit, const Eigen::VectorXd& shape) const override {
    ColumnBlock block;
    const double rise = std::min(shape[2], 0.5 * shape[1]);
    const Eigen::ArrayXd since = motion.t.array() + (motion.start - shape[0]), until = shape[1] - since;
    const Eigen::ArrayXd inside = (since.min(until) / rise).max(0.0).min(1.0);
    Eigen::Index first = 0, last = inside.size();
    while (first < last && inside[first] == 0.0) ++first;
    while (last > first && inside[last - 1] == 0.0) --last;
    const std::vector<Eigen::MatrixXd> force =
        motion.force_columns(unit, shape.tail<3>(), first, last - first);
    for (int j = 0; j <= unit; ++j) {
      block.channels.push_back(j);
      block.values.emplace_back(Eigen::MatrixXd::Zero(inside.size(), 3));
      block.values.back().middleRows(first, last - first) =
          -(force[static_cast<std::size_t>(j)].array().colwise() * inside.segment(first, last - first))
               .matrix();
    }
    return block;
  }
  std::vector<NamedValue> parameters(const Robot&, int unit, const Eigen::VectorXd& c,
                                     const Eigen::VectorXd& shape) const override {
    return {{"link", "1", Eigen::VectorXd::Constant(1, unit + 1), false},
            {"force", "N", c, false},
            {"point", "m", shape.tail(3), false},
            {"start", "s", shape.head(1), false},
            {"duration", "s", shape.segment(1, 1), false},
            {"rise_time", "s", shape.segment(2, 1), false}};
  }
  void restore(const Robot&, const Effect& effect, int, Eigen::VectorXd& c,
               Eigen::VectorXd& shape) const override {
    c = arm_value(effect, "force", 3);
    shape.resize(6);
    shape << arm_value(effect, "start", 1), arm_value(effect, "duration", 1),
        arm_value(effect, "rise_time", 1), arm_value(effect, "point", 3);
  }
};

}  // namespace

std::unique_ptr<Hypothesis> make_external_contact() { return std::make_unique<ExternalContact>(); }

}  // namespace dynid::detail
