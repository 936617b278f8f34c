// SPDX-License-Identifier: Apache-2.0
// A real Panda without contact: what the identified model leaves, against what the published one does.
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdlib>
#include <vector>

#include "dynamics/chains.hpp"
#include "dynid/estimation/torque_estimator.hpp"
#include "dynid/identification/identify.hpp"

namespace dynid::test {
namespace {

using Vector7 = Eigen::Matrix<double, 7, 1>;

/// |r| that 99 % of the samples stay below, joint by joint, after the first second.
Vector7 residual_99(const Robot& robot, const Log& log, const TorqueEstimatorOptions& options) {
  TorqueEstimator<7> estimator(robot, options);
  std::vector<std::vector<double>> sizes(7);
  for (Eigen::Index k = 0; k < log.samples(); ++k) {
    const double dt = k > 0 ? log.t[k] - log.t[k - 1] : 0.0;
    const Estimate<7>& e =
        estimator.step(dt, log.q.row(k).transpose(), log.dq.row(k).transpose(), log.tau.row(k).transpose());
    EXPECT_FALSE(has(e.status, Status::bad_input | Status::gap | Status::time_went_back)) << "row " << k;
    if (log.t[k] - log.t[0] < 1.0) continue;
    for (int j = 0; j < 7; ++j) sizes[static_cast<std::size_t>(j)].push_back(std::abs(e.residual[j]));
  }
  Vector7 bound;
  for (int j = 0; j < 7; ++j) {
    std::vector<double>& s = sizes[static_cast<std::size_t>(j)];
    const auto at = s.begin() + static_cast<std::ptrdiff_t>(0.99 * static_cast<double>(s.size()));
    std::nth_element(s.begin(), at, s.end());
    bound[j] = *at;
  }
  return bound;
}

class Recorded : public testing::Test {
 protected:
  void SetUp() override {
    const char* data = std::getenv("DYNID_DATA");
    if (data == nullptr) GTEST_SKIP() << "DYNID_DATA is not set";
    path_ = std::string(data) + "/panda_real/exciting.csv";
  }
  std::string path_;
};

TEST_F(Recorded, IdentifiedModelLeavesLittleWithoutContact) {
  const Robot published = panda();
  const Log log = read_log(path_);
  const Vector7 most = (Vector7() << 0.6, 1.0, 0.6, 0.6, 0.35, 0.25, 0.2).finished();
  for (const FrictionLaw law : {FrictionLaw::linear, FrictionLaw::sigmoid}) {
    IdentifyOptions identification;
    identification.friction = law;
    identification.validate = law == FrictionLaw::sigmoid;
    const Robot identified = identify(published, {log}, {}, identification).robot;
    for (const bool second : {false, true}) {
      // Mean delay 100 ms, or 50 ms where the second order takes the noise of dq away.
      TorqueEstimatorOptions options;
      options.gain = Eigen::VectorXd::Constant(1, second ? 20.0 : 10.0);
      if (second) options.order = ObserverOrder::second;
      const Vector7 ours = residual_99(identified, log, options);
      const Vector7 theirs = residual_99(published, log, options);
      const std::string what = std::string(law == FrictionLaw::linear ? "linear" : "sigmoid") +
                               (second ? ", second order, K 20" : ", first order, K 10");
      std::printf("%s:", what.c_str());
      for (int j = 0; j < 7; ++j) std::printf(" %.3f (%.3f)", ours[j], theirs[j]);
      std::printf("\n");
      for (int j = 0; j < 7; ++j) EXPECT_LT(ours[j], most[j]) << what << ", joint " << j + 1;
      for (int j = 0; j < 4; ++j) EXPECT_LT(ours[j], theirs[j] * 2 / 3) << what << ", joint " << j + 1;
    }
  }
}

}  // namespace
}  // namespace dynid::test
