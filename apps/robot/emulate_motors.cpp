// SPDX-License-Identifier: BSD-3-Clause
#include "robot/emulate_motors.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <optional>
#include <sstream>
#include <string_view>
#include <utility>

#include "dynamixel/emulator.hpp"
#include "dynamixel/status.hpp"
#include "robot/typed_lines.hpp"
#include "servos/read_options.hpp"
#include "shared/output.hpp"
#include "shared/signals.hpp"
#include "sim/servo_plant.hpp"
#include "trifinger/base/error.hpp"

namespace trifinger::apps {
namespace {

using dynamixel::EmulatedBus;
using dynamixel::HardwareError;
using dynamixel::LineFaults;

constexpr Nanoseconds kSignalPeriod = std::chrono::milliseconds(20);

constexpr auto kErrors = std::to_array<std::pair<std::string_view, HardwareError>>(
    {{"input_voltage", HardwareError::kInputVoltage},
     {"overheating", HardwareError::kOverheating},
     {"encoder", HardwareError::kEncoder},
     {"electric_shock", HardwareError::kElectricShock},
     {"overload", HardwareError::kOverload}});

constexpr auto kLineFaults = std::to_array<std::pair<std::string_view, double LineFaults::*>>(
    {{"loses", &LineFaults::lost},
     {"damages", &LineFaults::damaged},
     {"mishears", &LineFaults::misheard},
     {"delays", &LineFaults::late}});

// Something that goes wrong, and when.
struct ScheduledFault {
  std::string text;
  std::optional<dynamixel::MotorId> motor{};  // otherwise the line
  std::optional<HardwareError> error{};       // of the motor; otherwise it is off
  double LineFaults::* what{nullptr};
  double share{0.0};
  Nanoseconds at{0};
  std::optional<Nanoseconds> length{};
  enum class Phase : std::uint8_t { kWaits, kLasts, kIsOver } phase{Phase::kWaits};
};

[[noreturn]] void refuse(const std::string& text) {
  throw InvalidArgument("'" + text + "' is no fault of Dynamixel motors; there are:\n" +
                        std::string(motor_fault_texts()));
}

Nanoseconds in_nanoseconds(double seconds) {
  return std::chrono::round<Nanoseconds>(std::chrono::duration<double>(seconds));
}

ScheduledFault parse(const std::string& text) {
  std::istringstream words(text);
  ScheduledFault fault{.text = text};
  std::string word;
  std::string what;
  words >> word;
  if (word == "motor") {
    int id = -1;
    words >> id >> what;
    constexpr int kMaxId = dynamixel::kMaxId;
    if (!words || id < 0 || id > kMaxId) refuse(text);
    fault.motor = static_cast<dynamixel::MotorId>(id);
    const auto* const error =
        std::ranges::find(kErrors, what, &decltype(kErrors)::value_type::first);
    if (error != kErrors.end()) {
      fault.error = error->second;
    } else if (what != "off") {
      refuse(text);
    }
  } else if (word == "line") {
    words >> what >> fault.share;
    const auto* const line =
        std::ranges::find(kLineFaults, what, &decltype(kLineFaults)::value_type::first);
    // Written so that NaN fails.
    const bool is_share = fault.share >= 0.0 && fault.share <= 1.0;
    if (!words || line == kLineFaults.end() || !is_share) {
      refuse(text);
    }
    fault.what = line->second;
  } else {
    refuse(text);
  }
  while (words >> word) {
    double seconds = -1.0;
    std::string unit;
    words >> seconds >> unit;
    constexpr double kMost = 1e6;
    const bool is_time = seconds >= 0.0 && seconds <= kMost;
    if (unit != "s" || !is_time) refuse(text);
    if (word == "at") {
      fault.at = in_nanoseconds(seconds);
    } else if (word == "for") {
      fault.length = in_nanoseconds(seconds);
    } else {
      refuse(text);
    }
  }
  return fault;
}

// The faults of an emulator, as they are given and as they happen.
class ScheduledFaults {
 public:
  ScheduledFaults(dynamixel::Emulator& emulator, std::string name)
      : emulator_(emulator), name_(std::move(name)) {}

  void add(ScheduledFault fault, Nanoseconds now) {
    fault.at += now;
    require_motor(fault);
    faults_.push_back(std::move(fault));
  }

