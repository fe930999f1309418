// SPDX-License-Identifier: BSD-3-Clause
#include "boards/emulator.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <string>
#include <utility>

#include "trifinger/base/error.hpp"

namespace trifinger::boards {
namespace {

using Kind = EmulatedFault::Kind;

}  // namespace

Emulator::Emulator(const BoardRobotOptions& wiring, std::vector<std::unique_ptr<can::Bus>> buses,
                   Plant& plant, Instant now, const EmulatedBoardOptions& options)
    : wiring_((wiring.validate(), wiring)),
      buses_(std::move(buses)),
      plant_(plant),
      torque_(wiring_.motors.size()),
      aligned_at_(wiring_.motors.size()),
      started_(now),
      scripted_(buses_.size(), nullptr),
      joint_faults_(wiring_.motors.size()),
      random_{.seed = options.seed} {
  trifinger::detail::require(buses_.size() == wiring_.interfaces.size(),
                             "every emulated board needs a bus");
  for (std::size_t i = 0; i < buses_.size(); ++i) {
    EmulatedBoardOptions its_options = options;
    // No two encoders are mounted alike, and no two draw the same noise.
    for (std::size_t motor = 0; motor < 2; ++motor) {
      double& place = its_options.index_places[motor];
      place += 0.137 * static_cast<double>(i);
      place -= static_cast<double>(static_cast<int>(place));
    }
    its_options.seed += i;
    boards_.emplace_back(its_options);
  }
  set_power(true, now);
}

void Emulator::set_power(bool is_on, Instant now) noexcept {
  for (std::size_t i = 0; i < boards_.size(); ++i) set_power(i, is_on, now);
}

void Emulator::set_power(std::size_t board, bool is_on, Instant now) noexcept {
  if (is_on) {
    boards_[board].switch_on(now, rotors(board));
  } else {
    boards_[board].switch_off();
  }
}

void Emulator::tick(Instant now) noexcept {
  execute(now);
  for (std::size_t i = 0; i < torque_.size(); ++i) {
    const BoardMotor& motor = wiring_.motors[i];
    const EmulatedBoard& board = boards_[motor.place.board];
    const double current = board.currents()[motor.place.number];
    if (joint_faults_[i].is_loose) {
      torque_[i] = 0.0;
      turn_loose_motor(i, motor.polarity * current);
    } else if (board.is_aligning(motor.place.number)) {
      torque_[i] = holding_torque(i);
    } else {
      aligned_at_[i] = plant_.position()[i];
      torque_[i] = motor.polarity * motor.torque_per_ampere() * current;
    }
  }
  plant_.step(torque_);
  for (std::size_t i = 0; i < boards_.size(); ++i) {
    if (scripted_[i] != nullptr) scripted_[i]->set_time(now);
    for (const can::Frame& frame : buses_[i]->receive(frames_)) boards_[i].receive(frame, now);
    static_cast<void>(buses_[i]->send(boards_[i].tick(now, rotors(i), analog_inputs(i))));
  }
}

// Currents of alignment hold the rotor where it is.
double Emulator::holding_torque(std::size_t joint) const noexcept {
  constexpr double kStiffness = 20.0;  // [Nm/rad]
  constexpr double kDamping = 0.1;     // [Nms/rad]
  constexpr double kMost = 0.5;        // [Nm]
  const double torque = kStiffness * (aligned_at_[joint] - plant_.position()[joint]) -
                        kDamping * plant_.velocity()[joint];
  return std::clamp(torque, -kMost, kMost);
}

EmulatedBoard::Rotors Emulator::rotors(std::size_t board) noexcept {
  EmulatedBoard::Rotors rotors{};
  for (std::size_t i = 0; i < wiring_.motors.size(); ++i) {
    const BoardMotor& motor = wiring_.motors[i];
    if (motor.place.board != board) continue;
    const double turns = motor.polarity * (motor.gear_ratio / (2.0 * std::numbers::pi));
    // From revolutions per second to 1000 revolutions per minute.
    rotors[motor.place.number] = {.revolutions = turns * seen_angle(i),
                                  .kilo_rpm = turns * seen_speed(i) * 60.0 / 1000.0};
  }
  return rotors;
}

std::array<double, 2> Emulator::analog_inputs(std::size_t board) const noexcept {
  std::array<double, 2> values{};
  const std::span<const double> force = plant_.tip_force();
  for (std::size_t i = 0; i < wiring_.tips.size(); ++i) {
    const Terminal& place = wiring_.tips[i];
    if (place.board != board) continue;
    values[place.number] = wiring_.tip_sensor.zero + force[i] / wiring_.tip_sensor.scale;
  }
  return values;
}

// ---- faults ----

void Emulator::add(const EmulatedFault& fault, Instant now) {
  const auto require_number = [](const char* what, std::size_t number, std::size_t count) {
    trifinger::detail::require(number < count, std::string("there is no ") + what + " " +
                                                   std::to_string(number) + ", only 0 to " +
                                                   std::to_string(count - 1));
  };
  const Instant begin = fault.at ? started_ + *fault.at : now;
  const Instant end = fault.duration ? begin + *fault.duration : Instant::max();
  if (fault.kind >= Kind::kJointJumps) {
    require_number("joint", fault.number, wiring_.motors.size());
    if (fault.kind == Kind::kJointsSwapped)
      require_number("joint", fault.other, wiring_.motors.size());
  } else if (fault.kind > Kind::kPowerOn) {
    require_number(fault.kind >= Kind::kBusLoses ? "bus" : "board", fault.number, boards_.size());
  }
  add_to_bus(fault, begin, end);
  faults_.push_back({.fault = fault, .begin = begin, .end = end});
}

// Adds a fault of a bus to the script of that bus.
void Emulator::add_to_bus(const EmulatedFault& fault, Instant begin, Instant end) {
  using Bus = can::BusFault::Kind;
  struct Script {
    Kind kind;
    Bus on_bus;
    bool is_by_chance{false};  // with the fault's amount as probability
  };
  constexpr std::array<Script, 10> kScripts{{{Kind::kBoardSilent, Bus::kLose},
                                             {Kind::kBusLoses, Bus::kLose, true},
                                             {Kind::kBusDuplicates, Bus::kDuplicate, true},
                                             {Kind::kBusDelays, Bus::kDelay, true},
                                             {Kind::kBusCorrupts, Bus::kCorrupt, true},
                                             {Kind::kBusFlooded, Bus::kFlood},
                                             {Kind::kBusFull, Bus::kQueueFull},
                                             {Kind::kBusOff, Bus::kBusOff},
                                             {Kind::kBusDown, Bus::kDown},
                                             {Kind::kBusGone, Bus::kGone}}};
  const auto* const found = std::ranges::find(kScripts, fault.kind, &Script::kind);
  if (found == kScripts.end()) return;
  can::BusFault script{.kind = found->on_bus,
                       .begin = begin,
                       .end = end,
                       .probability = found->is_by_chance ? fault.amount : 1.0,
                       .node = {},
                       .id = {}};
  // The board's own frames; the other node is everybody else.
  if (fault.kind == Kind::kBoardSilent || fault.kind == Kind::kBusFull) script.node = 0;
  if (script.kind == Bus::kDelay) script.delay = fault.time;
  if (script.kind == Bus::kFlood) script.rate = fault.amount;
  scripted(fault.number).add(script);
}

can::ScriptedBus& Emulator::scripted(std::size_t bus) {
  if (scripted_[bus] == nullptr) {
    auto made = std::make_unique<can::ScriptedBus>(std::move(buses_[bus]), random_.seed + bus);
    scripted_[bus] = made.get();
    buses_[bus] = std::move(made);
  }
  return *scripted_[bus];
}

void Emulator::execute(Instant now) noexcept {
  using Phase = ScheduledFault::Phase;
  for (ScheduledFault& scheduled : faults_) {
    if (scheduled.phase == Phase::kWaits && now >= scheduled.begin) {
      scheduled.phase = Phase::kLasts;
      begin(scheduled.fault, now);
    }
    if (scheduled.phase == Phase::kLasts && now >= scheduled.end) {
      scheduled.phase = Phase::kIsOver;
      end(scheduled.fault, now);
    }
  }
}

bool Emulator::has_power(std::size_t board) const noexcept {
  return std::ranges::none_of(faults_, [board](const ScheduledFault& scheduled) {
    const EmulatedFault& fault = scheduled.fault;
    return scheduled.phase == ScheduledFault::Phase::kLasts &&
           (fault.kind == Kind::kPowerOff ||
            (fault.kind == Kind::kBoardOff && fault.number == board));
  });
}

// Switches boards on and off as the faults that last say.
void Emulator::restore_power(Instant now) noexcept {
  for (std::size_t i = 0; i < boards_.size(); ++i) {
    if (boards_[i].is_on() != has_power(i)) set_power(i, has_power(i), now);
  }
}

// Ends the faults for which boards are without power.
void Emulator::end_power_faults() noexcept {
  for (ScheduledFault& other : faults_) {
    const bool is_off = other.fault.kind == Kind::kPowerOff || other.fault.kind == Kind::kBoardOff;
    if (is_off && other.phase == ScheduledFault::Phase::kLasts) {
      other.phase = ScheduledFault::Phase::kIsOver;
    }
  }
}

void Emulator::begin(const EmulatedFault& fault, Instant now) noexcept {
  const std::size_t number = fault.number;
  switch (fault.kind) {
    case Kind::kPowerOff:
    case Kind::kBoardOff:
      restore_power(now);
      break;
    case Kind::kPowerOn:
      end_power_faults();
      restore_power(now);
      break;
    case Kind::kBoardRestart:
      set_power(number, false, now);
      restore_power(now);
      break;
    case Kind::kBoardRollover:
      set_power(number, false, now);
      if (has_power(number)) {
        boards_[number].switch_on(now, rotors(number), can::kRolloverRevolutions - 0.01);
      }
      break;
    case Kind::kBoardError:
      boards_[number].fail(fault.error);
      break;
    case Kind::kJointJumps:
      joint_faults_[number].jump += fault.amount;
      break;
    case Kind::kJointStuck:
      joint_faults_[number].stuck_at = seen_angle(number);
      joint_faults_[number].is_stuck = true;
      break;
    case Kind::kJointNoisy:
      joint_faults_[number].noise = std::abs(fault.amount);
      break;
    case Kind::kJointHot:
      joint_faults_[number].hot_motor = wiring_.motors[number].place;
      boards_[wiring_.motors[number].place.board].set_current_factor(
          wiring_.motors[number].place.number, fault.amount);
      break;
    case Kind::kJointLoose:
      joint_faults_[number].loose_angle = plant_.position()[number];
      joint_faults_[number].loose_speed = 0.0;
      joint_faults_[number].is_loose = true;
      break;
    case Kind::kJointReversed:
      wiring_.motors[number].polarity = -wiring_.motors[number].polarity;
      break;
    case Kind::kJointsSwapped:
      std::swap(wiring_.motors[number].place, wiring_.motors[fault.other].place);
      break;
    default:  // in the script of the bus
      break;
  }
}

void Emulator::end(const EmulatedFault& fault, Instant now) noexcept {
  const std::size_t number = fault.number;
  switch (fault.kind) {
    case Kind::kPowerOff:
    case Kind::kBoardOff:
      restore_power(now);
      break;
    case Kind::kJointJumps:
      joint_faults_[number].jump -= fault.amount;
      break;
    case Kind::kJointStuck:
      joint_faults_[number].is_stuck = false;
      break;
    case Kind::kJointNoisy:
      joint_faults_[number].noise = 0.0;
      break;
    case Kind::kJointHot:
      boards_[joint_faults_[number].hot_motor.board].set_current_factor(
          joint_faults_[number].hot_motor.number, 1.0);
      break;
    case Kind::kJointLoose:
      joint_faults_[number].is_loose = false;
      break;
    case Kind::kJointReversed:
    case Kind::kJointsSwapped:
      begin(fault, now);  // the same exchange once more
      break;
    default:
      break;
  }
}

// A motor alone: its current drives it against friction that grows with its speed.
void Emulator::turn_loose_motor(std::size_t joint, double amperes) noexcept {
  constexpr double kTick = 1e-3;         // [s]
  constexpr double kTimeConstant = 0.1;  // [s]
  constexpr double kSpeed = 5.0;         // at the joint, per ampere [rad/s]
  JointFault& fault = joint_faults_[joint];
  fault.loose_speed += kTick / kTimeConstant * (kSpeed * amperes - fault.loose_speed);
  fault.loose_angle += kTick * fault.loose_speed;
}

double Emulator::seen_angle(std::size_t joint) noexcept {
  const JointFault& fault = joint_faults_[joint];
  if (fault.is_stuck) return fault.stuck_at;
  double angle = fault.is_loose ? fault.loose_angle : plant_.position()[joint];
  angle += fault.jump;
  if (fault.noise > 0.0) angle += random_.uniform(-fault.noise, fault.noise);
  return angle;
}

double Emulator::seen_speed(std::size_t joint) const noexcept {
  const JointFault& fault = joint_faults_[joint];
  if (fault.is_stuck) return 0.0;
  return fault.is_loose ? fault.loose_speed : plant_.velocity()[joint];
}

}  // namespace trifinger::boards
