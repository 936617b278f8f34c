// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <array>
#include <cstddef>

namespace dynid {

/// Standard parameters of one link, in this order everywhere in the library:
/// `m, mx, my, mz, xx, xy, yy, xz, yz, zz`.
///
/// m [kg]; first moments m*c [kg m] and inertia [kg m^2] about the *origin* of the link frame, in its axes:
/// p_1, p_2, p_3 of eq. (3) of Gaz et al. 2019, regrouped link by link. Torque is linear in them, eq. (5).
/// The products of inertia are tensor entries (J_xy = -integral of x y), as in eq. (2).
using StandardParameters = Eigen::Matrix<double, 10, 1>;

/// Names of the ten standard parameters, in storage order.
inline constexpr std::array<const char*, 10> standard_parameter_names = {"m",  "mx", "my", "mz", "xx",
                                                                         "xy", "yy", "xz", "yz", "zz"};

/// Mass, centre of mass and central inertia of one link: what a person or a simulator reads.
struct LinkInertia {
  double mass = 0.0;                                  ///< m [kg]
  Eigen::Vector3d com = Eigen::Vector3d::Zero();      ///< c [m], in the link frame
  Eigen::Matrix3d inertia = Eigen::Matrix3d::Zero();  ///< I [kg m^2], about c, in the axes of the link frame
};

/// How far a link is from being physically impossible; every margin is >= 0 for a body that can exist.
struct ConsistencyMargins {
  double mass = 0.0;  ///< eq. (11): m [kg]
  double triangle =
      0.0;  ///< eq. (16): tr(I)/2 - lambda_max(I) [kg m^2]; implies eq. (12), I positive definite
  bool consistent(double tolerance = 0.0) const { return mass > -tolerance && triangle >= -tolerance; }
};

/// The symmetric 3 x 3 inertia tensor [kg m^2] held in entries 4..9 of `p`.
Eigen::Matrix3d inertia_tensor(const StandardParameters& p) noexcept;

/// Writes the symmetric tensor `J` [kg m^2] into entries 4..9 of `p`.
void set_inertia_tensor(StandardParameters& p, const Eigen::Matrix3d& J) noexcept;

/// Eq. (26): central inertia to standard parameters (parallel axis theorem). Exact for any mass.
StandardParameters to_standard(const LinkInertia& link) noexcept;

/// Inverse of eq. (26). A link whose mass is zero has no centre of mass: `com` is then zero and `inertia` the
/// tensor about the origin.
LinkInertia from_standard(const StandardParameters& p) noexcept;

/// The 4 x 4 pseudo-inertia [[Sigma, h], [h^T, m]], Sigma = tr(J)/2 1 - J about the origin (Wensing et al.
/// 2018). Positive definite exactly when eqs. (11) and (16) hold strictly.
Eigen::Matrix4d pseudo_inertia(const StandardParameters& p) noexcept;

/// Inverse of pseudo_inertia().
StandardParameters from_pseudo_inertia(const Eigen::Matrix4d& P) noexcept;

/// Margins of eqs. (11) and (16).
ConsistencyMargins consistency_margins(const LinkInertia& link) noexcept;
/// The same, from standard parameters.
ConsistencyMargins consistency_margins(const StandardParameters& p) noexcept;

/// The same body seen from another frame. `pose` is the pose of the frame of `p` in the new frame.
StandardParameters transformed(const StandardParameters& p, const Eigen::Isometry3d& pose) noexcept;

/// The 10 x 10 matrix T with transformed(p, pose) = T p (row-to-column: new = T * old).
Eigen::Matrix<double, 10, 10> transform_matrix(const Eigen::Isometry3d& pose) noexcept;

}  // namespace dynid

#include "dynid/model/link_inertia.ipp"