  void look(Nanoseconds now) {
    for (ScheduledFault& fault : faults_) {
      using enum ScheduledFault::Phase;
      if (fault.phase == kWaits && now >= fault.at) change(fault, kLasts, "begins");
      if (fault.phase == kLasts && fault.length && now >= fault.at + *fault.length) {
        change(fault, kIsOver, "is over");
      }
    }
  }

 private:
  static std::optional<std::size_t> find(EmulatedBus& bus, dynamixel::MotorId id) {
    for (std::size_t i = 0; i < bus.num_motors(); ++i) {
      if (bus.motor(i).id() == id) return i;
    }
    return std::nullopt;
  }
  void require_motor(const ScheduledFault& fault) {
    if (!fault.motor) return;
    bool is_there = false;
    emulator_.change([&](EmulatedBus& bus) { is_there = find(bus, *fault.motor).has_value(); });
    if (!is_there) {
      throw InvalidArgument(fmt::format("there is no motor {}, for which there is the fault '{}'",
                                        int{*fault.motor}, fault.text));
    }
  }
  void change(ScheduledFault& fault, ScheduledFault::Phase phase, const char* what) {
    fault.phase = phase;
    const bool begins = phase == ScheduledFault::Phase::kLasts;
    emulator_.change([&](EmulatedBus& bus) {
      if (fault.what != nullptr) {
        line_.*fault.what = begins ? fault.share : 0.0;
        bus.set_faults(line_);
        return;
      }
      const auto index = find(bus, *fault.motor);
      if (!index) return;
      if (!fault.error) {
        bus.motor(*index).set_power(!begins);
      } else if (begins) {
        bus.motor(*index).fail(*fault.error);
      }
    });
    print_safely("{}: fault '{}' {}\n", name_, fault.text, what);
    std::fflush(stdout);
  }

  dynamixel::Emulator& emulator_;
  std::string name_;
  std::vector<ScheduledFault> faults_;
  LineFaults line_{};
};

}  // namespace

std::string_view motor_fault_texts() {
  return "motor N off [at T s] [for T s]\n"
         "motor N ERROR [at T s]\n"
         "line loses P [at T s] [for T s]\n"
         "line damages P [at T s] [for T s]\n"
         "line mishears P [at T s] [for T s]\n"
         "line delays P [at T s] [for T s]\n";
}

void emulate_motors(const RobotConfig& config, const std::vector<std::string>& faults,
                    const RealtimeOptions& realtime) {
  std::vector<ScheduledFault> given;
  given.reserve(faults.size());
  for (const std::string& text : faults) given.push_back(parse(text));
  const servos::ServoConfig& servos = *config.servos;
  if (!servos.port.empty()) {
    throw InvalidArgument("'" + config.name + "' has its motors at " + servos.port +
                          "; --set dynamixel.port=emulated emulates them");
  }
  const Signals signals;
  ServoPlant plant(config.simulation, servos);
  // The emulator's thread takes over what this one has been granted.
  for (const std::string& warning : enter_realtime(realtime)) {
    print_safely(stderr, "{}: {}\n", config.name, warning);
  }
  dynamixel::Emulator emulator(servos::emulated_motors(servos), plant, {},
                               servos::emulated_port(config.name).string());
  ScheduledFaults scheduled(emulator, config.name);
  const Instant begin = std::chrono::steady_clock::now();
  const auto elapsed = [begin] { return std::chrono::steady_clock::now() - begin; };
  for (ScheduledFault& fault : given) scheduled.add(std::move(fault), Nanoseconds::zero());
  print_safely("{}: {} emulated motors are on, at {}; Ctrl-C switches them off.\n", config.name,
               servos::emulated_motors(servos).size(), emulator.path());
  std::fflush(stdout);
  TypedLines typed;
  while (!signals.wait(kSignalPeriod)) {
    for (const std::string& line : typed.take()) {
      try {
        if (line == "reset") {
          emulator.change([&plant](EmulatedBus&) { plant.reset(); });
        } else {
          scheduled.add(parse(line), elapsed());
        }
      } catch (const InvalidArgument& error) {
        print_safely(stderr, "{}: {}\n", config.name, error.what());
      }
    }
    scheduled.look(elapsed());
    bool has_diverged = false;
    emulator.change([&](EmulatedBus&) { has_diverged = plant.has_diverged(); });
    if (has_diverged) throw Error("the simulation of the robot has diverged");
  }
  print_safely("{}: off.\n", config.name);
}

}  // namespace trifinger::apps
