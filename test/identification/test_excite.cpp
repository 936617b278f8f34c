// SPDX-License-Identifier: Apache-2.0
// Exciting motions: what they promise is checked by code that shares nothing with what found them.
#include "dynid/identification/excite.hpp"

#include <gtest/gtest.h>
#include <yaml-cpp/yaml.h>

#include <Eigen/SVD>
#include <cmath>
#include <cstdlib>
#include <kdl/chainfksolverpos_recursive.hpp>
#include <kdl/chainidsolver_recursive_newton_euler.hpp>
#include <random>

#include "../../src/identification/exciting_objective.hpp"
#include "dynid/dynamics/inverse_dynamics.hpp"
#include "dynid/dynamics/kinematics.hpp"
#include "dynid/identification/least_squares.hpp"
#include "dynid/model/kdl.hpp"
#include "dynid/model/yaml.hpp"
#include "synthetic.hpp"

namespace dynid {
namespace {

std::string what(const std::function<void()>& call) {
  try {
    call();
  } catch (const Error& error) {
    return error.what();
  }
  return "nothing was refused";
}
#define EXPECT_REFUSED(call, part) \
  EXPECT_NE(what([&] { call; }).find(part), std::string::npos) << what([&] { call; })

CollisionModel panda_collision(const Robot& robot) {
  return read_collision(std::string(DYNID_SOURCE_DIR) + "/config/panda_collision.yaml", robot);
}

ExciteOptions quick(int starts = 2, int effort = 45) {
  ExciteOptions options;
  options.starts = starts;
  options.effort = effort;
  return options;
}

/// Least distance of two segments: minimised in one parameter over a grid refined by golden section, the
/// other in closed form. (The squared distance is convex in both.)
double segment_distance(const Eigen::Vector3d& a0, const Eigen::Vector3d& a1, const Eigen::Vector3d& b0,
                        const Eigen::Vector3d& b1) {
  const auto at = [&](double s) {
    const Eigen::Vector3d p = a0 + s * (a1 - a0), d = b1 - b0;
    const double length = d.squaredNorm();
    const double u = length > 0.0 ? std::min(1.0, std::max(0.0, (p - b0).dot(d) / length)) : 0.0;
    return (p - b0 - u * d).norm();
  };
  double low = 0.0, high = 1.0;
  for (int k = 0; k < 60; ++k) {
    const double s = low + 0.381966 * (high - low), t = high - 0.381966 * (high - low);
    (at(s) < at(t) ? high : low) = at(s) < at(t) ? t : s;
  }
  return std::min({at(0.5 * (low + high)), at(0.0), at(1.0)});
}

/// Least distance from a segment to a box, over points of the segment; 0 where they meet.
double box_distance(const Eigen::Vector3d& a0, const Eigen::Vector3d& a1, const BoxObstacle& box) {
  double least = 1e9;
  for (int k = 0; k <= 400; ++k) {
    const Eigen::Vector3d p = box.turn.conjugate() * (a0 + k / 400.0 * (a1 - a0) - box.centre);
    least = std::min(least, (p.cwiseAbs() - 0.5 * box.size).cwiseMax(0.0).norm());
  }
  return least;
}

/// Poses of base, links and tip by KDL.
class KdlPoses {
 public:
  explicit KdlPoses(const Robot& robot) : chain_(to_kdl(robot)), solver_(chain_), n_(robot.size()) {}
  std::vector<KDL::Frame> operator()(const Eigen::VectorXd& q) {
    KDL::JntArray joints(static_cast<unsigned>(n_));
    joints.data = q;
    std::vector<KDL::Frame> poses = {KDL::Frame::Identity()};
    for (int k = 1; k <= n_ + 1; ++k) {
      KDL::Frame pose;
      const int segment = std::min(k, static_cast<int>(chain_.getNrOfSegments()));
      EXPECT_GE(solver_.JntToCart(joints, pose, segment), 0);
      poses.push_back(pose);
    }
    return poses;
  }

