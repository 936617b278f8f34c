// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <memory>
#include <string>
#include <vector>

#include "conventions_sample.hpp"
#include "dynid/identification/conventions.hpp"

namespace dynid::detail {

constexpr double degree_of_angle = 3.14159265358979323846 / 180.0;

// Rows of the quick passes: enough to keep the true reading among the best few.
constexpr Eigen::Index few_rows = 24, some_rows = 64;

struct TorqueUnit {
  const char* name;
  double factor;
};
constexpr TorqueUnit torque_units[] = {{"Nmm", 1e-3},     {"Ncm", 1e-2},       {"kgfcm", 0.0980665},
                                       {"kgfm", 9.80665}, {"lbfin", 0.112985}, {"kNm", 1e3}};

/// A reading and what it explains.
struct ReadingCandidate {
  Reading reading;
  Eigen::VectorXd left;  ///< n, part of each joint's torque energy not explained
  double score = 0.0;    ///< evidence, less is better, complexity included
};

/// The readings of a log that explain it better than it stands, found by trying them.
class ConventionSearch {
 public:
  ConventionSearch(const Robot& robot, const SpreadRows& rows, const ConventionOptions& options)
      : robot_(robot),
        n_(robot.size()),
        options_(options),
        kernel_(make_kernel(robot)),
        rotor_(rotor_bounds(robot, rows)),
        full_(robot, rows, rows.q.rows(), rotor_),
        mid_(robot, rows, std::min<Eigen::Index>(some_rows, rows.q.rows()), rotor_),
        small_(robot, rows, std::min<Eigen::Index>(few_rows, rows.q.rows()), rotor_) {}
  Reading plain() const;
  /// The candidates, best first. The first call's reading stands for the log as it is.
  void run(const Reading& base);
  const ReadingCandidate& before() const { return before_; }
  std::vector<ReadingCandidate>& found() { return found_; }
  const ConventionSample& full() const { return full_; }
  void sort();
  /// Beside the best readings with a known unit of torque, the same with a factor for each joint: a payload
  /// hides which it is. Before with_payload(), which fits them.
  void add_free_factors();
  /// The same reading of an arm that carries a payload, of any size that can exist: the physical explanation
  /// that comes nearest to another reading, and what hides one. Factors of joints are fitted with it.
  ReadingCandidate with_payload(const ReadingCandidate& from);
  /// The same of an arm that carries a payload or one of whose links, whichever explains most, is any other
  /// body that can exist.
  ReadingCandidate with_wrong_body(const ReadingCandidate& from);
  /// The reading without one of its parts, each in turn: a joint's zero or sign, a cycle of the order, ...
  std::vector<Reading> without_a_part(const Reading& reading) const;
  /// What a reading explains, with whatever the arm may carry.
  ReadingCandidate judged_loaded(const Reading& reading);
  /// The rigid body has a part in what it explains, on one joint at least: where friction and rotor inertia
  /// do alone, any reading that makes the body's torque small would do.
  bool needs_body(const ReadingCandidate& c) const;
  /// n: whether the torque of a joint shows its own factor, under a reading.
  std::vector<bool> felt(const Reading& reading);
  /// The nominal robot would have made the log say the same under both, to within what nominal models are off
  /// by: no one can tell the two apart on this log.
  bool equivalent(const Reading& a, const Reading& b);

