// SPDX-License-Identifier: Apache-2.0
#include "dynid/identification/conventions.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <numeric>

#include "conventions_sample.hpp"
#include "dynid/base/error.hpp"
#include "dynid/dynamics/mass_matrix.hpp"

namespace dynid {
namespace {

using detail::ConventionSample;
using detail::NominalKernel;
using detail::Reading;
using detail::SpreadRows;
using Eigen::Index;

constexpr double pi = 3.14159265358979323846;
constexpr double degree = pi / 180.0;

// Rows of the quick passes: enough to keep the true reading among the best few.
constexpr Index few = 24, some = 64;
/// Residual, as part of the energy, below which a better fit is no better evidence: a model is seldom nearer.
constexpr double enough = 0.03;
constexpr double at_most_worse = 10.0;  // in the same measure: beyond it a worse fit is no worse
/// A joint explained to here is read well: nothing is sought where all are.
constexpr double read_well = 0.6;
/// Rotor inertia to believe, in multiples of the links' own about the joint.
constexpr double most_rotor = 100.0;
constexpr double least_part = 0.3;  // of the residual without a rigid body, to count it as seen
constexpr double least_factor =
    3.0;  // between a torque's gain (an effect) and another unit or side of a gear
constexpr double gear_not_constant =
    30.0;  // [N m per unit]: from here a gear ratio, below it a torque constant
constexpr double least_mounting = 20.0 * degree;  // below it a tilt, which is an effect
constexpr double snap_gravity = 8.0 * degree;     // to an axis of the base: mountings are square
constexpr double snap_zero = 6.0 * degree;        // to a multiple of 90 deg
constexpr double least_zero = 15.0 * degree;      // below it an encoder's offset, which is an effect
constexpr double least_evidence = 1.0;            // for a payload, in the measure of evidence()
constexpr std::size_t tried_again = 16;           // readings that are tried with a payload too
constexpr double gravity_tolerance = 0.4;         // of its size, relative: a payload draws the fit away

struct TorqueUnit {
  const char* name;
  double factor;
};
constexpr TorqueUnit torque_units[] = {{"Nmm", 1e-3},     {"Ncm", 1e-2},       {"kgfcm", 0.0980665},
                                       {"kgfm", 9.80665}, {"lbfin", 0.112985}, {"kNm", 1e3}};

/// A reading and what it explains.
struct Candidate {
  Reading reading;
  Eigen::VectorXd left;  ///< n, part of each joint's torque energy not explained
  double score = 0.0;    ///< evidence, less is better, complexity included
};

double evidence(const Eigen::VectorXd& left) {
  double sum = 0.0;
  for (const double x : left) sum += std::log((std::min(x, at_most_worse) + enough) / (1.0 + enough));
  return sum;
}

class Search {
 public:
  Search(const Robot& robot, const SpreadRows& rows, const ConventionOptions& options)
      : robot_(robot),
        n_(robot.size()),
        options_(options),
        kernel_(detail::make_kernel(robot)),
        rotor_(rotor_bounds(robot, rows)),
        full_(robot, rows, rows.q.rows(), rotor_),
        mid_(robot, rows, std::min<Index>(some, rows.q.rows()), rotor_),
        small_(robot, rows, std::min<Index>(few, rows.q.rows()), rotor_) {}

  Reading plain() const {
    Reading r;
    r.order.resize(n_);
    std::iota(r.order.begin(), r.order.end(), 0);
    r.sign = r.torque_sign = r.factor = Eigen::VectorXd::Ones(n_);
    r.zero = Eigen::VectorXd::Zero(n_);
    r.gravity = robot_.gravity;
    return r;
  }

  /// The candidates, best first. The first call's reading stands for the log as it is.
  void run(const Reading& base) {
    before_ = judged(base, torque_of(full_, base, base.gravity));
    if (before_.left.maxCoeff() <= read_well) return;
    Reading degrees = base;
    degrees.position_unit = degree;
    degrees.complexity += 0.5;
    const std::array<Reading, 2> bases = {base, degrees};
    for (const Reading& r : bases) add_all(r);
    if (settled()) return;
    for (const Reading& r : bases) try_signs(r);
    if (settled()) return;
    for (const Reading& r : bases) try_zeros(r);
    for (const Reading& r : bases) {
      if (settled()) return;
      try_orders(r);
    }
    if (settled()) return;
    for (const Reading& r : bases) try_free_zeros(r);
  }

  const Candidate& before() const { return before_; }
  std::vector<Candidate>& found() { return found_; }
  const ConventionSample& full() const { return full_; }
  void sort() {
    std::stable_sort(found_.begin(), found_.end(),
                     [](const Candidate& a, const Candidate& b) { return a.score < b.score; });
  }

