// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <atomic>
#include <cstdint>
#include <functional>

#include "trifinger/core/frontend.hpp"
#include "trifinger/joint/types.hpp"
#include "trifinger/learning/environment.hpp"
#include "trifinger/learning/policy.hpp"

namespace trifinger::learning {

/// How an episode of a policy has ended.
struct EpisodeReport {
  std::uint64_t number{0};
  std::int64_t actions{0};
  double total_reward{0.0};
  Outcome outcome{};            ///< Of the last action.
  TimeIndex repeated_steps{0};  ///< In which the action before acted again, since one was late.
};

struct PolicyRunOptions {
  std::uint64_t seed{0};  ///< Of starts and goals.
  std::uint64_t first_episode{0};
  std::uint64_t episodes{10};
  /// Set from a signal handler or another thread: the run ends behind the action.
  const std::atomic<bool>* stop{nullptr};
  std::function<void(const EpisodeReport&)> on_episode{};
};

/// Runs `policy` on a robot as the environment in which it was trained would: episode by episode,
/// each from where it begins, in one session, which it ends. The robot goes to each start by
/// itself; nobody puts an object anywhere.
///
/// Does what `trifinger.environments.Environment` does with the same policy on the same robot. A
/// policy of which `Environment` gives several inputs, one behind the other, is asked for each: the
/// fingers share it. Between two episodes' ends it takes no memory.
/// @throws InvalidArgument if the policy's sizes are not those of the environment, or the robot has
/// not its object; RobotStopped
template <class R>
void run_policy(Frontend<R>& robot, const Environment& environment, Policy& policy,
                const PolicyRunOptions& options);

extern template void run_policy(Frontend<TriFinger>&, const Environment&, Policy&,
                                const PolicyRunOptions&);
extern template void run_policy(Frontend<Finger>&, const Environment&, Policy&,
                                const PolicyRunOptions&);

}  // namespace trifinger::learning
