// SPDX-License-Identifier: Apache-2.0
#include "dynid/model/link_inertia.hpp"

#include <gtest/gtest.h>

#include <Eigen/Cholesky>

#include "random_robot.hpp"

namespace dynid {
namespace {

using test::Random;

/// A body of point masses: what every inertia is made of.
struct Cloud {
  std::vector<double> masses;
  std::vector<Eigen::Vector3d> points;
};

Cloud random_cloud(Random& random) {
  Cloud cloud;
  for (int k = 0; k < 6; ++k) {
    cloud.masses.push_back(test::uniform(random, 0.1, 2.0));
    cloud.points.push_back(test::random_vector(random, 0.5));
  }
  return cloud;
}

Eigen::Matrix3d inertia_about(const Cloud& cloud, const Eigen::Vector3d& centre) {
  Eigen::Matrix3d J = Eigen::Matrix3d::Zero();
  for (std::size_t k = 0; k < cloud.masses.size(); ++k) {
    const Eigen::Vector3d r = cloud.points[k] - centre;
    J += cloud.masses[k] * (r.squaredNorm() * Eigen::Matrix3d::Identity() - r * r.transpose());
  }
  return J;
}

StandardParameters standard_of(const Cloud& cloud) {
  StandardParameters p = StandardParameters::Zero();
  for (std::size_t k = 0; k < cloud.masses.size(); ++k) {
    p[0] += cloud.masses[k];
    p.segment<3>(1) += cloud.masses[k] * cloud.points[k];
  }
  set_inertia_tensor(p, inertia_about(cloud, Eigen::Vector3d::Zero()));
  return p;
}

class LinkInertiaLaws : public ::testing::TestWithParam<unsigned> {
 protected:
  Random random{GetParam()};
};

TEST_P(LinkInertiaLaws, CentralAndStandardParametersAreThoseOfPointMasses) {
  const Cloud cloud = random_cloud(random);
  const StandardParameters p = standard_of(cloud);
  const LinkInertia link = from_standard(p);
  const Eigen::Vector3d com = p.segment<3>(1) / p[0];
  EXPECT_NEAR(link.mass, p[0], 1e-14);
  EXPECT_LT((link.com - com).norm(), 1e-14);
  EXPECT_LT((link.inertia - inertia_about(cloud, com)).norm(), 1e-13);
  EXPECT_LT((to_standard(link) - p).norm(), 1e-14);  // eq. (26) both ways
}

TEST_P(LinkInertiaLaws, PseudoInertiaIsTheSecondMomentOfPointMasses) {
  const Cloud cloud = random_cloud(random);
  const StandardParameters p = standard_of(cloud);
  Eigen::Matrix4d sum = Eigen::Matrix4d::Zero();
  for (std::size_t k = 0; k < cloud.masses.size(); ++k) {
    const Eigen::Vector4d x = cloud.points[k].homogeneous();
    sum += cloud.masses[k] * x * x.transpose();
  }
  EXPECT_LT((pseudo_inertia(p) - sum).norm(), 1e-13);
  EXPECT_LT((from_pseudo_inertia(pseudo_inertia(p)) - p).norm(), 1e-14);
}

TEST_P(LinkInertiaLaws, TransformedIsTheBodyOfMovedPointMasses) {
  const Cloud cloud = random_cloud(random);
  const Eigen::Isometry3d pose = test::random_pose(random);
  Cloud moved = cloud;
  for (Eigen::Vector3d& point : moved.points) point = pose * point;
  const StandardParameters p = standard_of(cloud);
  const StandardParameters expected = standard_of(moved);
  EXPECT_LT((transformed(p, pose) - expected).norm(), 1e-13);
  EXPECT_LT((transform_matrix(pose) * p - expected).norm(), 1e-13);
}

TEST_P(LinkInertiaLaws, MarginsAreFreeOfTheFrame) {
  const StandardParameters p = to_standard(test::random_link(random));
  const ConsistencyMargins here = consistency_margins(p);
  const ConsistencyMargins there = consistency_margins(transformed(p, test::random_pose(random)));
  EXPECT_GT(here.triangle, 0.0);
  EXPECT_NEAR(here.mass, there.mass, 1e-13);
  EXPECT_NEAR(here.triangle, there.triangle, 1e-12);
}

INSTANTIATE_TEST_SUITE_P(Seeds, LinkInertiaLaws, ::testing::Range(1U, 51U));

TEST(LinkInertia, PseudoInertiaIsPositiveDefiniteExactlyWhenTheMarginsArePositive) {
  Random random(7);
  int definite = 0;
  constexpr int cases = 20000;
  for (int k = 0; k < cases; ++k) {
    StandardParameters p;
    p[0] = test::uniform(random, -0.3, 1.0);
    p.segment<3>(1) = test::random_vector(random, 0.2);
    Eigen::Vector3d moments(test::uniform(random, 0, 1), test::uniform(random, 0, 1),
                            test::uniform(random, 0, 1));
    const Eigen::Matrix3d R = test::random_rotation(random);
    set_inertia_tensor(p, R * moments.asDiagonal() * R.transpose());
    const ConsistencyMargins margins = consistency_margins(p);
    if (std::abs(margins.mass) < 1e-9 || std::abs(margins.triangle) < 1e-9)
      continue;  // on the border: rounding
    const Eigen::SelfAdjointEigenSolver<Eigen::Matrix4d> eigen(pseudo_inertia(p), Eigen::EigenvaluesOnly);
    const bool is_definite = eigen.eigenvalues()[0] > 0.0;
    definite += is_definite ? 1 : 0;
    ASSERT_EQ(is_definite, margins.mass > 0.0 && margins.triangle > 0.0)
        << "case " << k << ": " << p.transpose();
  }
  EXPECT_GT(definite, cases / 20);  // both sides were tried
  EXPECT_LT(definite, cases - cases / 20);
}

TEST(LinkInertia, NoMassHasNoCentreOfMass) {
  StandardParameters p;
  p << 0, 0.1, 0.2, 0.3, 1, 0, 1, 0, 0, 1;
  const LinkInertia link = from_standard(p);
  EXPECT_EQ(link.com, Eigen::Vector3d::Zero());
  EXPECT_EQ(link.inertia, inertia_tensor(p));
}

}  // namespace
}  // namespace dynid
