// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <string_view>
#include <tuple>

#include "trifinger/core/description.hpp"
#include "trifinger/core/driver.hpp"
#include "trifinger/learning/environment.hpp"

namespace trifinger::learning {

/// What a learner has to know of a step of its decision process: an element of the companion
/// "experience". Whoever lets a robot do a task writes one for the start of an episode, and one for
/// the state after each action. Two elements of one episode whose `actions` follow one another are
/// a transition.
struct Experience {
  static constexpr std::size_t kMaxObserved = 256;
  static constexpr std::size_t kMaxActed = 64;
  static constexpr const char* kCompanion = "experience";
  static constexpr std::size_t kKept = 1024;  // elements that a writer keeps for the robot

  enum Flag : std::uint32_t {
    kTerminated = 1,  ///< The task has ended: nothing can follow.
    kTruncated = 2,   ///< The time of the episode is over.
    kSuccess = 4,
    kLate = 8,           ///< The action came too late: others acted before it.
    kIntervention = 16,  ///< The action was a person's, who has taken over: `action` is equivalent.
    kJudged = 32,        ///< A person or a program judges the episode: reward, success, end.
  };

  Stamp stamp{};
  std::uint64_t session{0};  ///< Id of the session of the robot to which the steps belong.
  TimeIndex step{-1};        ///< Step of the robot's observation that shows the state.
  std::uint64_t process{0};  ///< `digest` of the decision process.
  /// The episode is that with the number `episode` among those of `seed`: start and goals.
  std::uint64_t seed{0};
  std::uint64_t episode{0};
  std::int64_t actions{0};  ///< Number of actions since the start of the episode; 0: the start.
  std::int64_t policy{-1};  ///< Number of the policy that chose the last of them; -1: none did.
  double reward{0.0};       ///< Of the last action.
  std::uint32_t flags{0};   ///< Set of Flag.
  /// How many numbers there are in the arrays below; zeros follow.
  std::uint32_t num_observed{0};
  std::uint32_t num_acted{0};
  std::uint32_t num_goal{0};
  /// The state, as the policy sees it: `Layout::kFlat`, scaled to -1 to 1.
  std::array<float, kMaxObserved> observation{};
  std::array<float, kMaxActed> action{};   ///< The last action, from -1 to 1.
  std::array<float, kMaxGoal> achieved{};  ///< As `Environment::observe` says.
  std::array<float, kMaxGoal> desired{};   ///< The goal by which the last action was judged.

  static constexpr auto fields() {
    return std::tuple{field("stamp", &Experience::stamp),
                      field("session", &Experience::session),
                      field("step", &Experience::step),
                      field("process", &Experience::process),
                      field("seed", &Experience::seed),
                      field("episode", &Experience::episode),
                      field("actions", &Experience::actions),
                      field("policy", &Experience::policy),
                      field("reward", &Experience::reward),
                      field("flags", &Experience::flags),
                      field("num_observed", &Experience::num_observed),
                      field("num_acted", &Experience::num_acted),
                      field("num_goal", &Experience::num_goal),
                      field("observation", &Experience::observation),
                      field("action", &Experience::action),
                      field("achieved", &Experience::achieved),
                      field("desired", &Experience::desired)};
  }
};

/// A number for a decision process, by the entries "task" and "options" in the metadata of its
/// policies: FNV-1a (Fowler, Noll, Vo) of both, with a newline after each.
[[nodiscard]] constexpr std::uint64_t digest(std::string_view task, std::string_view options) {
  std::uint64_t hash = 0xcbf29ce484222325;
  const auto add = [&hash](char letter) {
    hash = (hash ^ static_cast<unsigned char>(letter)) * 0x100000001b3;
  };
  for (const std::string_view text : {task, options}) {
    for (const char letter : text) add(letter);
    add('\n');
  }
  return hash;
}

/// Describes the companion, which every robot has. Its history is enough to start a killed recorder
/// again: 80 s at 50 actions per second, 4 s at 1000.
[[nodiscard]] inline CompanionDescription experience_companion() {
  return {.name = Experience::kCompanion,
          .type = "experience",
          .element = describe<Experience>(),
          .history = 4096,
          .is_record = true};
}

}  // namespace trifinger::learning
