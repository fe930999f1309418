// SPDX-License-Identifier: BSD-3-Clause
#include "endurance/recovery.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>

#include "trifinger/base/error.hpp"

namespace trifinger::apps {
namespace {

// Others have the robot, or nobody runs it: this is no fault of the robot, and time is what helps.
bool is_missing(Trouble trouble) noexcept {
  return trouble == Trouble::kAbsent || trouble == Trouble::kControlHeld;
}

// What a person should do about it, in a sentence.
std::string_view remedy(Trouble trouble) noexcept {
  switch (trouble) {
    case Trouble::kActionLate:
    case Trouble::kFirstActionLate:
    case Trouble::kBackendLate:
    case Trouble::kMachineSuspended:
      return "The machine is too busy or not set up for real time: 'trifinger doctor' tells what "
             "to change.";
    case Trouble::kHardLimit:
      return "Look whether something pushes a joint, or whether it counts from a wrong place: move "
             "it by hand and home the robot ('trifinger home').";
    case Trouble::kSelfTest:
      return "Look for what is in the way of this joint, for a loose cable and for a broken belt: "
             "'trifinger self-test' tests each motor.";
    case Trouble::kStuck:
    case Trouble::kVelocityMismatch:
    case Trouble::kPositionJumped:
    case Trouble::kBadMeasurement:
      return "Look at the encoder of this joint, its disk and its cable; then 'trifinger "
             "self-test'.";
    case Trouble::kOverheated:
      return "A motor gets more current than it is told: switch it off and look at its board.";
    case Trouble::kHoming:
      return "Look whether the joint reaches its end stop, and home the robot ('trifinger home').";
    case Trouble::kControlHeld:
      return "End the program that controls it, or wait for its end.";
    case Trouble::kAbsent:
    case Trouble::kBackendDied:
    case Trouble::kDriverHangs:
      return "Look at the robot and at what its back-end printed last; then start it with "
             "'trifinger run'.";
    case Trouble::kOtherRobot:
      return "Start the robot that this folder is about, or choose another folder with --output.";
    default:
      return "Look at supply, cables and emergency stop; then 'trifinger recover' and 'trifinger "
             "self-test'.";
  }
}

}  // namespace

void RecoveryOptions::validate() const {
  detail::require(attempts >= 1, fmt::format("attempts is {}, must be at least 1", attempts));
  detail::require(first_pause >= Nanoseconds::zero() && first_pause <= longest_pause,
                  "the first pause must be between 0 and the longest");
  detail::require(patience >= Nanoseconds::zero(), "patience must be at least 0");
  detail::require_positive("most_per_hour", most_per_hour);
}

Recovery::Recovery(const RecoveryOptions& options)
    : options_(options), credit_(options.most_per_hour) {
  options_.validate();
}

Recovery::Decision Recovery::after(Trouble trouble, const std::string& text, Nanoseconds now) {
  const auto hand = [&](const std::string& why) {
    return Decision{.needs_hand = true,
                    .pause = {},
                    .why = fmt::format("{}. The last was: {}. {}", why, text, remedy(trouble))};
  };
  if (trouble == Trouble::kOtherRobot) return hand("another robot has its name");
  if (is_missing(trouble)) {
    if (missing_since_ < Nanoseconds::zero()) missing_since_ = now;
    if (now - missing_since_ > options_.patience) {
      return hand(
          fmt::format("the robot could not be had for {}", duration_text(options_.patience)));
    }
    return {.needs_hand = false,
            .pause = std::min<Nanoseconds>(std::chrono::seconds(1), options_.longest_pause),
            .why = {}};
  }
  missing_since_ = Nanoseconds(-1);

  if (filled_ >= Nanoseconds::zero()) {
    const double hours = std::chrono::duration<double, std::ratio<3600>>(now - filled_).count();
    credit_ = std::min(options_.most_per_hour, credit_ + hours * options_.most_per_hour);
  }
  filled_ = now;
  credit_ -= 1.0;
  if (credit_ < 0.0) {
    return hand(
        fmt::format("there were more than {:g} troubles in an hour", options_.most_per_hour));
  }
  if (attempts_ == options_.attempts) {
    return hand(fmt::format("{} attempts in a row to go on have failed", attempts_));
  }
  const double factor = std::exp2(std::min(attempts_, 40));
  ++attempts_;
  const double pause = std::min(static_cast<double>(options_.first_pause.count()) * factor,
                                static_cast<double>(options_.longest_pause.count()));
  return {.needs_hand = false, .pause = Nanoseconds(std::llround(pause)), .why = {}};
}

void Recovery::is_well() noexcept {
  attempts_ = 0;
  missing_since_ = Nanoseconds(-1);
}

}  // namespace trifinger::apps