  /// The same reading of an arm that carries a payload, of any size that can exist: the physical explanation
  /// that comes nearest to another reading, and what hides one. Factors of joints are fitted with it.
  Candidate with_payload(const Candidate& from) {
    Candidate out = from;
    Reading& r = out.reading;
    std::vector<Eigen::MatrixXd> columns;
    // A controller that takes gravity off knows its arm, not what it carries.
    Reading heavy = r;
    if (r.without_gravity) heavy.gravity = robot_.gravity;
    kernel_->last_link(full_, heavy, columns);
    const Eigen::MatrixXd T = torque_of(full_, r, r.gravity);
    Eigen::MatrixXd loaded = T;
    double arm_mass = 0.0;
    for (const Joint& joint : robot_.joints) arm_mass += std::max(joint.parameters[0], 0.0);
    const bool factors = !r.unit_of_torque && !r.factor.isOnes(0.0);
    for (int pass = 0; pass < (factors ? 6 : 3); ++pass) {
      Eigen::Matrix<double, 10, 10> H = Eigen::Matrix<double, 10, 10>::Zero();
      Eigen::Matrix<double, 10, 1> g = Eigen::Matrix<double, 10, 1>::Zero();
      for (int j = 0; j < n_; ++j) {
        const int k = r.order[j];
        if (!(full_.energy(k) > 0.0)) continue;
        Eigen::MatrixXd X = columns[j], y = measured(r, j, loaded) - T.col(j);
        full_.project(k, X);
        full_.project(k, y);
        const double f = r.factor[j];
        const double w = 1.0 / (f * f * full_.energy(k) * (std::min(out.left[j], 1.0) + enough));
        H += w * X.transpose() * X;
        g += w * X.transpose() * y;
      }
      const Eigen::Matrix<double, 10, 1> payload = physical_fit(H, g, arm_mass);
      for (int j = 0; j < n_; ++j) loaded.col(j) = T.col(j) + columns[j] * payload;
      for (int j = 0; j < n_; ++j) {
        if (factors) {
          double correlation = 0.0;
          const double a = full_.scale(r.order[j], j, loaded, correlation);
          if (correlation * correlation > 0.5 && std::abs(a) > 0.0) r.factor[j] = 1.0 / std::abs(a);
        }
        out.left[j] = left_of(r, j, loaded);
      }
    }
    out.score = evidence(out.left) + r.complexity + least_evidence;
    return out.score < from.score ? out : from;
  }

 private:
  static Eigen::VectorXd rotor_bounds(const Robot& robot, const SpreadRows& rows) {
    const int n = robot.size();
    const Model<> model(robot);
    Workspace<> ws(model);
    Eigen::MatrixXd M(n, n);
    Eigen::VectorXd sum = Eigen::VectorXd::Zero(n), q(n);
    const Index count = std::min<Index>(8, rows.q.rows());
    for (Index i = 0; i < count; ++i) {
      q = rows.q.row(i).transpose();
      mass_matrix(model, ws, q, M);
      sum += M.diagonal().cwiseAbs();
    }
    return most_rotor * sum / double(std::max<Index>(1, count));
  }

  /// The log's torque of joint j under the reading; T: the model's, whose sign a magnitude gets.
  Eigen::VectorXd measured(const Reading& r, int j, const Eigen::MatrixXd& T) const {
    Eigen::VectorXd tau = r.torque_sign[j] * r.factor[j] * full_.torque().col(r.order[j]);
    if (r.magnitude) {
      for (Index i = 0; i < tau.size(); ++i)
        if (T(i, j) < 0.0) tau[i] = -tau[i];
    }
    return tau;
  }
  double left_of(const Reading& r, int j, const Eigen::MatrixXd& T) const {
    if (r.magnitude) return left_of_magnitude(r, j, T);
    return full_.residual(r, j, T, r.torque_sign[j], r.factor[j]);
  }
  double left_of_magnitude(const Reading& r, int j, const Eigen::MatrixXd& T) const {
    const Eigen::ArrayXd tau = full_.torque().col(r.order[j]).array();
    Eigen::ArrayXd model = T.col(j).array();
    Eigen::VectorXd rest;
    double mean = 0.0;
    for (int pass = 0; pass < 3; ++pass) {
      rest = ((model >= 0.0).select(tau, -tau) - T.col(j).array()).matrix();
      const Eigen::VectorXd friction = full_.fitted(r, j, rest);
      mean = (rest - friction).mean();
      rest -= friction;
      model = T.col(j).array() + friction.array() + mean;
    }
    rest.array() -= mean;
    const double energy = full_.energy(r.order[j]);
    return energy > 0.0 ? rest.squaredNorm() / energy : 1.0;
  }

  Eigen::MatrixXd torque_of(const ConventionSample& sample, const Reading& r, const Eigen::Vector3d& g) {
    Eigen::MatrixXd out;
    kernel_->torque(sample, r, g, out);
    return out;
  }

  Candidate judged(const Reading& r, const Eigen::MatrixXd& T) const {
    Candidate c{r, Eigen::VectorXd(n_), 0.0};
    for (int j = 0; j < n_; ++j) c.left[j] = full_.residual(r, j, T, r.torque_sign[j], r.factor[j]);
    c.score = evidence(c.left) + r.complexity;
    return c;
  }

  /// The rigid body has a part in what it explains, on one joint at least: where friction and rotor inertia
  /// do alone, any reading that makes the body's torque small would do.
  bool needs_body(const Candidate& c) const {
    for (int j = 0; j < n_; ++j)
      if (c.left[j] < least_part * full_.bodyless(c.reading.order[j])) return true;
    return false;
  }

  void keep(const Candidate& c) {
    if (c.score >= before_.score || !needs_body(c)) return;
    found_.push_back(c);
    if (found_.size() > 400) {
      sort();
      found_.resize(100);
    }
  }

