// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <string_view>

#include "trifinger/core/session.hpp"

namespace trifinger::bindings {

/// The series that Python knows.
inline constexpr std::array kSeries{Series::kDesiredAction, Series::kAppliedAction,
                                    Series::kObservation, Series::kStatus};

/// The series called `name`. @throws InvalidArgument with the existing names
[[nodiscard]] Series series_of(std::string_view name);

}  // namespace trifinger::bindings
