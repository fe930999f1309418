// SPDX-License-Identifier: BSD-3-Clause
#include <chrono>
#include <cmath>
#include <string>

#include "base/text_of.hpp"
#include "boards/board_robot.hpp"
#include "trifinger/base/error.hpp"

namespace trifinger::boards {

using trifinger::detail::require;
using trifinger::detail::text_of;

std::array<Terminal, 9> trifinger_motors() noexcept {
  std::array<Terminal, 9> motors{};
  for (std::size_t finger = 0; finger < 3; ++finger) {
    motors[3 * finger] = {.board = 2 * finger + 1, .number = 0};
    motors[3 * finger + 1] = {.board = 2 * finger, .number = 0};
    motors[3 * finger + 2] = {.board = 2 * finger, .number = 1};
  }
  return motors;
}

std::array<Terminal, 3> trifinger_tips() noexcept {
  return {{{.board = 0, .number = 0}, {.board = 2, .number = 0}, {.board = 4, .number = 0}}};
}

template <class R>
void BoardRobotOptions<R>::validate() const {
  trifinger::validate(limits);
  stop.validate(limits);
  require(period > Nanoseconds::zero(), "period must be above 0");
  require(drive.gear_ratio > 0.0, text_of("gear_ratio is ", drive.gear_ratio, ", must be above 0"));
  require(drive.torque_constant > 0.0,
          text_of("torque_constant is ", drive.torque_constant, " Nm/A, must be above 0"));
  for (std::size_t i = 0; i < names.size(); ++i) {
    for (std::size_t k = 0; k < i; ++k) {
      require(names[i] != names[k], text_of("boards ", k, " and ", i, " are both on ", names[i]));
    }
  }
  const auto limit = std::chrono::duration<double, std::milli>(board.receive_timeout).count();
  require(limit >= 1.0 && limit == std::floor(limit) && board.receive_timeout > period,
          text_of("receive_timeout is ", limit,
                  " ms, must be a whole number of ms and longer than the period"));
  require(homing.max_travel > 0.0, "max_travel must be above 0");
  require(max_current > 0.0 && max_current <= 20.0,
          text_of("max_current is ", max_current, " A, must be above 0 and at most 20"));
  require(move_time > Nanoseconds::zero(), "move_time must be above 0");
  const auto check = [this](const Terminal& terminal, const std::string& what) {
    require(terminal.board < names.size(),
            text_of(what, " is on board ", terminal.board, ", but there are ", names.size()));
    require(terminal.number < 2,
            text_of(what, " is number ", terminal.number, " of its board, which has two"));
  };
  for (std::size_t i = 0; i < kJoints; ++i) {
    check(motors[i], text_of("the motor of joint ", i));
    require(polarity[i] == 1.0 || polarity[i] == -1.0,
            text_of("the polarity of joint ", i, " is ", polarity[i], ", must be 1 or -1"));
    for (std::size_t k = 0; k < i; ++k) {
      require(motors[i].board != motors[k].board || motors[i].number != motors[k].number,
              text_of("joints ", k, " and ", i, " are on the same motor"));
    }
    const bool is_inside =
        initial_position[i] >= limits[i].soft_lower && initial_position[i] <= limits[i].soft_upper;
    require(is_inside, text_of("initial_position of joint ", i, " is ", initial_position[i],
                               " rad, must be within its soft limits"));
    const bool pushes = homing.method != HomingMethod::kHere;
    require(!pushes || homing.torque[i] != 0.0,
            text_of("the homing torque of joint ", i, " is 0, must have a direction"));
    require(std::isfinite(homing.home_position[i]),
            text_of("home_position of joint ", i, " is not finite"));
    require(std::abs(homing.torque[i]) <= limits[i].max_torque,
            text_of("the homing torque of joint ", i, " is ", homing.torque[i],
                    " Nm, must be at most max_torque (", limits[i].max_torque, " Nm)"));
  }
  for (std::size_t i = 0; i < R::kTips; ++i) check(tips[i], text_of("the sensor of tip ", i));
}

template struct BoardRobotOptions<TriFinger>;
template struct BoardRobotOptions<Finger>;
template struct BoardRobotOptions<TwoJoints>;
template struct BoardRobotOptions<OneJoint>;

}  // namespace trifinger::boards
