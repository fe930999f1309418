// SPDX-License-Identifier: BSD-3-Clause
#include "shared_robot/robot_preparation.hpp"

#include <fmt/core.h>

#include <chrono>
#include <cmath>
#include <thread>

#include "robot/session_state.hpp"
#include "shared_robot/cube_recovery.hpp"
#include "sim/servo_plant.hpp"
#include "trifinger/base/error.hpp"
#include "trifinger/core/errors.hpp"
#include "trifinger/core/frontend.hpp"
#include "trifinger/core/session.hpp"
#include "trifinger/sim/robot_config.hpp"
#include "trifinger/sim/simulator.hpp"

namespace trifinger::apps {
namespace {

constexpr int kMaxRecoveries = 3;
constexpr Nanoseconds kPause = std::chrono::milliseconds(50);

KnownRobot known_robot(const Session& session) {
  try {
    const Simulator simulator(read_robot_config(config_file_of(session)).simulation);
    return {.weight =
                [weight = weight_of(make_model(simulator.options()))](
                    const std::vector<double>& position) {
                  std::vector<double> torque(position.size());
                  weight(position, torque);
                  return torque;
                },
            .initial_position = simulator.initial_position()};
  } catch (const Error&) {
    return {};
  }
}

// Waits until the robot is free. Adds faults that were cleared to `report`. Returns what is wrong.
std::string wait_for(const std::string& robot, const PreparationOptions& options,
                     PreparationReport& report) {
  const Deadline deadline(options.timeout);
  std::string state = "there is no such robot";
  int recoveries = 0;
  for (; !deadline.passed(); std::this_thread::sleep_for(kPause)) {
    options.look();
    try {
      const SessionInfo info = robot_info(robot);
      state = state_text(info);
      if (!info.backend_is_alive) {
        // It may be started again meanwhile: a service does.
        state = "its back-end is gone; 'trifinger run' starts it";
        continue;
      }
      if (info.phase == SessionInfo::Phase::kEnded && info.fault.needs_recovery()) {
        if (!info.is_at_rest) continue;
        if (recoveries++ == kMaxRecoveries) {
          return fmt::format("it has a fault again and again; look at it: {}", info.fault_text);
        }
        options.report("recovers from a fault: " + info.fault_text);
        report.recovered.push_back(info.fault_text);
        recover(robot, deadline.remaining(options.timeout));
        continue;
      }
      if (info.phase != SessionInfo::Phase::kHolding) continue;
      // Whoever gets control and gives it back before the first action leaves the session as it is.
      const UntypedFrontend free(robot, {.timeout = kPause});
      return "";
    } catch (const ControlHeld& error) {
      state = error.what();
    } catch (const RobotStopped& error) {
      state = error.what();  // It has ended just now.
    } catch (const TimedOut& error) {
      state = error.what();
    } catch (const Error& error) {
      state = error.what();
    }
  }
  return fmt::format("it is not ready for a user after {}: {}", duration_text(options.timeout),
                     state);
}

RobotTestReport test(const std::string& robot, SelfTest kind, const PreparationOptions& options) {
  try {
    UntypedFrontend frontend(robot);
    frontend.set_interrupt(options.look);
    return test_robot(frontend, kind, options.look, known_robot(frontend.session()));
  } catch (const Error& error) {
    return {.kind = kind, .problem = error.what(), .joints = {}, .cube = {}};
  }
}

std::string place_text(const std::array<double, 3>& place) {
  return fmt::format("{:.0f} mm from the middle", 1e3 * std::hypot(place[0], place[1]));
}

// Brings the cube to the middle. Returns what is wrong with the robot afterwards.
std::string recover_cube(const std::string& robot, const PreparationOptions& options,
                         PreparationReport& report) {
  if (!report.test || !report.test->cube) return "";
  std::array<double, 3> place = *report.test->cube;
  if (is_in_middle(place)) {
    report.cube = "in the middle";
    return "";
  }
  if (begins_anew(robot)) {
    report.cube = place_text(place) + ", where every session of this simulation begins";
    return "";
  }
  options.report("brings the cube to the middle; it is " + place_text(place));
  std::string reason = bring_to_middle(robot, options.look);
  if (std::string problem = wait_for(robot, options, report); !problem.empty()) return problem;
  const RobotTestReport again = test(robot, SelfTest::kHold, options);
  if (!again.problem.empty()) return again.problem;
  if (std::string problem = wait_for(robot, options, report); !problem.empty()) return problem;
  if (again.cube) place = *again.cube;
  const bool is_there = again.cube && is_in_middle(place);
  if (is_there) {
    report.cube = "brought to the middle";
    return "";
  }
  if (reason.empty()) reason = "it was lost on the way";
  report.cube = fmt::format("{}, and could not be brought there: {}", place_text(place), reason);
  options.report("the cube is " + report.cube);
  return options.cube == CubeRecovery::kDemand ? "its cube is " + report.cube : "";
}

}  // namespace

PreparationReport wait_until_free(const std::string& robot, const PreparationOptions& options) {
  PreparationReport report;
  report.problem = wait_for(robot, options, report);
  report.is_fit = report.problem.empty();
  return report;
}

PreparationReport make_fit(const std::string& robot, const PreparationOptions& options) {
  PreparationReport report = wait_until_free(robot, options);
  if (!report.is_fit) return report;
  report.is_fit = false;
  const SelfTest kind = options.self_test == SelfTest::kOff && options.cube != CubeRecovery::kLeave
                            ? SelfTest::kHold
                            : options.self_test;
  if (kind != SelfTest::kOff) {
    if (kind == SelfTest::kJoints) options.report("tests its joints, one after the other");
    report.test = test(robot, kind, options);
    report.problem = report.test->problem;
    if (report.problem.empty()) report.problem = wait_for(robot, options, report);
  }
  if (report.problem.empty() && options.cube != CubeRecovery::kLeave) {
    report.problem = recover_cube(robot, options, report);
  }
  report.is_fit = report.problem.empty();
  return report;
}

}  // namespace trifinger::apps
