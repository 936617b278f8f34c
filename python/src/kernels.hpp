// SPDX-License-Identifier: Apache-2.0
//
// The kernels over many samples, behind a table of plain functions: kernels.cpp is compiled for the machine
// at hand and once more for x86-64-v3, and which of them runs is chosen when the module is loaded.
#pragma once

#include <cstddef>

#include "dynid/model/robot.hpp"

namespace dynid::python {

/// Arrays are row by row: q, dq, ddq, tau are count x n, one row a sample; `out` as each function says. The
/// last samples of a batch are padded, so that a sample's result does not depend on its place.
struct Kernels {
  /// count x n [N m]: M ddq + S dq + g, and armature ddq where `armature` (n) is not null.
  void (*rnea)(const Robot&, std::ptrdiff_t count, const double* q, const double* dq, const double* ddq,
               const double* armature, double* out);
  void (*regressor)(const Robot&, std::ptrdiff_t count, const double* q, const double* dq, const double* ddq,
                    double* out);  ///< count x n x 10 n
  void (*mass_matrix)(const Robot&, std::ptrdiff_t count, const double* q, const double* armature,
                      double* out);  ///< count x n x n
  void (*coriolis)(const Robot&, std::ptrdiff_t count, const double* q, const double* dq,
                   double* out);                                                      ///< count x n x n
  void (*gravity)(const Robot&, std::ptrdiff_t count, const double* q, double* out);  ///< count x n [N m]
  void (*forward)(const Robot&, std::ptrdiff_t count, const double* q, const double* dq, const double* tau,
                  const double* armature, double* out);                                ///< count x n
  void (*jacobian)(const Robot&, std::ptrdiff_t count, const double* q, double* out);  ///< count x 6 x n
};

}  // namespace dynid::python

/// The table of the object that it is called in.
extern "C" const dynid::python::Kernels* dynid_python_kernels();
