// SPDX-License-Identifier: BSD-3-Clause
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <chrono>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <random>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "core/fake_robot.hpp"
#include "harness.hpp"
#include "log/logged_images.hpp"
#include "log/recorder.hpp"
#include "support/folder.hpp"
#include "trifinger/camera/calibration.hpp"
#include "trifinger/camera/images.hpp"
#include "trifinger/core/backend.hpp"
#include "trifinger/core/frontend.hpp"
#include "trifinger/core/sensor.hpp"
#include "trifinger/log/log.hpp"

// A source of 100 triples of 540 x 540 pixels per second beside a robot at 1 kHz, all recorded.
namespace trifinger::benchmarks {
namespace {

constexpr Nanoseconds kImagePeriod = std::chrono::milliseconds(10);
constexpr std::size_t kPictures = 8;

std::vector<camera::Camera> three_cameras() {
  std::vector<camera::Camera> cameras(3);
  for (std::size_t i = 0; i < cameras.size(); ++i) cameras[i].name = "camera" + std::to_string(i);
  return cameras;
}

// Mosaics of a scene with edges and the noise of a sensor.
std::vector<std::vector<std::byte>> noisy_pictures(const camera::ImageFormat& format) {
  std::mt19937 random(1);  // NOLINT(cert-msc51-cpp): the same pictures every time
  std::normal_distribution<double> noise(0, 3);
  std::vector<std::vector<std::byte>> pictures;
  for (std::size_t i = 0; i < kPictures; ++i) {
    std::vector<std::byte>& picture = pictures.emplace_back(format.size());
    for (int y = 0; y < format.height; ++y) {
      for (int x = 0; x < format.width; ++x) {
        const bool is_dark = (x / 70 + y / 70) % 2 == 0;
        const double value =
            110 + 50 * std::sin(0.02 * x) + 30 * std::cos(0.05 * y) + (is_dark ? -20 : 20);
        picture[static_cast<std::size_t>(y) * static_cast<std::size_t>(format.width) +
                static_cast<std::size_t>(x)] =
            static_cast<std::byte>(std::lround(value + noise(random)));
      }
    }
  }
  return pictures;
}

// The process of the cameras, as a thread that writes images while it is wanted.
class Cameras {
 public:
  Cameras(const std::string& robot, const std::vector<camera::Camera>& cameras)
      : pictures_(noisy_pictures(cameras[0].format)),
        sensor_(robot, cameras),
        thread_([this] { run(); }) {}
  Cameras(const Cameras&) = delete;
  Cameras& operator=(const Cameras&) = delete;
  ~Cameras() {
    is_over_.store(true, std::memory_order_relaxed);
    thread_.join();
  }

  void set_wanted(bool is_wanted) { is_wanted_.store(is_wanted, std::memory_order_relaxed); }
  [[nodiscard]] std::int64_t triples() const { return triples_.load(std::memory_order_acquire); }

 private:
  // relaxed: the flags order nothing.
  void run() {
    Instant due = Clock::now();
    std::int64_t count = 0;
    while (!is_over_.load(std::memory_order_relaxed)) {
      due += kImagePeriod;
      std::this_thread::sleep_until(due);
      if (!is_wanted_.load(std::memory_order_relaxed)) continue;
      const auto places = sensor_.begin();
      std::array<camera::Frame, 3> frames;
      for (std::size_t i = 0; i < places.size(); ++i) {
        const auto& picture = pictures_[(static_cast<std::size_t>(count) + i) % kPictures];
        std::ranges::copy(picture, places[i].begin());
        frames[i] = {.state = camera::Frame::State::kGood,
                     .number = count,
                     .time = Clock::now(),
                     .exposure = std::chrono::microseconds(1500)};
      }
      sensor_.write(frames);
      // release: they are written.
      triples_.store(++count, std::memory_order_release);
    }
  }

  std::vector<std::vector<std::byte>> pictures_;
  camera::CameraSensor sensor_;
  std::atomic<bool> is_wanted_{false};
  std::atomic<bool> is_over_{false};
  std::atomic<std::int64_t> triples_{0};
  std::thread thread_;
};

// A recorder in a thread of its own, which finds the robot like one in another process.
class Recording {
 public:
  Recording(const std::string& robot, log::RecorderOptions options)
      : recorder_({robot}, std::move(options)), thread_([this] { recorder_.run(); }) {
    while (!recorder_.state().robots[0].is_recording) std::this_thread::yield();
  }
  Recording(const Recording&) = delete;
  Recording& operator=(const Recording&) = delete;
  ~Recording() { stop(); }

