// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <atomic>
#include <cstdint>
#include <functional>

#include "learning/policy_source.hpp"
#include "trifinger/core/frontend.hpp"
#include "trifinger/joint/types.hpp"
#include "trifinger/learning/environment.hpp"

namespace trifinger::learning {

/// The result of an episode of a policy.
struct EpisodeReport {
  std::uint64_t number{0};
  std::int64_t actions{0};
  double total_reward{0.0};
  Outcome outcome{};            ///< Outcome of the last action.
  TimeIndex repeated_steps{0};  ///< Steps in which a late action was replaced by the previous one.
  TimeIndex first_step{0};      ///< Step of the observation from which the first action was chosen.
  TimeIndex last_step{0};       ///< Step of the observation that followed the last action.
  std::int64_t policy{0};       ///< Number of the policy that chose the last action.
};

struct PolicyRunOptions {
  std::uint64_t seed{0};  ///< Seed of starts and goals.
  std::uint64_t first_episode{0};
  std::uint64_t episodes{10};
  /// A signal handler or another thread sets this to end the run after the current action.
  const std::atomic<bool>* stop{nullptr};
  std::function<void(const EpisodeReport&)> on_episode{};
};

/// Runs the policies of `source` on a robot like the environment in which they were trained,
/// episode by episode, in one session, and ends the session. The robot moves to each start by
/// itself; nobody places an object.
///
/// The results are those of `trifinger.environments.Environment` with the same policy on the same
/// robot. If a policy has only a part of the inputs, it is asked several times, one part after the
/// other: the fingers share it. A new policy of `source` acts from the next action on. Between the
/// ends of two episodes the call allocates no memory.
/// @throws InvalidArgument if the policy's sizes differ from those of the environment, or if the
/// robot does not have the task's object; RobotStopped
template <class R>
void run_policy(Frontend<R>& robot, const Environment& environment, PolicySource& source,
                const PolicyRunOptions& options);

extern template void run_policy(Frontend<TriFinger>&, const Environment&, PolicySource&,
                                const PolicyRunOptions&);
extern template void run_policy(Frontend<Finger>&, const Environment&, PolicySource&,
                                const PolicyRunOptions&);

}  // namespace trifinger::learning
