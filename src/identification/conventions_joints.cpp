// SPDX-License-Identifier: Apache-2.0
// Readings joint by joint: which way each counts, from where, and in which order they stand.
#include <cmath>

#include "conventions_search.hpp"

namespace dynid::detail {

using Eigen::Index;

double ConventionSearch::quick(const ConventionSample& sample, const Reading& r) {
  kernel_->torque(sample, r, r.gravity, scratch_);
  double sum = 0.0;
  for (int j = 0; j < n_; ++j) {
    const int k = r.order[j];
    if (!(sample.bare_torque().col(k).squaredNorm() > 0.0)) continue;
    const double e =
        std::min(sample.quick_residual(j, k, scratch_, 1.0), sample.quick_residual(j, k, scratch_, -1.0)) /
        sample.bare_torque().col(k).squaredNorm();
    sum +=
        std::log((std::clamp(e, 0.0, options_.worst) + options_.model_error) / (1.0 + options_.model_error));
  }
  return sum;
}

void ConventionSearch::best_of(std::vector<Quick>& list, std::size_t count) {
  std::stable_sort(list.begin(), list.end(),
                   [](const Quick& a, const Quick& b) { return a.score < b.score; });
  if (list.size() > count) list.resize(count, list.front());
}

void ConventionSearch::insert(std::vector<Quick>& list, std::size_t count, const Reading& r,
                              double score) const {
  if (list.size() >= 2 * count) best_of(list, count);
  if (list.size() >= count && score > list[count - 1].score) return;
  list.push_back({score, r});
}

std::vector<ConventionSearch::Quick> ConventionSearch::signs_of(const Reading& base,
                                                                const ConventionSample& sample,
                                                                std::size_t count) {
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

void ConventionSearch::add_joint_signs(const Reading& r) {
  const Eigen::MatrixXd T = torque_of(full_, r, r.gravity);
  Reading turned = r;  // residual() turns the torque with torque_sign alone
  Eigen::VectorXd with(n_), other(n_);
  for (int j = 0; j < n_; ++j) {
    with[j] = full_.residual(r, j, T, r.sign[j], 1.0);
    other[j] = full_.residual(r, j, T, -r.sign[j], 1.0);
  }
  const auto add = [&](const Eigen::VectorXd& left, const Eigen::VectorXd& torque, double cost) {
    ReadingCandidate c{r, left, 0.0};
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

void ConventionSearch::try_signs(const Reading& base) {
  for (const Quick& q : signs_of(base, mid_, 8)) add_joint_signs(q.reading);
}

void ConventionSearch::try_orders(const Reading& base) {
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

bool ConventionSearch::zero_matters(int j) const {
  const Joint& joint = robot_.joints[j];
  if (joint.type == JointType::prismatic) return false;
  if (j > 0) return true;
  const Eigen::Vector3d axis = joint.origin.linear() * joint.axis;
  return axis.cross(robot_.gravity).norm() > 1e-3 * robot_.gravity.norm();
}

void ConventionSearch::try_zeros(const Reading& base) {
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
      r.zero[joints[i]] = quarters == 3 ? -90.0 * degree_of_angle : 90.0 * degree_of_angle * quarters;
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

void ConventionSearch::try_free_zeros(const Reading& base) {
  if (n_ == 1) return;  // any phase would fit: a spring, another centre of mass
  Reading r = base;
  double now = evidence(before_.left) + 1e9;
  for (int round = 0; round < 2; ++round) {
    Quick best{now, r};
    for (int j = 0; j < n_; ++j) {
      if (!zero_matters(j) || r.zero[j] != 0.0) continue;
      for (int step = 1; step < 24; ++step) {
        Reading tried = r;
        tried.zero[j] = std::remainder(15.0 * degree_of_angle * step, 360.0 * degree_of_angle);
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

std::vector<Reading> ConventionSearch::without_a_part(const Reading& r) const {
  std::vector<Reading> out;
  const auto add = [&](Reading simpler, double cost) {
    simpler.complexity -= cost;
    out.push_back(std::move(simpler));
  };
  const Eigen::VectorXd torque = r.torque_sign.cwiseProduct(r.sign);
  const bool all_turned = (torque.array() < 0.0).all();
  for (int j = 0; j < n_; ++j) {
    Reading simpler = r;
    if (r.zero[j] != 0.0) {
      simpler.zero[j] = 0.0;
      add(simpler, 0.5);
      simpler = r;
    }
    if (r.sign[j] < 0.0) {
      simpler.sign[j] = 1.0;
      simpler.torque_sign[j] = -r.torque_sign[j];
      add(simpler, 0.3);
      simpler = r;
    }
    if (torque[j] < 0.0 && !all_turned) {
      simpler.torque_sign[j] = -r.torque_sign[j];
      add(simpler, 0.3);
    }
  }
  std::vector<bool> seen(static_cast<std::size_t>(n_), false);
  for (int j = 0; j < n_; ++j) {
    if (seen[static_cast<std::size_t>(j)] || r.order[static_cast<std::size_t>(j)] == j) continue;
    Reading simpler = r;
    for (int k = j; !seen[static_cast<std::size_t>(k)]; k = r.order[static_cast<std::size_t>(k)]) {
      seen[static_cast<std::size_t>(k)] = true;
      simpler.order[static_cast<std::size_t>(k)] = k;
    }
    add(simpler, 0.4);
  }
  Reading simpler = r;
  if (all_turned) {
    simpler.torque_sign = r.sign;
    add(simpler, 0.4);
    simpler = r;
  }
  if (r.position_unit != 1.0) {
    simpler.position_unit = 1.0;
    add(simpler, 0.5);
    simpler = r;
  }
  if (!r.factor.isOnes(0.0)) {
    simpler.factor.setOnes();
    simpler.unit_of_torque = false;
    add(simpler, 0.4);
    simpler = r;
  }
  if (r.magnitude) {
    simpler.magnitude = false;
    add(simpler, 0.5);
    simpler = r;
  }
  if (r.without_gravity || r.turned_gravity) {
    simpler.without_gravity = simpler.turned_gravity = false;
    simpler.gravity = robot_.gravity;
    add(simpler, 0.4);
  }
  return out;
}

void ConventionSearch::refine(Reading& r) {
  double score = quick(mid_, r);
  double step = 7.5 * degree_of_angle;
  while (step > 0.1 * degree_of_angle) {
    for (int j = 0; j < n_; ++j) {
      if (r.zero[j] == 0.0) continue;
      for (const double s : {step, -step}) {
        Reading tried = r;
        tried.zero[j] += s;
        const double there = quick(mid_, tried);
        if (there < score) score = there, r = tried;
      }
    }
    step *= 0.5;
  }
}

}  // namespace dynid::detail
