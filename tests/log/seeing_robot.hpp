// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <filesystem>
#include <functional>
#include <memory>
#include <span>
#include <string_view>
#include <utility>
#include <vector>

#include "camera/cameras_of_tests.hpp"
#include "core/fake_robot.hpp"
#include "log/recorder.hpp"
#include "log/recorder_under_test.hpp"
#include "log/recordings.hpp"
#include "trifinger/camera/calibration.hpp"
#include "trifinger/camera/images.hpp"
#include "trifinger/core/backend.hpp"

namespace trifinger::test {

using ImageStates = std::array<camera::Frame::State, 3>;

/// How the images of a test look.
struct Seen {
  std::vector<camera::Camera> cameras = three_cameras();
  TimeIndex period{10};  ///< Steps from one image to the next.
  /// The states of the images with this number.
  std::function<ImageStates(std::int64_t number)> states = [](std::int64_t) {
    return ImageStates{camera::Frame::State::kGood, camera::Frame::State::kGood,
                       camera::Frame::State::kGood};
  };
  std::function<void(std::span<std::byte> pixels, std::size_t camera, std::int64_t number)> draw =
      fill_pattern;
};

/// A fake robot with three cameras in its own process.
class SeeingDriver final : public Driver<FakeRobot> {
 public:
  explicit SeeingDriver(Seen seen)
      : seen_(std::move(seen)),
        companions_{camera::camera_companion(seen_.cameras)},
        images_(camera::ImageWriter::anonymous(seen_.cameras)) {}

  using Driver::apply_action;
  using Driver::get_latest_observation;
  using Driver::hold;

  [[nodiscard]] DriverReport prepare(TimeIndex step) noexcept override {
    next_ = 0;
    return robot_.prepare(step);
  }
  [[nodiscard]] DriverReport get_latest_observation(
      FakeObservation& observation) noexcept override {
    return robot_.get_latest_observation(observation);
  }
  [[nodiscard]] DriverReport apply_action(const FakeAction& desired,
                                          FakeAction& applied) noexcept override {
    return robot_.apply_action(desired, applied);
  }
  [[nodiscard]] DriverReport hold(const FakeObservation& observation,
                                  FakeAction& action) noexcept override {
    return robot_.hold(observation, action);
  }
  [[nodiscard]] DriverReport stop(TimeIndex step) noexcept override { return robot_.stop(step); }
  void cut() noexcept override {}
  [[nodiscard]] std::span<const CompanionDescription> companions() const noexcept override {
    return companions_;
  }
  [[nodiscard]] bool get_companion_element(std::size_t, TimeIndex t,
                                           void* element) noexcept override {
    if (t < next_) return false;
    const std::int64_t number = next_ / seen_.period;
    const std::span<const std::span<std::byte>> places = images_.begin();
    const ImageStates states = seen_.states(number);
    std::array<camera::Frame, 3> frames;
    for (std::size_t i = 0; i < 3; ++i) {
      // The cameras are some microseconds apart.
      frames[i] = {
          .state = states[i],
          .number = number,
          .time = Instant(std::chrono::milliseconds(next_) + std::chrono::microseconds(7 * i)),
          .exposure = std::chrono::microseconds(1500)};
      if (states[i] == camera::Frame::State::kLost) frames[i] = {.state = states[i]};
      if (states[i] == camera::Frame::State::kGood) seen_.draw(places[i], i, number);
    }
    auto* const bytes = static_cast<std::byte*>(element);
    images_.commit(frames, {bytes, images_.element_size()});
    const Stamp stamp{.arrival_index = t, .capture_index = next_};
    std::memcpy(bytes, &stamp, sizeof(stamp));
    next_ += seen_.period;
    return true;
  }

 private:
  Seen seen_;
  FakeDriver robot_;
  std::array<CompanionDescription, 1> companions_;
  camera::ImageWriter images_;
  TimeIndex next_{0};
};

/// Sessions of a robot "robot" that sees, recorded into a folder.
class RecordedSight {
 public:
  RecordedSight(const std::filesystem::path& folder, log::ImageStorage storage, const Seen& seen,
                log::RecorderOptions options = {})
      : recorder_({"robot"}, with(std::move(options), folder, storage)),
        driver_(seen),
        host_(SessionHost::anonymous({.documents = documents(seen.cameras)}, "robot")),
        backend_(driver_, host_, kPatient) {
    backend_.follow(*recorder_);
  }

  /// A session of `steps` steps.
  void run(TimeIndex steps) {
    Frontend<FakeRobot> robot(backend_);
    for (TimeIndex i = 0; i < steps; ++i) {
      static_cast<void>(robot.get_status(robot.append_desired_action({})));
    }
    robot.finish();
  }
  void stop() { recorder_.stop(); }
  [[nodiscard]] RecorderUnderTest& recorder() noexcept { return recorder_; }

  static std::vector<Document> documents(const std::vector<camera::Camera>& cameras) {
    const camera::Calibration calibration{.date = {}, .residual = 0, .cameras = cameras};
    return {{camera::kDocument, "application/yaml", calibration.text()}};
  }

 private:
  static log::RecorderOptions with(log::RecorderOptions options,
                                   const std::filesystem::path& folder, log::ImageStorage storage) {
    options.folder = folder;
    options.keep_free = 0;
    options.is_follower = true;
    options.images = storage;
    return options;
  }

  RecorderUnderTest recorder_;
  SeeingDriver driver_;
  SessionHost host_;
  Backend backend_;
};

}  // namespace trifinger::test