  /// A reading good enough that more elaborate ones need no trial.
  bool settled() {
    sort();
    return !found_.empty() && found_.front().left.maxCoeff() < 0.1;
  }

  /// With each joint's torque as it is, turned throughout, and turned where that is better.
  void add_signs(const Reading& r, const Eigen::MatrixXd& T, bool some_joints) {
    Eigen::VectorXd up(n_), down(n_), best(n_);
    for (int j = 0; j < n_; ++j) {
      up[j] = full_.residual(r, j, T, 1.0, r.factor[j]);
      down[j] = full_.residual(r, j, T, -1.0, r.factor[j]);
    }
    const auto add = [&](const Eigen::VectorXd& left, const Eigen::VectorXd& sign, double cost) {
      Candidate c{r, left, 0.0};
      c.reading.torque_sign = sign;
      c.reading.complexity += cost;
      c.score = evidence(left) + c.reading.complexity;
      keep(c);
    };
    add(up, Eigen::VectorXd::Ones(n_), 0.0);
    add(down, -Eigen::VectorXd::Ones(n_), 0.4);
    if (!some_joints) return;
    Eigen::VectorXd sign(n_);
    double cost = 0.4;
    for (int j = 0; j < n_; ++j) {
      sign[j] = down[j] < 0.5 * up[j] ? -1.0 : 1.0;
      best[j] = std::min(up[j], down[j]);
      if (sign[j] < 0.0) cost += 0.3;
      if (sign[j] > 0.0) best[j] = up[j];
    }
    if (sign.minCoeff() < 0.0 && sign.maxCoeff() > 0.0) add(best, sign, cost);
  }

  /// With torques in another unit, or on the other side of a gear.
  void add_factors(const Reading& r, const Eigen::MatrixXd& T) {
    for (const TorqueUnit& unit : torque_units) {
      Reading scaled = r;
      scaled.factor.setConstant(unit.factor);
      scaled.unit_of_torque = true;
      scaled.complexity += 0.4;
      add_signs(scaled, T, false);
    }
    Eigen::VectorXd factor(n_), weight(n_), sign(n_);
    std::vector<double> known;
    for (int j = 0; j < n_; ++j) {
      const double a = full_.scale(r.order[j], j, T, weight[j]);
      sign[j] = a < 0.0 ? -1.0 : 1.0;
      factor[j] = 1.0 / std::max(std::abs(a), 1e-12);
      if (weight[j] * weight[j] > 0.5) known.push_back(factor[j]);
    }
    if (known.empty()) return;
    std::sort(known.begin(), known.end());
    const double median = known[known.size() / 2];
    if (known.front() < least_factor) return;
    for (int j = 0; j < n_; ++j) {
      if (weight[j] * weight[j] > 0.5) continue;
      factor[j] = median;
      sign[j] = 1.0;
    }
    Reading scaled = r;
    scaled.factor = factor;
    scaled.complexity += 0.4 + 0.1 * n_;
    add_signs(scaled, T, true);
    // One ratio for all, where that does as well.
    scaled.factor.setConstant(median);
    scaled.complexity = r.complexity + 0.6;
    add_signs(scaled, T, false);
  }

  /// The mounting that explains the torques best; whether it is one at all, and another than the model's.
  bool turned_gravity(const Reading& r, const Eigen::MatrixXd& without,
                      const std::array<Eigen::MatrixXd, 3>& by, Eigen::Vector3d& g) {
    const double size = robot_.gravity.norm() > 0.0 ? robot_.gravity.norm() : 9.81;
    Eigen::VectorXd left = Eigen::VectorXd::Ones(n_);
    g = robot_.gravity;
    for (int pass = 0; pass < 4; ++pass) {
      Eigen::Matrix3d H = 1e-12 * Eigen::Matrix3d::Identity();
      Eigen::Vector3d b = Eigen::Vector3d::Zero();
      for (int j = 0; j < n_; ++j) {
        const int k = r.order[j];
        if (!(full_.energy(k) > 0.0)) continue;
        Eigen::MatrixXd X(full_.rows(), 3), y = full_.torque().col(k) - without.col(j);
        X << by[0].col(j), by[1].col(j), by[2].col(j);
        full_.project(k, X);
        full_.project(k, y);
        const double w = 1.0 / (full_.energy(k) * (std::min(left[j], 1.0) + enough));
        H += w * X.transpose() * X;
        b += w * X.transpose() * y;
        left[j] = (y - X * g).squaredNorm() / full_.energy(k);
      }
      const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> axes(H);
      const double largest = axes.eigenvalues()[2];
      if (!(largest > 1e-9)) return false;
      // A direction that no joint feels stays out.
      Eigen::Vector3d solution = Eigen::Vector3d::Zero();
      for (int i = 0; i < 3; ++i)
        if (axes.eigenvalues()[i] > 1e-4 * largest)
          solution +=
              axes.eigenvectors().col(i) * (axes.eigenvectors().col(i).dot(b) / axes.eigenvalues()[i]);
      g = solution;
    }
    if (std::abs(g.norm() / size - 1.0) > gravity_tolerance) return false;
    g *= size / g.norm();
    for (int i = 0; i < 3; ++i)
      if (std::abs(g[i]) > size * std::cos(snap_gravity)) {
        const double s = g[i] > 0.0 ? 1.0 : -1.0;
        g.setZero();
        g[i] = s * size;
      }
    const double cosine = g.dot(robot_.gravity) / (size * std::max(robot_.gravity.norm(), 1e-12));
    return cosine < std::cos(least_mounting);
  }