 private:
  KDL::Chain chain_;
  KDL::ChainFkSolverPos_recursive solver_;
  int n_;
};

Eigen::Vector3d placed(const KDL::Frame& pose, const Eigen::Vector3d& point) {
  const KDL::Vector v = pose * KDL::Vector(point.x(), point.y(), point.z());
  return {v.x(), v.y(), v.z()};
}

/// Distance less clearance of the nearest two bodies, by KDL and segment_distance(): [self, floor, boxes].
Eigen::Vector3d clearance(const CollisionModel& model, int n, const std::vector<KDL::Frame>& poses) {
  Eigen::Vector3d least = Eigen::Vector3d::Constant(1e9);
  const auto end = [&](const Capsule& c, const Eigen::Vector3d& p) {
    return placed(poses[static_cast<std::size_t>(c.frame)], p);
  };
  const auto ignored = [&](const std::string& a, const std::string& b) {
    for (const auto& [x, y] : model.ignore)
      if ((x == a && y == b) || (x == b && y == a)) return true;
    return false;
  };
  for (const Capsule& a : model.capsules) {
    const Eigen::Vector3d a0 = end(a, a.from), a1 = end(a, a.to);
    for (const Capsule& b : model.capsules)
      if (std::min(n, b.frame) - std::min(n, a.frame) >= 2 && !ignored(a.link, b.link))
        least[0] =
            std::min(least[0], segment_distance(a0, a1, end(b, b.from), end(b, b.to)) - a.radius - b.radius);
    if (a.frame == 0) continue;
    if (model.floor) least[1] = std::min(least[1], std::min(a0.z(), a1.z()) - a.radius - *model.floor);
    for (const BoxObstacle& box : model.boxes)
      if (!ignored(a.link, box.name)) least[2] = std::min(least[2], box_distance(a0, a1, box) - a.radius);
  }
  return least.array() - model.clearance;
}

Eigen::MatrixXd differences(const Eigen::MatrixXd& x, double step) {
  return (x.bottomRows(x.rows() - 2) - x.topRows(x.rows() - 2)) / (2.0 * step);
}

/// Every limit of the robot along samples at 1 kHz, whose derivatives are found from q alone; torques by KDL
/// with eq. (25).
void expect_within_limits(const Robot& robot, const CollisionModel& collision, const Trajectory& motion,
                          const std::string& of) {
  const double step = motion.t[1] - motion.t[0];
  ASSERT_LT(step, 1.001e-3);
  const Eigen::MatrixXd dq = differences(motion.q, step), ddq = differences(dq, step),
                        jerk = differences(ddq, step);
  EXPECT_LT((dq - motion.dq.middleRows(1, dq.rows())).cwiseAbs().maxCoeff(), 1e-4) << of;
  EXPECT_LT((ddq - motion.ddq.middleRows(2, ddq.rows())).cwiseAbs().maxCoeff(), 1e-3) << of;
  for (int j = 0; j < robot.size(); ++j) {
    const JointLimits& limits = robot.joints[static_cast<std::size_t>(j)].limits;
    EXPECT_GT(motion.q.col(j).minCoeff(), limits.lower) << of << ", joint " << j + 1;
    EXPECT_LT(motion.q.col(j).maxCoeff(), limits.upper) << of << ", joint " << j + 1;
    EXPECT_LT(dq.col(j).cwiseAbs().maxCoeff(), limits.velocity) << of << ", joint " << j + 1;
    EXPECT_LT(ddq.col(j).cwiseAbs().maxCoeff(), limits.acceleration) << of << ", joint " << j + 1;
    EXPECT_LT(jerk.col(j).cwiseAbs().maxCoeff(), limits.jerk) << of << ", joint " << j + 1;
  }
  const Eigen::Index last = motion.samples() - 1;
  for (const Eigen::Index end : {Eigen::Index{0}, last})
    EXPECT_LT(motion.dq.row(end).norm() + motion.ddq.row(end).norm(), 1e-9) << of;

  const KDL::Chain chain = to_kdl(robot);
  KDL::ChainIdSolver_RNE solver(chain, KDL::Vector(robot.gravity.x(), robot.gravity.y(), robot.gravity.z()));
  const unsigned n = static_cast<unsigned>(robot.size());
  KDL::JntArray q(n), v(n), a(n), tau(n);
  const KDL::Wrenches none(chain.getNrOfSegments(), KDL::Wrench::Zero());
  KdlPoses poses(robot);
  for (Eigen::Index i = 0; i <= last; i += 5) {
    q.data = motion.q.row(i).transpose();
    v.data = motion.dq.row(i).transpose();
    a.data = motion.ddq.row(i).transpose();
    ASSERT_EQ(solver.CartToJnt(q, v, a, none, tau), 0);
    for (int j = 0; j < robot.size(); ++j) {
      const Joint& joint = robot.joints[static_cast<std::size_t>(j)];
      const SigmoidFriction& f = joint.friction.sigmoid;
      const double friction = f.phi1 / (1.0 + std::exp(-f.phi2 * (v.data[j] + f.phi3))) -
                              f.phi1 / (1.0 + std::exp(-f.phi2 * f.phi3));
      ASSERT_LT(std::abs(tau.data[j] + friction), joint.limits.torque)
          << of << ", joint " << j + 1 << ", " << i;
    }
    const Eigen::Vector3d margins = clearance(collision, robot.size(), poses(q.data));
    ASSERT_GT(margins.minCoeff(), 0.0) << of << ", sample " << i << ": " << margins.transpose();
  }
}

double margin_of(const Excitation& found, const std::string& name) {
  double least = 1e9;
  for (const LimitMargin& margin : found.margins)
    if (margin.name == name) least = std::min(least, margin.margin);
  return least;
}

class Motions : public ::testing::TestWithParam<MotionShape> {};

TEST_P(Motions, DerivativesAreThoseOfTheSeriesAndTheEndsRest) {
  const MotionShape shape = GetParam();
  std::mt19937 random(7);
  std::normal_distribution<double> normal;
  Eigen::MatrixXd c(2 * shape.harmonics, 2);
  for (double& x : c.reshaped()) x = normal(random);
  const Eigen::MatrixXd projection = rest_projection(shape);
  EXPECT_LT((projection * projection - projection).norm(), 1e-12);
  const ExcitingMotion motion(shape, projection * c, Eigen::Vector2d(0.3, -1.0));
  EXPECT_GT(motion.coefficients().norm(), 0.1);
  Eigen::MatrixXd jerk;
  const auto samples = static_cast<Eigen::Index>(shape.duration * 2000.0);
  const Trajectory at = motion.at(Eigen::VectorXd::LinSpaced(samples + 1, 0.0, shape.duration), &jerk);
  const double step = shape.duration / double(samples);
  const auto expect_derivative = [&](const Eigen::MatrixXd& dx, const Eigen::MatrixXd& x) {
    // A ramped motion's jerk is continuous, with kinks where a ramp ends.
    const double rounded = shape.kind == MotionKind::ramped && &dx == &jerk ? 0.05 : 2e-4;
    EXPECT_LT((differences(x, step) - dx.middleRows(1, dx.rows() - 2)).cwiseAbs().maxCoeff(), rounded);
  };
  expect_derivative(at.dq, at.q);
  expect_derivative(at.ddq, at.dq);
  expect_derivative(jerk, at.ddq);
  for (const Eigen::Index end : {Eigen::Index{0}, samples})
    EXPECT_LT(at.dq.row(end).norm() + at.ddq.row(end).norm(), 1e-11);
  const Trajectory sampled = motion.sampled(1000.0);
  EXPECT_EQ(sampled.t[sampled.samples() - 1], shape.duration);
  EXPECT_EQ(sampled.dq.row(0).norm() + sampled.ddq.row(sampled.samples() - 1).norm(), 0.0);
  if (shape.kind == MotionKind::ramped) {  // the middle is the series itself, period after period
    const double period = 2.0 * M_PI / shape.omega;
    const Trajectory one =
        motion.at(Eigen::VectorXd::LinSpaced(50, shape.ramp, shape.duration - shape.ramp - period));
    const Trajectory next = motion.at(Eigen::VectorXd(one.t.array() + period));
    EXPECT_LT((one.q - next.q).cwiseAbs().maxCoeff(), 1e-12);
    EXPECT_LT((one.ddq - next.ddq).cwiseAbs().maxCoeff(), 1e-11);
  }
}

INSTANTIATE_TEST_SUITE_P(Shapes, Motions,
                         ::testing::Values(MotionShape{MotionKind::fourier, 5, 2.0 * M_PI / 21.0, 21.0, 0.0},
                                           MotionShape{MotionKind::fourier, 3, 2.0 * M_PI / 5.0, 10.0, 0.0},
                                           MotionShape{MotionKind::fourier, 5, 0.4712, 21.0, 0.0},
                                           MotionShape{MotionKind::ramped, 5, 0.4712, 30.0, 1.0},
                                           MotionShape{MotionKind::ramped, 1, 2.0, 8.0, 2.0}));

TEST(RestProjection, KeepsTwoConditionsWhereTheEndsCoincideAndFourElsewhere) {
  EXPECT_NEAR(rest_projection({MotionKind::fourier, 5, 2.0 * M_PI / 10.5, 21.0, 0.0}).trace(), 8.0, 1e-9);
  EXPECT_NEAR(rest_projection({MotionKind::fourier, 5, 2.0 * M_PI / 13.0, 21.0, 0.0}).trace(), 6.0, 1e-9);
  EXPECT_NEAR(rest_projection({MotionKind::ramped, 5, 2.0 * M_PI / 13.0, 21.0, 1.0}).trace(), 10.0, 1e-9);
}

TEST(ExciteObjective, GradientIsThatOfTheValue) {
  Robot robot = test::panda();
  for (Joint& joint : robot.joints) {  // so that every penalty takes part
    joint.limits.torque *= 0.3;
    joint.limits.velocity *= 0.3;
    joint.limits.acceleration *= 0.05;
    joint.limits.jerk *= 2e-4;
    joint.rotor_inertia = 0.2;
  }
  CollisionModel collision = panda_collision(robot);
  collision.clearance = 0.15;
  collision.boxes.push_back({"table",
                             {0.5, 0.0, 0.3},
                             Eigen::Quaterniond(Eigen::AngleAxisd(0.4, Eigen::Vector3d::UnitZ())),
                             {0.3, 0.4, 0.6}});
  std::mt19937 random(3);
  std::normal_distribution<double> normal;
  for (const bool rotor : {false, true})
    for (const MotionKind kind : {MotionKind::fourier, MotionKind::ramped})
      for (const auto criterion : {ExcitationCriterion::condition, ExcitationCriterion::determinant}) {
        ExciteOptions options;
        options.criterion = criterion;
        options.regressor.rotor_inertia = rotor;
        options.regressor.weights = Eigen::VectorXd::LinSpaced(7, 0.5, 2.0);
        const BaseParameters base = base_parameters(robot, rotor);
        const MotionShape shape{kind, 3, 2.0 * M_PI / 7.0, 10.0, 1.0};
        detail::ExciteObjective objective(robot, base, collision, options, shape, true);
        objective.set_stage(6, 0.1);
        Eigen::MatrixXd c(6, 7);
        for (double& x : c.reshaped()) x = 0.4 * normal(random);
        Eigen::VectorXd offset(7);
        for (int j = 0; j < 7; ++j) {
          const JointLimits& limits = robot.joints[static_cast<std::size_t>(j)].limits;
          offset[j] = 0.5 * (limits.lower + limits.upper) + 0.3 * normal(random);
        }
        Eigen::VectorXd x = objective.unknowns(c, offset), gradient(objective.size());
        ASSERT_TRUE(std::isfinite(objective(x, gradient.data())));
        double error = 0.0;
        for (int k = 0; k < objective.size(); ++k) {
          const double h = 1e-6, here = x[k];
          x[k] = here + h;
          const double above = objective(x, nullptr);
          x[k] = here - h;
          const double below = objective(x, nullptr);
          x[k] = here;
          error = std::max(error, std::abs((above - below) / (2.0 * h) - gradient[k]));
        }
        EXPECT_LT(error, 1e-4 * (1.0 + gradient.cwiseAbs().maxCoeff()))
            << "criterion " << int(criterion) << ", kind " << int(kind) << ", rotor " << rotor;
      }
}

TEST(Clearances, AreThoseOfSegments) {
  const Robot robot = test::panda();
  CollisionModel collision = panda_collision(robot);
  collision.boxes.push_back({"table",
                             {0.5, 0.1, 0.3},
                             Eigen::Quaterniond(Eigen::AngleAxisd(0.4, Eigen::Vector3d::UnitZ())),
                             {0.3, 0.4, 0.6}});
  detail::Clearances clearances(robot, collision);
  const Model<> model(robot);
  Workspace<> workspace(model);
  std::vector<Eigen::Isometry3d> poses(8);
  std::vector<detail::Proximity> near;
  KdlPoses kdl(robot);
  std::mt19937 random(5);
  std::uniform_real_distribution<double> uniform(-2.8, 2.8);
  int overlaps = 0;
  for (int k = 0; k < 300; ++k) {
    Eigen::VectorXd q(7);
    for (double& x : q) x = uniform(random);
    forward_kinematics(model, workspace, q, poses);
    clearances.near(poses, 1e9, near);
    ASSERT_EQ(near.size(), clearances.pairs().size());
    Eigen::Vector3d least = Eigen::Vector3d::Constant(1e9);
    for (const detail::Proximity& one : near) {
      const auto kind = static_cast<int>(clearances.pairs()[static_cast<std::size_t>(one.pair)].kind);
      least[kind] = std::min(least[kind], one.distance - collision.clearance);
    }
    const Eigen::Vector3d expected = clearance(collision, 7, kdl(q));
    EXPECT_NEAR(least[0], expected[0], 1e-9) << "pose " << k << ": " << q.transpose();
    EXPECT_NEAR(least[1], expected[1], 1e-12) << "pose " << k << ": " << q.transpose();
    if (expected[0] < -collision.clearance) ++overlaps;
    if (expected[2] > -0.02) {
      EXPECT_NEAR(least[2], expected[2], 1e-5) << "pose " << k << ": " << q.transpose();
    } else {
      EXPECT_LT(least[2], 0.0) << "pose " << k << ": " << q.transpose();
    }
  }
  EXPECT_GT(overlaps, 10);  // the case was met
}

TEST(ExcitationFactor, IsTheStackedRegressor) {
  const Robot robot = test::panda();
  const BaseParameters base = base_parameters(robot);
  const Log log = test::synthetic_log(robot, 4, 10.0, 20.0);
  Trajectory motion;
  motion.t = log.t;
  motion.q = log.q;
  motion.dq = log.dq;
  motion.ddq = Eigen::MatrixXd::Random(log.samples(), 7);
  RegressorOptions options;
  options.weights = Eigen::VectorXd::LinSpaced(7, 1.0, 3.0);
  Eigen::MatrixXd stack = Eigen::MatrixXd::Zero(7 * motion.samples(), base.size() + 21);
  const Model<> model(robot);
  Workspace<> workspace(model);
  Eigen::VectorXd tau(7);
  for (int c = 0; c < base.size(); ++c) {  // a column is the torque of a unit of its parameter
    const Model<> one =
        model.with_parameters(Eigen::VectorXd::Unit(70, base.columns[static_cast<std::size_t>(c)]));
    for (Eigen::Index i = 0; i < motion.samples(); ++i) {
      inverse_dynamics(one, workspace, motion.q.row(i).transpose(), motion.dq.row(i).transpose(),
                       motion.ddq.row(i).transpose(), tau);
      stack.col(c).segment(7 * i, 7) = tau;
    }
  }
  for (Eigen::Index i = 0; i < motion.samples(); ++i)
    for (int j = 0; j < 7; ++j) {
      const double dq = motion.dq(i, j);
      stack.block<1, 3>(7 * i + j, base.size() + 3 * j) << dq, (dq > 0.0) - (dq < 0.0), 1.0;
      stack.row(7 * i + j) *= options.weights[j];
    }
  const Eigen::VectorXd s = Eigen::JacobiSVD<Eigen::MatrixXd>(stack).singularValues();
  const TriangularFactor factor = excitation_factor(robot, base, motion, options);
  EXPECT_EQ(factor.columns(), 64);
  EXPECT_NEAR(condition_number(factor), s[0] / s[63], 1e-8 * s[0] / s[63]);
}

TEST(Excite, KeepsEveryLimitOfThePanda) {
  const Robot robot = test::panda();
  CollisionModel collision = panda_collision(robot);
  for (const MotionKind kind : {MotionKind::fourier, MotionKind::ramped}) {
    const std::string of = kind == MotionKind::fourier ? "fourier" : "ramped";
    ExciteOptions options = quick();
    options.kind = kind;
    if (kind == MotionKind::ramped)  // a table too
      collision.boxes.push_back({"table", {0.7, 0.0, 0.2}, Eigen::Quaterniond::Identity(), {0.5, 1.0, 0.4}});
    const Excitation found = excite(robot, collision, options);
    ASSERT_TRUE(found.feasible) << of;
    EXPECT_EQ(found.columns, 64);
    EXPECT_LT(found.condition_number, 150.0) << of;
    EXPECT_EQ(found.runs.size(), 2u);
    const Trajectory motion = found.motion.sampled(1000.0);
    expect_within_limits(robot, collision, motion, of);
    // The margins reported are those of the motion, the limiting one the least.
    KdlPoses poses(robot);
    Eigen::Vector3d least = Eigen::Vector3d::Constant(1e9);
    for (Eigen::Index i = 0; i < motion.samples(); i += 5)
      least = least.cwiseMin(clearance(collision, 7, poses(motion.q.row(i).transpose())));
    EXPECT_NEAR(margin_of(found, "self_collision"), least[0], 1e-4) << of;
    EXPECT_NEAR(margin_of(found, "floor"), least[1], 1e-4) << of;
    if (kind == MotionKind::ramped) {
      EXPECT_NEAR(margin_of(found, "box"), least[2], 1e-4);
    }
    EXPECT_EQ(found.margins.size(), 5u * 7u + (kind == MotionKind::ramped ? 3u : 2u));
    ASSERT_GE(found.limiting, 0);
    for (const LimitMargin& margin : found.margins) {
      EXPECT_GE(margin.share, found.margins[static_cast<std::size_t>(found.limiting)].share);
      if (margin.name == "velocity") {
        EXPECT_NEAR(margin.margin,
                    robot.joints[static_cast<std::size_t>(margin.joint - 1)].limits.velocity -
                        motion.dq.col(margin.joint - 1).cwiseAbs().maxCoeff(),
                    1e-9);
      }
    }
  }
}

TEST(Excite, BeatsTheLettersMotion) {
  const char* data = std::getenv("DYNID_DATA");
  if (data == nullptr) GTEST_SKIP() << "DYNID_DATA is not set: panda_published/tables.yaml is not there";
  const YAML::Node table =
      YAML::LoadFile(std::string(data) + "/panda_published/tables.yaml")["exciting_trajectory"];
  MotionShape shape{MotionKind::fourier, 5, table["omega"].as<double>(), table["seconds"].as<double>(), 0.0};
  Eigen::MatrixXd c(10, 7);
  Eigen::VectorXd offset(7);
  for (int j = 0; j < 7; ++j) {
    offset[j] = table["q0"][j].as<double>();
    for (int l = 0; l < 5; ++l) {
      c(l, j) = table["a"][l][j].as<double>();
      c(5 + l, j) = table["b"][l][j].as<double>();
    }
  }
  const Robot robot = test::panda();
  const BaseParameters base = base_parameters(robot);
  const double theirs =
      condition_number(excitation_factor(robot, base, ExcitingMotion(shape, c, offset).sampled(200.0)));
  const Excitation found = excite(robot, panda_collision(robot), quick(4, 60));
  EXPECT_TRUE(found.feasible);
  EXPECT_LT(found.condition_number, 2.0 / 3.0 * theirs);
}

TEST(Excite, DependsOnTheSeedAloneWhateverTheThreads) {
  const Robot robot = test::panda();
  ExciteOptions options = quick(3, 20);
  options.threads = 1;
  const Excitation one = excite(robot, panda_collision(robot), options);
  options.threads = 3;
  const Excitation three = excite(robot, panda_collision(robot), options);
  EXPECT_EQ(one.motion.coefficients(), three.motion.coefficients());
  EXPECT_EQ(one.motion.offset(), three.motion.offset());
  options.seed = 2;
  EXPECT_NE(one.motion.coefficients(), excite(robot, panda_collision(robot), options).motion.coefficients());
}

TEST(Excite, EachCriterionWinsByItsOwnMeasure) {
  const Robot robot = test::panda();
  ExciteOptions options = quick(1, 60);
  options.base_period = 10.5;
  const Excitation condition = excite(robot, {}, options);
  options.criterion = ExcitationCriterion::determinant;
  const Excitation determinant = excite(robot, {}, options);
  EXPECT_LT(condition.condition_number, determinant.condition_number);
  EXPECT_GT(determinant.log_determinant, condition.log_determinant);
}

TEST(Excite, TorqueLimitsBind) {
  Robot robot = test::panda();
  robot.joints[1].limits.torque = 45.0;  // holds the arm where it is folded alone
  const Excitation found = excite(robot, {}, quick());
  ASSERT_TRUE(found.feasible);
  expect_within_limits(robot, {}, found.motion.sampled(1000.0), "weak shoulder");
  EXPECT_LT(margin_of(found, "torque"), 10.0);
}

TEST(Excite, RefusesImpossibleLimitsByName) {
  const Robot panda = test::panda();
  const auto with = [&](auto change) {
    Robot robot = panda;
    change(robot.joints[2].limits);
    return robot;
  };
  const ExciteOptions options = quick(1, 10);
  EXPECT_REFUSED(excite(with([](JointLimits& l) { l.lower = 3.0; }), {}, options),
                 "joint 3 ('panda_joint3'): the lower");
  EXPECT_REFUSED(excite(with([](JointLimits& l) { l.upper = l.lower; }), {}, options),
                 "joint 3 ('panda_joint3'): the position limits");
  EXPECT_REFUSED(excite(with([](JointLimits& l) { l.velocity = 0.0; }), {}, options),
                 "joint 3 ('panda_joint3'): velocity limit 0");
  EXPECT_REFUSED(excite(with([](JointLimits& l) { l.velocity = 1e-4; }), {}, options),
                 "joint 3 ('panda_joint3'): the velocity limit lets");
  EXPECT_REFUSED(excite(with([](JointLimits& l) { l.acceleration = 1e-5; }), {}, options),
                 "joint 3 ('panda_joint3'): the acceleration limit lets");
  EXPECT_REFUSED(excite(with([](JointLimits& l) { l.jerk = 1e-5; }), {}, options),
                 "joint 3 ('panda_joint3'): the jerk limit lets");
  EXPECT_REFUSED(excite(with([](JointLimits& l) { l = {}; }), {}, options),
                 "joint 3 ('panda_joint3'): has no lower");
  Robot weak = panda;
  weak.joints[3].limits = {-1.6, -1.5, 2.0, 10.0, 1e4, 0.5, 1000.0};
  weak.joints[1].limits = {1.5, 1.6, 2.0, 10.0, 1e4, 0.5, 1000.0};
  EXPECT_REFUSED(excite(weak, {}, options), "joint 2 ('panda_joint2'): the torque limit 0.5 holds none");

  CollisionModel touching = panda_collision(panda);
  touching.ignore.clear();
  EXPECT_REFUSED(excite(panda, touching, options), "panda_link1 and panda_link3 are at most");
  CollisionModel buried = panda_collision(panda);
  buried.floor = 0.5;
  EXPECT_REFUSED(excite(panda, buried, options), "panda_link1 and floor are at most");
  CollisionModel walled = panda_collision(panda);
  walled.boxes.push_back({"wall", {0.0, 0.0, 0.3}, Eigen::Quaterniond::Identity(), {0.2, 0.2, 0.2}});
  EXPECT_REFUSED(excite(panda, walled, options), "panda_link1 and wall are at most");

  ExciteOptions wrong = options;
  wrong.regressor.weights = Eigen::VectorXd::Ones(3);
  EXPECT_REFUSED(excite(panda, {}, wrong), "3 weights for 7 joints");
  wrong = options;
  wrong.harmonics = 1;
  EXPECT_REFUSED(excite(panda, {}, wrong), "at least two harmonics");
  wrong.harmonics = 2;
  wrong.base_period = 13.0;
  EXPECT_REFUSED(excite(panda, {}, wrong), "cannot start and end at rest");
  wrong = options;
  wrong.kind = MotionKind::ramped;
  wrong.ramp = 11.0;
  EXPECT_REFUSED(excite(panda, {}, wrong), "do not fit");
}

TEST(Excite, SaysWhereNothingWithinTheLimitsWasFound) {
  const Robot robot = test::panda();
  CollisionModel collision = panda_collision(robot);
  collision.floor = 0.0;
  // A cage that leaves single poses but no room to move.
  collision.boxes = {{"lid", {0.0, 0.0, 0.75}, Eigen::Quaterniond::Identity(), {2.0, 2.0, 0.05}}};
  collision.ignore.emplace_back("panda_link3", "lid");
  const Excitation found = excite(robot, collision, quick(1, 20));
  EXPECT_EQ(found.feasible, found.margins[static_cast<std::size_t>(found.limiting)].margin >= 0.0);
}

TEST(CollisionFile, RefusesByLineAndKey) {
  const Robot robot = test::panda();
  const std::string head = "format: dynid-collision-1\n";
  const std::string capsule =
      "capsules:\n  - {link: panda_link0, from: [0, 0, 0], to: [0, 0, 1], radius: 0.1}\n";
  const auto read = [&](const std::string& text) { return parse_collision(text, "c.yaml", robot); };
  const CollisionModel model =
      read(head + "floor: -0.1\n" + capsule +
           "boxes:\n  - {name: b, rpy: [0, 0, 1.5707963267948966], size: [1, 2, 3]}\n"
           "ignore:\n  - [panda_link0, b]\n");
  EXPECT_EQ(model.floor, -0.1);
  EXPECT_EQ(model.capsules[0].frame, 0);
  EXPECT_LT((model.boxes[0].turn * Eigen::Vector3d::UnitX() - Eigen::Vector3d::UnitY()).norm(), 1e-12);
  EXPECT_EQ(read(head + "capsules: [{link: panda_link8, from: [0, 0, 0], to: [0, 0, 0], radius: 1}]")
                .capsules[0]
                .frame,
            8);
  EXPECT_REFUSED(read("format: other\n" + capsule), "c.yaml:1: format");
  EXPECT_REFUSED(read(head), "capsules: missing");
  EXPECT_REFUSED(read(head + "wall: 1\n" + capsule), "c.yaml:2: unknown key 'wall'");
  EXPECT_REFUSED(read(head + "clearance: -1\n" + capsule), "c.yaml:2: clearance: is negative");
  EXPECT_REFUSED(read(head + "capsules:\n  - {link: nose, from: [0, 0, 0], to: [0, 0, 1], radius: 0.1}\n"),
                 "c.yaml:3: capsules[1].link: robot 'panda' has no link 'nose'");
  EXPECT_REFUSED(
      read(head + "capsules:\n  - {link: panda_link0, from: [0, 0], to: [0, 0, 1], radius: 0.1}\n"),
      "capsules[1].from: expected 3 numbers, found ");
  EXPECT_REFUSED(
      read(head + "capsules:\n  - {link: panda_link0, from: [0, 0, 0], to: [0, 0, 1], radius: 0}\n"),
      "capsules[1].radius: expected a positive number, found 0");
  EXPECT_REFUSED(read(head + capsule + "boxes:\n  - {name: b, size: [1, -1, 1]}\n"),
                 "boxes[1].size: is not positive");
  EXPECT_REFUSED(read(head + capsule + "ignore:\n  - [panda_link0, moon]\n"), "ignore[1][2]: 'moon'");
  EXPECT_REFUSED(read(head + "capsules: ["), "c.yaml:");
}

}  // namespace
}  // namespace dynid
