// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "dynid/diagnosis/gap_motion.hpp"
#include "dynid/dynamics/joint_scale.hpp"
#include "dynid/model/effect.hpp"

namespace dynid {

/// What one unit of an effect is.
enum class Scope {
  joint,   ///< unit k: joint k + 1; several joints are one effect
  link,    ///< unit k: link k + 1; one link at a time
  pair,    ///< unit k: two joints, neighbours or next but one: pair_of()
  arm,     ///< one unit: the whole arm
  window,  ///< unit k: link k + 1, in a window of time that is searched for: its first two shape parameters
           ///< are start, as the log is stamped, and duration [s]; one that is logarithmic is the time [s] of
           ///< its rise and fall, within the duration
};

/// A parameter that the torque depends on in another way than linearly: it is searched for in a grid, then
/// refined within its range.
struct ShapeParameter {
  std::string key, unit;
  double low, high;  ///< range, both included
  int points;        ///< of the grid
  /// Spacing of the grid. With `low` = -`high` it goes both ways from 0, in two decades each.
  bool logarithmic;

  bool both_ways() const { return logarithmic && low < 0.0; }
  /// Of a part of the range as the grid is spaced: `low` at 0, `high` at 1, point k at k / (points - 1).
  double at(double part) const;
  /// The points of the grid on either side of x, or the ends of the range.
  std::pair<double, double> beside(double x) const;
  /// What a small change of it about x is a part of, in `unit`: |x|, or the range where that is linear.
  double size_at(double x) const;
};

/// What a joint does on the logs: what can be sought on it follows.
struct JointRange {
  JointScale scale;
  double lower = 0.0, upper = 0.0;  ///< [rad] or [m]: of its positions
  double torque = 0.0;  ///< [N m] or [N]: that one measured sample in two hundred exceeds, white noise
                        ///< (four standard deviations) taken off
};

/// The scale of the arm as a whole: that of a sliding joint whose travel [m] is `reach`, and that takes as
/// long for it as the middle one of `joints` (not empty) takes for its own; torque [N]: the middle joint's
/// over the reach.
JointScale arm_scale(const std::vector<JointScale>& joints, double reach);

/// A value of an effect for a person, a file, a label.
struct NamedValue {
  std::string key, unit;
  Eigen::VectorXd value;  ///< one number for a joint's own parameter
  bool per_joint = true;  ///< one number for each joint of the robot; else of the whole arm
};

/// An effect that the diagnosis can find: linear in its coefficients c for given shape parameters s.
/// One effect is one file in src/diagnosis/effects/, see docs/effects.md.
class Hypothesis {
 public:
  virtual ~Hypothesis() = default;

  virtual std::string name() const = 0;
  /// An effect may have several forms, each a hypothesis of the same name: the parameter that only this form
  /// has. Empty where there is one form.
  virtual std::string form() const { return {}; }
  virtual Scope scope() const { return Scope::joint; }
  virtual std::vector<ShapeParameter> shape() const { return {}; }
  /// The same with the ranges that a joint of this scale asks for: those of shape() are for one of 1 rad/s,
  /// 20 N m and 1 kg m^2. An effect of the arm or of a window is given arm_scale().
  virtual std::vector<ShapeParameter> shape_on(const JointScale&) const { return shape(); }
  /// While its joint sticks, its torque is anything within its size: such rows say nothing about it.
  virtual bool silent_at_rest() const { return false; }
  /// The coefficients are all 1: the shape parameters say everything.
  virtual bool shape_only() const { return false; }
  /// Bound to the clock of its log: it does not come back alike in another one.
  virtual bool once() const { return false; }
  /// How likely it is that `nominal` lacks it, before the data are seen, relative to the others; for one that
  /// contains another as a special case, or can nearly imitate it, less than 1.
  virtual double prior(const Robot& /*nominal*/) const { return 1.0; }

  /// Minus the logarithm of how likely coefficients of this size are beside usual ones, before the data are
  /// seen: 0 where all are alike.
  virtual double surprise(const Robot&, int, const Eigen::VectorXd&) const { return 0.0; }

  /// [s] by which it makes the torque of its channels late: what other effects add there is as late.
  virtual double lateness(const Eigen::VectorXd&) const { return 0.0; }

  /// The truth is seldom of just this form: what the effect leaves need not be something else.
  virtual bool approximate() const { return false; }

  /// Torque columns [N m per unit of c] that unit `unit` adds on the measured side along `motion`.
  virtual ColumnBlock columns(const GapMotion& motion, int unit, const Eigen::VectorXd& shape) const = 0;
  /// The field's parameters from coefficients and shape.
  virtual std::vector<NamedValue> parameters(const Robot& robot, int unit, const Eigen::VectorXd& c,
                                             const Eigen::VectorXd& shape) const = 0;
  /// The inverse of parameters(): c and shape of unit `unit` from what a model file carries. Throws Error
  /// naming the effect and the key that is missing.
  virtual void restore(const Robot& robot, const Effect& effect, int unit, Eigen::VectorXd& c,
                       Eigen::VectorXd& shape) const = 0;
  /// Coefficients and shape can be those of such an effect at all; where shape_only(), c is 1.
  virtual bool plausible(const Robot&, int, const Eigen::VectorXd&, const Eigen::VectorXd&) const {
    return true;
  }

  /// The same, beside what the joints do on the logs (`ranges`: n): a limit that the log exceeds is none, a
  /// spring that rests where the joint never comes is an offset.
  virtual bool reachable(const std::vector<JointRange>&, int, const Eigen::VectorXd&,
                         const Eigen::VectorXd&) const {
    return true;
  }

  /// c (p coefficients, as columns() has them) can be those of a body, or whatever it is. Others give way in
  /// every fit to nearest_possible(): of all that can be, the x that minimises (x - c)^T I (x - c), I (p x p,
  /// symmetric, positive semidefinite) being their information in the fit.
  /// What c of unit `unit` adds to: in these two c stands for nominal() + c. Empty: anything is possible.
  virtual Eigen::VectorXd nominal(const Robot&, int) const { return {}; }
  virtual bool possible(const Eigen::VectorXd&) const { return true; }
  virtual Eigen::VectorXd nearest_possible(const Eigen::VectorXd& c, const Eigen::MatrixXd&) const {
    return c;
  }

  /// shape_on() of unit `unit`: of its joint, the first of its pair, or the arm.
  std::vector<ShapeParameter> shape_of(int unit, const std::vector<JointScale>& joints, double reach) const;
  int units(const Robot& robot) const;
  /// The joints (from 1) that unit `unit` concerns.
  std::vector<int> joints(const Robot& robot, int unit) const;
};

/// The two joints (from 0, increasing) of unit `unit` of an effect of pairs in an arm of `n` joints: first
/// all neighbours, then all that have one joint between them.
std::pair<int, int> pair_of(int n, int unit);

/// Every form of every effect, in the order of their names. The list is made from the files of
/// src/diagnosis/effects/.
const std::vector<std::unique_ptr<Hypothesis>>& hypotheses();
/// The first of that name, or null.
const Hypothesis* find_hypothesis(const std::string& name);
/// The form that the effect's parameters are of, or null where no effect has its name.
const Hypothesis* find_hypothesis(const Effect& effect);

/// The torques that the robot's effects add along a motion: N x n [N m]. Throws Error on an effect that is
/// not of the catalogue or lacks a parameter.
Eigen::MatrixXd effect_torque(const Robot& robot, const GapMotion& motion);

}  // namespace dynid