 private:
  /// rows x n: what the log's columns would say of the nominal rigid body, read so.
  Eigen::MatrixXd said_by(const Reading& r);
  Eigen::VectorXd rotor_bounds(const Robot& robot, const SpreadRows& rows) const;
  /// The log's torque of joint j under the reading; T: the model's, whose sign a magnitude gets.
  Eigen::VectorXd measured(const Reading& r, int j, const Eigen::MatrixXd& T) const;
  double left_of(const Reading& r, int j, const Eigen::MatrixXd& T) const;
  double left_of_magnitude(const Reading& r, int j, const Eigen::MatrixXd& T) const;
  Eigen::MatrixXd torque_of(const ConventionSample& sample, const Reading& r, const Eigen::Vector3d& g);
  /// The evidence against a reading that leaves `left` of each joint unexplained: less is better.
  double evidence(const Eigen::VectorXd& left) const;
  ReadingCandidate judged(const Reading& r, const Eigen::MatrixXd& T) const;
  /// A single joint whose torque has no gravity in it: what every reading of it has to be told from.
  static bool lost_gravity(const Reading& r) {
    return r.sign.size() == 1 && r.without_gravity && r.factor.isOnes(0.0) && r.position_unit == 1.0;
  }
  void keep(const ReadingCandidate& c);
  /// A reading good enough that more elaborate ones need no trial.
  bool settled();
  /// With each joint's torque as it is, turned throughout, and turned where that is better.
  void add_signs(const Reading& r, const Eigen::MatrixXd& T, bool some_joints);
  /// With torques in another unit, or on the other side of a gear.
  void add_factors(const Reading& r, const Eigen::MatrixXd& T);
  /// The mounting that explains the torques best; whether it is one at all, and another than the model's.
  bool turned_gravity(const Reading& r, const Eigen::MatrixXd& without,
                      const std::array<Eigen::MatrixXd, 3>& by, Eigen::Vector3d& g);
  /// Everything that needs no search over joints.
  void add_all(const Reading& r);
  void add_magnitude(const Reading& r, const Eigen::MatrixXd& T);
  /// Quick measure on a small sample, each joint's torque turned where that is better.
  double quick(const ConventionSample& sample, const Reading& r);
  struct Quick {
    double score;
    Reading reading;
  };
  static void best_of(std::vector<Quick>& list, std::size_t count);
  void insert(std::vector<Quick>& list, std::size_t count, const Reading& r, double score) const;
  std::vector<Quick> signs_of(const Reading& base, const ConventionSample& sample, std::size_t count);
  /// A joint counted the other way has both its position and its torque turned; what turns one alone costs
  /// more.
  void add_joint_signs(const Reading& r);
  void try_signs(const Reading& base);
  void try_orders(const Reading& base);
  const ConventionSample& few_or_some() const { return n_ <= 5 ? mid_ : small_; }
  /// A zero of joint j matters: not of a prismatic one, nor of a first one that turns about gravity.
  bool zero_matters(int j) const;
  void try_zeros(const Reading& base);
  /// Any angle, for one or two joints, from the best multiples of 90 deg.
  void try_free_zeros(const Reading& base);
  /// Halves the step about each joint's zero until it stands still.
  void refine(Reading& r);
  /// The reading with `link`, from 0, another body than `known`: zero for a payload, which is more than none.
  ReadingCandidate with_more(const ReadingCandidate& from, int link, const StandardParameters& known);
  /// What is nearest to the least-squares solution of H x = g such that known + x can exist; its mass hardly
  /// above the arm's.
  StandardParameters physical_fit(Eigen::Matrix<double, 10, 10> H, const StandardParameters& g,
                                  double arm_mass, const StandardParameters& known) const;
  const Robot& robot_;
  int n_;
  ConventionOptions options_;
  std::unique_ptr<NominalKernel> kernel_;
  Eigen::VectorXd rotor_;
  ConventionSample full_, mid_, small_;
  ReadingCandidate before_;
  std::vector<ReadingCandidate> found_;
  Eigen::MatrixXd scratch_;
};

/// What velocity and stamps say, without any torque.
struct VelocityReading {
  double time_unit = 1.0;      ///< [s]
  double velocity_unit = 1.0;  ///< against the positions as they stand
  bool unrelated = false;      ///< the velocity is not that of the positions
  double before = 1.0, after = 1.0;
};
VelocityReading compare_velocity(const SpreadRows& rows);

/// The conventions of a reading, in the order in which they are applied. felt: n, whether the torque of a
/// joint shows its own factor.
std::vector<Convention> conventions_of(const Reading& reading, const Robot& robot,
                                       const VelocityReading& velocity, const std::vector<bool>& felt = {});
/// The text for parse_assumptions().
std::string joined(const std::vector<Convention>& conventions);

}  // namespace dynid::detail