  void stop() {
    if (!thread_.joinable()) return;
    recorder_.request_stop();
    thread_.join();
  }
  [[nodiscard]] log::RecorderState state() const { return recorder_.state(); }

 private:
  log::Recorder recorder_;
  std::thread thread_;
};

class Robot {
 public:
  Robot() { robot_.append_desired_action({}); }

  // Returns the 99th percentile of the lateness in a window [us].
  double window(double window_time) {
    const auto steps =
        static_cast<TimeIndex>(window_time * 1e9 / static_cast<double>(kPeriod.count()));
    Samples lateness;
    std::vector<Status> part(100);
    // It begins with a step in the future.
    TimeIndex t = robot_.current_time_index() + 1;
    for (const TimeIndex end = t + steps; t < end; t += static_cast<TimeIndex>(part.size())) {
      robot_.get_statuses(t, part);
      for (const Status& status : part) {
        lateness.add(1e-3 * static_cast<double>(status.lateness));
      }
    }
    return lateness.quantile(0.99);
  }

  const std::vector<camera::Camera> cameras = three_cameras();

 private:
  DriverWithSensors driver_{
      std::make_unique<FakeDriver>(), "bench", {camera::camera_companion(cameras)}};
  SessionHost host_{SessionHost::named(
      "bench", {.documents = {
                    {camera::kDocument, "application/yaml",
                     camera::Calibration{.date = {}, .residual = 0, .cameras = cameras}.text()}}})};
  Backend backend_{driver_,
                   host_,
                   {.mode = BackendOptions::Mode::kRealTime,
                    .period = kPeriod,
                    .max_action_repeats = 1'000'000'000,
                    .max_skipped_ticks = 1'000'000'000}};
  BackendThread thread_{backend_, {.demand = Demand::kTry, .priority = 80}};
  Frontend<FakeRobot> robot_{host_};
};

// Counts the images in a log with numbers from `first` on.
std::int64_t images_in(const std::filesystem::path& folder, std::int64_t first) {
  const log::LoggedCameras cameras(log::Log(folder).session());
  std::int64_t count = 0;
  const auto [begin, end] = cameras.range();
  for (TimeIndex i = begin; i < end; ++i) {
    const log::LoggedImages images = cameras.at(i);
    for (std::size_t camera = 0; camera < images.infos().size(); ++camera) {
      if (images.infos()[camera].number >= first && images.has(camera)) ++count;
    }
  }
  return count;
}

Row measure(const Effort& effort, log::ImageStorage storage) {
  Robot robot;
  Cameras cameras("bench", robot.cameras);
  Paired lateness;
  std::int64_t written = 0;
  std::int64_t recorded = 0;
  std::int64_t left_out = 0;
  std::uint64_t bytes = 0;
  // The robot finds its cameras by their first images.
  cameras.set_wanted(true);
  static_cast<void>(robot.window(0.3));
  cameras.set_wanted(false);
  static_cast<void>(robot.window(0.1));
  for (int i = 0; i < effort.windows; ++i) {
    report_progress(i, effort.windows);
    const test::Folder folder;
    Recording recording("bench", {.folder = folder.path(), .images = storage, .keep_free = 0});
    const std::int64_t before = cameras.triples();
    cameras.set_wanted(true);
    lateness.measure.add(robot.window(effort.window_time));
    cameras.set_wanted(false);
    // The last one has been handed over, and the robot has taken it.
    static_cast<void>(robot.window(0.1));
    recording.stop();
    written += 3 * (cameras.triples() - before);
    recorded += images_in(folder.path(), before);
    left_out += recording.state().left_out_images;
    bytes += recording.state().bytes;
    lateness.reference.add(robot.window(effort.window_time));
    lateness.ratio.add(lateness.measure.median() / lateness.reference.median());
  }
  const char* const name = storage == log::ImageStorage::kJpeg ? "JPEG" : "raw";
  const double ratio = lateness.measure.median() / lateness.reference.median();
  Row row = make_row(
      fmt::format("1 kHz beside 100 triples/s of 540 x 540, recorded as {}: lateness, p99", name),
      "us", lateness, "robot alone", "<= 1.2x, no image lost",
      ratio <= 1.2 && recorded == written && left_out == 0);
  row.ratio = ratio;
  row.remark = fmt::format(
      "{} of {} images in the log, {} left out, {:.0f} MB/s", recorded, written, left_out,
      1e-6 * static_cast<double>(bytes) / (effort.windows * effort.window_time));
  return row;
}

}  // namespace

std::vector<Row> recorded_images(const Effort& effort) {
  return {measure(effort, log::ImageStorage::kJpeg), measure(effort, log::ImageStorage::kRaw)};
}

}  // namespace trifinger::benchmarks
