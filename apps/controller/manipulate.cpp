// SPDX-License-Identifier: BSD-3-Clause
// The program `trifinger-manipulate`: handles an object with a robot that runs elsewhere.
#include <fmt/core.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <atomic>
#include <cstdio>
#include <filesystem>
#include <functional>
#include <nlohmann/json.hpp>
#include <numbers>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "controller/user_program.hpp"
#include "shared/exit_code.hpp"
#include "shared/output.hpp"
#include "trifinger/base/error.hpp"
#include "trifinger/base/regular_file.hpp"
#include "trifinger/base/suggestion.hpp"
#include "trifinger/config/file.hpp"
#include "trifinger/core/frontend.hpp"
#include "trifinger/manipulation/config.hpp"
#include "trifinger/manipulation/run.hpp"
#include "trifinger/manipulation/run_skill.hpp"
#include "trifinger/manipulation/skills.hpp"
#include "trifinger/realtime/thread.hpp"
#include "trifinger/sim/robot_cameras.hpp"
#include "trifinger/sim/robot_config.hpp"

namespace trifinger::apps {
namespace {

using manipulation::Manipulation;
using manipulation::ManipulationConfig;
using manipulation::Phase;
using manipulation::Report;
using manipulation::Seconds;
using manipulation::SkillTrace;
using manipulation::Trace;

struct ManipulateOptions {
  std::string task;
  std::string config;
  std::string robot{"sim"};
  bool needs_sight{false};
  bool is_taught{false};
  std::vector<std::string> settings;
  std::filesystem::path output{"manipulate_output"};
  Demand scheduling{Demand::kTry};
};

// The robot according to its back-end, and the limits of its safety checks.
manipulation::SkillContext context_of(const Session& session, bool needs_sight) {
  if (needs_sight && !has_tracked_objects(robot_config_of(session))) {
    throw InvalidArgument("'" + session.info().name +
                          "' does not see: its simulation says where objects are; 'trifinger run "
                          "sim_tracked' runs a robot that finds them in images");
  }
  return manipulation::context_of(session);
}

void tell_phase(const Manipulation& at) {
  std::string more;
  if (at.phase() == Phase::kGrasp) {
    more =
        fmt::format(", which takes {:.0f} % of the motors' torque", 100 * at.plan()->torque_share);
    if (at.grasps() > 1) more += fmt::format("; attempt {}", at.grasps());
  } else if (at.phase() == Phase::kFailed) {
    more = fmt::format(": {}", text_of(at.failure()));
  }
  print_safely("  {}{}\n", name_of(at.phase()), more);
  std::fflush(stdout);
}

void tell_sight(const Manipulation& at) {
  print_safely("  {}\n", at.is_in_sight()
                             ? "the object is in sight again"
                             : "the object is out of sight: the tips feel where it is");
  std::fflush(stdout);
}

nlohmann::ordered_json json_of(const Report& report) {
  return {{"is_done", report.is_done},
          {"failure", text_of(report.failure)},
          {"grasps", report.grasps},
          {"num_poses", report.num_poses},
          {"position_rms", report.position_rms},
          {"position_max", report.position_max},
          {"orientation_rms", report.orientation_rms},
          {"orientation_max", report.orientation_max},
          {"height", report.height},
          {"hold_drift", report.hold_drift},
          {"hold_slip", report.hold_slip},
          {"normal_force_min", report.normal_force_min},
          {"normal_force_mean", report.normal_force_mean},
          {"normal_force_max", report.normal_force_max},
          {"tangential_force_max", report.tangential_force_max},
          {"friction_used", report.friction_used},
          {"travel_max", report.travel_max},
          {"blind_time", report.blind_time.count()},
          {"slip_time", report.slip_time.count()},
          {"torque_margin", report.torque_margin},
          {"exact_wrenches", report.exact_wrenches},
          {"cycle_p50", report.cycle_p50},
          {"cycle_p999", report.cycle_p999}};
}

void print(const Report& report) {
  const double degrees = 180 / std::numbers::pi;
  const auto line = [](std::string_view name, const std::string& value) {
    print_safely("  {:<26}{}\n", name, value);
  };
  line("position, rms and max",
       fmt::format("{:.2f} mm, {:.2f} mm", 1e3 * report.position_rms, 1e3 * report.position_max));
  line("orientation, rms and max", fmt::format("{:.2f}°, {:.2f}°", degrees * report.orientation_rms,
                                               degrees * report.orientation_max));
  line("highest", fmt::format("{:.1f} cm", 100 * report.height));
  line("drift, slip while held",
       fmt::format("{:.2f} mm, {:.2f} mm", 1e3 * report.hold_drift, 1e3 * report.hold_slip));
  if (report.blind_time.count() > 0)
    line("out of sight",
         fmt::format("{:.1f} s, led by what the tips felt", report.blind_time.count()));
  line("normal forces", fmt::format("{:.2f} to {:.2f} N, mean {:.2f} N", report.normal_force_min,
                                    report.normal_force_max, report.normal_force_mean));
  line("tangential forces", fmt::format("up to {:.2f} N, {:.2f} of the normal force",
                                        report.tangential_force_max, report.friction_used));
  line("torque left", fmt::format("{:.0f} %", 100 * report.torque_margin));
  line("controller, p50 and p99.9",
       fmt::format("{:.1f} µs, {:.1f} µs", 1e6 * report.cycle_p50, 1e6 * report.cycle_p999));
}

void write_text(const std::filesystem::path& path, const std::string& text) {
  replace_file(path, std::as_bytes(std::span(text)));
}

// The columns that all tables have.
constexpr std::string_view kPoseColumns =
    "step,phase,desired_x,desired_y,desired_z,desired_qw,desired_qx,desired_qy,desired_qz,"
    "estimated_x,estimated_y,estimated_z,estimated_qw,estimated_qx,estimated_qy,estimated_qz";

std::string pose_cells(TimeIndex step, std::string_view phase, const manipulation::Pose& desired,
                       const manipulation::Pose& estimated) {
  std::string text = fmt::format("{},{}", step, phase);
  for (const manipulation::Pose* pose : {&desired, &estimated}) {
    const auto& q = pose->orientation;
    for (const double value : pose->position) text += fmt::format(",{:.6f}", value);
    for (const double value : {q.w(), q.x(), q.y(), q.z()}) text += fmt::format(",{:.6f}", value);
  }
  return text;
}

// Calls `write` for every tenth step and for each change of the phase.
template <class Step>
void write_rows(const std::vector<Step>& steps, const std::function<void(const Step&)>& write) {
  constexpr TimeIndex kEvery = 10;
  const Step* previous = nullptr;
  for (const Step& step : steps) {
    if (step.step % kEvery == 0 || previous == nullptr || step.phase != previous->phase)
      write(step);
    previous = &step;
  }
}

std::string table_of(const Trace& trace) {
  std::string text = fmt::format(
      "{},normal_0,normal_1,normal_2,tangential_0,tangential_1,tangential_2,travel_0,travel_1,"
      "travel_2,torque_share,cycle_time\n",
      kPoseColumns);
  write_rows<manipulation::TraceStep>(trace.steps, [&](const manipulation::TraceStep& step) {
    text += pose_cells(step.step, name_of(step.phase), step.desired, step.estimated);
    for (const Eigen::Vector3d* values :
         {&step.normal_forces, &step.tangential_forces, &step.travel}) {
      for (const double value : *values) text += fmt::format(",{:.6f}", value);
    }
    text += fmt::format(",{:.4f},{:.7f}\n", step.torque_share, step.cycle_time.count());
  });
  return text;
}

std::string table_of(const SkillTrace& trace) {
  std::string text = fmt::format("{},torque_share,cycle_time\n", kPoseColumns);
  write_rows<manipulation::SkillStep>(trace.steps, [&](const manipulation::SkillStep& step) {
    text += pose_cells(step.step, step.phase, step.desired, step.estimated);
    text += fmt::format(",{:.4f},{:.7f}\n", step.torque_share, step.cycle_time.count());
  });
  return text;
}

// Writes the files of a report. `json` gets what all reports have.
void write_report(const ManipulateOptions& options, const Session& session, Seconds period,
                  nlohmann::ordered_json json, const std::string& table) {
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

void announce(const ManipulateOptions& options, std::string_view object) {
  std::filesystem::create_directories(options.output);
  print_safely("'{}' shall {} the {}.\n", options.robot, options.task, object);
  std::fflush(stdout);
}

// Lifts or slides a cube.
int manipulate(const ManipulateOptions& options, Frontend<TriFinger>& robot,
               const manipulation::SkillContext& context) {
  const std::string name = options.config.empty()
                               ? std::string(variant_figures(context.description.variant).name)
                               : options.config;
  ManipulationConfig config = manipulation::load_config(name, options.task, options.settings);
  config.planner.limits = context.limits;
  config.controller.limits = context.limits;

  const std::atomic<bool>& stop = stop_on_signals();
  announce(options, config.object);
  const manipulation::RunOptions run_options{
      .realtime = realtime_beside(robot.session().info(), options.scheduling),
      .stop = &stop,
      .on_step = {},
      .on_phase = tell_phase,
      .on_sight = tell_sight};
  const Trace trace = manipulation::run(robot, context.description, config, run_options);

  const Report report = manipulation::make_report(trace, trace.seen);
  if (report.num_poses > 0) print(report);
  write_report(options, robot.session(), trace.period, json_of(report), table_of(trace));
  if (trace.failure == manipulation::Failure::kStopped) return kInterrupted;
  return report.is_done ? kDone : kFailed;
}

void tell_state(const manipulation::Skill& skill) {
  const manipulation::SkillState& state = skill.state();
  print_safely("  {}{}{}\n", state.phase, state.failure.empty() ? "" : ": ", state.failure);
  std::fflush(stdout);
}

// Carries out any other skill.
int carry_out(const ManipulateOptions& options, Frontend<TriFinger>& robot,
              const manipulation::SkillContext& context) {
  const auto make = options.is_taught ? manipulation::make_taught_skill : manipulation::make_skill;
  const auto skill = make(options.task, context, options.config, options.settings);
  const std::atomic<bool>& stop = stop_on_signals();
  announce(options, skill->object());
  const SkillTrace trace = manipulation::run_skill(
      robot, *skill,
      {.realtime = realtime_beside(robot.session().info(), options.scheduling),
       .stop = &stop,
       .on_step = {},
       .on_update = {},
       .on_phase = tell_state});
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

// Throws InvalidArgument if there is no such task.
void require_task(const std::string& task) {
  std::vector<std::string_view> names{"lift", "slide"};
  for (const manipulation::SkillInfo& skill : manipulation::all_skills())
    names.push_back(skill.name);
  if (std::ranges::find(names, task) != names.end()) return;
  const std::string_view similar = closest(task, names);
  throw InvalidArgument(fmt::format("there is no task '{}', {}", task,
                                    similar.empty() ? "there are " + quoted_list(names, "and")
                                                    : fmt::format("perhaps '{}'", similar)));
}

int manipulate(const ManipulateOptions& options) {
  require_task(options.task);
  auto robot = connect<TriFinger>(options.robot);
  const auto context = context_of(robot.session(), options.needs_sight);
  const bool is_cube_task = options.task == "lift" || options.task == "slide";
  if (is_cube_task && options.is_taught)
    throw InvalidArgument("nobody has taught '" + options.task + "'");
  return is_cube_task ? manipulate(options, robot, context) : carry_out(options, robot, context);
}

// The tasks with a line for each.
std::string list_of_tasks() {
  std::string text =
      "Tasks:\n"
      "  lift        Lifts a cube, holds it, and puts it down (trifinger run pushing)\n"
      "  slide       Slides a cube on a circle (trifinger run sim)\n";
  for (const manipulation::SkillInfo& skill : manipulation::all_skills())
    text += fmt::format("  {:<12}{} (trifinger run {})\n", skill.name, skill.summary, skill.robot);
  return text;
}

int manipulate_command(const std::vector<std::string>& words) {
  ManipulateOptions options;
  CLI::App program(
      "Handles an object with a robot that runs elsewhere: lifts it, throws it, turns it.\n"
      "Its report compares with the poses that the robot's cameras see, noise included.\n\n" +
          list_of_tasks(),
      "trifinger manipulate");
  program.set_help_flag("-h,--help", "Print this help");
  program.footer(
      "Example:\n"
      "  trifinger run sim --set fingers.height=0.3     in one terminal\n"
      "  trifinger manipulate lift                      in another\n"
      "With nothing but eyes and joints:\n"
      "  trifinger run sim_tracked --set fingers.height=0.3\n"
      "  trifinger manipulate lift --poses cameras --set lift.height=0.15");
  program.add_option("TASK", options.task, "What to do; see above")->required();
  program.add_option("ROBOT,--robot", options.robot, "Name of the running robot")
      ->capture_default_str();
  program
      .add_option("--config", options.config,
                  "A configuration or the path of one; default: that of the task, for lift and\n"
                  "slide that of the robot's variant")
      ->option_text("FILE");
  program
      .add_option_function<std::string>(
          "--poses",
          [&options](const std::string& poses) { options.needs_sight = poses == "cameras"; },
          "Where poses may come from. cameras: only from images; any (the default)")
      ->check(CLI::IsMember({"cameras", "any"}))
      ->option_text("SOURCE");
  program.add_flag("--taught", options.is_taught,
                   "Plays the motion that was taught, whatever the object does");
  program.add_option("--set", options.settings, "A setting, as in lift.height=0.1")
      ->allow_extra_args(false);
  program.add_option("--output", options.output, "Folder of the report")->capture_default_str();
  add_user_scheduling(program, options.scheduling);
  return run_user_program(program, words, [&] { return manipulate(options); });
}

}  // namespace
}  // namespace trifinger::apps

int main(int argument_count, char** arguments) {
  return trifinger::apps::manipulate_command({arguments + 1, arguments + argument_count});
}
