// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string_view>
#include <vector>

#include "trifinger/base/random.hpp"
#include "trifinger/base/time.hpp"
#include "trifinger/joint/limits.hpp"

// Random motions that wear a robot as years of work do.
namespace trifinger::apps {

using Seconds = std::chrono::duration<double>;

// What a robot does at a time.
enum class Move : std::uint8_t {
  kReach,    // Some joints move to a random place within their soft limits.
  kShake,    // Some joints shake.
  kPush,     // Random torques are added for a moment.
  kRest,     // All joints stay where they are.
  kRetreat,  // Something was in the way: back to where the last move began.
  kPass,     // All joints move slowly, forth and back on the same way: what this takes is friction.
};
inline constexpr std::size_t kNumMoves = 6;
[[nodiscard]] std::string_view name_of(Move move) noexcept;

struct MotionOptions {
  std::uint64_t seed{0};
  Seconds period{1e-3};
  double speed{0.5};            // share of the greatest speed of each joint, above 0, at most 1
  Seconds pass_every{600.0};    // time from one slow pass to the next
  double pass_speed{0.2};       // speed of each joint in a slow pass [rad/s]
  double pass_amplitude{0.15};  // how far it then goes to each side [rad]
};

// The part of a slow pass that a step belongs to.
enum class PassPart : std::uint8_t {
  kNone,
  kOnTheWay,  // to where the pass begins, and from where it ends
  kForth,     // at constant speed
  kBack,      // at constant speed, through the same places
};

// What is wanted of one step.
struct MotionStep {
  Move move{Move::kRest};
  PassPart part{PassPart::kNone};
  bool begins{false};  // the first step of its move
  bool ends{false};    // the last one
};

// Makes the desired positions and torques of each step. Seed, session and number of the step decide
// them. Nothing jumps, and all positions are within the soft limits. After the constructor nothing
// takes memory.
class RandomMotion {
 public:
  // Throws InvalidArgument that names an option or limit that makes no sense.
  RandomMotion(std::vector<JointLimit> limits, const MotionOptions& options);

  [[nodiscard]] std::size_t joints() const noexcept { return limits_.size(); }
  [[nodiscard]] const std::vector<JointLimit>& limits() const noexcept { return limits_; }
  [[nodiscard]] const MotionOptions& options() const noexcept { return options_; }

  // Begins session number `session` of the robot: the joints are at `position`. Slow passes are at
  // `home`. The first one begins after `free_time`: until then, joints may free themselves of what
  // holds them. First they go back the way they came, however long that takes, then at random.
  void begin(std::span<const double> position, std::span<const double> home, std::uint64_t session,
             Seconds free_time = Seconds(0)) noexcept;
  // Something holds a joint up, and all of them are where they were measured: the move is given up,
  // and the next step begins a retreat. Slow passes go on, because their judgement needs all of it.
  void give_way(std::span<const double> measured) noexcept;
  // The joints were measured there: this is part of the path back. The path is forgotten when they
  // are at home. Of a path longer than `kMaxPlaces` only the end is kept.
  void remember(std::span<const double> measured) noexcept;
  // Makes the next step.
  MotionStep next() noexcept;
  // What `next` has made: [rad] and [Nm].
  [[nodiscard]] std::span<const double> position() const noexcept { return position_; }
  [[nodiscard]] std::span<const double> torque() const noexcept { return torque_; }
  // The speed of a joint in a slow pass [rad/s]. Joints that do not go so far go slower.
  [[nodiscard]] double pass_speed(std::size_t joint) const noexcept;

  static constexpr std::size_t kMaxPlaces = 5000;

 private:
  void begin_move() noexcept;
  void begin_reach() noexcept;
  void begin_shake() noexcept;
  void begin_push() noexcept;
  void begin_retreat() noexcept;
  void begin_return() noexcept;
  void begin_pass() noexcept;
  [[nodiscard]] PassPart make_pass() noexcept;
  // Where the joints were, counted from home or from the oldest place that is kept.
  [[nodiscard]] std::span<double> place(std::size_t number) noexcept;
  // The duration of a smooth motion from `start_` to `target_` at a share of the greatest speed.
  [[nodiscard]] double move_time(double share) const noexcept;
  [[nodiscard]] TimeIndex steps_in(double time) const noexcept;

  std::vector<JointLimit> limits_;
  MotionOptions options_;
  std::vector<double> most_speed_;  // [rad/s]
  std::vector<double> amplitude_;
  std::vector<double> home_;
  std::vector<double> centre_;  // of slow passes
  std::vector<double> position_;
  std::vector<double> torque_;
  std::vector<double> start_;
  std::vector<double> target_;
  std::vector<double> before_;     // where the last move began
  std::vector<double> measured_;   // when something was in the way
  std::vector<double> frequency_;  // [1/s]
  Random random_;
  Move move_{Move::kRest};
  TimeIndex step_{0};   // of the move
  TimeIndex steps_{0};  // in the move
  TimeIndex since_pass_{0};
  bool is_pass_due_{true};
  bool gives_way_{false};
  int retreats_{0};           // in a row
  std::vector<double> path_;  // from home to here: a ring of `kMaxPlaces` places
  std::size_t oldest_place_{0};
  std::size_t num_places_{0};
  bool returns_{false};                   // goes back to them, the newest first
  std::array<TimeIndex, 6> pass_ends_{};  // of the parts of a slow pass
};

}  // namespace trifinger::apps
