// SPDX-License-Identifier: Apache-2.0
#pragma once

/// All of the rigid-body equations. Each header may be included alone.
#include "dynid/dynamics/coriolis_matrix.hpp"
#include "dynid/dynamics/energy.hpp"
#include "dynid/dynamics/forward_dynamics.hpp"
#include "dynid/dynamics/gravity.hpp"
#include "dynid/dynamics/inertia_stack_regressor.hpp"
#include "dynid/dynamics/inverse_dynamics.hpp"
#include "dynid/dynamics/joint_wrenches.hpp"
#include "dynid/dynamics/kinematics.hpp"
#include "dynid/dynamics/mass_matrix.hpp"
#include "dynid/dynamics/model.hpp"
#include "dynid/dynamics/packet.hpp"
#include "dynid/dynamics/regressor.hpp"
#include "dynid/dynamics/workspace.hpp"
