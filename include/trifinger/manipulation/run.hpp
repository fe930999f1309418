// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <atomic>
#include <functional>

#include "trifinger/core/frontend.hpp"
#include "trifinger/joint/types.hpp"
#include "trifinger/manipulation/report.hpp"
#include "trifinger/realtime/thread.hpp"

namespace trifinger::manipulation {

/// Who looks on while a manipulation runs.
struct RunOptions {
  /// What the calling thread asks of the machine, from before its first action.
  RealtimeOptions realtime{.demand = Demand::kOff};
  /// Set from a signal handler or another thread: the object is put down, then all ends.
  const std::atomic<bool>* stop{nullptr};
  /// Is called in every step once its observation is there.
  std::function<void(TimeIndex step)> on_step{};
  /// Is called when another phase begins.
  std::function<void(const Manipulation& manipulation)> on_phase{};
};

/// Carries out a manipulation on `robot`, which nobody has driven in its session yet, and ends the
/// session. The same code drives a robot in real time and a simulation that waits.
///
/// The object's pose comes from the companion "object". In real-time mode plans are made by another
/// thread; otherwise the robot waits for them, so that the same robot gives the same series bit for
/// bit. Between its plans the loop takes no memory.
/// @throws RobotStopped, IncompatibleSession if the object is not the only one and called "cube",
/// InvalidArgument
[[nodiscard]] Trace run(Frontend<TriFinger>& robot, const RobotDescription& description,
                        const ManipulationConfig& config, const RunOptions& options = {});

}  // namespace trifinger::manipulation
