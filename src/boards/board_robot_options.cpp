// SPDX-License-Identifier: BSD-3-Clause
#include <chrono>
#include <cmath>
#include <numbers>
#include <optional>
#include <string>
#include <string_view>

#include "base/text_of.hpp"
#include "boards/board_robot.hpp"
#include "trifinger/base/error.hpp"

namespace trifinger::boards {

using trifinger::detail::require;
using trifinger::detail::text_of;

namespace {

void check(const BoardRobotOptions& options, const Terminal& terminal, const std::string& what) {
  require(terminal.board < options.interfaces.size(),
          text_of(what, " is on board ", terminal.board, ", but there are ",
                  options.interfaces.size()));
  require(terminal.number < 2,
          text_of(what, " is number ", terminal.number, " of its board, which has two"));
}

void validate_motor(const BoardRobotOptions& options, std::size_t joint) {
  const BoardMotor& motor = options.motors[joint];
  const std::string name(options.joint_text(joint).view());
  check(options, motor.place, "the motor of " + name);
  for (std::size_t k = 0; k < joint; ++k) {
    require(motor.place != options.motors[k].place,
            text_of("joints ", k, " and ", joint, " are on the same motor"));
  }
  // The comparisons are written so that NaN fails.
  require(motor.polarity == 1.0 || motor.polarity == -1.0,
          text_of("the polarity of ", name, " is ", motor.polarity, ", must be 1 or -1"));
  require(motor.gear_ratio > 0.0,
          text_of("the gear ratio of ", name, " is ", motor.gear_ratio, ", must be above 0"));
  require(motor.torque_constant > 0.0, text_of("the torque constant of ", name, " is ",
                                               motor.torque_constant, " Nm/A, must be above 0"));
  const HomingOptions& homing = motor.homing;
  require(homing.method == HomingMethod::kHere || homing.torque != 0.0,
          text_of("the homing torque of ", name, " is 0, must have a direction"));
  require(std::isfinite(homing.home_position),
          text_of("home_position of ", name, " is not finite"));
  require(std::abs(homing.torque) <= options.limits[joint].max_torque,
          text_of("the homing torque of ", name, " is ", homing.torque,
                  " Nm, must be at most max_torque (", options.limits[joint].max_torque, " Nm)"));
}

}  // namespace

double BoardMotor::angle_per_revolution() const noexcept {
  return 2.0 * std::numbers::pi / gear_ratio;
}

std::string BoardRobotOptions::key_text(std::string_view key,
                                        std::optional<std::size_t> joint) const {
  if (names[joint.value_or(0)].empty()) return text_of("boards.", key);
  return joint ? text_of("boards.motors.", names[*joint], ".", key)
               : text_of(key, " of each joint in boards.motors");
}

void BoardRobotOptions::validate() const {
  validate_joints(motors.size());
  stop.validate(limits);
  for (std::size_t i = 0; i < interfaces.size(); ++i) {
    for (std::size_t k = 0; k < i; ++k) {
      require(interfaces[i] != interfaces[k],
              text_of("boards ", k, " and ", i, " are both on ", interfaces[i]));
    }
  }
  const auto limit = std::chrono::duration<double, std::milli>(board.receive_timeout).count();
  require(limit >= 1.0 && limit == std::floor(limit) && board.receive_timeout > period,
          text_of("receive_timeout is ", limit,
                  " ms, must be a whole number of ms and longer than the period"));
  require(max_travel > 0.0, "max_travel must be above 0");
  require(max_current > 0.0 && max_current <= 20.0,
          text_of("max_current is ", max_current, " A, must be above 0 and at most 20"));
  require(move_time > Nanoseconds::zero(), "move_time must be above 0");
  for (std::size_t i = 0; i < motors.size(); ++i) validate_motor(*this, i);
  // All joints are homed again if the place of one is in doubt. That would give a joint without an
  // end stop another zero wherever it stands by then.
  for (std::size_t i = 1; i < motors.size(); ++i) {
    const HomingMethod first = motors[0].homing.method;
    const HomingMethod method = motors[i].homing.method;
    require(method == first || (homes_at_end_stop(method) && homes_at_end_stop(first)),
            text_of("joint 0 and ", joint_text(i).view(),
                    " find their homes in different ways, of which only one needs an end stop; all "
                    "joints must have end stops, or the same method"));
  }
  require(tips.size() == num_tips,
          text_of("there are ", tips.size(), " sensors for ", num_tips, " tips, must be one each"));
  for (std::size_t i = 0; i < tips.size(); ++i)
    check(*this, tips[i], text_of("the sensor of tip ", i));
  for (const auto& source : all_joints) {
    require(!source || *source < motors.size(), "a joint is measured by a motor that is not there");
  }
}

}  // namespace trifinger::boards
