// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <Eigen/Eigenvalues>
#include <cstdio>
#include <initializer_list>
#include <iomanip>
#include <kdl/chaindynparam.hpp>
#include <kdl/chainfksolverpos_recursive.hpp>
#include <kdl/chainidsolver_recursive_newton_euler.hpp>
#include <kdl/chainjnttojacsolver.hpp>
#include <locale>
#include <memory>
#include <sstream>
#include <vector>

#ifdef DYNID_HAVE_MUJOCO
#include <mujoco/mujoco.h>
#endif

#include "chains.hpp"
#include "dynid/dynamics/dynamics.hpp"
#include "dynid/model/kdl.hpp"

namespace dynid::test {
namespace {

using Vector = Eigen::VectorXd;
using Matrix = Eigen::MatrixXd;

/// What this library says of one state.
struct Answer {
  Vector tau, g, coriolis;
  Matrix M;
  double size;  // of the torque's parts

  Answer(const Model<>& model, Workspace<>& ws, const Vector& q, const Vector& dq, const Vector& ddq) {
    const int n = model.size();
    tau.resize(n), g.resize(n), M.resize(n, n);
    Matrix S(n, n);
    inverse_dynamics(model, ws, q, dq, ddq, tau);
    gravity(model, ws, q, g);
    mass_matrix(model, ws, q, M);
    coriolis_matrix(model, ws, q, dq, S);
    coriolis = S * dq;
    size = (M * ddq).norm() + coriolis.norm() + g.norm();
  }
};

double agree_with_kdl(Robot robot, int count) {
  for (Joint& joint : robot.joints) joint.rotor_inertia = 0.0;
  const KDL::Chain chain = to_kdl(robot);
  const KDL::Vector gravity(robot.gravity.x(), robot.gravity.y(), robot.gravity.z());
  KDL::ChainIdSolver_RNE rne(chain, gravity);
  KDL::ChainDynParam dynamics(chain, gravity);
  KDL::ChainFkSolverPos_recursive fk(chain);
  KDL::ChainJntToJacSolver jac(chain);
  const Model<> model(robot);
  const int n = model.size();
  Workspace<> ws(model);
  KDL::JntArray q(n), dq(n), ddq(n), tau(n), coriolis(n), g(n);
  KDL::JntSpaceInertiaMatrix M(n);
  KDL::Jacobian J(n);
  KDL::Frame tip;
  std::vector<Eigen::Isometry3d> poses(n + 1);
  Matrix jacobian_here(6, n);
  double worst = 0.0;
  for (int k = 0; k < count; ++k) {
    Generator generator(static_cast<unsigned>(k));
    q.data = random_state(generator, n, 3.0);
    dq.data = random_state(generator, n, 2.0);
    ddq.data = random_state(generator, n, 5.0);
    const Answer here(model, ws, q.data, dq.data, ddq.data);
    const KDL::Wrenches none(chain.getNrOfSegments(), KDL::Wrench::Zero());
    rne.CartToJnt(q, dq, ddq, none, tau);
    dynamics.JntToMass(q, M);
    dynamics.JntToCoriolis(q, dq, coriolis);
    dynamics.JntToGravity(q, g);
    fk.JntToCart(q, tip);
    jac.JntToJac(q, J);
    forward_kinematics(model, ws, q.data, poses);
    jacobian(model, ws, q.data, jacobian_here);
    const Eigen::Vector3d at(tip.p.x(), tip.p.y(), tip.p.z());
    for (const double error :
         {(here.tau - tau.data).norm() / here.size, (here.M - M.data).norm() / here.M.norm(),
          (here.coriolis - coriolis.data).norm() / here.size, (here.g - g.data).norm() / here.size,
          (poses[n].translation() - at).norm(), (jacobian_here - J.data).norm() / J.data.norm()}) {
      if (error > worst) worst = error;
      EXPECT_LE(error, 1e-10) << robot.name << ", seed " << k;
      if (!(error <= 1e-10)) return error;
    }
  }
  return worst;
}

TEST(Kdl, AgreesOnThePanda) { std::printf("  %.1e\n", agree_with_kdl(panda(), states(100000))); }
TEST(Kdl, AgreesOnTheChainWithYAxes) { std::printf("  %.1e\n", agree_with_kdl(ur_like(), states(100000))); }
TEST(Kdl, AgreesOnAHundredRandomChains) {
  double worst = 0.0;
  const int each = (states(100000) + chains - 1) / chains;
  for (unsigned seed = 0; seed < chains; ++seed)
    worst = std::max(worst, agree_with_kdl(random_chain(seed), each));
  std::printf("  %.1e\n", worst);
}

#ifdef DYNID_HAVE_MUJOCO

/// The chain as MuJoCo's own format: link frames are body frames.
std::string to_mjcf(const Robot& robot) {
  const auto numbers = [](std::initializer_list<double> values) {
    std::ostringstream text;
    text.imbue(std::locale::classic());
    text << std::setprecision(17);
    for (const double value : values) text << value << ' ';
    return text.str();
  };
  const auto vector = [&](const Eigen::Vector3d& v) { return numbers({v[0], v[1], v[2]}); };
  const auto quaternion = [&](const Eigen::Quaterniond& q) { return numbers({q.w(), q.x(), q.y(), q.z()}); };
  std::ostringstream out;
  out << "<mujoco><compiler angle='radian' coordinate='local' inertiafromgeom='false'/><option gravity='"
      << vector(robot.gravity) << "'/><worldbody>";
  for (const Joint& joint : robot.joints) {
    const LinkInertia link = from_standard(joint.parameters);
    // Principal axes found here: MuJoCo's own, from a full tensor, are good to 1e-8 only.
    Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> principal(link.inertia);
    Eigen::Matrix3d axes = principal.eigenvectors();
    if (axes.determinant() < 0.0) axes.col(0) *= -1.0;
    out << "<body pos='" << vector(joint.origin.translation()) << "' quat='"
        << quaternion(Eigen::Quaterniond(joint.origin.linear())) << "'><inertial pos='" << vector(link.com)
        << "' mass='" << numbers({link.mass}) << "' quat='" << quaternion(Eigen::Quaterniond(axes))
        << "' diaginertia='" << vector(principal.eigenvalues()) << "'/><joint type='"
        << (joint.type == JointType::prismatic ? "slide" : "hinge") << "' axis='" << vector(joint.axis)
        << "'/>";
  }
  for (int i = 0; i < robot.size(); ++i) out << "</body>";
  out << "</worldbody></mujoco>";
  return out.str();
}

double agree_with_mujoco(const Robot& robot, int count) {
  const std::string text = to_mjcf(robot);
  const auto vfs = std::make_unique<mjVFS>();
  mj_defaultVFS(vfs.get());
  mj_makeEmptyFileVFS(vfs.get(), "chain.xml", static_cast<int>(text.size()));
  std::copy(text.begin(), text.end(), static_cast<char*>(vfs->filedata[0]));
  char error[500] = "";
  const std::unique_ptr<mjModel, void (*)(mjModel*)> m(
      mj_loadXML("chain.xml", vfs.get(), error, sizeof(error)), &mj_deleteModel);
  mj_deleteVFS(vfs.get());
  if (!m) {
    ADD_FAILURE() << error << "\n" << text;
    return HUGE_VAL;
  }
  const std::unique_ptr<mjData, void (*)(mjData*)> d(mj_makeData(m.get()), &mj_deleteData);
  const Model<> model(robot);
  const int n = model.size();
  Workspace<> ws(model);
  double worst = 0.0;
  for (int k = 0; k < count; ++k) {
    Generator generator(static_cast<unsigned>(k));
    const Vector q = random_state(generator, n, 3.0), dq = random_state(generator, n, 2.0);
    const Vector ddq = random_state(generator, n, 5.0);
    const Answer here(model, ws, q, dq, ddq);
    Eigen::Map<Vector>(d->qpos, n) = q;
    Eigen::Map<Vector>(d->qvel, n) = dq;
    Eigen::Map<Vector>(d->qacc, n) = ddq;
    mj_inverse(m.get(), d.get());
    const Vector tau = Eigen::Map<Vector>(d->qfrc_inverse, n);
    Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor> M(n, n);
    mj_fullM(m.get(), M.data(), d->qM);
    const Vector bias = Eigen::Map<Vector>(d->qfrc_bias, n);
    for (const double e : {(here.tau - tau).norm() / here.size, (here.M - M).norm() / here.M.norm(),
                           (here.coriolis + here.g - bias).norm() / here.size}) {
      if (e > worst) worst = e;
      EXPECT_LE(e, 1e-10) << robot.name << ", seed " << k;
      if (!(e <= 1e-10)) return e;
    }
  }
  return worst;
}

// MuJoCo refuses a body whose principal moments break the triangle inequality at all.
Robot with_bodies(Robot robot) {
  Generator generator(5);
  for (Joint& joint : robot.joints) joint.parameters = random_body(generator);
  return robot;
}

TEST(Mujoco, AgreesOnThePandasKinematics) {
  std::printf("  %.1e\n", agree_with_mujoco(with_bodies(panda()), states(20000)));
}
TEST(Mujoco, AgreesOnTheChainWithYAxes) {
  std::printf("  %.1e\n", agree_with_mujoco(ur_like(), states(20000)));
}
TEST(Mujoco, AgreesOnAHundredRandomChains) {
  double worst = 0.0;
  const int each = (states(20000) + chains - 1) / chains;
  for (unsigned seed = 0; seed < chains; ++seed)
    worst = std::max(worst, agree_with_mujoco(random_chain(seed), each));
  std::printf("  %.1e\n", worst);
}

#else

TEST(Mujoco, Agrees) { GTEST_SKIP() << "built without MuJoCo"; }

#endif

}  // namespace
}  // namespace dynid::test
