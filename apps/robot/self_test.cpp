// SPDX-License-Identifier: BSD-3-Clause
#include "boards/self_test.hpp"

#include <fmt/core.h>

#include <exception>
#include <string>

#include "commands.hpp"
#include "robot/maintenance.hpp"
#include "shared/output.hpp"
#include "trifinger/base/error.hpp"

namespace trifinger::apps {
namespace {

using SelfTestOptions = MaintenanceOptions;

// A number with its unit, or a dash.
template <class Number>
std::string cell(const std::optional<Number>& number, const char* format) {
  return number ? fmt::format(fmt::runtime(format), *number) : "-";
}

// Prints what was measured. Returns the number of joints that have a problem.
int print_reports(const boards::BoardRobot& boards) {
  const boards::BoardRobotOptions& options = boards.options();
  const auto problem_of_joint = [&](std::size_t i) {
    return problem_of(boards.report(i), options.motors[i].angle_per_revolution(),
                      options.key_text("gear_ratio", i));
  };
  print_safely(
      "\n  joint  wiring          load [Nm]  weight [Nm]  friction [Nm]  index distance [rad]\n");
  int problems = 0;
  for (std::size_t i = 0; i < options.motors.size(); ++i) {
    const boards::JointReport& report = boards.report(i);
    std::string wiring = "-";
    if (report.wiring) {
      const boards::WiringFinding& found = *report.wiring;
      wiring = !found.moves        ? "does not move"
               : found.joint != i  ? fmt::format("moves joint {}", found.joint)
               : found.is_hindered ? "hindered"
               : found.is_reversed ? "reversed"
                                   : "good";
    }
    std::optional<double> load;
    std::optional<double> friction;
    std::optional<double> distance;
    if (report.sweep) load = report.sweep->load;
    if (report.sweep) friction = report.sweep->friction;
    if (report.index_distance > 0.0) distance = report.index_distance;
    print_safely("  {:>5}  {:14}  {:>9}  {:>11}  {:>13}  {:>20}\n", i, wiring, cell(load, "{:.3f}"),
                 cell(report.weight, "{:.3f}"), cell(friction, "{:.3f}"), cell(distance, "{:.4f}"));
    if (!problem_of_joint(i).empty()) ++problems;
  }
  print_safely("\n");
  for (std::size_t i = 0; i < options.motors.size(); ++i) {
    const std::string problem = problem_of_joint(i);
    // A joint that was not reached has no problem of its own.
    if (!problem.empty() && boards.report(i).sweep) {
      print_safely("{} {}.\n", options.joint_text(i).view(), problem);
    }
  }
  std::fflush(stdout);
  return problems;
}

int self_test(const SelfTestOptions& options) {
  ServicedRobot robot(options);
  robot.boards().set_preparation({.test = true});
  std::exception_ptr fault;
  try {
    robot.prepare();
  } catch (const Error&) {
    fault = std::current_exception();
  }
  const int problems = robot.boards().report(0).wiring ? print_reports(robot.boards()) : 0;
  if (fault) std::rethrow_exception(fault);
  if (problems > 0) {
    robot.print("does not pass", Style::kBad);
    return kFailed;
  }
  robot.print("passes", Style::kGood);
  return kDone;
}

}  // namespace

void add_self_test(CLI::App& program, Action& action) {
  const auto& [command, options] =
      add_command(program, action, "self-test",
                  "Test the wiring of a robot on motor boards, and measure its joints", self_test);
  add_maintenance(command, options);
  command.footer(
      "First each joint moves by about 2 degrees, forth and back: this finds motors that do not "
      "move\n"
      "their joint, turn the other way, or belong to the encoder of another joint. Then the robot\n"
      "homes itself and moves each joint slowly by 2 degrees and back. The load that this takes "
      "must\n"
      "be the weight of the finger, as the model has it.\n"
      "Watch the robot meanwhile: whole fingers that are exchanged look right from inside. Joints\n"
      "move in the order of their numbers: finger 0 first, from the base to the tip.\n"
      "Exit code 0: it passes. 1: it does not; the text says what to do.\n"
      "Example:\n"
      "  trifinger self-test trifinger_edu_can");
}

}  // namespace trifinger::apps
