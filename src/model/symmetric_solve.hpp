// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>

namespace trifinger {

// The solution x of A x = b for a symmetric matrix A that is positive or negative semidefinite.
// Like `rotation_between`, it is compiled once: a factorisation takes 6 s in each file that has
// one.
[[nodiscard]] Eigen::Matrix<double, 6, 1> symmetric_solve(
    const Eigen::Matrix<double, 6, 6>& a, const Eigen::Matrix<double, 6, 1>& b) noexcept;

}  // namespace trifinger
