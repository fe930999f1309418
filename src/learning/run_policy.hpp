// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <atomic>
#include <cstdint>
#include <functional>
#include <limits>
#include <optional>
#include <string>

#include "learning/experience.hpp"
#include "learning/policy_source.hpp"
#include "learning/takeover.hpp"
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
  std::int64_t policy{0};       ///< Number of the policy that chose the last action; -1: none did.
  std::int64_t interventions{0};  ///< Number of actions of a person who had taken over.
};

/// What is said of an episode from outside.
enum class Verdict : std::uint8_t { kNone, kFailure, kSuccess };

/// Why a run ended before its last episode.
struct NeedsCare {
  enum class Kind : std::uint8_t { kWarmMotors, kObjectOutOfReach };

  Kind kind;
  std::string text;  ///< A sentence without its end.
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
  /// Somebody judges episodes by this, if it is not null: a verdict ends the episode after the
  /// current action. The reward is 1 for success, or else 0, whatever the task says. What comes in
  /// the first 0.3 s of an episode, or its first half, is about the one before and does not count.
  std::atomic<Verdict>* verdict{nullptr};
  /// The run ends after an episode that leaves a motor with a thermal margin below this [1].
  double rest_below{-std::numeric_limits<double>::infinity()};
  /// The run ends after an episode that leaves the object more than 2 cm beyond where episodes
  /// begin.
  bool ends_out_of_reach{false};
};

/// Runs the policies of `source` on a robot like the environment in which they were trained,
/// episode by episode, in one session, and ends the session. The robot moves to the starts by
/// itself; nobody places an object.
///
/// Without exploration the results are those of `trifinger.environments.Environment` with the same
/// policy on the same robot. If a policy has only a part of the inputs, it is asked several times,
/// one part after the other: the fingers share it. A new policy of `source` acts from the next
/// action on. Between the ends of two episodes the call allocates no memory.
///
/// If a person takes over by `takeover`, the person's actions replace the policy's from the next
/// action on, step by step. The robot does not move to a start then: the episode begins where the
/// person has it. Returns why the run ended
/// early, if the robot needs care.
/// @throws InvalidArgument if the policy's sizes differ from those of the environment, or if the
/// robot does not have the task's object; RobotStopped; Error if the robot does not take the
/// experience
template <class R>
std::optional<NeedsCare> run_policy(Frontend<R>& robot, const Environment& environment,
                                    PolicySource& source, const PolicyRunOptions& options,
                                    Takeover<R>* takeover = nullptr);

extern template std::optional<NeedsCare> run_policy(Frontend<TriFinger>&, const Environment&,
                                                    PolicySource&, const PolicyRunOptions&,
                                                    Takeover<TriFinger>*);
extern template std::optional<NeedsCare> run_policy(Frontend<Finger>&, const Environment&,
                                                    PolicySource&, const PolicyRunOptions&,
                                                    Takeover<Finger>*);

}  // namespace trifinger::learning
