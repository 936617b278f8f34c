// SPDX-License-Identifier: Apache-2.0
#include "dynid/app/bounds.hpp"

#include <algorithm>
#include <cmath>
#include <sstream>

#include "dynid/app/option_error.hpp"
#include "dynid/base/error.hpp"
#include "dynid/base/number.hpp"
#include "dynid/retrieval/bounds.hpp"
#include "dynid/retrieval/collision_box.hpp"
#include "dynid/retrieval/shape.hpp"

namespace dynid {
namespace {

constexpr double total_mass_tolerance = 0.1;

/// An interval, and in words where it comes from.
struct Range {
  double lower = 0.0, upper = 0.0;
  std::string reason;
};

struct LinkBounds {
  std::string name;
  Range mass, com[3], diagonal, off_diagonal;
  std::string shape;  ///< why there is none; empty: there is one
  bool hull = false;
};

std::string figure(double x) { return short_number(x, 4); }

/// To six digits, away from what the interval holds: a file to be edited has no use for more.
double rounded(double x, bool up) {
  if (x == 0.0 || !std::isfinite(x)) return x;
  const double last = std::pow(10.0, std::floor(std::log10(std::abs(x))) - 5.0);
  const double steps = up ? std::ceil(x / last - 1e-6) : std::floor(x / last + 1e-6);
  double value = x;
  parse_number(short_number(steps * last, 6), value);
  return value;
}
void round_outwards(Range& range) {
  range.lower = rounded(range.lower, false);
  range.upper = rounded(range.upper, true);
}

Eigen::Vector2d total_of(const BoundsJob& job) {
  if (job.total_mass) return *job.total_mass;
  double sum = 0.0;
  for (const Joint& joint : job.robot.joints) sum += joint.parameters[0];
  return sum * Eigen::Vector2d(1.0 - total_mass_tolerance, 1.0 + total_mass_tolerance);
}

/// Where the link reaches at least, when no geometry says so: from its frame to the next joint's.
Eigen::AlignedBox3d skeleton(const Robot& robot, std::size_t link) {
  Eigen::AlignedBox3d box(Eigen::Vector3d::Zero().eval());
  const Eigen::Isometry3d& next = link + 1 < robot.joints.size() ? robot.joints[link + 1].origin : robot.tip;
  box.extend(next.translation());
  return box;
}

Eigen::AlignedBox3d widened(Eigen::AlignedBox3d box, double margin) {
  box.min().array() -= margin;
  box.max().array() += margin;
  return box;
}

class Maker {
 public:
  Maker(const BoundsJob& job, BoundsReport& report)
      : job_(job), report_(report), given_(job.total_mass.has_value()), total_(total_of(job)) {
    total_ = {rounded(total_[0], false), rounded(total_[1], true)};
  }

  LinkBounds link(std::size_t k) {
    const Joint& joint = job_.robot.joints[k];
    const LinkInertia body = from_standard(joint.parameters);
    LinkBounds bounds;
    bounds.name = joint.link_name;
    bounds.mass = mass(body);
    const std::optional<Eigen::AlignedBox3d> geometry = geometry_of(k, body, bounds);
    const std::string margin = figure(job_.com_margin) + " m";
    Eigen::AlignedBox3d box;
    std::string reason;
    if (geometry) {
      ++report_.with_geometry;
      box = *geometry;
      reason = "box around the collision geometry";
      if (body.mass > 0.0 && !widened(box, 1e-9).contains(body.com)) {
        box.extend(body.com);
        reason += ", widened to the inertial's centre of mass, which lies outside it";
      }
    } else if (body.mass > 0.0) {
      box = widened(Eigen::AlignedBox3d(body.com), job_.com_margin);
      reason = "the inertial's centre of mass -+ " + margin;
    } else {
      box = widened(skeleton(job_.robot, k), job_.com_margin);
      reason = "from the link's frame to the next joint's, and " + margin + " around";
    }
    for (int i = 0; i < 3; ++i) bounds.com[i] = {box.min()[i], box.max()[i], reason};
    inertia(body, geometry.has_value(), box, bounds);
    for (Range* range : {&bounds.mass, &bounds.com[0], &bounds.com[1], &bounds.com[2], &bounds.diagonal,
                         &bounds.off_diagonal})
      round_outwards(*range);
    return bounds;
  }

