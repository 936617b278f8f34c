// SPDX-License-Identifier: Apache-2.0
#include "remarks.hpp"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdlib>
#include <sstream>
#include <string>

#include "dynid/model/link_inertia.hpp"

namespace dynid::detail {
namespace {

enum class Kind { rigid_body, rotor_inertia, viscous, coulomb };

/// A significant coefficient on the impossible side of 0.
struct Impossible {
  std::string name;
  Kind kind = Kind::rigid_body;
  int joint = 0;  // from 0
  double value = 0.0, std = 0.0;
};

bool starts_with(const std::string& name, const char* with) { return name.rfind(with, 0) == 0; }

/// The joint, from 0, whose number ends the name: `zz1`, `phi1_7`.
int joint_of(const std::string& name) {
  const std::size_t last_letter = name.find_last_not_of("0123456789");
  return std::atoi(name.c_str() + last_letter + 1) - 1;
}

std::vector<Impossible> impossible_signs(const Identification& id, double significance) {
  std::vector<Impossible> found;
  for (int k = 0; k < id.rank; ++k) {
    const std::string& name = id.coefficients[static_cast<std::size_t>(k)].name;
    Kind kind = Kind::rigid_body;
    if (k < id.base.size()) {
      if (!never_negative(id.base.K.row(k), id.base.standard)) continue;
      if (starts_with(name, "ia")) kind = Kind::rotor_inertia;
    } else if (starts_with(name, "fv")) {
      kind = Kind::viscous;
    } else if (starts_with(name, "fc") || starts_with(name, "phi1_")) {  // phi2 > 0, so phi1 has fc's sign
      kind = Kind::coulomb;
    } else {
      continue;
    }
    const double std = std::sqrt(id.variance[k]);
    if (id.values[k] < 0.0 && -id.values[k] > significance * std)
      found.push_back({name, kind, joint_of(name), id.values[k], std});
  }
  return found;
}

const char* unit(const Impossible& c, const Robot& robot) {
  const bool prismatic = robot.joints[static_cast<std::size_t>(c.joint)].type == JointType::prismatic;
  if (c.kind == Kind::viscous) return prismatic ? "N s/m" : "N m s/rad";
  if (c.kind == Kind::coulomb) return prismatic ? "N" : "N m";
  if (c.kind == Kind::rotor_inertia) return prismatic ? "kg" : "kg m^2";
  return starts_with(c.name, "m") ? "kg" : "kg m^2";
}

const char* what(Kind kind) {
  switch (kind) {
    case Kind::viscous:
      return "viscous friction";
    case Kind::coulomb:
      return "Coulomb friction";
    case Kind::rotor_inertia:
      return "rotor inertia";
    case Kind::rigid_body:
      break;
  }
  return "inertia or mass";
}

/// Whether the value is about what subtracting the nominal damping from the torque leaves of a joint that has
/// little friction of its own.
bool like_damping(const Impossible& c, double damping) {
  return damping > 0.0 && -c.value > 0.5 * damping - 3.0 * c.std && -c.value < 1.2 * damping + 3.0 * c.std;
}

/// What usually makes it. `turned`: on this joint inertia or both kinds of friction have the wrong sign.
std::string cause(const Impossible& c, const Robot& robot, bool turned) {
  if (turned)
    return "the recorded torque of this joint has its sign turned, or the joint counts the other way than in "
           "the model";
  const double damping = robot.joints[static_cast<std::size_t>(c.joint)].friction.linear.viscous;
  if (c.kind == Kind::viscous && like_damping(c, damping)) {
    std::ostringstream text;
    text.precision(3);
    text << "the robot's description has a damping of " << damping << ' ' << unit(c, robot)
         << " here, probably a placeholder, and it was taken off the recorded torque";
    return text.str();
  }
  switch (c.kind) {
    case Kind::viscous:
      return "the recorded torque has friction taken off already (compensated by the controller, or by a "
             "damping that the joint does not have), or friction falls with speed in this log (Stribeck)";
    case Kind::coulomb:
      return "the recorded torque has friction taken off already (compensated by the controller), or its "
             "sign is turned";
    case Kind::rotor_inertia:
      return "the torque was recorded on the link's side of the gear, where a rotor does not show (identify "
             "without rotor inertia), or with the rotor's share taken off it";
    case Kind::rigid_body:
      break;
  }
  return "the sign of torque or acceleration is turned, the torque is on the motor's side of the gear, or "
         "the joint's zero or order is not the model's";
}

Remark remark_on(const Impossible& c, const Robot& robot, bool turned) {
  std::ostringstream text;
  text.precision(3);
  text << c.name << " = " << c.value << " +- " << c.std << ' ' << unit(c, robot) << ": " << what(c.kind)
       << " below 0 on joint " << c.joint + 1 << "; usually " << cause(c, robot, turned);
  return {c.name, c.joint + 1, c.value, c.std, text.str()};
}

void add_error(const char* name, const FitQuality& quality, double limit, std::vector<Remark>& remarks) {
  if (!(quality.relative_error_percent > limit)) return;
  std::ostringstream text;
  text.precision(3);
  text
      << quality.relative_error_percent << " % of the torque is not explained (" << quality.source
      << "): log and robot do not belong together as they are read; usually joint order, zeros, units, signs "
         "or the direction of gravity";
  remarks.push_back({name, 0, quality.relative_error_percent, 0.0, text.str()});
}

}  // namespace

bool never_negative(const Eigen::RowVectorXd& row, int standard) {
  constexpr double rounding = 1e-9;
  const double scale = row.cwiseAbs().maxCoeff();
  if (scale == 0.0 || (row.tail(row.size() - standard).array() < -rounding * scale).any()) return false;
  for (int first = 0; first < standard; first += 10) {
    const StandardParameters w = row.segment<10>(first).transpose();
    Eigen::Matrix4d S;  // w . p = <S, pseudo-inertia of p>
    for (int a = 0; a < 4; ++a) {
      for (int b = 0; b < 4; ++b) {
        Eigen::Matrix4d E = Eigen::Matrix4d::Zero();
        E(a, b) += 0.5;
        E(b, a) += 0.5;
        S(a, b) = w.dot(from_pseudo_inertia(E));
      }
    }
    const Eigen::SelfAdjointEigenSolver<Eigen::Matrix4d> solver(S, Eigen::EigenvaluesOnly);
    if (solver.eigenvalues()[0] < -rounding * scale) return false;
  }
  return true;
}

std::vector<Remark> remarks_on(const Identification& id, const Robot& robot, const RemarkCriteria& criteria) {
  std::vector<Impossible> found = impossible_signs(id, criteria.significance);
  std::stable_sort(found.begin(), found.end(),
                   [](const Impossible& a, const Impossible& b) { return a.joint < b.joint; });
  std::vector<Remark> remarks;
  for (const Impossible& c : found) {
    const auto has = [&](Kind kind) {
      return std::any_of(found.begin(), found.end(), [&](const Impossible& other) {
        return other.joint == c.joint && other.kind == kind;
      });
    };
    // Friction alone may be compensated; nothing compensates inertia.
    const bool turned = has(Kind::coulomb) && (has(Kind::viscous) || has(Kind::rigid_body));
    remarks.push_back(remark_on(c, robot, turned));
  }
  add_error("relative_error", id.fit, criteria.relative_error_percent, remarks);
  if (id.validation)
    add_error("validation_relative_error", *id.validation, criteria.relative_error_percent, remarks);
  return remarks;
}

}  // namespace dynid::detail
