// SPDX-License-Identifier: Apache-2.0
#include "export_common.hpp"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <set>

#include "conversions.hpp"
#include "dynid/base/error.hpp"
#include "dynid/base/number.hpp"
#include "dynid/base/text.hpp"
#include "not_expressed.hpp"

namespace dynid::detail::exporting {
namespace {

constexpr double unlimited = 1e16;  // what simulators write, and take, for a limit that there is not

}  // namespace

std::string number(double x) { return exact_number(x); }

std::string triple(const Eigen::Vector3d& v) {
  return number(v[0] + 0.0) + " " + number(v[1] + 0.0) + " " + number(v[2] + 0.0);  // -0 becomes 0
}

std::string attribute(const char* key, const std::string& value) {
  return std::string(" ") + key + "=\"" + xml_escaped(value) + "\"";
}

bool bounded(const JointLimits& limits) { return std::isfinite(limits.lower) || std::isfinite(limits.upper); }

std::string position_limit(double value) { return number(std::clamp(value, -unlimited, unlimited)); }

void check_names(const Robot& robot) {
  std::set<std::string> joints, links{robot.base_link};
  for (const Joint& joint : robot.joints) {
    if (!joints.insert(joint.name).second)
      throw Error("robot '" + robot.name + "': two joints are called '" + joint.name + "'");
    if (!links.insert(joint.link_name).second)
      throw Error("robot '" + robot.name + "': two links are called '" + joint.link_name + "'");
    if (joint.link_name == "world")
      throw Error("robot '" + robot.name + "': link 'world' moves; simulators keep this name for themselves");
  }
}

std::string tip_name(const Robot& robot) {
  const bool at_last_link = robot.tip.matrix().isIdentity(0.0);
  return at_last_link && robot.tip_link == robot.joints.back().link_name ? "" : robot.tip_link;
}

void list_joint_not_expressed(const Joint& joint, std::vector<std::string>& list) {
  const std::string prefix = "joint '" + joint.name + "': ";
  detail::list_friction_not_expressed(joint.friction, prefix, list);
  if (std::isfinite(joint.limits.acceleration))
    list.push_back(prefix + "acceleration limit " + number(joint.limits.acceleration));
  if (std::isfinite(joint.limits.jerk)) list.push_back(prefix + "jerk limit " + number(joint.limits.jerk));
  if (std::isfinite(joint.limits.torque_rate))
    list.push_back(prefix + "torque rate limit " + number(joint.limits.torque_rate));
}

void list_first_moments_not_expressed(const StandardParameters& p, const std::string& link,
                                      std::vector<std::string>& list) {
  if (detail::has_centre_of_mass(p)) return;
  list.push_back("link '" + link + "': mass " + number(p[0]) + " kg is too small to carry first moments of " +
                 triple(p.segment<3>(1)) + " kg m");
}

PrincipalInertia principal_inertia(const LinkInertia& body) {
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solver(body.inertia);
  PrincipalInertia principal;
  principal.moments = solver.eigenvalues();
  principal.frame.linear() = solver.eigenvectors();
  if (solver.eigenvectors().determinant() < 0.0) principal.frame.linear().col(0) *= -1.0;
  principal.frame.translation() = body.com;
  // A flat body is on the border of eq. (16): rounding must not put it beyond, for the simulators' tests are
  // exact. The rounding is that of the tensor about the link's origin, which the central one came from.
  Eigen::Vector3d& m = principal.moments;
  const double rounding = 1e-14 * (m[2] + body.mass * body.com.squaredNorm());
  if (m[0] < 0.0 && m[0] >= -rounding) m[0] = 0.0;
  if (m[2] > m[0] + m[1] && m[2] - m[0] - m[1] <= rounding) m[2] = m[0] + m[1];
  return principal;
}

void list_impossible(const LinkInertia& body, const std::string& link, double least,
                     const std::string& program, std::vector<std::string>& list) {
  const Eigen::Vector3d m = principal_inertia(body).moments;
  if (body.mass >= least && m[0] >= least && m[0] + m[1] >= m[2]) return;
  list.push_back("link '" + link + "': mass " + number(body.mass) + " kg with principal moments " +
                 triple(m) + " kg m^2, which " + program + " refuses");
}

}  // namespace dynid::detail::exporting
