// SPDX-License-Identifier: BSD-3-Clause
// The program `trifinger-manipulate`: handles an object with a robot that runs elsewhere.
#include <fmt/core.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <atomic>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <set>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "base/regular_file.hpp"
#include "base/suggestion.hpp"
#include "controller/user_program.hpp"
#include "shared/command_line.hpp"
#include "shared/exit_code.hpp"
#include "shared/options.hpp"
#include "shared/output.hpp"
#include "sim/robot_cameras.hpp"
#include "trifinger/base/error.hpp"
#include "trifinger/config/file.hpp"
#include "trifinger/core/frontend.hpp"
#include "trifinger/manipulation/run_skill.hpp"
#include "trifinger/manipulation/skills.hpp"
#include "trifinger/realtime/thread.hpp"
#include "trifinger/sim/robot_config.hpp"

namespace trifinger::apps {
namespace {

using manipulation::SkillStep;
using manipulation::SkillTrace;

struct ManipulateOptions {
  std::string task;
  std::string config;
  std::string identified;
  std::string robot;
  bool needs_cameras{false};
  bool is_taught{false};
  std::vector<std::string> settings;
  std::filesystem::path output{"manipulate_output"};
  Demand scheduling{Demand::kTry};
};

// The robot according to its back-end, and the limits of its safety checks.
manipulation::SkillContext context_of(const Session& session, bool needs_cameras) {
  if (needs_cameras && !has_tracked_objects(robot_config_of(session))) {
    throw InvalidArgument("'" + session.info().name +
                          "' does not see: its simulation says where objects are; 'trifinger run "
                          "sim_tracked' runs a robot that finds them in images");
  }
  return manipulation::context_of(session);
}

void report_state(const manipulation::Skill& skill) {
  const manipulation::SkillState& state = skill.state();
  print_safely("  {}{}{}\n", state.phase, state.failure.empty() ? "" : ": ", state.failure);
  std::fflush(stdout);
}

void report_visibility(const manipulation::Skill& skill) {
  print_safely("  {}\n", skill.state().is_visible
                             ? "the object is in sight again"
                             : "the object is out of sight: the tips feel where it is");
  std::fflush(stdout);
}

void write_text(const std::filesystem::path& path, const std::string& text) {
  replace_file(path, std::as_bytes(std::span(text)));
}

constexpr std::string_view kColumns =
    "step,phase,desired_x,desired_y,desired_z,desired_qw,desired_qx,desired_qy,desired_qz,"
    "estimated_x,estimated_y,estimated_z,estimated_qw,estimated_qx,estimated_qy,estimated_qz";
// Only of skills that hold an object with three tips.
constexpr std::string_view kGraspColumns =
    ",normal_0,normal_1,normal_2,tangential_0,tangential_1,tangential_2,travel_0,travel_1,travel_2";

std::string row_of(const SkillStep& step) {
  std::string text = fmt::format("{},{}", step.step, step.phase);
  const auto add = [&text](double value) { text += fmt::format(",{:.6f}", value); };
  for (const manipulation::Pose* pose : {&step.desired, &step.estimated}) {
    const auto& q = pose->orientation;
    for (const double value : pose->position) add(value);
    for (const double value : {q.w(), q.x(), q.y(), q.z()}) add(value);
  }
  if (step.grasp) {
    for (const Eigen::Vector3d* values :
         {&step.grasp->normal_forces, &step.grasp->tangential_forces, &step.grasp->travel})
      for (const double value : *values) add(value);
  }
  return text + fmt::format(",{:.4f},{:.7f}\n", step.torque_share, step.cycle_time.count());
}

// Every tenth step and each change of the phase.
std::string table_of(const SkillTrace& trace) {
  constexpr TimeIndex kEvery = 10;
  const bool has_grasp = !trace.steps.empty() && trace.steps.front().grasp.has_value();
  std::string text =
      fmt::format("{}{},torque_share,cycle_time\n", kColumns, has_grasp ? kGraspColumns : "");
  std::string_view phase;
  for (const SkillStep& step : trace.steps) {
    if (step.step % kEvery == 0 || step.phase != phase) text += row_of(step);
    phase = step.phase;
  }
  return text;
}

// Writes the files of a report. `json` gets what all reports have.
void write_report(const ManipulateOptions& options, const Session& session,
                  manipulation::Seconds period, nlohmann::ordered_json json,
                  const std::string& table) {
  const auto trace = options.output / "trace.csv";
  const auto summary = options.output / "report.json";
  write_text(trace, table);
  json["task"] = options.task;
  json["robot"] = options.robot;
  json["session_id"] = session.info().session_id;
  json["period"] = period.count();
  write_text(summary, json.dump(2) + "\n");
  print_safely("Report: {}\nTrace:  {}\n", summary.string(), trace.string());
}

// Throws InvalidArgument if there is no such task.
void require_task(const std::string& task) {
  std::vector<std::string_view> names;
  for (const manipulation::SkillInfo& skill : manipulation::all_skills())
    names.push_back(skill.name);
  if (std::ranges::find(names, task) != names.end()) return;
  const std::string_view similar = closest(task, names);
  throw InvalidArgument(fmt::format("there is no task '{}', {}", task,
                                    similar.empty() ? "there are " + quoted_list(names, "and")
                                                    : fmt::format("perhaps '{}'", similar)));
}

Identified identified_in(const std::string& config) {
  return config.empty() ? Identified{} : load_robot_config(config).simulation.identified;
}

int manipulate(const ManipulateOptions& options) {
  require_task(options.task);
  auto robot = connect<TriFinger>(options.robot);
  const auto context = context_of(robot.session(), options.needs_cameras);
  const auto make = options.is_taught ? manipulation::make_taught_skill : manipulation::make_skill;
  const auto skill = make(options.task, context, options.config, options.settings);
  const std::atomic<bool>& stop = stop_on_signals();
  std::filesystem::create_directories(options.output);
  print_safely("'{}' shall {} the {}.\n", options.robot, options.task, skill->object());
  std::fflush(stdout);
  const SkillTrace trace = manipulation::run_skill(
      robot, *skill,
      {.realtime = realtime_beside(robot.session().info(), options.scheduling),
       .stop = &stop,
       .identified = identified_in(options.identified),
       .on_step = {},
       .on_update = {},
       .on_phase = report_state,
       .on_visibility = report_visibility});
  nlohmann::ordered_json json{{"is_done", trace.failure.empty()}, {"failure", trace.failure}};
  for (const manipulation::Figure& figure : skill->figures(trace, trace.seen)) {
    json[figure.name] = figure.value;
    const std::string number = figure.unit == "1" ? fmt::format("{:.4g} %", 100 * figure.value)
                               : figure.unit.empty()
                                   ? fmt::format("{:.4g}", figure.value)
                                   : fmt::format("{:.4g} {}", figure.value, figure.unit);
    print_safely("  {:<26}{:<14}{}\n", figure.name, number, figure.meaning);
  }
  write_report(options, robot.session(), trace.period, std::move(json), table_of(trace));
  for (const manipulation::ReportFile& file : skill->report_files(trace, trace.seen)) {
    write_text(options.output / file.name, file.text);
    print_safely("        {}\n", (options.output / file.name).string());
  }
  if (stop.load()) return kInterrupted;
  return trace.failure.empty() ? kDone : kFailed;
}

// The tasks with a line for each.
std::string list_of_tasks() {
  std::string text = "Tasks:\n";
  for (const manipulation::SkillInfo& skill : manipulation::all_skills())
    text += fmt::format("  {:<9}{} (trifinger run {})\n", skill.name, skill.summary, skill.robot);
  return text;
}

// The settings of a task, as its configuration and the files that this extends document them.
std::string list_of_settings(const std::string& config) {
  constexpr const char* kFolder = "skills";
  const auto values =
      config::File::load(find_config(config, kFolder), {}, config_folders(kFolder)).values();
  std::string text = "Settings for --set:\n";
  std::set<std::string> shown{"skill"};
  for (std::string name = config; !name.empty();) {
    std::ifstream file(find_config(name, kFolder));
    name.clear();
    std::string comment;
    std::vector<std::pair<std::size_t, std::string>> parents;  // indentation and key
    for (std::string line; std::getline(file, line);) {
      const std::size_t indent = line.find_first_not_of(' ');
      const std::size_t colon = line.find(':');
      if (indent != std::string::npos && line[indent] == '#') {
        comment += line.substr(indent + 1);
        continue;
      }
      const std::string meaning = std::exchange(comment, "");
      if (indent == std::string::npos || colon == std::string::npos || line[indent] == '-')
        continue;
      while (!parents.empty() && parents.back().first >= indent) parents.pop_back();
      parents.emplace_back(indent, line.substr(indent, colon - indent));
      std::string path;
      for (const auto& parent : parents) path += (path.empty() ? "" : ".") + parent.second;
      if (path == "extends") {
        name = std::filesystem::path(line.substr(line.find_first_not_of(' ', colon + 1))).stem();
      }
      const auto value = values.find(path);
      if (value == values.end() || !shown.insert(path).second) continue;
      const std::string usual = "default: " + value->second;
      text += help_row(path, meaning.empty() ? usual : meaning.substr(1) + " (" + usual + ")");
    }
  }
  return text + "A list is given in brackets, as in --set 'lift.lead_turns=[0, 0.4]'.";
}

int manipulate_command(const std::vector<std::string>& words) {
  ManipulateOptions options;
  CLI::App program(
      "Handles an object with a robot that runs elsewhere: lifts it, throws it, turns it.\n"
      "Its report compares with the poses that the robot's cameras see, noise included.\n\n" +
          list_of_tasks(),
      "trifinger manipulate");
  set_up_help(program);
  program.footer([&options] {
    if (!options.task.empty()) {
      require_task(options.task);
      return list_of_settings(options.config.empty() ? options.task : options.config);
    }
    return std::string(
        "'trifinger manipulate TASK --help' shows the settings of a task.\n"
        "Example:\n"
        "  trifinger run sim --set fingers.height=0.3     in one terminal\n"
        "  trifinger manipulate lift                      in another\n"
        "With nothing but cameras and joints:\n"
        "  trifinger run sim_tracked --set fingers.height=0.3\n"
        "  trifinger manipulate lift --poses cameras --set lift.height=0.15");
  });
  program.add_option("TASK", options.task, "What to do; see above")->required();
  add_robot_option(program, options.robot);
  program
      .add_option("--config", options.config,
                  "A configuration or the path of one; default: that of the task")
      ->option_text("FILE");
  program
      .add_option_function<std::string>(
          "--poses",
          [&options](const std::string& poses) { options.needs_cameras = poses == "cameras"; },
          "Where poses may come from. cameras: only from images; any (the default)")
      ->check(CLI::IsMember({"cameras", "any"}))
      ->option_text("SOURCE");
  program.add_flag("--taught", options.is_taught,
                   "Plays the motion that was taught, whatever the object does");
  program
      .add_option("--identified", options.identified,
                  "Configuration that 'trifinger identify' has written of this robot: torques "
                  "and zeros are made up for")
      ->option_text("FILE");
  add_overrides(program, options.settings, "lift.height=0.1", "Change a setting");
  add_output(program, options.output, "Folder of the report", "FOLDER")->capture_default_str();
  add_user_scheduling(program, options.scheduling);
  return run_user_program(program, words, [&] { return manipulate(options); });
}

}  // namespace
}  // namespace trifinger::apps

int main(int argument_count, char** arguments) {
  return trifinger::apps::manipulate_command({arguments + 1, arguments + argument_count});
}
