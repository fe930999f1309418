// SPDX-License-Identifier: BSD-3-Clause
#include "model/symmetric_solve.hpp"

#include <Eigen/Cholesky>

namespace trifinger {

Eigen::Matrix<double, 6, 1> symmetric_solve(const Eigen::Matrix<double, 6, 6>& a,
                                            const Eigen::Matrix<double, 6, 1>& b) noexcept {
  return a.ldlt().solve(b);
}

}  // namespace trifinger
