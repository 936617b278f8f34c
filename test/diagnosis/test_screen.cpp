// SPDX-License-Identifier: Apache-2.0
// Laws of what is compared quickly: it says what the slow way says.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>
#include <utility>
#include <vector>

#include "diagnosis/evaluator.hpp"
#include "diagnosis/propose.hpp"
#include "diagnosis/screen.hpp"
#include "dynid/diagnosis/criteria.hpp"
#include "dynid/diagnosis/hypothesis.hpp"
#include "dynid/model/robot_file.hpp"
#include "dynid/signal/prepare.hpp"
#include "dynid/simulation/effect_catalogue.hpp"
#include "dynid/simulation/random_motion.hpp"
#include "dynid/simulation/simulate.hpp"

namespace dynid::detail {
namespace {

class Screened : public ::testing::Test {
 protected:
  static constexpr double kappa = 0.01;

  static Robot panda() { return read_model_file(DYNID_SOURCE_DIR "/config/panda.yaml").robot; }

  static std::vector<PreparedLog> logs() {
    const Robot robot = panda();
    SimulateOptions options;
    options.measurement = MeasurementOptions::realistic();
    options.rate = 250.0;
    options.seed = 11;
    options.record_torques = false;
    return {prepare(simulate(robot,
                             {parse_effect("torque_ripple:joints=2,amplitude=1.5,order=20", robot),
                              parse_effect("viscous_friction:joints=2+4,coefficient=4", robot)},
                             random_motion(robot, 12.0, 11), options)
                        .log)};
  }

  static const Hypothesis& effect(const std::string& name) { return *find_hypothesis(name); }

  UnitShape unit(const std::string& name, int joint) const {
    return by_.made(effect(name), joint, grid_points(rows_, effect(name), joint).front());
  }

