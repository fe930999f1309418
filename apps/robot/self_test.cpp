// SPDX-License-Identifier: BSD-3-Clause
#include "boards/self_test.hpp"

#include <fmt/core.h>

#include <cstddef>
#include <exception>
#include <filesystem>
#include <string>

#include "commands.hpp"
#include "robot/maintenance.hpp"
#include "shared/json.hpp"
#include "shared/options.hpp"
#include "shared/output.hpp"
#include "shared/output_file.hpp"
#include "trifinger/base/error.hpp"

namespace trifinger::apps {
namespace {

struct SelfTestOptions : MaintenanceOptions {
  std::filesystem::path output;
};

// What was found out about a joint; null is what was not. "problem" is empty if it has none.
Json report_of(const boards::BoardRobot& boards, std::size_t joint) {
  const boards::BoardRobotOptions& options = boards.options();
  const boards::JointReport& report = boards.report(joint);
  Json row{{"joint", joint},    {"wiring", nullptr},   {"load", nullptr},
           {"weight", nullptr}, {"friction", nullptr}, {"index_distance", nullptr}};
  if (report.wiring) {
    const boards::WiringFinding& found = *report.wiring;
    row["wiring"] = !found.moves           ? "does not move"
                    : found.joint != joint ? fmt::format("moves joint {}", found.joint)
                    : found.is_hindered    ? "hindered"
                    : found.is_reversed    ? "reversed"
                                           : "good";
  }
  if (report.sweep)
    row.update({{"load", report.sweep->load}, {"friction", report.sweep->friction}});
  if (report.weight) row["weight"] = *report.weight;
  if (report.index_distance > 0.0) row["index_distance"] = report.index_distance;
  row["problem"] = problem_of(report, options.motors[joint].angle_per_revolution(),
                              options.key_text("gear_ratio", joint));
  return row;
}

// A number, or a dash.
std::string cell(const Json& number, int digits) {
  return number.is_null() ? "-" : fmt::format("{:.{}f}", number.get<double>(), digits);
}

// Prints what was measured, in SI units, and writes it. Returns the number of joints that have a
// problem.
int print_reports(const boards::BoardRobot& boards, const std::filesystem::path& output) {
  Json rows = Json::array();
  for (std::size_t i = 0; i < boards.options().motors.size(); ++i) {
    rows.push_back(report_of(boards, i));
  }
  print_safely(
      "\n  joint  wiring          load [Nm]  weight [Nm]  friction [Nm]  index distance [rad]\n");
  int problems = 0;
  for (std::size_t i = 0; i < rows.size(); ++i) {
    const Json& row = rows[i];
    print_safely("  {:>5}  {:14}  {:>9}  {:>11}  {:>13}  {:>20}\n", i,
                 row["wiring"].is_null() ? "-" : row["wiring"].get<std::string>(),
                 cell(row["load"], 3), cell(row["weight"], 3), cell(row["friction"], 3),
                 cell(row["index_distance"], 4));
    if (!row["problem"].get<std::string>().empty()) ++problems;
  }
  print_safely("\n");
  for (std::size_t i = 0; i < rows.size(); ++i) {
    const auto problem = rows[i]["problem"].get<std::string>();
    // A joint that was not reached has no problem of its own.
    if (problem.empty() || !boards.report(i).sweep) continue;
    print_safely("{} {}.\n", boards.options().joint_text(i).view(), problem);
  }
  std::fflush(stdout);
  if (!output.empty()) write_output_file(output, rows.dump(2) + "\n");
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
  const int problems =
      robot.boards().report(0).wiring ? print_reports(robot.boards(), options.output) : 0;
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
  add_output(command, options.output, "Also write what was measured, as JSON: a list of joints");
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
