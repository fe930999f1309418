// SPDX-License-Identifier: BSD-3-Clause
#include "shared_robot/cube_recovery.hpp"

#include <atomic>
#include <cmath>
#include <exception>
#include <string>

#include "controller/user_program.hpp"
#include "trifinger/base/error.hpp"
#include "trifinger/core/errors.hpp"
#include "trifinger/core/frontend.hpp"
#include "trifinger/manipulation/run_skill.hpp"
#include "trifinger/manipulation/skills.hpp"
#include "trifinger/sim/robot_config.hpp"

namespace trifinger::apps {

bool is_in_middle(const std::array<double, 3>& place) noexcept {
  return std::hypot(place[0], place[1]) <= kMiddle;  // false for NaN
}

bool begins_anew(const std::string& robot) {
  try {
    return !robot_config_of(Session::open(robot)).boards;
  } catch (const Error&) {
    return false;  // It is of a kind that only its own program knows.
  }
}

std::string bring_to_middle(const std::string& name, const std::function<void()>& look) {
  std::exception_ptr interruption;
  try {
    auto robot = connect<TriFinger>(name);
    // A lift of a few millimetres that begins in the middle: what comes before it leads the cube
    // there.
    const auto skill =
        manipulation::make_skill("lift", manipulation::context_of(robot.session()), {},
                                 {"lift.height=0.005", "lift.time=0.3", "lift.hold_time=0.2",
                                  "lift.lower_time=0.5", "lift.lead_distances=[0]"});

    std::atomic<bool> stop{false};
    const auto on_step = [&](TimeIndex /*step*/) {
      if (interruption) return;
      try {
        look();
      } catch (...) {
        interruption = std::current_exception();
        stop.store(true, std::memory_order_relaxed);  // no other data depends on it
      }
    };
    const manipulation::SkillTrace trace =
        manipulation::run_skill(robot, *skill,
                                {.realtime = realtime_beside(robot.session().info(), Demand::kTry),
                                 .stop = &stop,
                                 .on_step = on_step});
    if (!interruption && !trace.failure.empty()) return std::string(trace.failure);
  } catch (const Error& error) {
    if (!interruption) return error.what();
  }
  if (interruption) std::rethrow_exception(interruption);
  return "";
}

}  // namespace trifinger::apps
