// SPDX-License-Identifier: BSD-3-Clause
#include <fmt/core.h>
#include <fmt/ranges.h>

#include <string>
#include <vector>

#include "commands.hpp"
#include "model/export.hpp"
#include "shared/json.hpp"
#include "shared/options.hpp"
#include "shared/output.hpp"
#include "shared/output_file.hpp"
#include "shared/terminal.hpp"
#include "trifinger/model/robot_description.hpp"

namespace trifinger::apps {
namespace {

using MakeObject = ObjectDescription (*)(std::string);
const Choices<MakeObject> kObjects{
    {"cube", cube}, {"cuboid", cuboid}, {"stick", stick}, {"ball", ball}};

enum class Format : unsigned char { kMjcf, kUrdf };

struct ModelOptions {
  RobotDescription robot;
  std::vector<std::string> objects;
  // The following options belong to `export`.
  Format format{Format::kMjcf};
  std::string file{"-"};
  Detail detail{Detail::kPictures};
  bool json{false};  // of `info`
};

RobotDescription description_of(const ModelOptions& options) {
  RobotDescription robot = options.robot;
  if (!options.objects.empty()) robot.objects.clear();
  for (const std::string& name : options.objects) {
    robot.objects.push_back(choose(kObjects, "--object", name)(name));
  }
  validate(robot);
  return robot;
}

int export_model(const ModelOptions& options) {
  const RobotDescription robot = description_of(options);
  const std::string text =
      options.format == Format::kUrdf ? export_urdf(robot) : export_mjcf(robot, options.detail);
  if (options.file == "-") {
    fmt::print("{}", text);
    return kDone;
  }
  write_output_file(options.file, text);
  print_safely("{} written.\n", options.file);
  return kDone;
}

std::string joint_text(const FingerJoints& values) {
  return fmt::format("{:g}", fmt::join(values, "  "));
}

int print_info(const ModelOptions& options) {
  const RobotDescription robot = description_of(options);
  const VariantFigures& known = figures(robot);
  const ActuatorParameters motor = actuator(robot);
  std::vector<std::string> objects;
  objects.reserve(robot.objects.size());
  for (const ObjectDescription& object : robot.objects) {
    objects.push_back(fmt::format("{} ({:g} g)", object.name, object.mass * 1e3));
  }
  std::vector<std::string> cameras;
  if (robot.cameras) {
    for (const CameraFigures& camera : camera_figures()) cameras.emplace_back(camera.name);
  }

  if (options.json) {
    print_json(Json::object({{"variant", known.name},
                             {"is_flipped", robot.flipped},
                             {"fingers", num_fingers(robot)},
                             {"finger_height", finger_height(robot)},
                             {"joints", joint_names(robot)},
                             {"tips", tip_names(robot)},
                             {"has_soft_tips", robot.soft_tips},
                             {"tip_radius", known.tip_radius},
                             {"objects", list_of(robot.objects,
                                                 [](const ObjectDescription& object) {
                                                   return Json{{"name", object.name},
                                                               {"mass", object.mass}};
                                                 })},
                             {"has_boundary", robot.boundary},
                             {"cameras", cameras},
                             {"torque_limit", motor.torque_limit},
                             {"no_load_speed", motor.no_load_speed},
                             {"initial_position", known.initial_position},
                             {"soft_lower", known.soft_lower},
                             {"soft_upper", known.soft_upper},
                             {"hard_lower", known.hard_lower},
                             {"hard_upper", known.hard_upper},
                             {"kp", known.kp},
                             {"kd", known.kd},
                             {"safety_kd", known.safety_kd}}));
    return kDone;
  }
  const auto line = [](const std::string& label, const std::string& text) {
    print_safely("{}{}\n", pad(label, 20), text);
  };
  line("variant", fmt::format("{}{}", known.name, robot.flipped ? ", flipped" : ""));
  line("fingers", fmt::format("{}, joint 0 at {:g} m", num_fingers(robot), finger_height(robot)));
  line("joints", fmt::format("{}", fmt::join(joint_names(robot), " ")));
  line("tips", fmt::format("{}, {}, radius {:g} m", fmt::join(tip_names(robot), " "),
                           robot.soft_tips ? "soft" : "hard", known.tip_radius));
  line("objects", fmt::format("{}", fmt::join(objects, ", ")));
  line("boundary", robot.boundary ? "yes" : "no");
  line("cameras", fmt::format("{}", fmt::join(cameras, " ")));
  line("torque limit", fmt::format("{:g} Nm", motor.torque_limit));
  line("no-load speed", fmt::format("{:g} rad/s", motor.no_load_speed));
  print_safely("\nof each finger, from the base to the tip\n");
  line("initial position", joint_text(known.initial_position) + " rad");
  line("soft limits",
       fmt::format("{}  to  {} rad", joint_text(known.soft_lower), joint_text(known.soft_upper)));
  line("hard limits",
       fmt::format("{}  to  {} rad", joint_text(known.hard_lower), joint_text(known.hard_upper)));
  line("default stiffness", joint_text(known.kp) + " Nm/rad");
  line("default damping", joint_text(known.kd) + " Nm s/rad");
  line("safety damping", joint_text(known.safety_kd) + " Nm s/rad");
  return kDone;
}

void add_description(CLI::App& command, ModelOptions& options) {
  RobotDescription& robot = options.robot;
  add_choice(command, "--variant", robot.variant,
             {{"edu", Variant::kEdu}, {"pro", Variant::kPro}, {"one", Variant::kOne}},
             "Which hardware; default: edu");
  command.add_flag_callback(
      "--single-finger", [&robot] { robot.arrangement = Arrangement::kSingleFinger; },
      "One finger on a stand");
  command
      .add_option("--finger-height", robot.finger_height,
                  "Height of the joint-0 axes above the table [m]; default: the variant's")
      ->option_text("METRES");
  command.add_flag("--flipped", robot.flipped, "Turn the platform upside down");
  command.add_flag_callback(
      "--no-boundary", [&robot] { robot.boundary = false; }, "Leave out the wall around the table");
  command.add_flag_callback(
      "--hard-tips", [&robot] { robot.soft_tips = false; }, "Make the tips hard");
  command.add_option("--object", options.objects, "What lies on the table; default: a cube")
      ->option_text("cube|cuboid|stick|ball ...");
}

void add_model_export(CLI::App& model, Action& action) {
  const auto& [command, options] =
      add_command(model, action, "export", "Write the model to a file", export_model);
  add_choice(command, "--format", options.format,
             {{"mjcf", Format::kMjcf}, {"urdf", Format::kUrdf}}, "What to write")
      ->required();
  add_output(command, options.file, "The file; default: standard output");
  command.add_flag_callback(
      "--physics-only", [&detail = options.detail] { detail = Detail::kPhysics; },
      "MJCF without what is only seen: frame, shells, lights, cameras");
  add_description(command, options);
  command.footer(
      "MJCF has the whole scene, URDF only the robot.\n"
      "Example:\n"
      "  trifinger model export --format mjcf --variant pro --object ball -o scene.xml");
}

void add_model_info(CLI::App& model, Action& action) {
  const auto& [command, options] = add_command(
      model, action, "info", "Print the figures of a robot: joints, limits, gains", print_info);
  add_description(command, options);
  add_json(command, options.json);
  command.footer(
      "Example:\n"
      "  trifinger model info --variant one --single-finger");
}

}  // namespace

void add_model(CLI::App& program, Action& action) {
  CLI::App* const command =
      program.add_subcommand("model", "Show the robot's model, or write it for other programs");
  command->require_subcommand(1);
  command->footer(
      "Example:\n"
      "  trifinger model info --variant pro\n"
      "  trifinger model export --format urdf -o trifinger.urdf");

  add_model_export(*command, action);
  add_model_info(*command, action);
}

}  // namespace trifinger::apps