  const Eigen::Vector2d& total() const { return total_; }
  std::string total_reason() const {
    if (given_) return "given";
    return "sum of the inertials of " + job_.source + ", -+ " + figure(100.0 * total_mass_tolerance) + " %";
  }

 private:
  Range mass(const LinkInertia& body) {
    if (!(body.mass > 0.0)) return {0.0, total_[1], "no inertial: anything up to the total mass"};
    ++report_.with_mass;
    const double upper = std::min(job_.mass_factor * body.mass, std::max(total_[1], body.mass));
    return {body.mass / job_.mass_factor, upper,
            "inertial: " + figure(body.mass) + " kg, over and times " + figure(job_.mass_factor) +
                (upper < job_.mass_factor * body.mass ? ", at most the total mass" : "")};
  }

  std::optional<Eigen::AlignedBox3d> geometry_of(std::size_t k, const LinkInertia& body, LinkBounds& bounds) {
    if (!job_.urdf) {
      bounds.shape = "the file has no collision geometry";
      return std::nullopt;
    }
    try {
      auto box = collision_box(job_.source, static_cast<int>(k) + 1, job_.base, job_.tip);
      if (!box) {
        bounds.shape = "no collision geometry";
      } else if (body.mass > 0.0 &&
                 Shape::collision(job_.source, static_cast<int>(k) + 1, job_.base, job_.tip)
                         .clearance(body.com) < 0.0) {
        bounds.shape = "the inertial's centre of mass lies outside it";
        report_.notes.push_back("link '" + bounds.name +
                                "': its centre of mass lies outside its collision geometry");
      }
      return box;
    } catch (const Error& error) {  // a mesh that is not on this machine
      bounds.shape = "its collision geometry could not be read";
      report_.notes.emplace_back(error.what());
      return std::nullopt;
    }
  }

  /// A body of mass m within a box of sides l has central inertias of at most m (l_y^2 + l_z^2) / 4 and
  /// products of at most m l_x l_y / 4; and eq. (16) lets no product be more than half a diagonal entry.
  void inertia(const LinkInertia& body, bool geometry, const Eigen::AlignedBox3d& box, LinkBounds& bounds) {
    const double own = body.mass > 0.0 ? body.inertia.diagonal().maxCoeff() : 0.0;
    std::string reason;
    double upper;
    if (geometry || !(body.mass > 0.0)) {
      const Eigen::Array3d side = box.sizes().array().square();
      upper = 0.25 * bounds.mass.upper * (side.sum() - side.minCoeff());
      reason = std::string("the most that ") + figure(bounds.mass.upper) + " kg within that box can have";
      if (upper < own) {
        upper = job_.mass_factor * own;
        reason = "inertial: at most " + figure(own) + ", times " + figure(job_.mass_factor) +
                 "; more than its mass can have within that box";
        report_.notes.push_back("link '" + bounds.name +
                                "': its inertia is too large for its mass and geometry");
      }
    } else {
      upper = job_.mass_factor * own + bounds.mass.upper * job_.com_margin * job_.com_margin;
      reason = "inertial: at most " + figure(own) + ", times " + figure(job_.mass_factor) + ", and " +
               figure(bounds.mass.upper) + " kg " + figure(job_.com_margin) + " m farther out";
    }
    bounds.diagonal = {0.0, upper, reason};
    bounds.off_diagonal = {-0.5 * upper, 0.5 * upper, "half of that: eq. (16) lets a product be no larger"};
  }

