// SPDX-License-Identifier: BSD-3-Clause
#include "core/fake_robot.hpp"

#include <cstring>

namespace trifinger {

FakeDriver::FakeDriver(const Options& options)
    : options_(options),
      companion_{CompanionDescription{
          .name = "sensor", .type = "fake_sensor", .element = describe<FakeSensorReading>()}} {}

DriverReport FakeDriver::prepare(TimeIndex step) noexcept {
  state_ = {};
  observations_ = 0;
  next_capture_ = 0;
  return step < options_.prepare_periods ? DriverReport::busy() : DriverReport::ready();
}

DriverReport FakeDriver::get_latest_observation(FakeObservation& observation) noexcept {
  if (observations_++ == options_.observation_fault_after)
    return DriverReport::fault(kInjectedFault);
  observation = state_;
  return DriverReport::ready();
}

DriverReport FakeDriver::apply_action(const FakeAction& desired, FakeAction& applied) noexcept {
  if (state_.applied_actions == options_.action_fault_after)
    return DriverReport::fault(kInjectedFault);
  const bool is_rejected = desired.setpoint == options_.rejected_setpoint;
  applied.setpoint = is_rejected ? 0.0 : desired.setpoint;
  state_.setpoint = applied.setpoint;
  ++state_.applied_actions;
  return {.action_rejected = is_rejected};
}

DriverReport FakeDriver::hold(const FakeObservation& observation, FakeAction& action) noexcept {
  action.setpoint = observation.setpoint;
  return DriverReport::ready();
}

DriverReport FakeDriver::stop(TimeIndex step) noexcept {
  return step < options_.stop_periods ? DriverReport::busy() : DriverReport::ready();
}

std::span<const CompanionDescription> FakeDriver::companions() const noexcept {
  return {companion_.data(), options_.sensor_period > 0 ? 1U : 0U};
}

bool FakeDriver::get_companion_element(std::size_t, TimeIndex time_index, void* element) noexcept {
  const TimeIndex arrival = next_capture_ + options_.sensor_delay;
  if (arrival > time_index) return false;
  FakeSensorReading reading;
  reading.stamp.capture_index = next_capture_;
  reading.stamp.arrival_index = arrival;
  // The robot counts its actions, so a past reading can be computed without memory.
  reading.applied_actions = state_.applied_actions - (time_index - next_capture_);
  std::memcpy(element, &reading, sizeof(reading));
  next_capture_ += options_.sensor_period;
  return true;
}

std::string_view FakeDriver::fault_text(std::int32_t fault_code) const noexcept {
  return fault_code == kInjectedFault ? "a fault was injected" : "";
}

std::string_view FakeDriver::rejection_text() const noexcept {
  return "its setpoint is the one that this fake robot was told to reject";
}

}  // namespace trifinger
