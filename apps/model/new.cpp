// SPDX-License-Identifier: BSD-3-Clause
#include <fmt/core.h>

#include <algorithm>
#include <array>
#include <filesystem>
#include <string>
#include <string_view>
#include <system_error>
#include <utility>
#include <vector>

#include "base/regular_file.hpp"
#include "commands.hpp"
#include "model/new_configuration.hpp"
#include "shared/options.hpp"
#include "shared/output.hpp"
#include "shared/shipped_file.hpp"
#include "trifinger/base/error.hpp"
#include "trifinger/model/model_file.hpp"

namespace trifinger::apps {
namespace {

namespace fs = std::filesystem;

// The robot that the templates are about.
constexpr std::string_view kName = "my_robot";
constexpr std::string_view kStruct = "MyRobot";
constexpr const char* kTemplates = "new_robot";  // a folder of the configurations
constexpr std::string_view kVersion = "@TRIFINGER_VERSION@";
// The files that name the robot last, so that a driver is looked at before what uses it.
constexpr std::array<std::string_view, 6> kFiles{
    "README.md", "my_robot.hpp", "my_robot.yml", "my_robot_test.cpp", "main.cpp", "CMakeLists.txt"};

struct NewRobotOptions {
  std::string name;
  ModelFileOptions file;
  fs::path folder{"."};
};

bool is_lower(char letter) { return letter >= 'a' && letter <= 'z'; }
bool is_digit(char letter) { return letter >= '0' && letter <= '9'; }

// The name becomes that of files, a session, a type in C++ and a target of CMake.
void require_usable(const std::string& name) {
  const bool is_plain =
      !name.empty() && is_lower(name.front()) &&
      std::ranges::all_of(
          name,
          [](char letter) { return is_lower(letter) || is_digit(letter) || letter == '_'; }) &&
      name.find("__") == std::string::npos && name.back() != '_';
  if (!is_plain) {
    throw UsageError(fmt::format(
        "'{}' cannot name a robot; a name has lower-case letters, digits and single '_' between "
        "them, such as my_robot",
        name));
  }
  constexpr std::size_t kMaxLetters = 40;
  if (name.size() > kMaxLetters) {
    throw UsageError(
        fmt::format("the name '{}' has {} letters, may have {}", name, name.size(), kMaxLetters));
  }
  constexpr std::array<std::string_view, 9> kTaken{
      "all", "clean", "finger", "help", "install", "package", "test", "trifinger", "main"};
  if (std::ranges::find(kTaken, name) != kTaken.end()) {
    throw UsageError(fmt::format("'{}' means something else already; choose another name", name));
  }
}

// "my_robot" becomes "MyRobot".
std::string struct_name(const std::string& name) {
  std::string words;
  bool begins = true;
  for (const char letter : name) {
    if (letter != '_')
      words += begins && is_lower(letter) ? static_cast<char>(letter - 'a' + 'A') : letter;
    begins = letter == '_';
  }
  return words;
}

std::string replaced(std::string text, std::string_view from, std::string_view to) {
  for (std::size_t at = text.find(from); at != std::string::npos;
       at = text.find(from, at + to.size())) {
    text.replace(at, from.size(), to);
  }
  return text;
}

// Behind ```bash our own pages name the test that types the commands.
std::string without_tests(std::string text) {
  constexpr std::string_view kBash = "```bash";
  const std::string test = std::string(kBash) + " tests/";
  for (std::size_t at = text.find(test); at != std::string::npos; at = text.find(test, at)) {
    const std::size_t begin = at + kBash.size();
    text.erase(begin, text.find('\n', begin) - begin);
  }
  return text;
}

// The template for somebody else's project: it is theirs, so our licence line and our tests go.
std::string for_robot(std::string text, const std::string& name) {
  if (text.find("SPDX-License-Identifier") < text.find('\n')) text.erase(0, text.find('\n') + 1);
  if (text.starts_with("#\n")) text.erase(0, 2);
  text = without_tests(std::move(text));
  const std::string version = TRIFINGER_VERSION;
  text = replaced(std::move(text), kVersion, version.substr(0, version.rfind('.')));
  return replaced(replaced(std::move(text), kName, name), kStruct, struct_name(name));
}

void require_new(const fs::path& path) {
  std::error_code ignored;
  if (fs::symlink_status(path, ignored).type() == fs::file_type::not_found) return;
  throw Error(fmt::format("{} exists already; nothing was written", path.string()));
}

void make_folder(const fs::path& folder) {
  std::error_code problem;
  fs::create_directories(folder, problem);
  if (problem) throw SystemError("make the folder " + folder.string(), problem.value());
}

void write_driver(const NewRobotOptions& options) {
  const fs::path folder = options.folder / options.name;
  std::vector<std::pair<fs::path, std::string>> files;
  files.reserve(std::size(kFiles));
  for (const std::string_view file : kFiles) {
    files.emplace_back(folder / replaced(std::string(file), kName, options.name),
                       for_robot(read_shipped_file(kTemplates, std::string(file)), options.name));
  }
  require_new(folder);
  make_folder(folder);
  for (const auto& [path, text] : files) write_new_file(path, std::as_bytes(std::span(text)));
  print_safely(
      "{}/ has a robot with a driver in one file, {}.hpp, where FILL_IN marks what you replace.\n"
      "It builds, passes its test and runs as it is: {}/README.md says how.\n",
      folder.string(), options.name, folder.string());
}

void write_configuration(const NewRobotOptions& options) {
  const ModelFileOptions& file = options.file;
  if (is_urdf(file) && file.angle_in_radians) {
    throw UsageError("--angle is for an MJCF: a URDF has radians always");
  }
  if (!is_urdf(file) && file.collision != UrdfCollision::kHull) {
    throw UsageError("--collision is for a URDF: an MJCF says itself what touches");
  }
  const ModelFile model(file);
  const fs::path path = options.folder / (options.name + ".yml");
  require_new(path);
  const std::string text = configuration_of(options.name, options.folder, model);
  make_folder(options.folder);
  write_new_file(path, std::as_bytes(std::span(text)));
  const bool is_whole = text.find("FILL_IN") == std::string::npos;
  for (const std::string& sentence : model.repairs()) print_safely("repaired: {}\n", sentence);
  print_safely("{} has the {} joints of {}.\n", path.string(), model.joints().size(),
               file.path.string());
  if (text.find(kHowToTakeRadians) != std::string::npos) {
    print_safely("Some joints can hardly move: {}.\n", kHowToTakeRadians);
  }
  print_safely("{}'trifinger run {}' starts it.\n",
               is_whole ? "What the file does not say was proposed for the simulation. "
                        : "Replace each FILL_IN: nobody knows the motors. Then ",
               path.string());
}

int make_robot_files(const NewRobotOptions& options) {
  require_usable(options.name);
  if (options.file.path.empty()) {
    write_driver(options);
  } else {
    write_configuration(options);
  }
  return kDone;
}

void add_new_robot(CLI::App& parent, Action& action) {
  const auto& [command, options] = add_command(
      parent, action, "robot", "Write a robot of your own to begin with", make_robot_files);
  command.add_option("NAME", options.name, "Its name, such as my_robot")->required();
  ModelFileOptions& file = options.file;
  CLI::Option* const from =
      command
          .add_option(
              "--from", file.path,
              "Write a configuration that simulates the robot of this MJCF or URDF file, instead "
              "of a driver")
          ->option_text("FILE")
          ->check([](const std::string& path) { return path.empty() ? "must be a file" : ""; });
  command
      .add_option("--meshes", file.mesh_folder,
                  "With --from: where the meshes are, if not where the file says")
      ->option_text("FOLDER")
      ->needs(from);
  command
      .add_flag("--repair-inertia", file.repair_inertia,
                "With --from: give bodies with an inertia that no body can have the nearest that "
                "is possible")
      ->needs(from);
  add_choice(command, "--angle", file.angle_in_radians, {{"radian", true}, {"degree", false}},
             "With --from: the unit of angles in an MJCF that names none. Default: degree")
      ->needs(from);
  add_choice(command, "--collision", file.collision,
             {{"hull", UrdfCollision::kHull},
              {"visual", UrdfCollision::kVisual},
              {"none", UrdfCollision::kNone}},
             "With --from: which shapes of a URDF touch: hull, its collision shapes as convex "
             "hulls; visual; none. Default: hull")
      ->needs(from);
  add_output(command, options.folder, "Where to write; default: the working directory", "FOLDER");
  command.footer(
      "Without --from it makes the folder NAME: a driver in one C++ file, its configuration, a "
      "test,\n"
      "and a project that builds against an installed trifinger.\n"
      "Example:\n"
      "  trifinger new robot my_robot\n"
      "  trifinger new robot panda --from panda.xml");
}

}  // namespace

void add_new(CLI::App& program, Action& action) {
  CLI::App* const command = program.add_subcommand("new", "Write files to begin with");
  command->require_subcommand(1);
  command->footer(
      "Example:\n"
      "  trifinger new robot my_robot");
  add_new_robot(*command, action);
}

}  // namespace trifinger::apps
