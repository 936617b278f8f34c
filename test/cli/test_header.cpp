// SPDX-License-Identifier: Apache-2.0
// The header first: it has to stand on its own.
#include <panda_model.hpp>

#include <gtest/gtest.h>

#include <random>

#include "dynid/dynamics/dynamics.hpp"
#include "dynid/model/yaml.hpp"

namespace dynid {
namespace {

static_assert(panda_model::joints == 7);
static_assert(panda_model::gravity[2] < -9.8);

TEST(ExportHeader, IsTheModelOfTheFile) {
  const Robot file = read_model(std::string(DYNID_SOURCE_DIR) + "/config/panda.yaml").robot;
  const Robot header = panda_model::make_robot<Robot>();
  EXPECT_EQ(header.name, file.name);
  EXPECT_EQ(header.base_link, file.base_link);
  EXPECT_EQ(header.tip_link, file.tip_link);
  EXPECT_EQ(header.tip.matrix(), file.tip.matrix());
  EXPECT_EQ(header.gravity, file.gravity);
  ASSERT_EQ(header.size(), file.size());
  for (std::size_t k = 0; k < 7; ++k) {
    SCOPED_TRACE("joint " + std::to_string(k + 1));
    const Joint &a = header.joints[k], &b = file.joints[k];
    EXPECT_EQ(a.name, b.name);
    EXPECT_EQ(a.link_name, b.link_name);
    EXPECT_EQ(a.type, b.type);
    EXPECT_EQ(a.origin.matrix(), b.origin.matrix());
    EXPECT_EQ(a.axis, b.axis);
    EXPECT_EQ(a.parameters, b.parameters);
    EXPECT_EQ(a.rotor_inertia, b.rotor_inertia);
    EXPECT_EQ(a.limits.lower, b.limits.lower);
    EXPECT_EQ(a.limits.upper, b.limits.upper);
    EXPECT_EQ(a.limits.velocity, b.limits.velocity);
    EXPECT_EQ(a.limits.acceleration, b.limits.acceleration);
    EXPECT_EQ(a.limits.jerk, b.limits.jerk);
    EXPECT_EQ(a.limits.torque, b.limits.torque);
    EXPECT_EQ(a.limits.torque_rate, b.limits.torque_rate);
    EXPECT_EQ(a.friction.linear.viscous, b.friction.linear.viscous);
    EXPECT_EQ(a.friction.linear.coulomb, b.friction.linear.coulomb);
    EXPECT_EQ(a.friction.linear.offset, b.friction.linear.offset);
    EXPECT_EQ(a.friction.linear.velocity_scale, b.friction.linear.velocity_scale);
    EXPECT_EQ(a.friction.sigmoid.phi1, b.friction.sigmoid.phi1);
    EXPECT_EQ(a.friction.sigmoid.phi2, b.friction.sigmoid.phi2);
    EXPECT_EQ(a.friction.sigmoid.phi3, b.friction.sigmoid.phi3);
  }
  const Model<7> ours(header), theirs(file);
  Workspace<7> ws(ours);
  std::mt19937 generator(1);
  std::normal_distribution<double> normal;
  for (int state = 0; state < 100; ++state) {
    Eigen::Matrix<double, 7, 1> q, dq, ddq, a, b;
    for (int j = 0; j < 7; ++j) {
      q[j] = normal(generator);
      dq[j] = normal(generator);
      ddq[j] = normal(generator);
    }
    inverse_dynamics(ours, ws, q, dq, ddq, a);
    inverse_dynamics(theirs, ws, q, dq, ddq, b);
    EXPECT_LE((a - b).cwiseAbs().maxCoeff(), 1e-12);
  }
}

}  // namespace
}  // namespace dynid
