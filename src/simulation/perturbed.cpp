// SPDX-License-Identifier: Apache-2.0
#include "dynid/simulation/perturbed.hpp"

#include <Eigen/Cholesky>
#include <random>

#include "dynid/base/error.hpp"

namespace dynid {

Robot perturbed(const Robot& robot, double spread, unsigned long seed) {
  if (!(spread >= 0.0 && spread < 0.5)) throw Error("spread must be at least 0 and below 0.5");
  Robot other = robot;
  if (spread == 0.0) return other;
  std::seed_seq sequence{seed, 0x7370726561UL};
  std::mt19937_64 random(sequence);
  std::normal_distribution<double> normal;
  for (Joint& joint : other.joints) {
    Eigen::Matrix4d E;
    for (double& e : E.reshaped()) e = 0.5 * spread * normal(random);  // squared below: twice as much
    const Eigen::Matrix4d P = pseudo_inertia(joint.parameters);
    const Eigen::LLT<Eigen::Matrix4d> factor(P);
    if (factor.info() == Eigen::Success) {
      const Eigen::Matrix4d L = factor.matrixL();
      const Eigen::Matrix4d root = L * (Eigen::Matrix4d::Identity() + E);
      joint.parameters = from_pseudo_inertia(root * root.transpose());
    } else {  // no body has these parameters: they are scaled as a whole
      joint.parameters *= 1.0 + 2.0 * E(0, 0);
    }
    for_each_parameter(joint.friction, [&](auto& law, const auto& p) {
      if (p.role != FrictionRole::given) law.*p.value *= 1.0 + spread * normal(random);
    });
    joint.rotor_inertia *= 1.0 + spread * normal(random);
  }
  return other;
}

}  // namespace dynid
