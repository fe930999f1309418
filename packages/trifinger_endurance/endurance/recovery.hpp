// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <chrono>
#include <string>

#include "endurance/tally.hpp"
#include "trifinger/base/time.hpp"

namespace trifinger::apps {

struct RecoveryOptions {
  int attempts{8};  // in a row, before a person has to look
  Nanoseconds first_pause{
      std::chrono::milliseconds(500)};  // before the first attempt; then doubled
  Nanoseconds longest_pause{std::chrono::minutes(1)};
  Nanoseconds timeout{
      std::chrono::minutes(10)};  // with a robot that nobody runs, or that others use
  double most_per_hour{30.0};     // failures in the long run

  // Throws InvalidArgument that names the option.
  void validate() const;
};

// Decides what to do after a failure: try again after a pause, or ask for an operator. Attempts
// count until the robot has passed its self-test. Pure: it knows no clock and no robot.
class Recovery {
 public:
  struct Decision {
    bool needs_operator{false};
    Nanoseconds pause{0};
    std::string why{};  // that an operator is needed, and what to do
  };

  // Throws InvalidArgument.
  explicit Recovery(const RecoveryOptions& options);

  // What to do after `failure`. `text` says what happened, `now` is any clock that never goes back.
  [[nodiscard]] Decision after(Failure failure, const std::string& text, Nanoseconds now);
  // The robot moves and has passed its self-test.
  void is_well() noexcept;
  // Attempts since the robot was well.
  [[nodiscard]] int attempts() const noexcept { return attempts_; }

 private:
  RecoveryOptions options_;
  int attempts_{0};
  Nanoseconds missing_since_{-1};
  // A bucket that fills with time and that each failure takes from: so a rate is bounded without a
  // list of failures.
  double credit_;
  Nanoseconds filled_{-1};
};

}  // namespace trifinger::apps
