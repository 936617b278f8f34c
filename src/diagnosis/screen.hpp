// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <vector>

#include "fit.hpp"

namespace dynid::detail {

/// The torques of many blocks on one joint, side by side, to be compared all at once: by one product with
/// what is to be explained, in single precision. What a block's columns are to each other in autoregressive
/// noise is a sum of their lagged products, which are made here.
class Screen {
 public:
  /// `blocks`: coefficients free, each with a torque on the joint. Allocates rows x (all columns) floats.
  Screen(const GapRows& rows, int joint, const std::vector<const RowBlock*>& blocks);
  /// What quick_gain() says of each, to within single precision.
  std::vector<double> gains(const GapRows& rows, int joint, const std::vector<SeenChannel>& base) const;

 private:
  Eigen::MatrixXf columns_;
  std::vector<Eigen::Index> first_;      ///< of each block's columns, and their number
  std::vector<Eigen::MatrixXd> lagged_;  ///< of each block: x_{t-a}^T x_{t-b}, a <= b <= noise_order, stacked
};

}  // namespace dynid::detail
