// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>

#include "dynid/dynamics/packet.hpp"

namespace dynid::detail {

/// out(row + k, column) = lane k of x, for sample `pass` when the scalar is a packet.
template <class S, class V, class Out>
[[gnu::always_inline]] inline void write_rows(Out& out, int row, int column, int pass, const V& x) {
  using E = ElementOf<S>;
  if constexpr (std::is_same_v<V, E>) {
    Element<S>::put(out.coeffRef(row, column), pass, x);
  } else if constexpr ((int(Out::Flags) & Eigen::DirectAccessBit) && !Out::IsRowMajor &&
                       Out::InnerStrideAtCompileTime == 1) {
    x.store(out.data() + row + column * out.outerStride());
  } else {
    for (int k = 0; k < width<V, E>; ++k) out.coeffRef(row + k, column) = x[k];
  }
}

/// out(row, column + k) = lane k of x for those columns that are below `end`.
template <class S, class V, class Out>
[[gnu::always_inline]] inline void write_columns(Out& out, int row, int column, int end, int pass,
                                                 const V& x) {
  using E = ElementOf<S>;
  for (int k = 0; k < width<V, E> && column + k < end; ++k) {
    if constexpr (std::is_same_v<V, E>)
      Element<S>::put(out.coeffRef(row, column), pass, x);
    else
      out.coeffRef(row, column + k) = x[k];
  }
}

/// A square matrix of elements in the workspace's last rows.
template <class E>
struct ElementMatrix {
  E* data;
  std::ptrdiff_t stride;
  E& operator()(int i, int j) const { return data[j * stride + i]; }
};

template <class S, class V, class E>
[[gnu::always_inline]] inline void write_rows(const ElementMatrix<E>& out, int row, int column, int,
                                              const V& x) {
  store(&out(row, column), x);
}

}  // namespace dynid::detail
