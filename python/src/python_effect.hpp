// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <nanobind/nanobind.h>

#include <memory>
#include <vector>

#include "dynid/diagnosis/hypothesis.hpp"

namespace dynid::python {

/// Effects that are written in Python (see dynid.Effect): for DiagnoseOptions::extra. They may be used and
/// destroyed on any thread, and take the interpreter lock when they need it.
std::vector<std::unique_ptr<Hypothesis>> python_effects(const std::vector<nanobind::object>& effects);

}  // namespace dynid::python
