// SPDX-License-Identifier: BSD-3-Clause
#include <fmt/core.h>

#include <algorithm>
#include <chrono>
#include <cstddef>
#include <cstring>
#include <filesystem>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "camera/image_file.hpp"
#include "commands.hpp"
#include "shared/options.hpp"
#include "shared/output.hpp"
#include "shared/output_file.hpp"
#include "trifinger/base/error.hpp"
#include "trifinger/camera/images.hpp"
#include "trifinger/camera/pixels.hpp"
#include "trifinger/core/frontend.hpp"
#include "trifinger/core/session.hpp"

namespace trifinger::apps {
namespace {

namespace fs = std::filesystem;

struct LookOptions {
  std::string robot;
  fs::path target{"."};
  bool raw{false};
  Nanoseconds timeout{std::chrono::seconds(5)};
};

using Pixels = std::vector<std::byte>;

constexpr Nanoseconds kLongestWait = std::chrono::milliseconds(100);
// Images that are older do not show what is there now.
constexpr Nanoseconds kOld = std::chrono::seconds(2);

// An image that can be saved: colours, or what the camera has measured.
camera::Picture picture_of(const camera::Images& images, std::size_t index, bool raw) {
  const camera::ImageFormat& format = images.cameras()[index].format;
  const auto pixels = images.pixels(index);
  camera::Picture picture{.format = format, .pixels = {pixels.begin(), pixels.end()}};
  images.require_valid();
  if (raw) return picture;
  camera::Picture colour{.format = format, .pixels = {}};
  colour.format.pixels = camera::PixelFormat::kRgb8;
  colour.pixels.resize(colour.format.size());
  camera::to_rgb(format, picture.pixels, colour.pixels);
  return colour;
}

void save(const fs::path& path, const camera::Picture& picture) {
  const std::string ending = path.extension().string();
  const bool is_jpeg = ending == ".jpg" || ending == ".jpeg";
  const std::string file = is_jpeg ? camera::encode_jpeg(picture.format, picture.pixels)
                                   : camera::encode_png(picture.format, picture.pixels);
  write_output_file(path, file);
}

// Puts pictures side by side. One that is missing is black. Throws InvalidArgument for raw images
// of different formats.
camera::Picture joined(const std::vector<std::optional<camera::Picture>>& pictures,
                       const std::vector<camera::Camera>& cameras, bool raw) {
  camera::ImageFormat format{.width = 0, .height = 0, .pixels = camera::PixelFormat::kRgb8};
  for (const camera::Camera& camera : cameras) {
    format.width += camera.format.width;
    format.height = std::max(format.height, camera.format.height);
    if (raw) format.pixels = camera.format.pixels;
    if (!raw || camera.format.pixels == cameras[0].format.pixels) continue;
    throw InvalidArgument(fmt::format(
        "raw images of {} are in {}, those of {} in {}, so they do not fit into one file; name a "
        "folder after -o, or leave out --raw",
        cameras[0].name, name_of(cameras[0].format.pixels), camera.name,
        name_of(camera.format.pixels)));
  }
  camera::Picture whole{.format = format, .pixels = Pixels(format.size())};
  const std::size_t channels = camera::channels(format.pixels);
  std::size_t left = 0;
  for (std::size_t i = 0; i < cameras.size(); ++i) {
    const auto width = static_cast<std::size_t>(cameras[i].format.width) * channels;
    const auto rows = static_cast<std::size_t>(cameras[i].format.height);
    const std::size_t row_size = static_cast<std::size_t>(format.width) * channels;
    for (std::size_t y = 0; pictures[i] && y < rows; ++y) {
      std::memcpy(whole.pixels.data() + y * row_size + left, pictures[i]->pixels.data() + y * width,
                  width);
    }
    left += width;
  }
  return whole;
}

bool is_any_good(const camera::Images& images) {
  return std::ranges::any_of(images.infos(), [](const camera::ImageInfo& info) {
    return info.frame().state == camera::Frame::State::kGood;
  });
}

// How long ago images were taken. A robot without real time ages by its steps.
Nanoseconds age_of(const camera::Images& images, const Session& robot) {
  const SessionInfo info = robot.info();
  const bool is_running = info.backend_is_alive && info.phase != SessionInfo::Phase::kEnded;
  if (!info.is_real_time && is_running) {
    return (info.steps - std::max<TimeIndex>(images.stamp().arrival_index, 0)) * info.period;
  }
  return Instant(std::chrono::steady_clock::now()) -
         Instant(Nanoseconds(images.stamp().capture_time));
}

// Images of the process of the cameras, or of the robot's own. Waits for good ones that are new: a
// process that was stopped or killed leaves old ones.
camera::Images newest_images(const Session& robot, const std::string& name, Nanoseconds timeout) {
  const camera::CameraReader reader(robot, UntypedFrontend(robot.companion(camera::kCompanion)));
  camera::LiveCameras live(name, reader.calibration().cameras);
  const Deadline deadline(timeout);
  std::optional<camera::Images> last;
  bool is_old = false;
  do {
    std::optional<camera::Images> images = live.next(deadline.remaining(kLongestWait));
    if (!images) images = reader.latest();
    if (!images) continue;
    last = std::move(images);
    is_old = age_of(*last, robot) > kOld;
    if (!is_old && is_any_good(*last)) return *last;
  } while (!deadline.passed());
  const std::string remedy = "'trifinger cameras " + name + "' delivers them";
  if (!last) throw TimedOut("no images of robot '" + name + "' have come; " + remedy);
  if (is_old) {
    throw TimedOut(
        fmt::format("the newest images of robot '{}' are {} old, and no newer ones come; {}", name,
                    duration_text(age_of(*last, robot)), remedy));
  }
  return *last;
}

int look(const LookOptions& options) {
  const Session robot = Session::open(options.robot);
  const camera::Images images = newest_images(robot, options.robot, options.timeout);

  std::vector<std::optional<camera::Picture>> pictures(images.cameras().size());
  int exit_code = kDone;
  for (std::size_t i = 0; i < pictures.size(); ++i) {
    try {
      pictures[i] = picture_of(images, i, options.raw);
    } catch (const camera::CameraLost& error) {
      print_safely(stderr, "{}: {}\n", options.robot, error.what());
      exit_code = kIncomplete;
    }
  }
  const std::string ending = options.target.extension().string();
  if (ending == ".png" || ending == ".jpg" || ending == ".jpeg") {
    save(options.target, joined(pictures, images.cameras(), options.raw));
    print_safely("{}\n", options.target.string());
    return exit_code;
  }
  fs::create_directories(options.target);
  for (std::size_t i = 0; i < pictures.size(); ++i) {
    if (!pictures[i]) continue;
    const fs::path path = options.target / (images.cameras()[i].name + ".png");
    save(path, *pictures[i]);
    print_safely("{}\n", path.string());
  }
  return exit_code;
}

}  // namespace

void add_look(CLI::App& program, Action& action) {
  const auto& [command, options] =
      add_command(program, action, "look", "Save the newest images of a robot's cameras", look);
  add_robot(command, options.robot);
  add_output(command, options.target,
             "A folder, for one image per camera, or a file .png or .jpg, for all of them side by "
             "side; default: this folder",
             "PATH");
  command.add_flag("--raw", options.raw, "Save what the camera delivers, such as a Bayer mosaic");
  add_seconds(command, "--timeout", options.timeout, 3600.0,
              "How long to wait for images; default: 5");
  command.footer(
      "Exit code 3 means that some camera had no image.\n"
      "Example:\n"
      "  trifinger look sim -o all.png\n"
      "  trifinger look sim -o images");
}

}  // namespace trifinger::apps
