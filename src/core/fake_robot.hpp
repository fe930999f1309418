// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <cstdint>
#include <string_view>

#include "trifinger/core/driver.hpp"

namespace trifinger {

/// A command for the fake robot: a number, which it remembers.
struct FakeAction {
  double setpoint{0.0};

  static constexpr auto fields() { return std::tuple{field("setpoint", &FakeAction::setpoint)}; }
};

/// What the fake robot measures: the last applied action and the number of actions so far.
struct FakeObservation {
  double setpoint{0.0};
  std::int64_t applied_actions{0};

  static constexpr auto fields() {
    return std::tuple{field("setpoint", &FakeObservation::setpoint),
                      field("applied_actions", &FakeObservation::applied_actions)};
  }
};

/// An element of the companion "sensor" of the fake robot.
struct FakeSensorReading {
  Stamp stamp;
  std::int64_t applied_actions{0};  ///< Number of actions applied before the step of capture.

  static constexpr auto fields() {
    return std::tuple{field("stamp", &FakeSensorReading::stamp),
                      field("applied_actions", &FakeSensorReading::applied_actions)};
  }
};

/// A robot without physics and without joints, for tests of your own program and for measuring the
/// loop itself.
struct FakeRobot {
  static constexpr std::string_view kType = "fake";
  using Action = FakeAction;
  using Observation = FakeObservation;
};

/// Drives the fake robot. Faults can be injected: each field says after how many calls something
/// goes wrong.
class FakeDriver final : public Driver<FakeRobot> {
 public:
  struct Options {
    TimeIndex prepare_periods{0};  ///< Number of periods until the robot can hold.
    TimeIndex stop_periods{0};     ///< Number of periods of the orderly stop.
    TimeIndex sensor_period{
        0};  ///< Steps between readings of the companion "sensor"; 0 means no companion.
    TimeIndex sensor_delay{0};              ///< Number of steps from capture to arrival.
    TimeIndex observation_fault_after{-1};  ///< The observation with this number faults; -1: none.
    TimeIndex action_fault_after{-1};       ///< The action with this number faults; -1: none.
    double rejected_setpoint{
        -1.0};  ///< Actions with this setpoint are rejected; 0 is applied instead.
  };

  /// Fault code of every injected fault.
  static constexpr std::int32_t kInjectedFault = 7;

  FakeDriver() : FakeDriver(Options{}) {}
  explicit FakeDriver(const Options& options);

  using Driver::apply_action;
  using Driver::get_latest_observation;
  using Driver::hold;

  [[nodiscard]] DriverReport prepare(TimeIndex step) noexcept override;
  [[nodiscard]] DriverReport get_latest_observation(FakeObservation& observation) noexcept override;
  [[nodiscard]] DriverReport apply_action(const FakeAction& desired,
                                          FakeAction& applied) noexcept override;
  [[nodiscard]] DriverReport hold(const FakeObservation& observation,
                                  FakeAction& action) noexcept override;
  [[nodiscard]] DriverReport stop(TimeIndex step) noexcept override;
  void cut() noexcept override {}
  [[nodiscard]] std::span<const CompanionDescription> companions() const noexcept override;
  [[nodiscard]] bool get_companion_element(std::size_t index, TimeIndex time_index,
                                           void* element) noexcept override;
  [[nodiscard]] std::string_view fault_text(std::int32_t fault_code) const noexcept override;
  [[nodiscard]] std::string_view rejection_text() const noexcept override;

 private:
  Options options_;
  std::array<CompanionDescription, 1> companion_;
  FakeObservation state_;
  TimeIndex observations_{0};
  TimeIndex next_capture_{0};
};

}  // namespace trifinger
