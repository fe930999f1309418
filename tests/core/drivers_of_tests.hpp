// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <memory>
#include <string_view>

#include "core/fake_robot.hpp"
#include "core/odd_robot.hpp"

namespace trifinger::test {

struct FakeDriverTraits {
  static constexpr std::string_view kName = "FakeDriver";
  using Robot = FakeRobot;

  static std::unique_ptr<UntypedDriver> make_driver() {
    return std::make_unique<FakeDriver>(FakeDriver::Options{.sensor_period = 4, .sensor_delay = 2});
  }
  static FakeAction action(TimeIndex k) { return {.setpoint = 0.5 + static_cast<double>(k)}; }
};

struct OddDriverTraits {
  static constexpr std::string_view kName = "OddDriver";
  using Robot = OddRobot;

  static std::unique_ptr<UntypedDriver> make_driver() { return std::make_unique<OddDriver>(); }
  static OddAction action(TimeIndex k) {
    return {.speed = {0.1F * static_cast<float>(k), -1.0F},
            .gear = {static_cast<std::int8_t>(k % 7), static_cast<std::int8_t>(-(k % 3))},
            .colour = static_cast<std::uint16_t>(k)};
  }
};

/// Measures nothing and applies what it gets. Base of drivers that differ from it in one thing.
class IdleDriver : public Driver<FakeRobot> {
 public:
  using Driver::apply_action;
  using Driver::get_latest_observation;
  using Driver::hold;

  [[nodiscard]] DriverReport get_latest_observation(
      FakeObservation& observation) noexcept override {
    observation = {};
    return DriverReport::ready();
  }
  [[nodiscard]] DriverReport apply_action(const FakeAction& desired,
                                          FakeAction& applied) noexcept override {
    applied = desired;
    return DriverReport::ready();
  }
  [[nodiscard]] DriverReport hold(const FakeObservation&, FakeAction& action) noexcept override {
    action = {};
    return DriverReport::ready();
  }
};

}  // namespace trifinger::test
