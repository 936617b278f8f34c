// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <vector>

#include "dynid/identification/base_parameters.hpp"
#include "dynid/identification/identify.hpp"

namespace dynid::detail {

/// Whether no physically consistent links and rotors make this base parameter (a row of BaseParameters::K)
/// negative: a linear form in the pseudo-inertias of the links, each of which may be any positive
/// semi-definite matrix, is >= 0 exactly where its own matrix is positive semi-definite for every link.
bool never_negative(const Eigen::RowVectorXd& row, int standard);

/// The remarks on `id`, all else of which is set. `robot`: the one given to identify(), whose friction is the
/// nominal one.
std::vector<Remark> remarks_on(const Identification& id, const Robot& robot, const RemarkCriteria& criteria);

}  // namespace dynid::detail
