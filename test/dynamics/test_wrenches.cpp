// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <vector>

#include "chains.hpp"
#include "dynid/dynamics/joint_wrenches.hpp"
#include "dynid/dynamics/kinematics.hpp"

namespace dynid::test {
namespace {

using Poses = std::vector<Eigen::Isometry3d>;

/// All six components of every joint's wrench, by d'Alembert on the bodies it carries: with r = T(t) x and
/// the pseudo-inertia P = integral of x x^T dm, the integral of r'' r^T dm is T'' P T^T, whose last column is
/// the force and whose antisymmetric part the moment about the base's origin. T'' comes from differences of
/// the poses in time.
void free_bodies(const Robot& robot, unsigned seed) {
  SCOPED_TRACE(robot.name + ", seed " + std::to_string(seed));
  Generator generator(seed);
  const int n = robot.size();
  const Model<> model(robot);
  Workspace<> ws(model);
  const Eigen::VectorXd q = random_state(generator, n, 3.0), dq = random_state(generator, n, 2.0),
                        ddq = random_state(generator, n, 4.0);
  Eigen::MatrixXd W(6, n);
  joint_wrenches(model, ws, q, dq, ddq, W);

  constexpr double h = 1e-3;
  std::vector<Poses> at;  // at -2h, -h, 0, h, 2h
  for (int k = -2; k <= 2; ++k) {
    Poses poses(static_cast<std::size_t>(n) + 1);
    forward_kinematics(model, ws, q + k * h * dq + 0.5 * k * h * k * h * ddq, poses);
    at.push_back(poses);
  }
  Eigen::Vector3d force = Eigen::Vector3d::Zero(), moment = force;  // about the base's origin, in its axes
  const double scale = W.cwiseAbs().maxCoeff();
  for (int i = n - 1; i >= 0; --i) {
    const auto k = static_cast<std::size_t>(i);
    const Eigen::Matrix4d T = at[2][k].matrix();
    const Eigen::Matrix4d second = (-at[0][k].matrix() + 16.0 * at[1][k].matrix() - 30.0 * T +
                                    16.0 * at[3][k].matrix() - at[4][k].matrix()) /
                                   (12.0 * h * h);
    const Eigen::Matrix4d P = pseudo_inertia(robot.joints[k].parameters);
    const Eigen::Matrix4d flow = second * P * T.transpose(), place = T * P * T.transpose();
    const Eigen::Vector3d h_world = place.topRightCorner<3, 1>();
    force += flow.topRightCorner<3, 1>() - place(3, 3) * robot.gravity;
    moment += Eigen::Vector3d(flow(2, 1) - flow(1, 2), flow(0, 2) - flow(2, 0), flow(1, 0) - flow(0, 1)) -
              h_world.cross(robot.gravity);
    const Eigen::Matrix3d R = T.topLeftCorner<3, 3>();
    const Eigen::Vector3d p = T.topRightCorner<3, 1>();
    EXPECT_LT((R.transpose() * force - W.col(i).head<3>()).norm(), 1e-6 * scale)
        << "force at joint " << i + 1;
    EXPECT_LT((R.transpose() * (moment - p.cross(force)) - W.col(i).tail<3>()).norm(), 1e-6 * scale)
        << "moment at joint " << i + 1;
  }
}

TEST(JointWrenches, BalanceTheBodiesTheyCarry) {
  for (unsigned seed = 0; seed < 20; ++seed) {
    free_bodies(panda(), seed);
    free_bodies(ur_like(), seed);
    free_bodies(random_chain(seed), seed);
  }
}

}  // namespace
}  // namespace dynid::test
