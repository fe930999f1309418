// SPDX-License-Identifier: BSD-3-Clause
// How a robot on motor boards prepares.
#include <algorithm>
#include <chrono>
#include <cmath>
#include <optional>
#include <utility>

#include "boards/board_robot.hpp"
#include "fault_texts.hpp"

namespace trifinger::boards {

namespace {

double seconds(Nanoseconds time) noexcept { return std::chrono::duration<double>(time).count(); }

}  // namespace

DriverReport BoardRobot::prepare(TimeIndex step) noexcept {
  const Instant now = clock_.now();
  if (step == 0) {
    for (Board& board : boards_) board.resume(now);
    phase_ = Phase::kStarting;
    has_fault_ = false;
    // A pause is no wear.
    counted_ = now;
    wear_shown_.reset();
    for (MotorMeter& meter : meters_) meter.skip_travel();
    // Motors stay as warm as they were.
    for (JointMemory& memory : chain_.memory()) memory = {.heat = memory.heat};
  }
  receive(now);
  if (phase_ == Phase::kStarting) start_what_is_not_ready(step, now);
  if (const DriverReport fault = fault_of_boards(); fault.state != DriverReport::State::kReady) {
    return fault;
  }
  if (phase_ == Phase::kStarting) {
    const auto is_usable = [](const Board& board) {
      return board.is_ready() && board.is_current();
    };
    if (!std::ranges::all_of(boards_, is_usable)) return DriverReport::busy();
    std::ranges::fill(newest_index_, NewestIndex());
    begin_phase_after(Phase::kStarting);
  }
  measure_index_distances();
  const DriverReport report = do_phase();
  if (report.state == DriverReport::State::kReady) lost_before_ = lost_frames();
  return report;
}

void BoardRobot::begin_phase_after(Phase phase) noexcept {
  const bool must_home =
      preparation_.home || preparation_.test || preparation_.reference || !is_homed();
  const bool must_test = preparation_.test || (options_.self_test && must_home);
  switch (phase) {
    case Phase::kStarting:
      if (preparation_.reference) {
        begin_reference();
        return;
      }
      [[fallthrough]];
    case Phase::kReference:
      if (must_test) {
        begin_test();
        return;
      }
      [[fallthrough]];
    case Phase::kTesting:
      if (must_home) {
        begin_homing();
        return;
      }
      // It may have been moved by hand, or have fallen while it was released.
      if (!is_outside()) break;
      [[fallthrough]];
    case Phase::kHoming:
      begin_move();
      return;
    case Phase::kMoving:
      if (preparation_.test) {
        begin_sweeps();
        return;
      }
      break;
    case Phase::kSweeping:
    case Phase::kReady:
      break;
  }
  phase_ = Phase::kReady;
}

DriverReport BoardRobot::do_phase() noexcept {
  switch (phase_.load()) {
    case Phase::kStarting:
      return DriverReport::busy();
    case Phase::kReference:
      return wait_for_reference();
    case Phase::kTesting:
      return test();
    case Phase::kHoming:
      return home();
    case Phase::kMoving:
      return move();
    case Phase::kSweeping:
      return sweep();
    case Phase::kReady:
      break;
  }
  return DriverReport::ready();
}

// A board that was ready may have been switched off in a pause, so this is no fault yet.
void BoardRobot::start_what_is_not_ready(TimeIndex step, Instant now) noexcept {
  for (Board& board : boards_) {
    const bool is_lost = board.is_ready() && board.fault() != BoardFault::kNone;
    if (is_lost || (step == 0 && !board.is_ready())) board.start(now);
  }
}

bool BoardRobot::is_outside() noexcept {
  observe();
  for (std::size_t i = 0; i < num_joints(); ++i) {
    const JointLimit& limit = options_.limits[i];
    const double position = observation_.position[i];
    if (position < limit.soft_lower || position > limit.soft_upper) return true;
  }
  return false;
}

void BoardRobot::begin_reference() noexcept {
  is_homed_ = false;
  reference_step_ = ReferenceStep::kWaiting;
  release();
  phase_ = Phase::kReference;
}

DriverReport BoardRobot::wait_for_reference() noexcept {
  if (reference_step_ == ReferenceStep::kTaken) {
    for (std::size_t i = 0; i < num_joints(); ++i) {
      zero_[i] = measure(i).angle - (*preparation_.reference)[i];
    }
    // Unless somebody has left it meanwhile.
    ReferenceStep expected = ReferenceStep::kTaken;
    reference_step_.compare_exchange_strong(expected, ReferenceStep::kStored);
    return DriverReport::busy();
  }
  if (reference_step_ == ReferenceStep::kLeft) begin_phase_after(Phase::kReference);
  return DriverReport::busy();
}

void BoardRobot::begin_test() noexcept {
  is_homed_ = false;
  phase_ = Phase::kTesting;
  for (std::size_t i = 0; i < num_joints(); ++i) {
    reports_[i] = {.max_torque = options_.limits[i].max_torque};
  }
  wiring_.begin();
}

DriverReport BoardRobot::test() noexcept {
  PerJoint<double> angles(num_joints(), 0.0);
  PerJoint<double> torques(num_joints(), 0.0);
  for (std::size_t i = 0; i < num_joints(); ++i) angles[i] = measure(i).angle;
  wiring_.next(angles, torques);
  for (std::size_t i = 0; i < num_joints(); ++i) {
    const bool is_held = i != wiring_.joint() && wiring_.findings()[i].is_good(i);
    if (!is_held) {
      start_[i] = angles[i];
      continue;
    }
    const HomingGains gain = gains(i);
    torques[i] = std::clamp(gain.kp * (start_[i] - angles[i]) - gain.kd * measure(i).velocity,
                            -gain.max_torque, gain.max_torque);
  }
  drive(torques);
  if (!wiring_.is_done()) return DriverReport::busy();
  for (std::size_t i = 0; i < num_joints(); ++i) reports_[i].wiring = wiring_.findings()[i];
  for (std::size_t i = 0; i < num_joints(); ++i) {
    const WiringFinding& found = wiring_.findings()[i];
    if (!found.moves) {
      return joint_fault(i,
                         "does not move when its motor is driven; check the motor's cable, the "
                         "belt, and what is in its way");
    }
    if (found.is_hindered) {
      return joint_fault(i,
                         "moves as if something held it back; see that it is free, then recover");
    }
    if (found.joint != i) {
      FixedText text("is not what its motor moves: that is ");
      text.append(options_.joint_text(found.joint).view())
          .append("; exchange the cables of these motors, or those of their encoders");
      return joint_fault(i, text.view());
    }
    if (found.is_reversed) {
      return joint_fault(i, "turns against its torque; exchange two wires of its motor");
    }
  }
  begin_phase_after(Phase::kTesting);
  return DriverReport::busy();
}

// The way between two indexes that came one after the other is a revolution of the motor, unless it
// has turned back to the same one.
void BoardRobot::measure_index_distances() noexcept {
  for (std::size_t i = 0; i < num_joints(); ++i) {
    const HomingMeasurement measured = measure(i);
    NewestIndex& newest = newest_index_[i];
    const double distance = std::abs(measured.index - newest.angle);
    if (newest.pulses > 0 && measured.index_pulses == newest.pulses + 1 &&
        distance > 0.5 * options_.motors[i].angle_per_revolution()) {
      reports_[i].index_distance = distance;
    }
    newest = {.angle = measured.index, .pulses = measured.index_pulses};
  }
}

void BoardRobot::begin_homing() noexcept {
  is_homed_ = false;
  phase_ = Phase::kHoming;
  free_pushes_ = std::exchange(must_free_, false) ? 12 : 0;
  stop_pushes_ = 0;
  has_stops_ = !homes_at_end_stops();
  begin_push();
}

void BoardRobot::begin_push() noexcept {
  // If two pushes have ended elsewhere, the joints take turns in a random order, and until then go
  // the other way: a finger that leans on the table, on a wall or on another finger comes free when
  // its joints do not push at once.
  constexpr Nanoseconds kTurn = std::chrono::milliseconds(1500);
  constexpr std::int64_t kTurns = 3;
  part_steps_ = 0;
  for (std::size_t i = 0; i < num_joints(); ++i) {
    const BoardMotor& motor = options_.motors[i];
    turn_[i] = stop_pushes_ < 2 ? 0 : pushes_.integer(0, kTurns) * (kTurn / options_.period);
    push_[i] = -pushes_.uniform(0.0, 1.0) * motor.homing.torque;
    homing_[i].begin(motor.homing.method, motor.homing.torque, motor.angle_per_revolution(),
                     measure(i));
  }
}

// Fingers that hook into each other come apart when each joint is pushed another way each time. No
// push is harder than that towards an end stop.
DriverReport BoardRobot::free_joints() noexcept {
  constexpr Nanoseconds kPush = std::chrono::milliseconds(400);
  const TimeIndex steps = std::max<TimeIndex>(1, kPush / options_.period);
  if (part_steps_ == steps * free_pushes_) {
    free_pushes_ = 0;
    begin_push();
    return home();
  }
  PerJoint<double> torque(num_joints(), 0.0);
  for (std::size_t i = 0; i < num_joints(); ++i) {
    const double towards_stop = options_.motors[i].homing.torque;
    // The first push leads away from what the joint leans on.
    if (part_steps_ == 0) {
      push_[i] = -pushes_.uniform(0.5, 1.0) * towards_stop;
    } else if (part_steps_ % steps == 0) {
      push_[i] = pushes_.uniform(-1.0, 1.0) * towards_stop;
    }
    torque[i] = free_torque(i, measure(i));
  }
  ++part_steps_;
  drive(torque);
  return DriverReport::busy();
}

double BoardRobot::free_torque(std::size_t joint,
                               const HomingMeasurement& measured) const noexcept {
  const HomingGains gain = gains(joint);
  const double most = std::min(std::abs(options_.motors[joint].homing.torque), gain.max_torque);
  return std::clamp(push_[joint] - gain.kd * measured.velocity, -most, most);
}

// An end stop is always in the same place. A finger that leans on the table, on a wall or on
// another finger comes to rest elsewhere when it was pushed to and fro meanwhile.
DriverReport BoardRobot::confirm_stops() noexcept {
  constexpr double kSamePlace = 0.02;  // [rad]
  constexpr int kFreePushes = 3;
  constexpr int kMaxPushes = 12;
  std::optional<std::size_t> moved;
  for (std::size_t i = 0; i < num_joints(); ++i) {
    const double angle = measure(i).angle;
    if (std::abs(angle - std::exchange(stops_[i], angle)) > kSamePlace && !moved) moved = i;
  }
  has_stops_ = ++stop_pushes_ > 1 && !moved;
  if (has_stops_) return DriverReport::ready();
  if (moved && stop_pushes_ == kMaxPushes) {
    return joint_fault(*moved,
                       "comes to rest at another place whenever it is pushed to its end stop; see "
                       "what is in its way");
  }
  free_pushes_ = kFreePushes;
  part_steps_ = 0;
  return DriverReport::busy();
}

DriverReport BoardRobot::home() noexcept {
  if (free_pushes_ > 0) return free_joints();
  PerJoint<double> torque(num_joints(), 0.0);
  bool is_part_done = true;
  for (std::size_t i = 0; i < num_joints(); ++i) {
    const HomingMeasurement measured = measure(i);
    torque[i] = part_steps_ < turn_[i]
                    ? free_torque(i, measured)
                    : homing_[i].next(measured, gains(i), seconds(options_.period));
    const auto failure = homing_[i].failure(measured, options_.max_travel);
    if (failure != JointHoming::Failure::kNone) return joint_fault(i, boards::text_of(failure));
    is_part_done = is_part_done && homing_[i].is_part_done();
  }
  if (++part_steps_ * options_.period > options_.max_homing_time) {
    for (std::size_t i = 0; i < num_joints(); ++i) {
      if (homing_[i].is_part_done()) continue;
      return joint_fault(i, "does not come to rest at its end stop; check the belt and the torque");
    }
  }
  drive(torque);
  if (!is_part_done) return DriverReport::busy();
  if (!has_stops_) {
    const DriverReport report = confirm_stops();
    if (report.state != DriverReport::State::kReady) return report;
  }
  bool has_next_part = false;
  for (std::size_t i = 0; i < num_joints(); ++i) {
    has_next_part |= homing_[i].next_part(measure(i));
  }
  part_steps_ = 0;
  std::ranges::fill(turn_, 0);
  if (has_next_part) return DriverReport::busy();
  for (std::size_t i = 0; i < num_joints(); ++i) {
    if (preparation_.reference) {
      home_position_[i] = homing_[i].home() - zero_[i];
    } else {
      zero_[i] = homing_[i].home() - home_position_[i];
    }
  }
  for (Board& board : boards_) board.trust_positions();
  is_homed_ = true;
  ++wear_.homings;
  begin_phase_after(Phase::kHoming);
  return DriverReport::busy();
}

// All joints do, or none: `BoardRobotOptions::validate`.
bool BoardRobot::homes_at_end_stops() const noexcept {
  return std::ranges::any_of(options_.motors, [](const BoardMotor& motor) {
    return homes_at_end_stop(motor.homing.method);
  });
}

void BoardRobot::begin_move() noexcept {
  phase_ = Phase::kMoving;
  part_steps_ = 0;
  observe();
  start_ = observation_.position;
}

PerJoint<double> BoardRobot::torques_towards(const PerJoint<double>& target) const noexcept {
  PerJoint<double> torque(num_joints(), 0.0);
  write_weight(observation_.position, torque);
  for (std::size_t i = 0; i < num_joints(); ++i) {
    const HomingGains gain = gains(i);
    torque[i] += gain.kp * (target[i] - observation_.position[i]);
    torque[i] = std::clamp(torque[i] - gain.kd * observation_.velocity[i], -gain.max_torque,
                           gain.max_torque);
  }
  return torque;
}

// End stops may be beyond hard limits, so the safety chain cannot judge this movement.
DriverReport BoardRobot::move() noexcept {
  observe();
  // At the end the joints have half a second to arrive.
  const double time = seconds(++part_steps_ * options_.period);
  const double done = trifinger::detail::smooth(std::min(time / seconds(options_.move_time), 1.0));
  PerJoint<double> target(num_joints(), 0.0);
  for (std::size_t i = 0; i < num_joints(); ++i) {
    target[i] = start_[i] + done * (options_.initial_position[i] - start_[i]);
  }
  drive(torques_towards(target));
  constexpr double kSettling = 0.5;
  if (time < seconds(options_.move_time) + kSettling) return DriverReport::busy();
  constexpr double kTolerance = 0.2;  // [rad]
  for (std::size_t i = 0; i < num_joints(); ++i) {
    const double error = std::abs(observation_.position[i] - options_.initial_position[i]);
    if (error > kTolerance) {
      // Fingers that have fallen may hold each other, and then homing took that for end stops.
      must_free_ = homes_at_end_stops();
      return joint_fault(i,
                         "did not reach its initial position; check max_current, home_position, "
                         "and whether something is in its way");
    }
  }
  begin_phase_after(Phase::kMoving);
  return phase_ == Phase::kReady ? DriverReport::ready() : DriverReport::busy();
}

void BoardRobot::begin_sweeps() noexcept {
  phase_ = Phase::kSweeping;
  swept_ = 0;
  sweep_.begin();
}

DriverReport BoardRobot::sweep() noexcept {
  observe();
  PerJoint<double> target{std::span<const double>(options_.initial_position)};
  target[swept_] += sweep_.next(seconds(options_.period));
  const PerJoint<double> torque = torques_towards(target);
  drive(torque);
  sweep_.add(torque[swept_], observation_.position[swept_] - options_.initial_position[swept_]);
  if (!sweep_.is_done()) return DriverReport::busy();
  JointReport& report = reports_[swept_];
  report.sweep = sweep_.result();
  if (weight_) {
    PerJoint<double> weight(num_joints(), 0.0);
    weight_(options_.initial_position, weight);
    report.weight = weight[swept_];
  }
  if (++swept_ < num_joints()) {
    sweep_.begin();
    return DriverReport::busy();
  }
  begin_phase_after(Phase::kSweeping);
  return DriverReport::ready();
}

}  // namespace trifinger::boards
