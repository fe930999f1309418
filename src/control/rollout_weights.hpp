// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <span>

namespace trifinger::control {

// The median of the finite costs; of an even number the upper one. `scratch` is as long as `costs`.
[[nodiscard]] double median_of(std::span<const double> costs, std::span<double> scratch) noexcept;

}  // namespace trifinger::control