  /// Everything that needs no search over joints.
  void add_all(const Reading& r) {
    const Eigen::MatrixXd T = torque_of(full_, r, r.gravity), without = torque_of(full_, r, {0, 0, 0});
    std::array<Eigen::MatrixXd, 3> by;
    for (int i = 0; i < 3; ++i) by[i] = torque_of(full_, r, Eigen::Vector3d::Unit(i)) - without;
    add_signs(r, T, true);
    add_factors(r, T);
    add_magnitude(r, T);
    Reading no_gravity = r;
    no_gravity.gravity.setZero();
    no_gravity.without_gravity = true;
    no_gravity.complexity += 0.5;
    add_signs(no_gravity, without, true);
    add_factors(no_gravity, without);
    Eigen::Vector3d g;
    // One joint cannot tell a mounting from its zero.
    if (n_ > 1 && turned_gravity(r, without, by, g)) {
      Reading turned = r;
      turned.gravity = g;
      turned.turned_gravity = true;
      turned.complexity += (g.cwiseAbs().maxCoeff() > 0.999 * g.norm()) ? 0.4 : 0.9;
      add_signs(turned, without + g[0] * by[0] + g[1] * by[1] + g[2] * by[2], false);
    }
  }

  void add_magnitude(const Reading& r, const Eigen::MatrixXd& T) {
    if (full_.torque().minCoeff() < 0.0 || !(full_.torque().maxCoeff() > 0.0)) return;
    if (T.minCoeff() >= 0.0) return;
    Candidate c{r, Eigen::VectorXd(n_), 0.0};
    c.reading.magnitude = true;
    c.reading.complexity += 0.5;
    for (int j = 0; j < n_; ++j) c.left[j] = left_of(c.reading, j, T);
    c.score = evidence(c.left) + c.reading.complexity;
    keep(c);
  }

  /// Quick measure on a small sample, each joint's torque turned where that is better.
  double quick(const ConventionSample& sample, const Reading& r) {
    kernel_->torque(sample, r, r.gravity, scratch_);
    double sum = 0.0;
    for (int j = 0; j < n_; ++j) {
      const int k = r.order[j];
      if (!(sample.bare_torque().col(k).squaredNorm() > 0.0)) continue;
      const double e =
          std::min(sample.quick_residual(j, k, scratch_, 1.0), sample.quick_residual(j, k, scratch_, -1.0)) /
          sample.bare_torque().col(k).squaredNorm();
      sum += std::log((std::clamp(e, 0.0, at_most_worse) + enough) / (1.0 + enough));
    }
    return sum;
  }

  struct Quick {
    double score;
    Reading reading;
  };
  static void best_of(std::vector<Quick>& list, std::size_t count) {
    std::stable_sort(list.begin(), list.end(),
                     [](const Quick& a, const Quick& b) { return a.score < b.score; });
    if (list.size() > count) list.resize(count, list.front());
  }
  void insert(std::vector<Quick>& list, std::size_t count, const Reading& r, double score) const {
    if (list.size() >= 2 * count) best_of(list, count);
    if (list.size() >= count && score > list[count - 1].score) return;
    list.push_back({score, r});
  }

  std::vector<Quick> signs_of(const Reading& base, const ConventionSample& sample, std::size_t count) {
    std::vector<Quick> list;
    const int searched = std::min(n_, 10);  // beyond it, the first ten
    for (int set = 1; set < (1 << searched); ++set) {
      Reading r = base;
      for (int j = 0; j < searched; ++j)
        if (set & (1 << j)) {
          r.sign[j] = -1.0;
          r.complexity += 0.3;
        }
      r.complexity += 0.2;
      insert(list, count, r, quick(sample, r) + r.complexity);
    }
    best_of(list, count);
    return list;
  }

  /// A joint counted the other way has both its position and its torque turned; what turns one alone costs
  /// more.
  void add_joint_signs(const Reading& r) {
    const Eigen::MatrixXd T = torque_of(full_, r, r.gravity);
    Reading turned = r;  // residual() turns the torque with torque_sign alone
    Eigen::VectorXd with(n_), other(n_);
    for (int j = 0; j < n_; ++j) {
      with[j] = full_.residual(r, j, T, r.sign[j], 1.0);
      other[j] = full_.residual(r, j, T, -r.sign[j], 1.0);
    }
    const auto add = [&](const Eigen::VectorXd& left, const Eigen::VectorXd& torque, double cost) {
      Candidate c{r, left, 0.0};
      c.reading.torque_sign = torque;
      c.reading.complexity += cost;
      c.score = evidence(left) + c.reading.complexity;
      keep(c);
    };
    add(with, r.sign, 0.0);
    add(other, -r.sign, 0.4);
    Eigen::VectorXd best = with, sign = r.sign;
    double cost = 0.4;
    for (int j = 0; j < n_; ++j)
      if (other[j] < 0.5 * with[j]) best[j] = other[j], sign[j] = -r.sign[j], cost += 0.3;
    if (cost > 0.4) add(best, sign, cost);
  }

