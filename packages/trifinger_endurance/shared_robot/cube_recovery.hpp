// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <functional>
#include <string>

namespace trifinger::apps {

// Nearer to the middle of the table than this the cube may stay [m].
inline constexpr double kMiddle = 0.03;

// True if a cube with its centre at `place` lies in the middle of the table.
[[nodiscard]] bool is_in_middle(const std::array<double, 3>& place) noexcept;

// True if the robot cannot be left as it is: the next session of a simulation restores everything.
[[nodiscard]] bool begins_anew(const std::string& robot);

// Lets the robot `name` grasp the cube and lead it to the middle of the table. Returns why it could
// not; empty if it did. `look` is called in every step; when it throws, the cube is put down first.
[[nodiscard]] std::string bring_to_middle(const std::string& name,
                                          const std::function<void()>& look);

}  // namespace trifinger::apps
