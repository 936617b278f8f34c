// SPDX-License-Identifier: Apache-2.0
// -J^T F on one link in a window of time: F and the moment about the link's origin, in the base frame, held.
#include "effects.hpp"

namespace dynid::detail {
namespace {

class ExternalContact : public Hypothesis {
 public:
  std::string name() const override { return "external_contact"; }
  Scope scope() const override { return Scope::window; }
  bool once() const override { return true; }
  std::vector<ShapeParameter> shape() const override {
    return {{"start", "s", 0.0, 1e9, 1, false}, {"duration", "s", 0.1, 1e9, 1, false}};
  }
  ColumnBlock columns(const GapMotion& motion, int unit, const Eigen::VectorXd& shape) const override {
    ColumnBlock block;
    const Eigen::ArrayXd inside =
        (motion.t.array() >= shape[0] && motion.t.array() <= shape[0] + shape[1]).cast<double>();
    for (int j = 0; j <= unit; ++j) {
      block.channels.push_back(j);
      block.values.push_back(-(motion.wrench_columns(unit, j).array().colwise() * inside).matrix());
    }
    return block;
  }
  std::vector<NamedValue> parameters(const Robot&, int unit, const Eigen::VectorXd& c,
                                     const Eigen::VectorXd& shape) const override {
    return {{"link", "1", Eigen::VectorXd::Constant(1, unit + 1), false},
            {"force", "N", c.head(3), false},
            {"moment", "N m", c.tail(3), false},
            {"start", "s", shape.head(1), false},
            {"duration", "s", shape.tail(1), false}};
  }
  void restore(const Robot&, const Effect& effect, int, Eigen::VectorXd& c,
               Eigen::VectorXd& shape) const override {
    c.resize(6);
    c << arm_value(effect, "force", 3), arm_value(effect, "moment", 3);
    shape.resize(2);
    shape << arm_value(effect, "start", 1), arm_value(effect, "duration", 1);
  }
};

}  // namespace

std::unique_ptr<Hypothesis> make_external_contact() { return std::make_unique<ExternalContact>(); }

}  // namespace dynid::detail