  void try_signs(const Reading& base) {
    for (const Quick& q : signs_of(base, mid_, 8)) add_joint_signs(q.reading);
  }

  void try_orders(const Reading& base) {
    std::vector<Quick> list;
    std::vector<int> order = base.order;
    const auto one = [&](const std::vector<int>& p) {
      Reading r = base;
      r.order = p;
      int moved = 0;
      for (int j = 0; j < n_; ++j) moved += p[j] != j;
      if (moved == 0) return;
      r.complexity += 0.6 + 0.1 * moved;
      insert(list, 30, r, quick(few_or_some(), r) + r.complexity);
    };
    if (n_ <= 7) {
      while (std::next_permutation(order.begin(), order.end())) one(order);
    } else {
      for (int a = 0; a < n_; ++a) {
        for (int b = a + 1; b < n_; ++b) {
          order = base.order;
          std::swap(order[a], order[b]);
          one(order);
        }
        order = base.order;
        std::rotate(order.begin(), order.begin() + a, order.end());
        one(order);
        std::reverse(order.begin(), order.end());
        one(order);
      }
    }
    best_of(list, 30);
    // The best few again on more rows, then with the joints' signs.
    std::vector<Quick> again;
    for (const Quick& q : list) insert(again, 6, q.reading, quick(mid_, q.reading) + q.reading.complexity);
    best_of(again, 6);
    for (const Quick& q : again) {
      add_signs(q.reading, torque_of(full_, q.reading, q.reading.gravity), true);
      if (settled()) return;
    }
    for (const Quick& q : again)
      for (const Quick& s : signs_of(q.reading, mid_, 3)) add_joint_signs(s.reading);
  }
  const ConventionSample& few_or_some() const { return n_ <= 5 ? mid_ : small_; }

  /// A zero of joint j matters: not of a prismatic one, nor of a first one that turns about gravity.
  bool zero_matters(int j) const {
    const Joint& joint = robot_.joints[j];
    if (joint.type == JointType::prismatic) return false;
    if (j > 0) return true;
    const Eigen::Vector3d axis = joint.origin.linear() * joint.axis;
    return axis.cross(robot_.gravity).norm() > 1e-3 * robot_.gravity.norm();
  }

  void try_zeros(const Reading& base) {
    std::vector<int> joints;
    for (int j = 0; j < n_; ++j)
      if (zero_matters(j)) joints.push_back(j);
    const auto m = std::min<std::size_t>(joints.size(), 6);
    joints.erase(joints.begin(), joints.end() - static_cast<std::ptrdiff_t>(m));
    std::vector<Quick> list;
    for (long set = 1; set < (1L << (2 * m)); ++set) {
      Reading r = base;
      for (std::size_t i = 0; i < m; ++i) {
        const int quarters = static_cast<int>(set >> (2 * i)) & 3;
        if (quarters == 0) continue;
        r.zero[joints[i]] = quarters == 3 ? -0.5 * pi : 0.5 * pi * quarters;
        r.complexity += 0.5;
      }
      insert(list, 30, r, quick(small_, r) + r.complexity);
    }
    best_of(list, 30);
    std::vector<Quick> again;
    for (const Quick& q : list) insert(again, 10, q.reading, quick(mid_, q.reading) + q.reading.complexity);
    best_of(again, 10);
    for (const Quick& q : again) add_signs(q.reading, torque_of(full_, q.reading, q.reading.gravity), false);
  }

  /// Any angle, for one or two joints, from the best multiples of 90 deg.
  void try_free_zeros(const Reading& base) {
    if (n_ == 1) return;  // any phase would fit: a spring, another centre of mass
    Reading r = base;
    double now = evidence(before_.left) + 1e9;
    for (int round = 0; round < 2; ++round) {
      Quick best{now, r};
      for (int j = 0; j < n_; ++j) {
        if (!zero_matters(j) || r.zero[j] != 0.0) continue;
        for (int step = 1; step < 24; ++step) {
          Reading tried = r;
          tried.zero[j] = std::remainder(15.0 * degree * step, 2.0 * pi);
          tried.complexity += 0.7;
          const double score = quick(mid_, tried) + tried.complexity;
          if (score < best.score) best = {score, tried};
        }
      }
      if (best.score >= now) return;
      now = best.score;
      r = best.reading;
      refine(r);
      add_signs(r, torque_of(full_, r, r.gravity), false);
    }
  }

  /// Halves the step about each joint's zero until it stands still.
  void refine(Reading& r) {
    double score = quick(mid_, r);
    for (double step = 7.5 * degree; step > 0.1 * degree; step *= 0.5) {
      for (int j = 0; j < n_; ++j) {
        if (r.zero[j] == 0.0) continue;
        for (const double s : {step, -step}) {
          Reading tried = r;
          tried.zero[j] += s;
          const double there = quick(mid_, tried);
          if (there < score) score = there, r = tried;
        }
      }
    }
  }

