// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "kernels.hpp"

namespace dynid::python {

/// Those that are in use on this machine.
const Kernels& kernels();

}  // namespace dynid::python
