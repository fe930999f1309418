// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <atomic>
#include <functional>

#include "trifinger/core/frontend.hpp"
#include "trifinger/joint/types.hpp"
#include "trifinger/manipulation/report.hpp"
#include "trifinger/realtime/thread.hpp"

namespace trifinger::manipulation {

/// Settings and observers of a manipulation that runs.
struct RunOptions {
  /// What the calling thread requests from the machine. Applied before the first action.
  RealtimeOptions realtime{.demand = Demand::kOff};
  /// A signal handler or another thread sets this: the object is put down, then the run ends.
  const std::atomic<bool>* stop{nullptr};
  /// Called in every step when its observation has arrived.
  std::function<void(TimeIndex step)> on_step{};
  /// Called when another phase begins.
  std::function<void(const Manipulation& manipulation)> on_phase{};
  /// Called when a held object is no longer in sight, and when it is in sight again.
  std::function<void(const Manipulation& manipulation)> on_sight{};
};

/// Carries out a manipulation on `robot` and ends the session. Nobody may have driven the robot in
/// this session before. The same code drives a robot in real time and a simulation that waits.
///
/// The object's pose comes from the companion "object". In real-time mode another thread makes the
/// plans. Otherwise the robot waits for them, so that the same robot gives the same series bit for
/// bit. Between its plans the loop allocates no memory.
/// @throws RobotStopped, IncompatibleSession if the scene does not have exactly one object, called
/// "cube", InvalidArgument
[[nodiscard]] Trace run(Frontend<TriFinger>& robot, const RobotDescription& description,
                        const ManipulationConfig& config, const RunOptions& options = {});

}  // namespace trifinger::manipulation
