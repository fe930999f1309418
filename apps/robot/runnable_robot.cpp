// SPDX-License-Identifier: BSD-3-Clause
#include "robot/runnable_robot.hpp"

#include <algorithm>
#include <chrono>
#include <cstddef>
#include <filesystem>
#include <iterator>
#include <optional>
#include <system_error>
#include <utility>

#include "base/regular_file.hpp"
#include "boards/board_robot.hpp"
#include "boards/calibration.hpp"
#include "core/fake_robot.hpp"
#include "learning/experience.hpp"
#include "log/replay.hpp"
#include "servos/read_options.hpp"
#include "shared/exit_code.hpp"
#include "sim/boards_config.hpp"
#include "sim/gain_warnings.hpp"
#include "sim/robot_cameras.hpp"
#include "sim/scene_observation.hpp"
#include "sim/servo_plant.hpp"
#include "trifinger/base/error.hpp"
#include "trifinger/camera/images.hpp"
#include "trifinger/config/file.hpp"
#include "trifinger/core/sensor.hpp"
#include "trifinger/log/log.hpp"
#include "trifinger/model/scene_model.hpp"
#include "trifinger/realtime/clock.hpp"
#include "trifinger/realtime/thread.hpp"
#include "trifinger/rendering/simulation_with_cameras.hpp"
#include "trifinger/sim/object_observation.hpp"
#include "trifinger/sim/robot_config.hpp"
#include "trifinger/sim/simulated_robot.hpp"

