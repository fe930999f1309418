// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <gtest/gtest.h>

#include <chrono>
#include <cstdint>
#include <memory>
#include <ostream>
#include <span>
#include <string>
#include <vector>

#include "dynamixel/bus.hpp"
#include "dynamixel/emulated_bus.hpp"
#include "dynamixel/emulated_port.hpp"
#include "trifinger/base/error.hpp"

namespace trifinger::dynamixel {

inline void PrintTo(const MotorModel& model, std::ostream* stream) { *stream << model.name; }

}  // namespace trifinger::dynamixel

namespace trifinger::dynamixel::test {

/// The numbers of D'Claw's motors.
inline const std::vector<MotorId> kClawIds{10, 11, 12, 20, 21, 22, 30, 31, 32};

inline constexpr Instant kBegin{std::chrono::seconds(1000)};

inline std::vector<EmulatedMotorOptions> motors_of(const std::vector<MotorId>& ids, int baud,
                                                   Nanoseconds return_delay,
                                                   const MotorModel* model = &kXm430W210) {
  std::vector<EmulatedMotorOptions> motors;
  motors.reserve(ids.size());
  for (const MotorId id : ids) {
    motors.push_back({.id = id, .model = model, .baud = baud, .return_delay = return_delay});
  }
  return motors;
}

/// A motor of every model, numbered from 0.
inline std::vector<EmulatedMotorOptions> motors_of_all_models(int baud) {
  std::vector<EmulatedMotorOptions> motors;
  for (const MotorModel& model : kMotorModels) {
    const auto id = static_cast<MotorId>(motors.size());
    motors.push_back({.id = id, .model = &model, .baud = baud});
  }
  return motors;
}

/// The name of a model without what the name of a test cannot have.
inline std::string word_of(const testing::TestParamInfo<MotorModel>& tested) {
  std::string name(tested.param.name);
  std::erase(name, '-');
  return name;
}

/// What a rig is made of.
struct RigOptions {
  std::vector<MotorId> ids{kClawIds};
  const MotorModel* model{&kXm430W210};
  int baud{4'000'000};
  Nanoseconds return_delay{0};
  EmulatedBusOptions line{};
};

/// Emulated motors with a host in the same thread, in simulated time.
class Rig {
 public:
  explicit Rig(const RigOptions& options = {})
      : ids(options.ids),
        plant(ids.size()),
        line(motors_of(ids, options.baud, options.return_delay, options.model), plant, kBegin,
             options.line),
        port(new EmulatedPort(line, options.baud, kBegin)),
        bus(std::unique_ptr<Port>(port), {.return_delay = options.return_delay}),
        answers(ids.size()) {}

  /// Time since the beginning.
  [[nodiscard]] Nanoseconds elapsed() const { return port->now() - kBegin; }

  std::vector<MotorId> ids;
  InertiaPlant plant;
  EmulatedBus line;
  EmulatedPort* port;  // the bus owns it
  Bus bus;
  std::vector<MotorAnswer> answers;
};

}  // namespace trifinger::dynamixel::test