  /// The body nearest to the least-squares solution of H x = g that can exist; its mass hardly above the
  /// arm's.
  static Eigen::Matrix<double, 10, 1> physical_fit(Eigen::Matrix<double, 10, 10> H,
                                                   const Eigen::Matrix<double, 10, 1>& g, double arm_mass) {
    using Vector = Eigen::Matrix<double, 10, 1>;
    // A payload as heavy as the arm costs as much as a twentieth of one joint's torque.
    H(0, 0) += 0.05 / (enough * std::max(arm_mass * arm_mass, 1e-12));
    // P = L L^T, L lower triangular, is any body that can exist; Levenberg's steps in its ten entries.
    const auto body = [](const Vector& l) {
      Eigen::Matrix4d L = Eigen::Matrix4d::Zero();
      for (int i = 0, k = 0; i < 4; ++i)
        for (int j = 0; j <= i; ++j) L(i, j) = l[k++];
      return Vector(from_pseudo_inertia(L * L.transpose()));
    };
    const auto cost = [&](const Vector& x) { return x.dot(H * x) - 2.0 * g.dot(x); };
    Vector best = Vector::Zero();
    double lowest = 0.0;
    for (const double start : {0.3, 0.05}) {
      const double m = std::sqrt(start * std::max(arm_mass, 1e-3)), a = 0.1 * m;
      Vector l;
      l << a, 0.01 * a, a, 0.01 * a, 0.01 * a, a, 0.01 * a, 0.01 * a, 0.01 * a, m;
      double now = cost(body(l)), damping = 1e-3;
      for (int step = 0; step < 60; ++step) {
        Eigen::Matrix<double, 10, 10> J;
        const Vector x = body(l);
        for (int k = 0; k < 10; ++k) {
          Vector moved = l;
          const double h = 1e-6 * (std::abs(l[k]) + 1e-3 * m);
          moved[k] += h;
          J.col(k) = (body(moved) - x) / h;
        }
        Eigen::Matrix<double, 10, 10> A = J.transpose() * H * J;
        const Vector b = J.transpose() * (g - H * x);
        A.diagonal() += damping * A.diagonal() + Vector::Constant(1e-12 * A.trace());
        const Vector tried = l + A.ldlt().solve(b);
        const double there = tried.allFinite() ? cost(body(tried)) : now + 1.0;
        if (there < now) {
          const double gain = now - there;
          l = tried, now = there, damping = std::max(1e-9, 0.3 * damping);
          if (gain < 1e-9 * std::abs(now)) break;
        } else {
          damping *= 10.0;
          if (damping > 1e8) break;
        }
      }
      if (now < lowest) lowest = now, best = body(l);
    }
    return best;
  }

