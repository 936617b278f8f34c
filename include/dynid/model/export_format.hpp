// SPDX-License-Identifier: Apache-2.0
#pragma once

namespace dynid {

/// Files that a robot is exported to.
enum class ExportFormat {
  urdf,
  mjcf,    ///< MuJoCo
  sdf,     ///< Gazebo
  yaml,    ///< this library's own, coefficients included
  header,  ///< C++
  franka,  ///< the inertials that franka_description reads
};

}  // namespace dynid
