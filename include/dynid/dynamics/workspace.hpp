// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "dynid/dynamics/model.hpp"
#include "dynid/dynamics/packet.hpp"

namespace dynid {

/// All scratch of the kernels, for one thread. Scalar: double, Packet8 or a differentiable type.
///
/// Only the constructor allocates, and only when N is Eigen::Dynamic (or the scalar itself does). Nothing in
/// it outlives a call: a workspace serves any kernel and any model of the same size, in any order.
template <int N = Eigen::Dynamic, class Scalar = double>
class Workspace {
 public:
  using Element = detail::ElementOf<Scalar>;  ///< what the kernels compute with

  explicit Workspace(const Model<N>& model) {
    stride_ = padded(model.size());
    if constexpr (N == Eigen::Dynamic) data_.resize((rows_of_kernels + model.size()) * stride_);
  }

  /// Row k of the scratch: n elements. Rows 0 to rows_of_kernels - 1 are the kernels' own; the n after them
  /// hold a square matrix for forward_dynamics().
  Element* row(int k) noexcept { return data_.data() + k * (N == Eigen::Dynamic ? stride_ : padded(N)); }

  static constexpr int rows_of_kernels = 72;

 private:
  static constexpr int padded(int n) { return (n + 3) / 4 * 4; }
  static constexpr int fixed_elements = N == Eigen::Dynamic ? 0 : (rows_of_kernels + N) * padded(N);

  int stride_ = 0;
  alignas(alignof(Element) < 32
              ? 32
              : alignof(Element)) detail::JointArray<Element, N == Eigen::Dynamic ? N : fixed_elements> data_;
};

}  // namespace dynid
