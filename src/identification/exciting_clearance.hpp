// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Geometry>
#include <memory>
#include <string>
#include <vector>

#include "dynid/identification/excite_collision.hpp"

namespace dynid::detail {

/// How near two bodies of a collision model are.
struct Proximity {
  int pair = 0;                ///< which, see Clearances::pairs()
  double distance = 0.0;       ///< [m]; negative: they overlap by as much
  Eigen::Vector3d on_a, on_b;  ///< points of both on the line of nearest approach, in the base frame
  Eigen::Vector3d
      normal;  ///< in the base frame: the distance grows by normal . (motion of on_b less that of on_a)
};

/// Distances between the bodies of a collision model: of capsules by FCL, of a capsule and a box or the floor
/// by what they are. Not for two threads at once.
class Clearances {
 public:
  enum class Kind { self_collision, floor, box };
  struct Pair {
    Kind kind = Kind::self_collision;
    int a = 0;                       ///< capsule
    int b = 0;                       ///< capsule or box
    int moving_a = 0, moving_b = 0;  ///< joints, from the base, that move each
    std::string name_a, name_b;
  };

  Clearances(const Robot& robot, const CollisionModel& model);
  ~Clearances();
  Clearances(const Clearances&) = delete;
  Clearances& operator=(const Clearances&) = delete;

  const std::vector<Pair>& pairs() const noexcept { return pairs_; }
  /// All pairs nearer than `reach` [m], in a fixed order. `poses`: n links, then the tip, in the base frame.
  void near(const std::vector<Eigen::Isometry3d>& poses, double reach, std::vector<Proximity>& out);

 private:
  struct Shapes;
  CollisionModel model_;
  std::vector<Pair> pairs_;
  Eigen::Vector3d up_;
  std::unique_ptr<Shapes> shapes_;
};

}  // namespace dynid::detail
