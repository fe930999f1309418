// SPDX-License-Identifier: BSD-3-Clause
#include "endurance/recovery.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>

#include "trifinger/base/error.hpp"

namespace trifinger::apps {
namespace {

// Others have the robot, or nobody runs it: this is no fault of the robot, and time is what helps.
bool is_missing(Failure failure) noexcept {
  return failure == Failure::kAbsent || failure == Failure::kControlHeld;
}

// What a person should do about it, in a sentence.
std::string_view remedy(Failure failure) noexcept {
  switch (failure) {
    case Failure::kActionLate:
    case Failure::kFirstActionLate:
    case Failure::kBackendLate:
    case Failure::kMachineSuspended:
      return "The machine is too busy or not set up for real time: 'trifinger doctor' tells what "
             "to change.";
    case Failure::kHardLimit:
      return "Look whether something pushes a joint, or whether it counts from a wrong place: move "
             "it by hand and home the robot ('trifinger home').";
    case Failure::kSelfTest:
      return "Look for what is in the way of this joint, for a loose cable and for a broken belt: "
             "'trifinger self-test' tests each motor.";
    case Failure::kStuck:
    case Failure::kVelocityMismatch:
    case Failure::kPositionJumped:
    case Failure::kBadMeasurement:
      return "Look at the encoder of this joint, its disk and its cable; then 'trifinger "
             "self-test'.";
    case Failure::kOverheated:
      return "A motor gets more current than is commanded: switch it off and look at its board.";
    case Failure::kHoming:
      return "Look whether the joint reaches its end stop, and home the robot ('trifinger home').";
    case Failure::kControlHeld:
      return "End the program that controls it, or wait for its end.";
    case Failure::kAbsent:
    case Failure::kBackendDied:
    case Failure::kDriverHangs:
      return "Look at the robot and at what its back-end printed last; then start it with "
             "'trifinger run'.";
    case Failure::kOtherRobot:
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
  detail::require(timeout >= Nanoseconds::zero(), "timeout must be at least 0");
  detail::require_positive("most_per_hour", most_per_hour);
}

Recovery::Recovery(const RecoveryOptions& options)
    : options_(options), credit_(options.most_per_hour) {
  options_.validate();
}

Recovery::Decision Recovery::after(Failure failure, const std::string& text, Nanoseconds now) {
  const auto ask_operator = [&](const std::string& why) {
    return Decision{.needs_operator = true,
                    .pause = {},
                    .why = fmt::format("{}. The last was: {}. {}", why, text, remedy(failure))};
  };
  if (failure == Failure::kOtherRobot) return ask_operator("another robot has its name");
  if (is_missing(failure)) {
    if (missing_since_ < Nanoseconds::zero()) missing_since_ = now;
    if (now - missing_since_ > options_.timeout) {
      return ask_operator(
          fmt::format("the robot could not be had for {}", duration_text(options_.timeout)));
    }
    return {.needs_operator = false,
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
    return ask_operator(
        fmt::format("there were more than {:g} failures in an hour", options_.most_per_hour));
  }
  if (attempts_ == options_.attempts) {
    return ask_operator(fmt::format("{} attempts in a row to go on have failed", attempts_));
  }
  const double factor = std::exp2(std::min(attempts_, 40));
  ++attempts_;
  const double pause = std::min(static_cast<double>(options_.first_pause.count()) * factor,
                                static_cast<double>(options_.longest_pause.count()));
  return {.needs_operator = false, .pause = Nanoseconds(std::llround(pause)), .why = {}};
}

void Recovery::is_well() noexcept {
  attempts_ = 0;
  missing_since_ = Nanoseconds(-1);
}

}  // namespace trifinger::apps
