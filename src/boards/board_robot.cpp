// SPDX-License-Identifier: BSD-3-Clause
#include "boards/board_robot.hpp"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <utility>

#include "base/text_of.hpp"
#include "fault_texts.hpp"
#include "trifinger/base/error.hpp"
#include "trifinger/joint/safety_report.hpp"

namespace trifinger::boards {
namespace {

using trifinger::detail::require;
using trifinger::detail::text_of;

// Checks the options. The safety chain must know what the motors can give at most.
const BoardRobotOptions& with_torque_of_current(BoardRobotOptions& options) {
  options.validate();
  for (std::size_t i = 0; i < options.limits.size(); ++i) {
    const double most = options.max_current * options.motors[i].torque_per_ampere();
    options.limits[i].max_torque = std::min(options.limits[i].max_torque, most);
  }
  // A controller of currents overshoots; twice the largest command is something else.
  options.board.max_current = std::min(options.board.max_current, 2.0 * options.max_current);
  return options;
}

// The largest torques that test the wiring: what a motor may give for long.
std::vector<double> test_torques(const BoardRobotOptions& options) {
  std::vector<double> torques;
  torques.reserve(options.limits.size());
  for (const JointLimit& limit : options.limits) {
    torques.push_back(std::min(limit.max_torque, limit.continuous_torque));
  }
  return torques;
}

std::vector<double> home_positions(const BoardRobotOptions& options) {
  std::vector<double> positions;
  positions.reserve(options.motors.size());
  for (const BoardMotor& motor : options.motors) positions.push_back(motor.homing.home_position);
  return positions;
}

}  // namespace

BoardRobot::BoardRobot(Options options, std::vector<std::unique_ptr<can::Bus>> buses,
                       const Clock& clock)
    : CountedDriver(with_torque_of_current(options), options.limits),
      options_(std::move(options)),
      clock_(clock),
      wiring_(test_torques(options_), options_.period),
      homing_(num_joints()),
      home_position_(home_positions(options_)),
      reports_(num_joints()),
      newest_index_(num_joints()),
      turn_(num_joints()),
      stops_(num_joints()),
      push_(num_joints()),
      zero_(num_joints()),
      start_(num_joints(), 0.0),
      desired_(num_joints()),
      companions_{{{.name = "wear",
                    .type = options_.types.type + "_wear",
                    .element = Wear::describe(num_joints())}}},
      wear_(num_joints()),
      meters_(num_joints()) {
  require(
      buses.size() == options_.interfaces.size(),
      text_of("there are ", options_.interfaces.size(), " boards, but ", buses.size(), " buses"));
  boards_.reserve(buses.size());
  for (auto& bus : buses) boards_.emplace_back(std::move(bus), options_.board);
}

BoardRobot::~BoardRobot() {
  for (Board& board : boards_) board.switch_off();
}

bool BoardRobot::is_homed() const noexcept {
  return is_homed_ && std::ranges::all_of(boards_, &Board::keeps_positions);
}

HomingMeasurement BoardRobot::measure(std::size_t joint) const noexcept {
  const BoardMotor& driven = options_.motors[joint];
  const MotorReading& motor = boards_[driven.place.board].motors()[driven.place.number];
  const double angle = driven.polarity * driven.angle_per_revolution();
  // 1000 revolutions per minute, in revolutions per second.
  constexpr double kKiloRpm = 1000.0 / 60.0;
  return {.angle = angle * motor.revolutions,
          .velocity = angle * kKiloRpm * motor.kilo_rpm,
          .index = angle * motor.index.value_or(motor.revolutions),
          .index_pulses = motor.index_pulses};
}

HomingGains BoardRobot::gains(std::size_t joint) const noexcept {
  const JointLimit& limit = options_.limits[joint];
  return {.kp = limit.default_kp,
          .kd = limit.safety_kd + limit.default_kd,
          .max_torque = std::min(limit.max_torque, limit.continuous_torque)};
}

void BoardRobot::receive(Instant now) noexcept {
  for (Board& board : boards_) board.receive(now);
  count_wear(now);
}

// What a motor does while its board is off or has a fault does not count: nobody knows it.
void BoardRobot::count_wear(Instant now) noexcept {
  // Boards have let their motors go before a longer gap ends.
  constexpr Nanoseconds kLongestGap = std::chrono::milliseconds(100);
  const Nanoseconds passed = std::clamp(now - counted_, Nanoseconds::zero(), kLongestGap);
  const double elapsed = std::chrono::duration<double>(passed).count();
  counted_ = now;
  // A revolution more, because the messages do not come regularly.
  const double reach = options_.board.max_speed * elapsed + 1.0;
  for (std::size_t i = 0; i < num_joints(); ++i) {
    const Terminal& place = options_.motors[i].place;
    const Board& board = boards_[place.board];
    const MotorReading& motor = board.motors()[place.number];
    if (!board.is_ready() || board.fault() != BoardFault::kNone) {
      meters_[i].forget(motor);
      continue;
    }
    const MotorMeter::Step step =
        meters_[i].measure(motor, elapsed, options_.motors[i].torque_constant, reach);
    wear_.powered_time[i] += step.powered_time;
    wear_.revolutions[i] += step.revolutions;
    wear_.work[i] += step.work;
    wear_.squared_current[i] += step.squared_current;
    wear_.index_slips[i] += step.has_slipped ? 1 : 0;
  }
}

// A session counts one fault, however many follow from it.
void BoardRobot::note_fault() noexcept {
  wear_.faults += has_fault_ ? 0 : 1;
  has_fault_ = true;
}

std::vector<std::byte> BoardRobot::wear_bytes() const {
  std::vector<std::byte> bytes(companions_[0].element.size());
  wear_.write({}, bytes.data());
  return bytes;
}

void BoardRobot::continue_wear(std::span<const std::byte> kept) {
  const std::size_t size = companions_[0].element.size();
  require(kept.empty() || kept.size() == size, text_of("running hours of this robot have ", size,
                                                       " bytes, but ", kept.size(), " were kept"));
  if (!kept.empty()) wear_.read(kept.data());
  ++wear_.starts;
}

bool BoardRobot::get_companion_element(std::size_t, TimeIndex time_index, void* element) noexcept {
  if (wear_shown_ && counted_ - *wear_shown_ < std::chrono::seconds(1)) return false;
  wear_shown_ = counted_;
  wear_.write({.arrival_index = time_index, .capture_index = time_index}, element);
  return true;
}

std::uint64_t BoardRobot::lost_frames() const noexcept {
  std::uint64_t lost = 0;
  for (const Board& board : boards_) lost += board.bus().lost + board.counts().missing;
  return lost;
}

DriverReport BoardRobot::joint_fault(std::size_t joint, std::string_view text) noexcept {
  is_homed_ = false;
  note_fault();
  release();
  chain_.set_fault_text(options_.joint_text(joint).append(" ").append(text));
  return DriverReport::fault(kHomingCode + (static_cast<std::int32_t>(joint + 1) << 8));
}

DriverReport BoardRobot::fault_of_boards() noexcept {
  for (std::size_t i = 0; i < boards_.size(); ++i) {
    const Board& board = boards_[i];
    const BoardFault fault = board.fault();
    if (fault == BoardFault::kNone) continue;
    note_fault();
    FaultText text = boards::text_of(fault);
    if (fault == BoardFault::kError) {
      const can::BoardErrorText& error = can::text_of(board.error());
      text = {.sentence = error.sentence, .remedy = error.remedy};
    }
    FixedText described("board ");
    described.append(i).append(" (").append(options_.interfaces[i]);
    append_joints(i, described);
    chain_.set_fault_text(
        described.append("): ").append(text.sentence).append("; ").append(text.remedy));
    return DriverReport::fault(kBoardFaultCode + static_cast<std::int32_t>(fault) +
                               (static_cast<std::int32_t>(i + 1) << 8));
  }
  return DriverReport::ready();
}

void BoardRobot::append_joints(std::size_t board, FixedText& text) const noexcept {
  const auto is_here = [board](const BoardMotor& motor) { return motor.place.board == board; };
  const bool is_one = std::ranges::count_if(options_.motors, is_here) == 1;
  const char* separator = is_one ? ", joint " : ", joints ";
  for (std::size_t i = 0; i < num_joints(); ++i) {
    if (!is_here(options_.motors[i])) continue;
    text.append(separator);
    if (options_.names[i].empty()) {
      text.append(i);
    } else {
      text.append(options_.names[i]);
    }
    separator = " and ";
  }
}

void BoardRobot::observe() noexcept {
  for (std::size_t i = 0; i < num_joints(); ++i) {
    const HomingMeasurement measured = measure(i);
    const BoardMotor& motor = options_.motors[i];
    observation_.position[i] = measured.angle - zero_[i];
    observation_.velocity[i] = measured.velocity;
    observation_.torque[i] = motor.polarity * motor.torque_per_ampere() *
                             boards_[motor.place.board].motors()[motor.place.number].amperes;
  }
  copy_to_all_joints();
  for (std::size_t i = 0; i < tip_force_.size(); ++i) {
    const Terminal& place = options_.tips[i];
    const double value = boards_[place.board].analog_inputs()[place.number];
    tip_force_[i] = std::max(0.0, options_.tip_sensor.scale * (value - options_.tip_sensor.zero));
  }
}

DriverReport BoardRobot::get_latest_observation(void* observation) noexcept {
  const Instant now = clock_.now();
  receive(now);
  observe();
  write_observation(observation);
  if (const DriverReport fault = fault_of_boards(); fault.state != DriverReport::State::kReady) {
    return fault;
  }
  DriverReport report;
  Instant oldest = now;
  for (const Board& board : boards_) oldest = std::min(oldest, board.oldest_measurement());
  report.measurement_age = (now - oldest).count();
  report.lost_frames = static_cast<std::uint32_t>(lost_frames() - lost_before_);
  return report;
}

DriverReport BoardRobot::apply_action(const void* desired, void* applied) noexcept {
  read_element(desired, desired_);
  const DriverReport report = apply(desired_);
  drive(chain_.applied().torque);
  write_element(chain_.applied(), applied);
  if (report.state != DriverReport::State::kFault) return report;
  note_fault();
  const auto fault = static_cast<SafetyFault>(report.fault_code & 0xFF);
  // The zero of its encoder may have moved.
  if (fault == SafetyFault::kPositionJumped) is_homed_ = false;
  // It counts from a wrong place, or something holds it: the way to the end stops, with small
  // torques, leads out of both.
  if (fault == SafetyFault::kHardLimit && homes_at_end_stops()) is_homed_ = false;
  return report;
}

// A joint whose board has a fault gets nothing; the others are damped.
DriverReport BoardRobot::stop(TimeIndex step) noexcept {
  receive(clock_.now());
  observe();
  const auto is_broken = [this] { return fault_of_boards().state != DriverReport::State::kReady; };
  if (phase_ < Phase::kMoving || !apply_stop(step, is_broken)) {
    release();
    return DriverReport::ready();
  }
  drive(chain_.applied().torque);
  return DriverReport::busy();
}

void BoardRobot::drive(const PerJoint<double>& torque) noexcept {
  for (std::size_t board = 0; board < boards_.size(); ++board) {
    can::MotorPair currents{};
    for (std::size_t i = 0; i < num_joints(); ++i) {
      const BoardMotor& motor = options_.motors[i];
      if (motor.place.board != board) continue;
      const double current = motor.polarity * torque[i] / motor.torque_per_ampere();
      // Written so that NaN gives no current.
      currents[motor.place.number] =
          std::isfinite(current) ? std::clamp(current, -options_.max_current, options_.max_current)
                                 : 0.0;
    }
    if (boards_[board].fault() != BoardFault::kNone) currents = {};
    boards_[board].drive(currents);
  }
}

void BoardRobot::release() noexcept {
  for (Board& board : boards_) {
    // A start that waits on a bus without a board must not happen later.
    if (board.is_ready()) {
      board.release();
    } else {
      board.switch_off();
    }
  }
}

}  // namespace trifinger::boards
