// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <Eigen/Core>
#include <unsupported/Eigen/AutoDiff>
#include <vector>

#include "chains.hpp"
#include "dual.hpp"
#include "dynid/dynamics/dynamics.hpp"

namespace dynid::test {
namespace {

using Vector = Eigen::VectorXd;
using DualVector = Eigen::Matrix<Dual, Eigen::Dynamic, 1>;
using DualMatrix = Eigen::Matrix<Dual, Eigen::Dynamic, Eigen::Dynamic>;

DualVector along(const Vector& x, int k) {
  DualVector d(x.size());
  for (int i = 0; i < x.size(); ++i) d[i] = Dual(x[i], i == k ? 1.0 : 0.0);
  return d;
}

void derivatives(const Robot& robot, int count) {
  const Model<> model(robot);
  const int n = model.size();
  Workspace<> ws(model);
  Workspace<Eigen::Dynamic, Dual> dual_ws(model);
  for (int k = 0; k < count; ++k) {
    SCOPED_TRACE(robot.name + ", seed " + std::to_string(k));
    Generator generator(static_cast<unsigned>(k));
    const Vector q = random_state(generator, n, 3.0), dq = random_state(generator, n, 2.0);

    std::vector<Eigen::MatrixXd> dM(n, Eigen::MatrixXd(n, n));
    Vector dU(n);
    DualMatrix Md(n, n);
    std::vector<Eigen::Transform<Dual, 3, Eigen::Isometry>> dual_poses(n + 1);
    std::vector<Eigen::Isometry3d> poses(n + 1);
    Eigen::MatrixXd J(6, n), S(n, n), M(n, n), expected_J(6, n);
    forward_kinematics(model, ws, q, poses);
    for (int j = 0; j < n; ++j) {
      const DualVector qd = along(q, j);
      mass_matrix(model, dual_ws, qd, Md);
      for (int a = 0; a < n; ++a)
        for (int b = 0; b < n; ++b) dM[j](a, b) = Md(a, b).d;
      dU[j] = potential_energy(model, dual_ws, qd).d;
      forward_kinematics(model, dual_ws, qd, dual_poses);
      Eigen::Matrix4d dT;
      for (int a = 0; a < 4; ++a)
        for (int b = 0; b < 4; ++b) dT(a, b) = dual_poses[n].matrix()(a, b).d;
      const Eigen::Matrix3d spin = dT.topLeftCorner<3, 3>() * poses[n].linear().transpose();
      expected_J.col(j) << dT.topRightCorner<3, 1>(), spin(2, 1), spin(0, 2), spin(1, 0);
    }

    jacobian(model, ws, q, J);
    EXPECT_LE((J - expected_J).norm(), 1e-11 * J.norm())
        << "Jacobian against the derivative of the tip's pose";

    Vector g(n);
    gravity(model, ws, q, g);
    EXPECT_LE((g - dU).norm(), 1e-11 * (g.norm() + 1.0))
        << "gravity against the derivative of the potential energy";

    mass_matrix(model, ws, q, M);
    coriolis_matrix(model, ws, q, dq, S);
    Eigen::MatrixXd christoffel = Eigen::MatrixXd::Zero(n, n);
    for (int a = 0; a < n; ++a)
      for (int b = 0; b < n; ++b)
        for (int c = 0; c < n; ++c)
          christoffel(a, b) += 0.5 * (dM[c](a, b) + dM[b](a, c) - dM[a](b, c)) * dq[c];
    EXPECT_LE((S - christoffel).norm(), 1e-11 * M.norm() * dq.norm()) << "Christoffel's symbols";
  }
}

TEST(Derivatives, Panda) { derivatives(panda(), 300); }
TEST(Derivatives, ChainWithYAxesAndTurnedOrigins) { derivatives(ur_like(), 300); }
TEST(Derivatives, HundredRandomChains) {
  for (unsigned seed = 0; seed < chains; ++seed) derivatives(random_chain(seed), 10);
}

// The pose of each link, composed as Robot says.
TEST(ForwardKinematics, IsTheProductOfOriginsAndJoints) {
  for (unsigned seed = 0; seed < chains; ++seed) {
    const Robot robot = random_chain(seed);
    const Model<> model(robot);
    const int n = model.size();
    Workspace<> ws(model);
    Generator generator(seed);
    const Vector q = random_state(generator, n, 3.0);
    std::vector<Eigen::Isometry3d> poses(n + 1);
    forward_kinematics(model, ws, q, poses);
    Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
    for (int i = 0; i <= n; ++i) {
      if (i < n) {
        const Joint& joint = robot.joints[i];
        pose = pose * joint.origin;
        if (joint.type == JointType::prismatic)
          pose.translate(joint.axis * q[i]);
        else
          pose.rotate(Eigen::AngleAxisd(q[i], joint.axis));
      } else {
        pose = pose * robot.tip;
      }
      EXPECT_LE((poses[i].matrix() - pose.matrix()).norm(), 1e-13) << robot.name << ", link " << i + 1;
    }
  }
}

// d tau/dq, d tau/d dq by Eigen's own differentiable scalar, in one call, against the Coriolis matrix and
// Dual.
TEST(Derivatives, OfInverseDynamicsByEigensAutoDiff) {
  using Scalar = Eigen::AutoDiffScalar<Eigen::Matrix<double, 14, 1>>;
  const Model<7> model(panda());
  Workspace<7, Scalar> ws(model);
  Workspace<7, Dual> dual_ws(model);
  Generator generator(3);
  const Vector q = random_state(generator, 7, 3.0), dq = random_state(generator, 7, 2.0);
  const Vector ddq = random_state(generator, 7, 5.0);
  Eigen::Matrix<Scalar, 7, 1> qa, dqa, ddqa, tau;
  for (int i = 0; i < 7; ++i) {
    qa[i] = Scalar(q[i], 14, i);
    dqa[i] = Scalar(dq[i], 14, 7 + i);
    ddqa[i] = Scalar(ddq[i]);
    ddqa[i].derivatives().setZero();
  }
  inverse_dynamics(model, ws, qa, dqa, ddqa, tau);
  for (int k = 0; k < 14; ++k) {
    Eigen::Matrix<Dual, 7, 1> qd = along(q, k), dqd = along(dq, k - 7), ddqd = along(ddq, -1), expected;
    inverse_dynamics(model, dual_ws, qd, dqd, ddqd, expected);
    for (int i = 0; i < 7; ++i)
      EXPECT_NEAR(tau[i].derivatives()[k], expected[i].d, 1e-11 * (1.0 + std::abs(expected[i].d)));
  }
}

}  // namespace
}  // namespace dynid::test
