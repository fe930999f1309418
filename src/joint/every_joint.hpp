// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string_view>

namespace trifinger::detail {

/// In a section of a configuration that has a key for each joint: the key for all joints that do
/// not say otherwise.
inline constexpr std::string_view kEveryJoint = "every_joint";

/// @throws InvalidArgument if a joint is called like this key
void require_other_name(std::string_view joint);

}  // namespace trifinger::detail
