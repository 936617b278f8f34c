// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "chains.hpp"
#include "dynid/dynamics/dynamics.hpp"

namespace dynid::test {
namespace {

using Eigen::Dynamic;

constexpr int columns(int n) { return n == Dynamic ? Dynamic : 10 * n; }

/// Every kernel on N joints at once, for scalar S.
template <int N, class S>
struct Results {
  Eigen::Matrix<S, N, 1> tau, g, ddq;
  Eigen::Matrix<S, N, N> M, C;
  Eigen::Matrix<S, N, columns(N)> Y;
  Eigen::Matrix<S, Dynamic, Dynamic> Ys;
  Eigen::Matrix<S, 6, N> J, W;
  S kinetic, potential;

  Results(const Model<N>& model, const Eigen::Matrix<S, N, 1>& q, const Eigen::Matrix<S, N, 1>& dq,
          const Eigen::Matrix<S, N, 1>& ddq_in) {
    const int n = model.size();
    tau.resize(n), g.resize(n), ddq.resize(n), M.resize(n, n), C.resize(n, n), Y.resize(n, 10 * n);
    Ys.resize(n * (n + 1) / 2 + n, 10 * n), J.resize(6, n), W.resize(6, n);
    Workspace<N, S> ws(model);
    inverse_dynamics(model, ws, q, dq, ddq_in, tau);
    gravity(model, ws, q, g);
    forward_dynamics(model, ws, q, dq, tau, ddq);
    mass_matrix(model, ws, q, M);
    coriolis_matrix(model, ws, q, dq, C);
    regressor(model, ws, q, dq, ddq_in, Y);
    inertia_stack_regressor(model, ws, q, Ys);
    jacobian(model, ws, q, J);
    joint_wrenches(model, ws, q, dq, ddq_in, W);
    kinetic = kinetic_energy(model, ws, q, dq);
    potential = potential_energy(model, ws, q);
  }
};

template <class A, class B>
void expect_close(const A& a, const B& b, const char* what) {
  EXPECT_LE((a - b).norm(), 1e-9 * (1.0 + b.norm())) << what;
}

template <class A>
Eigen::MatrixXd lane(const A& a, int k) {
  Eigen::MatrixXd r(a.rows(), a.cols());
  for (int i = 0; i < r.rows(); ++i)
    for (int j = 0; j < r.cols(); ++j) r(i, j) = a(i, j)[k];
  return r;
}

/// Eight samples at once give what each gives alone, and a fixed size what a dynamic one gives.
template <int N>
void compare(const Robot& robot, unsigned seed) {
  SCOPED_TRACE(robot.name + ", seed " + std::to_string(seed));
  const Model<N> model(robot);
  const Model<> dynamic_model(robot);
  const int n = model.size();
  Generator generator(seed);
  Eigen::Matrix<Packet8, N, 1> q(n), dq(n), ddq(n);
  for (int i = 0; i < n; ++i)
    for (int k = 0; k < 8; ++k) {
      q[i][k] = uniform(generator, -3.0, 3.0);
      dq[i][k] = uniform(generator, -2.0, 2.0);
      ddq[i][k] = uniform(generator, -5.0, 5.0);
    }
  const Results<N, Packet8> eight(model, q, dq, ddq);
  for (int k = 0; k < 8; ++k) {
    const Eigen::VectorXd qk = lane(q, k), dqk = lane(dq, k), ddqk = lane(ddq, k);
    const Results<N, double> one(model, qk, dqk, ddqk);
    const Results<Dynamic, double> same(dynamic_model, qk, dqk, ddqk);
#define DYNID_COMPARE(field)                                       \
  expect_close(lane(eight.field, k), one.field, #field " packet"); \
  expect_close(same.field, one.field, #field " dynamic")
    DYNID_COMPARE(tau);
    DYNID_COMPARE(g);
    DYNID_COMPARE(ddq);
    DYNID_COMPARE(M);
    DYNID_COMPARE(C);
    DYNID_COMPARE(Y);
    DYNID_COMPARE(Ys);
    DYNID_COMPARE(J);
    DYNID_COMPARE(W);
#undef DYNID_COMPARE
    EXPECT_NEAR(eight.kinetic[k], one.kinetic, 1e-10 * (1.0 + one.kinetic));
    EXPECT_NEAR(eight.potential[k], one.potential, 1e-10 * (1.0 + std::abs(one.potential)));
  }
}

TEST(Packets, EqualTheScalarLaneByLane) {
  for (unsigned seed = 0; seed < 50; ++seed) {
    compare<7>(panda(), seed);
    compare<6>(ur_like(), seed);
  }
  for (unsigned seed = 0; seed < chains; ++seed) compare<Dynamic>(random_chain(seed), seed);
}

TEST(FixedSize, OfTwoToFourJoints) {  // fewer joints than lanes
  compare<2>(random_chain(8), 1);
  compare<3>(random_chain(9), 2);
  compare<4>(random_chain(10), 3);
}

TEST(Outputs, MayBeBlocksMapsAndRowMajor) {
  const Model<7> model(panda());
  Workspace<7> ws(model);
  Generator generator(1);
  const Eigen::Matrix<double, 7, 1> q = random_state(generator, 7, 3.0), dq = random_state(generator, 7, 2.0);
  const Eigen::Matrix<double, 7, 1> ddq = random_state(generator, 7, 5.0);
  Eigen::Matrix<double, 7, 70> Y;
  Eigen::Matrix<double, 7, 7> M, S;
  regressor(model, ws, q, dq, ddq, Y);
  mass_matrix(model, ws, q, M);
  coriolis_matrix(model, ws, q, dq, S);

  Eigen::MatrixXd frame = Eigen::MatrixXd::Constant(20, 90, -1.0), untouched = frame;
  regressor(model, ws, q, dq, ddq, frame.block(3, 5, 7, 70));
  EXPECT_EQ((frame.block<7, 70>(3, 5) - Y).norm(), 0.0);
  frame.block(3, 5, 7, 70).setConstant(-1.0);
  EXPECT_EQ((frame - untouched).norm(), 0.0) << "written outside the block";

  Eigen::Matrix<double, 7, 70, Eigen::RowMajor> rows;
  regressor(model, ws, q, dq, ddq, rows);
  EXPECT_EQ((rows - Y).norm(), 0.0);
  Eigen::Matrix<double, 7, 7, Eigen::RowMajor> square;
  mass_matrix(model, ws, q, square);
  EXPECT_EQ((square - M).norm(), 0.0);
  coriolis_matrix(model, ws, q, dq, square);
  EXPECT_EQ((square - S).norm(), 0.0);

  // Inputs: a strided row of a log, an expression.
  Eigen::Matrix<double, 5, 7> log;
  log.row(2) = q.transpose();
  mass_matrix(model, ws, log.row(2).transpose(), square);
  EXPECT_EQ((square - M).norm(), 0.0);
  mass_matrix(model, ws, 2.0 * (0.5 * q), square);
  EXPECT_EQ((square - M).norm(), 0.0);
}

TEST(Armature, IsAddedToTheDiagonal) {
  const Model<7> model(panda());
  Workspace<7> ws(model);
  Generator generator(2);
  const Eigen::Matrix<double, 7, 1> q = random_state(generator, 7, 3.0), dq = random_state(generator, 7, 2.0);
  const Eigen::Matrix<double, 7, 1> ddq = random_state(generator, 7, 5.0);
  const Eigen::Matrix<double, 7, 1> armature = random_state(generator, 7, 0.5).cwiseAbs();
  Eigen::Matrix<double, 7, 7> M, plain;
  mass_matrix(model, ws, q, M, armature);
  mass_matrix(model, ws, q, plain);
  EXPECT_LE((M - plain - Eigen::MatrixXd(armature.asDiagonal())).norm(), 1e-14);
  Eigen::Matrix<double, 7, 1> tau, back;
  inverse_dynamics(model, ws, q, dq, ddq, tau);
  tau += armature.cwiseProduct(ddq);
  forward_dynamics(model, ws, q, dq, tau, back, armature);
  EXPECT_LE((back - ddq).norm(), 1e-11);
}

TEST(Model, RefusesWhatItCannotCompile) {
  EXPECT_THROW(Model<6>{panda()}, Error);
  EXPECT_THROW(Model<>{Robot()}, Error);
  Robot robot = panda();
  robot.joints[2].axis *= 2.0;
  EXPECT_THROW(Model<7>{robot}, Error);
  robot = panda();
  robot.joints[3].parameters[4] = std::nan("");
  EXPECT_THROW(Model<7>{robot}, Error);
  robot = panda();
  robot.joints[3].origin.matrix()(0, 0) += 0.1;
  EXPECT_THROW(Model<7>{robot}, Error);
  Model<7> model(panda());
  EXPECT_THROW(model.set_parameters(Eigen::VectorXd::Zero(69)), Error);
}

TEST(Model, GravityAndParametersAreReplaced) {
  Generator generator(4);
  Robot robot = random_chain(13);
  const Model<> before(robot);
  robot.gravity = random_vector(generator, 10.0);
  Eigen::VectorXd pi(10 * robot.size());
  for (Joint& joint : robot.joints) joint.parameters = random_body(generator);
  for (int i = 0; i < robot.size(); ++i) pi.segment<10>(10 * i) = robot.joints[i].parameters;
  const Model<> rebuilt(robot), changed = before.with_gravity(robot.gravity).with_parameters(pi);
  EXPECT_EQ(changed.gravity(), robot.gravity);
  const int n = robot.size();
  Workspace<> ws(rebuilt);
  const Eigen::VectorXd q = random_state(generator, n, 3.0), dq = random_state(generator, n, 2.0);
  Eigen::VectorXd a(n), b(n);
  inverse_dynamics(rebuilt, ws, q, dq, dq, a);
  inverse_dynamics(changed, ws, q, dq, dq, b);
  EXPECT_EQ((a - b).norm(), 0.0);
}

double ulp(double x) {
  x = std::abs(x);
  return std::nextafter(x, std::numeric_limits<double>::infinity()) - x;
}

struct SinCos {
  double s, c;
  explicit SinCos(double x) {
    detail::Lane sine, cosine;
    detail::sincos(detail::Lane(x), sine, cosine);
    double out[8];
    detail::store(out, sine);
    s = out[0];
    detail::store(out, cosine);
    c = out[0];
  }
};

TEST(SinCos, WithinOneUnitInTheLastPlace) {
  Generator generator(7);
  double worst = 0.0;
  const auto check = [&](double x) {
    const SinCos here(x);
    const long double s = std::sin(static_cast<long double>(x)), c = std::cos(static_cast<long double>(x));
    const double es = static_cast<double>(std::abs(here.s - s)) / ulp(static_cast<double>(s));
    const double ec = static_cast<double>(std::abs(here.c - c)) / ulp(static_cast<double>(c));
    worst = std::max({worst, es, ec});
    ASSERT_LE(es, 1.0) << "sin " << x;
    ASSERT_LE(ec, 1.0) << "cos " << x;
  };
  for (const double range : {1e-8, 1.0, 10.0, 1e3, 1e4, 9.9e4, 1e5, 1e9, 1e300})
    for (int k = 0; k < 100000; ++k) check(uniform(generator, -range, range));
  for (int k = -60000; k <= 60000; ++k) check(k * 1.5707963267948966);  // where r all but vanishes
  std::printf("  worst: %.3f ulp\n", worst);
}

TEST(SinCos, AtTheEdges) {
  EXPECT_EQ(SinCos(0.0).s, 0.0);
  EXPECT_EQ(SinCos(0.0).c, 1.0);
  const double tiny = std::numeric_limits<double>::denorm_min();
  EXPECT_EQ(SinCos(tiny).s, tiny);
  for (const double x : {std::numeric_limits<double>::infinity(), -std::numeric_limits<double>::infinity(),
                         std::numeric_limits<double>::quiet_NaN()}) {
    EXPECT_TRUE(std::isnan(SinCos(x).s));
    EXPECT_TRUE(std::isnan(SinCos(x).c));
  }
  // A NaN or a far angle in one lane leaves the others alone.
  double angles[4] = {0.5, std::nan(""), 1e6, -2.0}, s[4] = {}, c[4] = {};
  for (int first = 0; first < 4; first += detail::lane_width) {
    detail::Lane sine, cosine;
    detail::sincos(detail::load<detail::Lane>(angles + first), sine, cosine);
    detail::store(s + first, sine);
    detail::store(c + first, cosine);
  }
  EXPECT_NEAR(s[0], std::sin(0.5), 1e-16);
  EXPECT_TRUE(std::isnan(s[1]));
  EXPECT_NEAR(c[2], std::cos(1e6), 1e-15);
  EXPECT_NEAR(c[3], std::cos(2.0), 1e-16);
}

}  // namespace
}  // namespace dynid::test
