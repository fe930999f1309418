// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <atomic>
#include <cstdint>
#include <functional>

#include "learning/experience.hpp"
#include "learning/policy_source.hpp"
#include "trifinger/core/frontend.hpp"
#include "trifinger/core/sensor.hpp"
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
  /// Gets all that happens, if it is not null.
  SensorWriter<Experience>* experience{nullptr};
  std::uint64_t process{0};  ///< `Experience::process`.
  /// Adds the noise that each policy's file asks for to its actions.
  bool explores{false};
  /// The robot moves to the start of each n-th episode. The others begin where the one before has
  /// ended.
  std::uint64_t approach_every{1};
};

/// Runs the policies of `source` on a robot like the environment in which they were trained,
/// episode by episode, in one session, and ends the session. The robot moves to the starts by
/// itself; nobody places an object.
///
/// Without exploration the results are those of `trifinger.environments.Environment` with the same
/// policy on the same robot. If a policy has only a part of the inputs, it is asked several times,
/// one part after the other: the fingers share it. A new policy of `source` acts from the next
/// action on. Between the ends of two episodes the call allocates no memory.
/// @throws InvalidArgument if the policy's sizes differ from those of the environment, or if the
/// robot does not have the task's object; RobotStopped; Error if the robot does not take the
/// experience
template <class R>
void run_policy(Frontend<R>& robot, const Environment& environment, PolicySource& source,
                const PolicyRunOptions& options);

extern template void run_policy(Frontend<TriFinger>&, const Environment&, PolicySource&,
                                const PolicyRunOptions&);
extern template void run_policy(Frontend<Finger>&, const Environment&, PolicySource&,
                                const PolicyRunOptions&);

}  // namespace trifinger::learning
