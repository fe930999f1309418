// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include "endurance/motion.hpp"
#include "endurance/tally.hpp"
#include "trifinger/core/status.hpp"

namespace trifinger::apps {

// One step as the robot has published it. One value for each joint.
struct StepRecord {
  std::span<const double> position;        // [rad]
  std::span<const double> torque;          // of the period before [Nm]
  std::span<const std::uint64_t> reasons;  // bits of `Reason`
  std::span<const double> thermal_margin;
};

// What a slow pass has found.
struct PassResult {
  std::optional<std::size_t> hindered{};  // the first joint that did not follow
  double went{0.0};                       // how far this one went [rad]
  double wanted{0.0};                     // how far it should have gone [rad]
};

// Judges each step of a random motion. Nothing takes memory after the constructor.
//
// Friction is measured in slow passes. At constant speed a motor gives the torque of the weight,
// which depends on the place alone, and of the friction, which is against the motion:
//
//     forth: torque(q) = weight(q) + friction      back: torque(q) = weight(q) - friction
//
// Both ways go through the same places, so half the difference of their mean torques is the mean
// friction. This needs no model of the robot. (B. Armstrong-Hélouvry: Control of Machines with
// Friction, Kluwer 1991, measures friction at constant speeds, too.)
//
// A joint has collided when it is further behind than a free one can be: for `kHeldUp` steps its
// error is more than twice the one at which its motor gives all its torque, besides the lag of its
// damping.
class Health {
 public:
  static constexpr int kHeldUp = 40;
  static constexpr int kStillHeldUp = 250;

  explicit Health(const RandomMotion& motion);

  // Forgets the step before: a session begins.
  void begin_session() noexcept;
  // Adds a step: what was wanted of it, and what came of the step before.
  void add(const MotionStep& step, std::span<const double> wanted, const StepRecord& record,
           Tally& tally) noexcept;
  // Adds what the back-end says about a step. `period` is that of the session.
  static void add(const Status& status, Nanoseconds period, Tally& tally) noexcept;
  // Whether something has held a joint up since the last call. It is true again and again as long
  // as the joint does not come free.
  [[nodiscard]] bool take_hindrance() noexcept { return std::exchange(is_hindered_, false); }
  // What the slow pass has found that was over with the last step, once.
  [[nodiscard]] std::optional<PassResult> take_pass() noexcept;

 private:
  struct Joint {
    double wanted{0.0};
    double wanted_before{0.0};
    double position{0.0};
    int held_up{0};
    bool has_collided{false};
    // Of the slow pass:
    double forth_torque{0.0};
    double back_torque{0.0};
    double forth_begin{0.0};
    double forth_end{0.0};
    double back_begin{0.0};
    double back_end{0.0};
  };

  void note_collision(std::size_t i, double error, JointTally& tally, Tally& all) noexcept;
  void measure_pass(std::size_t i, double position, double torque) noexcept;
  void end_pass(Tally& tally) noexcept;

  const RandomMotion& motion_;
  std::vector<double> saturation_;  // error at which the motor gives all its torque [rad]
  std::vector<double> lag_;         // error per speed, from damping [s]
  std::vector<Joint> joints_;
  bool is_first_{true};
  bool is_hindered_{false};
  MotionStep before_{};
  std::uint64_t forth_steps_{0};
  std::uint64_t back_steps_{0};
  std::optional<PassResult> pass_{};
};

}  // namespace trifinger::apps
