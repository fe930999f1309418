// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <optional>
#include <string>
#include <string_view>

#include "boards/joint_sweep.hpp"
#include "boards/wiring_test.hpp"

namespace trifinger::boards {

/// What a test has found out about one joint.
struct JointReport {
  std::optional<WiringFinding> wiring{};  ///< Nothing before the test.
  std::optional<SweepResult> sweep{};     ///< Nothing if the test did not come so far.
  std::optional<double> weight{};  ///< Torque that should carry its weight in the sweep [Nm].
  double max_torque{0.0};          ///< The largest of this joint [Nm]: a strong joint may rub more.
  double index_distance{0.0};  ///< From one index of its encoder to the next [rad]; 0 if none came.
};

/// Describes what is wrong with the joint of `report`, and what to do; empty if nothing is. The
/// text follows the name of the joint. One revolution of its motor is `index_distance` [rad], which
/// follows from the value under `gear_ratio_key`.
[[nodiscard]] std::string problem_of(const JointReport& report, double index_distance,
                                     std::string_view gear_ratio_key);

}  // namespace trifinger::boards
