// SPDX-License-Identifier: BSD-3-Clause
#include <fmt/ranges.h>

#include <algorithm>
#include <chrono>
#include <csignal>
#include <cstdio>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "camera/feed.hpp"
#include "commands.hpp"
#include "log/image_source.hpp"
#include "rendering/simulated_cameras.hpp"
#include "shared/child_program.hpp"
#include "shared/json.hpp"
#include "shared/options.hpp"
#include "shared/output.hpp"
#include "shared/signals.hpp"
#include "shared/text.hpp"
#include "sim/robot_cameras.hpp"
#include "trifinger/base/error.hpp"
#include "trifinger/camera/images.hpp"
#include "trifinger/camera/options.hpp"
#include "trifinger/core/errors.hpp"
#include "trifinger/core/session.hpp"
#include "trifinger/log/log.hpp"
#include "trifinger/realtime/thread.hpp"
#include "trifinger/rendering/simulation_with_cameras.hpp"
#include "trifinger/sim/robot_config.hpp"

namespace trifinger::apps {
namespace {

struct CamerasOptions {
  std::optional<std::string> robot;
  std::optional<std::string> name;
  std::vector<std::string> overrides;
  std::optional<std::filesystem::path> log;
  bool list{false};
  bool json{false};
  Nanoseconds length{0};  // 0: until a signal
  pid_t parent{0};        // ends with it, unless 0
  // For GenICam cameras alone. Images come before the user's programs, but after the robot's loop
  // and its boards.
  RealtimeOptions realtime{
      .demand = Demand::kTry, .priority = 60, .lock_memory = false, .keep_cpus_awake = false};
};

// The cameras of a robot, and for whom they are.
struct Cameras {
  std::string robot;
  SimulationOptions simulation;
  camera::CameraOptions options;
  std::vector<camera::Camera> cameras;
};

std::string text_of(const std::vector<camera::Camera>& cameras) {
  std::string text;
  for (const camera::Camera& camera : cameras) {
    text += fmt::format("{}{} ({} x {}, {})", text.empty() ? "" : ", ", camera.name,
                        camera.format.width, camera.format.height,
                        camera::name_of(camera.format.pixels));
  }
  return text;
}

// The newest session of the robot in a log, or of the only robot there.
log::LoggedSession log_session(const log::Log& log, const std::string& robot) {
  for (const log::LoggedSession& session : log.sessions()) {
    if (session.name() == robot) return log.session(robot);
  }
  return log.session();
}

// Takes what the robot's session says if it runs, so that both agree; otherwise its configuration.
Cameras cameras_of(const CamerasOptions& options) {
  if (options.overrides.empty()) {
    const std::string name = options.name.value_or(*options.robot);
    try {
      const Session session = Session::open(name);
      if (session.info().backend_is_alive) {
        const RobotConfig config = read_robot_config(config_file_of(session));
        const std::vector<camera::Camera> cameras = camera::calibration_of(session).cameras;
        return {.robot = name,
                .simulation = config.simulation,
                .options = config.cameras.value(),
                .cameras = cameras};
      }
    } catch (const SessionNotFound&) {
    } catch (const InvalidArgument&) {
      // Not a name but a file, or a robot without cameras: see below.
      if (options.robot->find('/') == std::string::npos && !options.robot->ends_with(".yml")) throw;
    }
  }
  const RobotConfig config = load_robot_config(*options.robot, options.overrides);
  const std::string name = options.name.value_or(config.name);
  const camera::Calibration calibration = camera_calibration(config, name);
  return {.robot = name,
          .simulation = config.simulation,
          .options = *config.cameras,
          .cameras = calibration.cameras};
}

// To copy an image of a GenICam camera takes little time, but must be done at once. To draw or
// decode one, or to convert that of a webcam, takes much, and with a real-time priority it would
// keep everybody else from running.
bool only_copies(const CamerasOptions& options, const Cameras& cameras) {
  return !options.log && cameras.options.source == camera::SourceKind::kAravis;
}

// The images of a log must be those of cameras with these names and formats.
std::unique_ptr<camera::Source> open_log(const Cameras& cameras,
                                         const std::filesystem::path& path) {
  auto source = std::make_unique<log::ImageSource>(log_session(log::Log(path), cameras.robot));
  const std::vector<camera::Camera>& logged = source->calibration().cameras;
  const bool is_same = std::ranges::equal(
      logged, cameras.cameras, [](const camera::Camera& one, const camera::Camera& other) {
        return one.name == other.name && one.format == other.format;
      });
  if (!is_same) {
    throw InvalidArgument("the log " + path.string() + " has images of " + text_of(logged) + "; " +
                          cameras.robot + " has " + text_of(cameras.cameras));
  }
  return source;
}

std::unique_ptr<camera::Source> open_source(const Cameras& cameras,
                                            const std::optional<std::filesystem::path>& log) {
  if (log) return open_log(cameras, *log);
  const camera::CameraOptions& options = cameras.options;
  if (options.source != camera::SourceKind::kSimulated) {
    return camera::open_source(options, cameras.cameras);
  }
  rendering::RenderingOptions look = rendering::rendering_options(options);
  if (options.simulated.varies) {
    Random random{.seed = look.seed};
    look = rendering::varied(look, random);
  }
  return std::make_unique<rendering::SimulatedCameras>(cameras.robot, cameras.simulation,
                                                       cameras.cameras, options.period, look);
}

void print(const std::string& robot, const camera::FeedStatistics& statistics) {
  const double seconds = std::chrono::duration<double>(statistics.duration).count();
  for (const auto& camera : statistics.cameras) {
    const double rate = seconds > 0 ? static_cast<double>(camera.good - 1) / seconds : 0.0;
    std::string text = fmt::format("{}: {} images", camera.name, camera.good);
    if (rate > 0) text += fmt::format(", {}", rate_text(rate));
    if (camera.damaged > 0) text += fmt::format(", {} damaged", camera.damaged);
    if (camera.missing > 0) text += fmt::format(", {} missing", camera.missing);
    if (camera.lost > 0) text += fmt::format(", {} times not there", camera.lost);
    say(robot, text);
  }
  say(robot,
      fmt::format("images arrive {} after the middle of their exposure, at most {}; those "
                  "that belong together differ by {} at most",
                  duration_text(statistics.mean_delay), duration_text(statistics.largest_delay),
                  duration_text(statistics.largest_skew)));
}

int list_devices(bool json) {
  std::vector<std::string> warnings;
  const std::vector<camera::DeviceInfo> devices = camera::list_devices(warnings);
  if (json) {
    print_json(Json::object({{"devices", list_of(devices, [](const camera::DeviceInfo& device) {
                                return Json::object({{"kind", device.kind},
                                                     {"id", device.id},
                                                     {"name", device.name},
                                                     {"detail", device.detail}});
                              })}}));
  } else {
    for (const camera::DeviceInfo& device : devices) {
      print_safely("{:7} {:24} {}  {}\n", device.kind, device.id, device.name, device.detail);
    }
    if (devices.empty()) print_safely("There is no camera.\n");
  }
  for (const std::string& warning : warnings) print_safely(stderr, "{}\n", warning);
  return kDone;
}

int cameras(const CamerasOptions& options) {
  if (options.list) return list_devices(options.json);
  if (!options.robot) {
    throw UsageError("'trifinger cameras' needs the name of a robot, or --list");
  }
  std::signal(SIGPIPE, SIG_IGN);
  const Signals signals;
  if (options.parent > 0) end_with_parent(options.parent);
  const Cameras found = cameras_of(options);
  // Before the source is opened: each device has a thread, which inherits the priority.
  if (only_copies(options, found)) {
    for (const std::string& warning : enter_realtime(options.realtime)) say(found.robot, warning);
  } else if (options.realtime.demand == Demand::kRequire) {
    throw UsageError(
        "--scheduling require is for GenICam cameras (cameras.source: aravis); to draw, decode or "
        "convert images is work that must not keep programs from running");
  }
  const std::unique_ptr<camera::Source> source = open_source(found, options.log);
  camera::CameraFeed feed(*source, found.robot, found.cameras, found.options.period);
  say(found.robot, fmt::format("{} deliver images, {}", fmt::join(source->names(), ", "),
                               rate_text(1e9 / static_cast<double>(found.options.period.count()))));
  const Deadline deadline(options.length > Nanoseconds(0) ? options.length : kForever);
  while (!deadline.passed() && !signals.wait(Nanoseconds::zero())) {
    const bool goes_on = feed.step();
    for (const std::string& sentence : feed.take_messages()) say(found.robot, sentence);
    if (!goes_on) break;
  }
  print(found.robot, feed.statistics());
  return kDone;
}

}  // namespace

void add_cameras(CLI::App& program, Action& action) {
  const auto& [command, options] =
      add_command(program, action, "cameras", "Deliver the images of a robot's cameras", cameras);
  add_configured_robot(command, options,
                       "A robot that runs, or a configuration with cameras, by name or file",
                       "cameras.source=folder");
  add_seconds(command, "--seconds", options.length, 1e9, "End after this time; default: at Ctrl-C");
  command.add_option("--with-process", options.parent)->group("");
  command.add_option("--log", options.log, "Show the images of this log again and again")
      ->option_text("LOG");
  CLI::Option* const list =
      command.add_flag("--list", options.list, "List the devices that could be cameras, and end");
  add_json(command, options.json)->needs(list);
  add_scheduling(
      command, options.realtime.demand,
      "Whether real-time priority is required to take images from GenICam cameras; default: try. "
      "Other sources never have it");
  command.footer(
      "The robot runs beside it, in another terminal, and does not wait for images. Both may be\n"
      "started again at any time, in any order. Images are the robot's companion 'cameras'.\n"
      "At the end, figures say how many images came, how late, and how far apart.\n"
      "Example:\n"
      "  trifinger cameras trifinger-pro-3\n"
      "  trifinger cameras sim_cameras --set cameras.source=folder --set cameras.folder=images\n"
      "  trifinger cameras sim_cameras --log logs\n"
      "  trifinger cameras --list");
}

}  // namespace trifinger::apps
