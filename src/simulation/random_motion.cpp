// SPDX-License-Identifier: Apache-2.0
#include "dynid/simulation/random_motion.hpp"

#include <algorithm>
#include <cmath>
#include <random>

#include "dynid/base/error.hpp"
#include "dynid/dynamics/joint_scale.hpp"

namespace dynid {

Trajectory random_motion(const Robot& robot, double duration, unsigned long seed,
                         const RandomMotionOptions& options) {
  if (!(duration > 0.0) || !std::isfinite(duration))
    throw Error("random motion: the duration must be positive");
  if (options.harmonics < 3) throw Error("random motion: at least 3 harmonics are needed to start at rest");
  if (!(options.rate > 0.0) || !(options.base_frequency > 0.0) || !(duration * options.rate >= 2.0))
    throw Error("random motion: rate and base frequency must be positive, and the motion have samples");
  if (!(options.margin > 0.0 && options.margin <= 1.0))
    throw Error("random motion: margin must be in (0, 1]");
  const int n = robot.size(), L = options.harmonics;
  const double periods = std::max(1.0, std::round(duration * options.base_frequency));
  const double w0 = 2.0 * M_PI * periods / duration;
  const auto samples = static_cast<Eigen::Index>(std::floor(duration * options.rate + 1e-6)) + 1;
  std::seed_seq sequence{seed, 0x6d6f74696fUL};
  std::mt19937_64 random(sequence);
  std::normal_distribution<double> normal;
  std::uniform_real_distribution<double> part(0.0, 1.0);

  Trajectory motion;
  motion.source = "random motion " + std::to_string(seed);
  motion.t = Eigen::VectorXd::LinSpaced(samples, 0.0, double(samples - 1) / options.rate);
  motion.q.resize(samples, n);
  motion.dq.resize(samples, n);
  motion.ddq.resize(samples, n);
  // dq = sum a_l cos(l w t) + b_l sin(l w t); at rest at t = 0: sum a_l = 0, sum l b_l = 0.
  Eigen::ArrayXd lw = w0 * Eigen::ArrayXd::LinSpaced(L, 1.0, double(L));
  const Eigen::MatrixXd angle = motion.t * lw.matrix().transpose();
  const Eigen::MatrixXd cosine = angle.array().cos(), sine = angle.array().sin();
  const std::vector<JointScale> scales = joint_scales(robot);
  for (int j = 0; j < n; ++j) {
    const JointScale& typical = scales[static_cast<std::size_t>(j)];
    Eigen::ArrayXd a(L), b(L);
    for (int l = 0; l < L; ++l) a[l] = normal(random), b[l] = normal(random);
    a -= a.mean();
    b -= lw * ((lw * b).sum() / lw.square().sum());
    Eigen::VectorXd q = sine * (a / lw).matrix() - cosine * (b / lw).matrix();
    const Eigen::VectorXd dq = cosine * a.matrix() + sine * b.matrix();
    const Eigen::VectorXd ddq = cosine * (lw * b).matrix() - sine * (lw * a).matrix();
    const JointLimits& limits = robot.joints[static_cast<std::size_t>(j)].limits;
    const bool bounded = std::isfinite(limits.lower) && std::isfinite(limits.upper);
    const double centre = bounded ? 0.5 * (limits.lower + limits.upper) : 0.0;
    const double reach =
        options.margin * (bounded ? 0.5 * (limits.upper - limits.lower) : 0.4 * typical.travel);
    const double speed = options.margin * (std::isfinite(limits.velocity) ? limits.velocity : typical.speed);
    const double rush = options.margin * (std::isfinite(limits.acceleration) ? limits.acceleration
                                                                             : 6.0 * typical.acceleration);
    // The position may wander about the middle as far as the swing leaves room.
    const double middle = 0.5 * (q.maxCoeff() + q.minCoeff()), swing = 0.5 * (q.maxCoeff() - q.minCoeff());
    double scale =
        std::min({speed / dq.cwiseAbs().maxCoeff(), rush / ddq.cwiseAbs().maxCoeff(), reach / swing});
    scale *= 0.6 + 0.4 * part(random);
    const double room = reach - scale * swing;
    const double shift = centre + room * (2.0 * part(random) - 1.0) - scale * middle;
    motion.q.col(j) = (scale * q).array() + shift;
    motion.dq.col(j) = scale * dq;
    motion.ddq.col(j) = scale * ddq;
  }
  return motion;
}

}  // namespace dynid
