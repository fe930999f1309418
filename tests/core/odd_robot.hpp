// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <cstring>
#include <span>
#include <string_view>

#include "trifinger/core/driver.hpp"

namespace trifinger::test {

// A robot that has nothing in common with the others: two wheels with gears and a lamp. If it
// works, the core depends on no particular robot. No element is a whole number of 64-bit words, so
// the incomplete last words are tested, too.

struct OddAction {
  std::array<float, 2> speed{};
  std::array<std::int8_t, 2> gear{};
  std::uint16_t colour{0};

  static constexpr auto fields() {
    return std::tuple{field("speed", &OddAction::speed, "rad/s"), field("gear", &OddAction::gear),
                      field("colour", &OddAction::colour)};
  }
};

struct OddAppliedAction {
  std::array<std::int8_t, 2> gear{};
  std::uint8_t was_clipped{0};

  static constexpr auto fields() {
    return std::tuple{field("gear", &OddAppliedAction::gear),
                      field("was_clipped", &OddAppliedAction::was_clipped)};
  }
};

struct OddWheel {
  float angle{0.0F};
  float speed{0.0F};

  static constexpr auto fields() {
    return std::tuple{field("angle", &OddWheel::angle, "rad"),
                      field("speed", &OddWheel::speed, "rad/s")};
  }
};

struct OddObservation {
  OddWheel left;
  OddWheel right;
  std::array<std::array<std::int8_t, 2>, 2> gears{};  // now and before

  static constexpr auto fields() {
    return std::tuple{field("left", &OddObservation::left), field("right", &OddObservation::right),
                      field("gears", &OddObservation::gears)};
  }
};

struct OddRobot {
  static constexpr std::string_view kType = "odd";
  using Action = OddAction;
  using Observation = OddObservation;
  using AppliedAction = OddAppliedAction;
};

/// What the lamp of the odd robot shows. It is read every third step and known two steps later.
struct OddLampReading {
  Stamp stamp;
  std::array<std::uint16_t, 3> colour{};
  std::array<std::int8_t, 2> gear{};

  static constexpr auto fields() {
    return std::tuple{field("stamp", &OddLampReading::stamp),
                      field("colour", &OddLampReading::colour),
                      field("gear", &OddLampReading::gear)};
  }
};

class OddDriver final : public Driver<OddRobot> {
 public:
  using Driver::apply_action;
  using Driver::get_latest_observation;
  using Driver::hold;

  [[nodiscard]] DriverReport prepare(TimeIndex) noexcept override {
    state_ = {};
    next_capture_ = 0;
    return DriverReport::ready();
  }

  [[nodiscard]] DriverReport get_latest_observation(OddObservation& observation) noexcept override {
    observation = state_;
    return DriverReport::ready();
  }

  [[nodiscard]] DriverReport apply_action(const OddAction& desired,
                                          OddAppliedAction& applied) noexcept override {
    constexpr std::int8_t kMaxGear = 5;
    applied = {};
    state_.gears[1] = state_.gears[0];
    for (std::size_t i = 0; i < 2; ++i) {
      applied.gear[i] = std::min(desired.gear[i], kMaxGear);
      if (applied.gear[i] != desired.gear[i]) applied.was_clipped = 1;
    }
    state_.gears[0] = applied.gear;
    move(state_.left, desired.speed[0]);
    move(state_.right, desired.speed[1]);
    colour_ = desired.colour;
    return DriverReport::ready();
  }

  [[nodiscard]] DriverReport hold(const OddObservation& observation,
                                  OddAction& action) noexcept override {
    action = {.speed = {observation.left.speed, observation.right.speed},
              .gear = observation.gears[0]};
    return DriverReport::ready();
  }

  [[nodiscard]] std::span<const CompanionDescription> companions() const noexcept override {
    return companions_;
  }

  [[nodiscard]] bool get_companion_element(std::size_t, TimeIndex time_index,
                                           void* element) noexcept override {
    constexpr TimeIndex kLampPeriod = 3;
    constexpr TimeIndex kLampDelay = 2;
    if (time_index == next_capture_) {
      captured_.stamp = {.arrival_index = time_index + kLampDelay, .capture_index = time_index};
      captured_.colour = {colour_, 0, 0};
      captured_.gear = state_.gears[0];
    }
    if (time_index < next_capture_ + kLampDelay) return false;
    std::memcpy(element, &captured_, sizeof(captured_));
    next_capture_ += kLampPeriod;
    return true;
  }

 private:
  static void move(OddWheel& wheel, float speed) noexcept {
    wheel.speed += 0.25F * (speed - wheel.speed);
    wheel.angle += 0.001F * wheel.speed;
  }

  std::array<CompanionDescription, 1> companions_{CompanionDescription{
      .name = "lamp", .type = "odd_lamp", .element = describe<OddLampReading>(), .history = 256}};
  OddObservation state_;
  OddLampReading captured_;
  std::uint16_t colour_{0};
  TimeIndex next_capture_{0};
};

}  // namespace trifinger::test