  std::vector<PreparedLog> logs_ = logs();
  GapRows rows_{panda(), logs_};
  Criteria criteria_;
  Evaluator by_{rows_, criteria_};
  /// Viscous friction of joint 2, fitted.
  GapModel model_ = by_.evaluate({{&effect("viscous_friction"), {unit("viscous_friction", 1)}, 0.0}}, kappa);
  Base base_ = by_.base_of(model_);
};

TEST_F(Screened, WhiteningAndItsAdjointAreOne) {
  const ChannelNoise& noise = model_.fit.noise[1];
  ASSERT_FALSE(noise.ar.isZero(0.0));
  const Eigen::MatrixXd x = rows_.y.leftCols(3), white = whitened(rows_, x, noise);
  const Eigen::MatrixXd w = Eigen::MatrixXd::Random(white.rows(), 2);
  const Eigen::MatrixXd there = w.transpose() * white, back = whitened_back(rows_, w, noise).transpose() * x;
  EXPECT_LT((there - back).norm(), 1e-12 * there.norm());
}

// In double precision one block after the other, and in single precision all at once.
TEST_F(Screened, AGridIsScreenedAsItsPointsAreWeighed) {
  for (const char* name : {"torque_ripple", "stribeck_friction"}) {
    const Hypothesis& h = effect(name);
    for (const int joint : {0, 1, 3}) {
      std::vector<GridPoint> points;
      for (const Eigen::VectorXd& shape : grid_points(rows_, h, joint))
        points.push_back({shape, by_.made(h, joint, shape).block});
      const UnitGrid grid = unit_grid(rows_, h, joint, points);
      ASSERT_NE(grid.screen, nullptr) << name;
      const std::vector<SeenChannel>& channel = base_.channels[static_cast<std::size_t>(joint)].by;
      const std::vector<double> quick = grid.screen->gains(rows_, joint, channel);
      ASSERT_EQ(quick.size(), points.size());
      double most = 0.0;
      for (std::size_t k = 0; k < points.size(); ++k) {
        const double slow = quick_gain(rows_, joint, {points[k].block.get(), &h}, channel);
        EXPECT_NEAR(quick[k], slow, 0.01 + 1e-3 * slow)
            << name << " of joint " << joint + 1 << ", point " << k;
        most = std::max(most, slow);
      }
      if (joint == 1 && std::string(name) == "torque_ripple") {
        EXPECT_GT(most, 50.0) << "there is one to find";
      }
    }
  }
}

// From the best point of a grid, a refined shape gains what the best of a fine scan between its neighbours
// does.
TEST_F(Screened, ARefinedShapeGainsWhatAFineScanDoes) {
  constexpr int scanned = 300;
  constexpr double near_enough = 0.02;  // nats
  for (const auto& [name, joint] : {std::pair("torque_ripple", 1), std::pair("stribeck_friction", 3)}) {
    const Hypothesis& h = effect(name);
    const ShapeParameter p = rows_.shape(h, joint).at(0);
    const Channel& channel = base_.channels[static_cast<std::size_t>(joint)];
    int evaluations = 0;
    const auto gain = [&, joint = joint](const RowBlock& block) {
      ++evaluations;
      return by_.own_gain(h, joint, block, channel, kappa);
    };
    UnitShape best;
    double most = -std::numeric_limits<double>::infinity();
    for (const Eigen::VectorXd& shape : grid_points(rows_, h, joint)) {
      const UnitShape here = by_.made(h, joint, shape);
      if (const double g = gain(*here.block); g > most) most = g, best = here;
    }
    const double step = p.logarithmic ? std::pow(p.high / p.low, 1.0 / (p.points - 1))
                                      : (p.high - p.low) / (p.points - 1),
                 x = best.shape[0], low = std::max(p.low, p.logarithmic ? x / step : x - step),
                 high = std::min(p.high, p.logarithmic ? x * step : x + step);
    double scan = most;
    for (int k = 0; k <= scanned; ++k) {
      Eigen::VectorXd shape = best.shape;
      shape[0] = low + (high - low) * k / scanned;
      scan = std::max(scan, gain(*by_.made(h, joint, shape).block));
    }
    UnitShape refined = best;
    evaluations = 0;
    const double found = improve(by_, h, refined, 0, low, high, p.logarithmic, most, gain);
    EXPECT_LE(evaluations, 10) << name;
    EXPECT_GT(found, scan - near_enough) << name << ": " << most << " before";
    EXPECT_EQ(found, gain(*refined.block)) << name;
  }
}

// What is profiled out is what elimination leaves of the normal equations of all of them.
TEST_F(Screened, NormalEquationsBesideABaseAreThoseOfBothWithItEliminated) {
  for (const char* name : {"gear_coupling", "link_inertial_error", "payload"}) {
    const UnitShape more = unit(name, 0);
    const Term base = {model_.effects[0].units[0].block.get(), nullptr}, both = {more.block.get(), nullptr};
    const std::vector<Eigen::MatrixXd> beside = normal_equations_beside(rows_, base_.terms, *more.block);
    ASSERT_EQ(beside.size(), 2u);
    // The same by the information of all of them, base eliminated.
    const Eigen::MatrixXd all = information_of(rows_, {base, both}, model_.fit.noise, kappa);
    const Eigen::Index p = more.block->size();
    const Eigen::MatrixXd own =
        all.bottomRightCorner(p, p) - all.bottomLeftCorner(p, 1) * all.topRightCorner(1, p) / all(0, 0);
    EXPECT_LT((beside[1].leftCols(p) - own).norm(), 1e-6 * own.norm()) << name;
    // And the coefficients that they ask for.
    const Eigen::VectorXd joint_fit = answer_to(rows_, {base, both}, rows_.y, model_.fit.noise, kappa);
    const Eigen::VectorXd alone = beside[1].leftCols(p).ldlt().solve(beside[1].col(p));
    const Eigen::VectorXd taken = beside[1].leftCols(p) * (joint_fit.tail(p) - alone);
    EXPECT_LT(taken.norm(), 1e-5 * beside[1].col(p).norm()) << name;
  }
}

}  // namespace
}  // namespace dynid::detail