  const BoundsJob& job_;
  BoundsReport& report_;
  bool given_;
  Eigen::Vector2d total_;
};

void put(std::ostream& out, const char* lead, const char* key, const Range& range) {
  out << lead << key << ": [" << exact_number(range.lower) << ", " << exact_number(range.upper) << "]  # "
      << range.reason << "\n";
}

/// A path between double quotes.
std::string quoted(const std::string& path) {
  std::string out = "\"";
  for (const char c : path) {
    if (c == '"' || c == '\\') out += '\\';
    out += c;
  }
  return out + "\"";
}

std::string text_of(const BoundsJob& job, const Maker& maker, const std::vector<LinkBounds>& links) {
  std::ostringstream out;
  out << "# Bounds for dynid retrieve, made from " << job.source
      << ". Every line says where it comes from: narrow what\n"
      << "# you know better (scales, a data sheet, CAD). Base to tip; kg, m in the link frame, kg m^2 about "
         "the centre\n"
      << "# of mass. Eqs. (11) and (16), that a body can exist, always hold and need not be written.\n"
      << "format: dynid-bounds-1\n";
  put(out, "", "total_mass", {maker.total()[0], maker.total()[1], maker.total_reason()});
  out << "links:\n";
  for (const LinkBounds& link : links) {
    out << "  # " << one_line(link.name) << "\n";
    put(out, "  - ", "mass", link.mass);
    const char* const keys[3] = {"com_x", "com_y", "com_z"};
    for (int i = 0; i < 3; ++i) put(out, "    ", keys[i], link.com[i]);
    put(out, "    ", "inertia_diagonal", link.diagonal);
    put(out, "    ", "inertia_off_diagonal", link.off_diagonal);
  }
  if (job.named.empty()) return out.str();
  bool any = false;
  std::string shapes;
  for (std::size_t k = 0; k < links.size(); ++k) {
    const std::string number = std::to_string(k + 1);
    if (links[k].hull) {
      any = true;
      shapes += "  - {link: " + number + ", urdf: " + quoted(job.named) +
                (job.base.empty() ? "" : ", base: " + quoted(job.base)) +
                (job.tip.empty() ? "" : ", tip: " + quoted(job.tip)) + "}\n";
    } else {
      shapes += "  # none of link " + number + ": " + links[k].shape + "\n";
    }
  }
  out << "# The centre of mass lies within the convex hull of the link's collision geometry.\n"
      << (any ? "shapes:\n" : "") << shapes;
  return out.str();
}

}  // namespace

void check_options(const BoundsJob& job) {
  if (!(job.mass_factor > 1.0) || !std::isfinite(job.mass_factor))
    throw OptionError("mass_factor", exact_number(job.mass_factor) + " is not above 1");
  if (!(job.com_margin > 0.0) || !std::isfinite(job.com_margin))
    throw OptionError("com_margin", exact_number(job.com_margin) + " is not above 0");
  if (job.total_mass) {
    const Eigen::Vector2d& t = *job.total_mass;
    if (!t.allFinite() || !(t[0] >= 0.0) || !(t[1] >= t[0]) || !(t[1] > 0.0))
      throw OptionError("total_mass",
                        "a lower and an upper mass [kg] are expected, not negative and in order");
    return;
  }
  for (const Joint& joint : job.robot.joints)
    if (!(joint.parameters[0] > 0.0))
      throw OptionError("total_mass", "is needed: " + job.source + " says no mass of link '" +
                                          joint.link_name + "'; weigh the arm or take its data sheet's");
}

BoundsReport run(const BoundsJob& job, const Context& context) {
  check_options(job);
  context.check();
  BoundsReport report;
  report.robot = job.robot.name;
  Maker maker(job, report);
  report.total_mass = maker.total();
  std::vector<LinkBounds> links;
  const auto n = static_cast<Eigen::Index>(job.robot.joints.size());
  report.lower.resize(10 * n);
  report.upper.resize(10 * n);
  for (Eigen::Index k = 0; k < n; ++k) {
    context.report("link " + std::to_string(k + 1), static_cast<double>(k) / static_cast<double>(n));
    links.push_back(maker.link(static_cast<std::size_t>(k)));
    LinkBounds& link = links.back();
    link.hull = link.shape.empty();
    const Range* const order[10] = {
        &link.mass,         &link.com[0],   &link.com[1],       &link.com[2],       &link.diagonal,
        &link.off_diagonal, &link.diagonal, &link.off_diagonal, &link.off_diagonal, &link.diagonal};
    for (Eigen::Index i = 0; i < 10; ++i) {
      report.lower[10 * k + i] = order[i]->lower;
      report.upper[10 * k + i] = order[i]->upper;
    }
  }
  Bounds bounds;
  bounds.lower = report.lower;
  bounds.upper = report.upper;
  bounds.total_mass_lower = report.total_mass[0];
  bounds.total_mass_upper = report.total_mass[1];
  bounds.source = job.source;
  validate(bounds);
  report.text = text_of(job, maker, links);
  return report;
}

}  // namespace dynid