  const Robot& robot_;
  int n_;
  ConventionOptions options_;
  std::unique_ptr<NominalKernel> kernel_;
  Eigen::VectorXd rotor_;
  ConventionSample full_, mid_, small_;
  Candidate before_;
  std::vector<Candidate> found_;
  Eigen::MatrixXd scratch_;
};

// --------------------------------------------------------------------------------------------- saying it

std::string number(double x) {
  char text[32];
  std::snprintf(text, sizeof text, "%.7g", x == 0.0 ? 0.0 : x);
  return text;
}

std::string list(const Eigen::VectorXd& x, int digits = 7) {
  std::string text;
  char one[32];
  for (Index j = 0; j < x.size(); ++j) {
    std::snprintf(one, sizeof one, "%.*g", digits, x[j] == 0.0 ? 0.0 : x[j]);
    text += (j > 0 ? "," : "") + std::string(one);
  }
  return text;
}

std::string joints_text(const std::vector<int>& joints) {
  std::string text;
  for (std::size_t i = 0; i < joints.size(); ++i)
    text += (i == 0 ? "" : i + 1 == joints.size() ? " and " : ", ") + std::to_string(joints[i]);
  return text;
}

/// What velocity and stamps say, without any torque.
struct Kinematics {
  double time_unit = 1.0;      ///< [s]
  double velocity_unit = 1.0;  ///< against the positions as they stand
  bool unrelated = false;      ///< the velocity is not that of the positions
  double before = 1.0, after = 1.0;
};

Kinematics compare_velocity(const SpreadRows& rows) {
  Kinematics k;
  if (rows.logged_dq.size() == 0) {
    // A millisecond is the shortest step that joints are logged at; a second is none to log joints at.
    if (rows.interval >= 1e5)
      k.time_unit = 1e-9;
    else if (rows.interval >= 100.0)
      k.time_unit = 1e-6;
    k.before = k.time_unit == 1.0 ? 1.0 : 0.0;
    return k;
  }
  const double travel = (rows.q.colwise().maxCoeff() - rows.q.colwise().minCoeff()).maxCoeff();
  if (!(travel > 1e-9 * std::max(1.0, rows.q.cwiseAbs().maxCoeff()))) return k;  // it stands still
  const Eigen::VectorXd speed = rows.dq.colwise().squaredNorm().transpose();
  std::vector<double> factors;
  double energy = 0.0, apart = 0.0;
  int moving = 0, related = 0;
  for (int j = 0; j < rows.q.cols(); ++j) {
    const double own = speed[j], there = rows.logged_dq.col(j).squaredNorm(),
                 along = rows.logged_dq.col(j).dot(rows.dq.col(j));
    if (!(own > 0.01 * speed.maxCoeff())) continue;
    ++moving;
    energy += 1.0;
    apart += (rows.logged_dq.col(j) - rows.dq.col(j)).squaredNorm() / own;
    if (there > 0.0 && along * along > 0.7 * own * there) {
      ++related;
      factors.push_back(along / own);
    }
  }
  if (moving == 0) return k;
  k.before = 1.0 - apart / energy;
  if (2 * related < moving) {
    k.unrelated = true;
    return k;
  }
  std::sort(factors.begin(), factors.end());
  const double f = factors[factors.size() / 2];
  if (f > 1.0 / 1.5 && f < 1.5) return k;
  if (f > 0.0 && factors.front() > 0.0) {
    for (const double unit : {1e3, 1e6, 1e9}) {
      if (rows.interval >= 1e-4 * unit && std::abs(std::log(f / unit)) < 0.3) k.time_unit = 1.0 / unit;
      // Degrees a second beside stamps in another unit.
      if (rows.interval >= 1e-4 * unit && std::abs(std::log(f * degree / unit)) < 0.3) {
        k.time_unit = 1.0 / unit;
        k.velocity_unit = degree;
      }
    }
  }
  if (k.time_unit == 1.0) k.velocity_unit = 1.0 / f;
  double after = 0.0;
  for (int j = 0; j < rows.q.cols(); ++j) {
    if (!(speed[j] > 0.01 * speed.maxCoeff())) continue;
    const Eigen::VectorXd own = rows.dq.col(j) / k.time_unit, there = k.velocity_unit * rows.logged_dq.col(j);
    after += (own - there).squaredNorm() / own.squaredNorm();
  }
  k.after = 1.0 - after / energy;
  if (k.after < 0.5) k = {1.0, 1.0, true, k.before, 1.0};
  return k;
}

bool near_factor(double a, double b) { return std::abs(std::log(a / b)) < 0.25; }

/// The conventions of a reading, in the order in which they are applied.
std::vector<Convention> conventions_of(const Reading& r, const Robot& robot, const Kinematics& k) {
  const int n = robot.size();
  std::vector<Convention> out;
  const auto add = [&](const char* name, std::vector<int> joints, double value, const std::string& assume,
                       const std::string& text) {
    out.push_back({name, std::move(joints), value, 0.0, 0.0, std::string(name) + "=" + assume, text});
  };
  if (r.time_unit != 1.0) {
    const char* unit = r.time_unit < 1e-8 ? "ns" : r.time_unit < 1e-5 ? "us" : "ms";
    add("time_unit", {}, r.time_unit, unit, std::string("stamps are in ") + unit);
  }
  std::vector<int> moved;
  std::string order;
  for (int j = 0; j < n; ++j) {
    if (r.order[j] != j) moved.push_back(j + 1);
    order += (j > 0 ? "," : "") + std::to_string(r.order[j] + 1);
  }
  if (!moved.empty())
    add("joint_order", moved, double(moved.size()), order,
        "the log's joints stand in another order: base to tip they are its " + order);
  if (r.position_unit != 1.0) add("position_unit", {}, r.position_unit, "deg", "positions are in degrees");
  if (k.unrelated) {
    add("velocity_unit", {}, 0.0, "from_position", "the velocities are not those of the positions");
  } else {
    // Against positions and stamps as they are now read.
    const double unit = k.velocity_unit * r.position_unit * (k.time_unit / r.time_unit);
    if (near_factor(unit, degree))
      add("velocity_unit", {}, degree, "deg/s", "velocities are in degrees a second");
    else if (near_factor(unit, 2.0 * pi / 60.0))
      add("velocity_unit", {}, 2.0 * pi / 60.0, "rpm", "velocities are in turns a minute");
    else if (!(unit > 0.0))
      add("velocity_unit", {}, unit, number(unit), "velocities have the other sign");
    else if (!near_factor(unit, 1.0))
      add("velocity_unit", {}, unit, number(unit),
          "velocities are " + number(1.0 / unit) + " times those of the positions");
  }
  std::vector<int> joints;
  for (int j = 0; j < n; ++j)
    if (r.sign[j] < 0.0) joints.push_back(j + 1);
  if (!joints.empty())
    add("joint_sign", joints, -1.0, list(r.sign), "joint " + joints_text(joints) + " counts the other way");
  joints.clear();
  for (int j = 0; j < n; ++j)
    if (r.zero[j] != 0.0) joints.push_back(j + 1);
  if (!joints.empty())
    add("joint_zero", joints, r.zero[joints.front() - 1], list(r.zero, 10),
        "the zero of joint " + joints_text(joints) + " lies elsewhere");
  joints.clear();
  const Eigen::VectorXd torque_sign = r.torque_sign.cwiseProduct(r.sign);
  for (int j = 0; j < n; ++j)
    if (torque_sign[j] < 0.0) joints.push_back(j + 1);
  if (!joints.empty())
    add("torque_sign", joints, -1.0, static_cast<int>(joints.size()) == n ? "-1" : list(torque_sign),
        "the torque of joint " + joints_text(joints) + " has the other sign");
  if (!r.factor.isOnes(0.0)) {
    const double f = r.factor[0];
    std::vector<double> sorted(r.factor.begin(), r.factor.end());
    std::sort(sorted.begin(), sorted.end());
    const double median = sorted[sorted.size() / 2];
    if (r.unit_of_torque) {
      std::string unit;
      for (const TorqueUnit& u : torque_units)
        if (u.factor == f) unit = u.name;
      add("torque_unit", {}, f, unit == "kNm" ? "1000" : unit,
          unit == "kNm" ? "torques are a thousandth of the model's (or the model's masses are in grams)"
                        : "torques are in " + unit);
    } else {
      const bool one = (r.factor.array() == f).all();
      const bool gear = median >= gear_not_constant;
      add(gear ? "torque_is_motor_side" : "torque_is_current", {}, median,
          one ? number(f) : list(r.factor, 5),
          gear ? "torques are on the motor's side of the gears" : "torques are motor currents");
    }
  }
  if (r.magnitude)
    add("torque_is_magnitude", {}, 1.0, "1", "torques have lost their sign: the log has their magnitude");
  if (r.without_gravity)
    add("torque_without_gravity", {}, 1.0, "1",
        "torques are without gravity: the controller has taken it off");
  if (r.turned_gravity) {
    const double cosine =
        r.gravity.dot(robot.gravity) / (r.gravity.norm() * std::max(robot.gravity.norm(), 1e-12));
    add("gravity", {}, std::acos(std::clamp(cosine, -1.0, 1.0)), list(r.gravity, 5),
        "the arm is mounted otherwise: gravity in its base frame is (" + list(r.gravity, 4) + ") m/s^2");
  }
  return out;
}

std::string joined(const std::vector<Convention>& conventions) {
  std::string text;
  for (const Convention& c : conventions) text += (text.empty() ? "" : ",") + c.assume;
  return text;
}

}  // namespace

ConventionReport find_conventions(const Robot& nominal, const std::vector<Log>& logs,
                                  const ConventionOptions& options) {
  const int n = nominal.size();
  for (const Log& log : logs)
    if (log.joints() != n)
      throw Error(log.source + ": the log has " + std::to_string(log.joints()) + " joints, the robot has " +
                  std::to_string(n));
  ConventionReport report;
  const SpreadRows rows = detail::spread_rows(logs, options.rows);
  if (rows.q.rows() < some) return report;
  const Kinematics kinematics = compare_velocity(rows);
  const bool model = !nominal.parameters().isZero(0.0) && rows.tau.size() > 0;

  Reading plain;
  bool fire = false;
  const Candidate* best = nullptr;
  double before = 0.0, after = 0.0;
  std::optional<Search> search;
  if (model) {
    search.emplace(nominal, rows, options);
    plain = search->plain();
    plain.time_unit = kinematics.time_unit;
    search->run(plain);
    search->sort();
    report.explained = 1.0 - search->before().left.cwiseMin(at_most_worse).mean();
    if (!search->found().empty()) {
      // The best few once more, on an arm that may carry something.
      const Candidate as_is = search->with_payload(search->before());
      std::vector<Candidate>& found = search->found();
      for (std::size_t k = 0; k < std::min(found.size(), tried_again); ++k)
        found[k] = search->with_payload(found[k]);
      found.resize(std::min(found.size(), tried_again));
      search->sort();
      best = &found.front();
      const Eigen::VectorXd& left = as_is.left;
      double gain = 0.0;
      int concerned = 0;
      bool spoils = false;
      for (int j = 0; j < n; ++j) {
        if (best->left[j] < 0.5 * left[j]) {
          ++concerned;
          before += 1.0 - std::min(left[j], at_most_worse);
          after += 1.0 - best->left[j];
          gain += std::log(std::min(left[j], at_most_worse) / std::max(best->left[j], 1e-3));
        }
        spoils = spoils || (left[j] < 0.5 && best->left[j] > std::max(0.7, 1.5 * left[j]));
      }
      if (concerned > 0) {
        before /= concerned, after /= concerned, gain /= concerned;
        fire = !spoils && before < options.most_before && after > options.least_after &&
               gain > std::log(options.least_gain);
      }
    }
  }
  if (fire) {
    report.conventions = conventions_of(best->reading, nominal, kinematics);
  } else if (kinematics.time_unit != 1.0 || kinematics.velocity_unit != 1.0 || kinematics.unrelated) {
    Reading as_is = model ? plain : Reading{};
    if (!model) {
      as_is.order.resize(n);
      std::iota(as_is.order.begin(), as_is.order.end(), 0);
      as_is.sign = as_is.torque_sign = as_is.factor = Eigen::VectorXd::Ones(n);
      as_is.zero = Eigen::VectorXd::Zero(n);
      as_is.time_unit = kinematics.time_unit;
    }
    report.conventions = conventions_of(as_is, nominal, kinematics);
  }
  for (Convention& c : report.conventions) {
    const bool of_motion = c.name == "time_unit" || c.name == "velocity_unit";
    c.explained_before = of_motion ? kinematics.before : before;
    c.explained_after = of_motion ? kinematics.after : after;
  }
  report.assume = joined(report.conventions);
  if (fire) {
    for (const Candidate& c : search->found()) {
      const std::string assume = joined(conventions_of(c.reading, nominal, kinematics));
      if (assume == report.assume || assume.empty()) continue;
      report.runner_up = assume;
      report.runner_up_explained = 1.0 - c.left.cwiseMin(at_most_worse).mean();
      break;
    }
  }
  return report;
}

}  // namespace dynid