namespace trifinger::apps {
namespace {

constexpr const char* kFakeRobot = "fake";

RunnableRobot make_fake_robot(const std::vector<std::string>& overrides) {
  const config::File file = config::File::parse("name: fake", kFakeRobot, overrides);
  const config::Node root = file.root();
  const config::Range count{.min = 0, .max = 1e6};
  RunnableRobot robot;
  robot.name = root.required<std::string>("name");
  robot.backend.mode = BackendOptions::Mode::kRealTime;
  const auto period =
      root.optional<double>("period", 0.001, {.unit = "s", .min = 1e-5, .max = 0.1});
  robot.backend.period = std::chrono::round<Nanoseconds>(std::chrono::duration<double>(period));
  robot.backend.max_action_repeats = root.optional<std::uint32_t>("max_repeats", 100, count);
  robot.backend.max_skipped_ticks = root.optional<std::uint32_t>("max_skipped", 100, count);
  robot.session.history = root.optional<std::size_t>("history", 16384, {.min = 16, .max = 1048576});
  // -1: never.
  const config::Range step{.min = -1, .max = 1e15};
  robot.driver = std::make_unique<FakeDriver>(
      FakeDriver::Options{.prepare_periods = root.optional<TimeIndex>("prepare_periods", 0, count),
                          .stop_periods = root.optional<TimeIndex>("stop_periods", 0, count),
                          .sensor_period = root.optional<TimeIndex>("sensor_period", 10, count),
                          .sensor_delay = root.optional<TimeIndex>("sensor_delay", 0, count),
                          .action_fault_after = root.optional<TimeIndex>("fault_after", -1, step)});
  file.reject_unknown_keys();
  robot.session.documents = {{"configuration.yml", "application/yaml", file.text()}};
  return robot;
}

// Makes a robot that plays a log.
RunnableRobot make_replay(const std::string& path, const std::vector<std::string>& overrides,
                          const std::optional<std::string>& name) {
  const config::File file = config::File::parse("", path, overrides);
  const config::Node root = file.root();
  const log::Log log{std::filesystem::path(path)};
  const log::LoggedSession session = log.session(root.optional<std::string>("robot", ""));
  const auto step = [&root](const char* key) -> std::optional<TimeIndex> {
    const std::optional<config::Node> node = root.find(key);
    if (!node) return std::nullopt;
    return node->as<TimeIndex>({.min = 0, .max = 1e15});
  };
  log::ReplayOptions part{.first = step("first"), .last = step("last")};
  RunnableRobot robot;
  robot.name = name.value_or(root.optional<std::string>("name", session.name()));
  file.reject_unknown_keys();
  part.images_of = robot.name;
  auto driver = std::make_unique<log::ReplayDriver>(session, part);
  robot.backend = driver->backend_options();
  robot.session = driver->session_options();
  robot.driver = std::move(driver);
  return robot;
}

// A folder with the name of a configuration does not hide it.
bool is_log(const std::string& robot) {
  std::error_code ignored;
  return robot.ends_with(".mcap") || (std::filesystem::is_directory(robot, ignored) &&
                                      std::ranges::count(config_names(), robot) == 0);
}

SimulationState read_state(const std::filesystem::path& path) {
  constexpr std::size_t kMaxSize = std::size_t{64} << 20U;
  const std::string bytes = read_file(path, kMaxSize);
  const auto* const begin = reinterpret_cast<const std::byte*>(bytes.data());
  return {begin, begin + bytes.size()};
}

RunnableRobot as_chosen(RunnableRobot robot, const RobotChoice& choice) {
  robot.name = choice.name.value_or(robot.name);
  robot.backend.mode = choice.mode.value_or(robot.backend.mode);
  return robot;
}

void add_cameras(RunnableRobot& robot, std::vector<CompanionDescription>& sensors,
                 const RobotConfig& config) {
  if (!config.cameras) return;
  const camera::Calibration calibration = camera_calibration(config, robot.name);
  robot.session.documents.push_back(camera_document(calibration));
  sensors.push_back(camera::camera_companion(calibration.cameras));
}

// Adds what other processes say: `sensors`, and what whoever lets the robot do a task tells
// learners.
void add_sensors(RunnableRobot& robot, std::vector<CompanionDescription> sensors = {}) {
  sensors.push_back(learning::experience_companion());
  auto with_sensors =
      std::make_unique<DriverWithSensors>(std::move(robot.driver), robot.name, std::move(sensors));
  robot.messages = [sensors = with_sensors.get(), others = std::move(robot.messages)] {
    std::vector<std::string> messages = others();
    std::ranges::move(sensors->take_messages(), std::back_inserter(messages));
    return messages;
  };
  robot.driver = std::move(with_sensors);
}

// The programs that deliver what the cameras see, and where they see objects.
std::vector<std::vector<std::string>> programs_for(const RunnableRobot& robot,
                                                   const RobotConfig& config) {
  if (!config.cameras || robot.backend.mode != BackendOptions::Mode::kRealTime) return {};
  std::vector<std::vector<std::string>> programs{{"cameras", robot.name}};
  if (has_tracked_objects(config)) programs.push_back({"track", robot.name});
  return programs;
}

// Begins a simulation in the state of this file.
void begin_in(SimulatedRobot& simulated, const std::filesystem::path& state) {
  try {
    simulated.restore(read_state(state));
  } catch (const InvalidArgument& error) {
    throw InvalidArgument(state.string() + ": " + error.what());
  }
}

// Returns the state before a simulation diverged, for `RunnableRobot::state_before`.
std::function<SimulationState(const Fault& fault)> state_before(const SimulatedRobot* simulated) {
  return [simulated](const Fault& fault) {
    const bool has_diverged =
        fault.code == Fault::Code::kDriver && fault.detail == SimulatedRobot::kDiverged;
    return has_diverged ? simulated->state_before_divergence() : SimulationState();
  };
}

void add_simulation(RunnableRobot& robot, const RobotConfig& config,
                    const std::optional<std::filesystem::path>& state) {
  SimulationOptions options = config.simulation;
  const bool is_real_time = robot.backend.mode == BackendOptions::Mode::kRealTime;
  std::vector<CompanionDescription> sensors;
  if (is_real_time && config.tracks_objects) {
    options.exact_poses = false;
    if (auto objects = object_companion(objects_of(options))) {
      sensors.push_back(std::move(*objects));
    }
  }
  options.has_hand = true;
  auto driver = std::make_unique<SimulatedRobot>(std::move(options));
  driver->listen_to_hand(robot.name);
  robot.messages = [simulation = driver.get()] { return simulation->take_hand_messages(); };
  if (state) begin_in(*driver, *state);
  robot.state_before = state_before(driver.get());
  if (!is_real_time) {
    // Time stands still while images are drawn, so nothing is gained by other processes.
    if (auto seeing = rendering::make_driver_with_cameras(*driver, config, robot.name)) {
      robot.session.documents.push_back(camera_document(camera_calibration(config, robot.name)));
      seeing->share_images(robot.name);
      robot.driver = std::move(seeing);
      robot.owned = std::move(driver);
      add_sensors(robot);
      return;
    }
  }
  robot.driver = std::move(driver);
  add_cameras(robot, sensors, config);
  add_sensors(robot, std::move(sensors));
}

void add_servos(RunnableRobot& robot, servos::ServoConfig config) {
  config.loop.realtime = {.demand = Demand::kTry};
  servos::ConnectedRobot connected = servos::connect(config, robot.name);
  robot.messages = [warnings = std::move(connected.warnings)]() mutable {
    return std::exchange(warnings, {});
  };
  robot.driver = std::move(connected.robot);
  add_sensors(robot);
}

// Gives the robot its calibration, if there is one.
void add_calibration(RunnableRobot& robot, boards::BoardRobotOptions& options) {
  const std::filesystem::path path = boards::calibration_file(robot.name);
  std::error_code ignored;
  if (std::filesystem::symlink_status(path, ignored).type() ==
      std::filesystem::file_type::not_found) {
    robot.calibration =
        "has no calibration of its own: " + options.key_text("homing.home_position") +
        " counts; 'trifinger calibrate' measures it";
    return;
  }
  const boards::Calibration calibration = boards::read_calibration(path);
  try {
    boards::calibrate(options, robot.name, calibration);
  } catch (const InvalidArgument& error) {
    throw InvalidArgument(path.string() + ": " + error.what());
  }
  robot.session.documents.push_back({"calibration.yml", "application/yaml", calibration.text()});
  const std::string serial =
      calibration.serial == "any" ? "" : ", serial number " + calibration.serial;
  robot.calibration = "was calibrated on " + calibration.date + serial + " (" + path.string() + ")";
}

void add_boards(RunnableRobot& robot, const RobotConfig& config, bool is_calibrated) {
  boards::BoardRobotOptions options = config.boards->options;
  const std::shared_ptr<const SceneModel> model = make_model(config.simulation);
  if (is_calibrated) add_calibration(robot, options);
  options.weight = weight_of(model);
  auto buses = boards::open_buses(config.boards->bus, options.interfaces, robot.name);
  auto boards = std::make_unique<boards::BoardRobot>(std::move(options), std::move(buses),
                                                     MonotonicClock::instance());
  robot.boards = boards.get();
  robot.driver = std::move(boards);
  std::vector<CompanionDescription> sensors;
  // Cameras, or the emulator, say where the objects are.
  if (auto objects = object_companion(*model)) sensors.push_back(std::move(*objects));
  // The emulator says what simulated cameras see.
  if (has_simulated_cameras(config)) sensors.push_back(scene_companion(*model));
  add_cameras(robot, sensors, config);
  add_sensors(robot, std::move(sensors));
}

}  // namespace

RunnableRobot make_robot(const RobotChoice& choice) {
  const auto& [robot, name, overrides, state, mode, is_calibrated] = choice;
  if (robot == kFakeRobot) {
    if (state) throw UsageError("--state is for simulations; the fake robot has no state to save");
    return as_chosen(make_fake_robot(overrides), choice);
  }
  if (is_log(robot)) {
    if (state) throw UsageError("--state is for simulations; a log begins as it was recorded");
    return as_chosen(make_replay(robot, overrides, choice.name), choice);
  }

  RobotConfig config = load_robot_config(robot, overrides);
  RunnableRobot made;
  made.name = name.value_or(config.name);
  made.backend = config.backend;
  made.backend.mode = mode.value_or(config.backend.mode);
  made.session = std::move(config.session);
  std::ranges::move(model_documents(config.simulation), std::back_inserter(made.session.documents));
  made.needs_real_time = config.boards || config.servos;
  if (!made.needs_real_time) {
    for (const auto& [joint, warning] : detail::gain_warnings(config.simulation)) {
      made.warnings.push_back(warning);
    }
  }
  if (state && made.needs_real_time) {
    throw UsageError(std::string("--state is for simulations; a robot on ") +
                     (config.boards ? "boards" : "motors") + " begins where it is");
  }
  if (config.servos) {
    add_servos(made, *config.servos);
  } else if (config.boards) {
    add_boards(made, config, is_calibrated);
  } else {
    add_simulation(made, config, state);
  }
  made.sensor_programs = programs_for(made, config);
  return made;
}

}  // namespace trifinger::apps
