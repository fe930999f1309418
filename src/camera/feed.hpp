// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "camera/error_throttle.hpp"
#include "trifinger/base/time.hpp"
#include "trifinger/camera/images.hpp"
#include "trifinger/camera/source.hpp"

namespace trifinger::camera {

/// What a feed has done.
struct FeedStatistics {
  struct OfCamera {
    std::string name;
    std::int64_t good{0};
    std::int64_t damaged{0};
    std::int64_t missing{0};  ///< No image among the others of its time.
    std::int64_t lost{0};     ///< The camera was not there.
  };

  std::int64_t elements{0};  ///< Written altogether.
  std::vector<OfCamera> cameras;
  Nanoseconds duration{0};       ///< From the first good image to the last one.
  Nanoseconds mean_delay{0};     ///< From the middle of the exposure until the image was written.
  Nanoseconds largest_delay{0};  ///< [ns]
  Nanoseconds largest_skew{0};   ///< Largest difference of time between the images of one element.
};

/// The work of a process with cameras: takes images from a source, and hands them to the robot and
/// to everybody who looks.
class CameraFeed {
 public:
  /// `period` is the time between two images.
  /// @throws InvalidArgument if the source has other cameras, SystemError, Error if another process
  /// is the cameras of this robot
  CameraFeed(Source& source, const std::string& robot, const std::vector<Camera>& cameras,
             Nanoseconds period);

  /// Waits for the next images, but not longer than 0.1 s, and hands them over. If none come for
  /// five periods and 0.1 s, it says so to those who wait for images, too. False if no more will
  /// come.
  /// @throws Error if the source is broken for good
  bool step();

  /// What has happened since the last call, in sentences.
  [[nodiscard]] std::vector<std::string> take_messages();
  [[nodiscard]] const FeedStatistics& statistics() const noexcept { return statistics_; }

 private:
  // What was reported last about a camera.
  struct CameraState {
    ErrorThrottle throttle;
    int absent{0};  // elements in a row without its image
    std::int64_t number{-1};
    std::int64_t missed{0};  // since the last sentence about it
    bool is_out_of_step{false};
  };

  void count(Instant now);
  // `is_silent`: no camera has delivered anything for some periods.
  void judge(Instant now, bool is_silent);
  void judge_absence(std::size_t camera, Instant now);
  void judge_steps();
  void report_missed();

  Source& source_;
  CameraSensor sensor_;
  Nanoseconds period_;
  std::vector<std::string> names_;
  std::vector<Frame> frames_;
  std::vector<CameraState> states_;
  std::vector<std::string> messages_;
  FeedStatistics statistics_;
  Nanoseconds sum_of_delays_{0};
  std::int64_t delays_{0};
  Instant written_;  // when the last element was
  Instant first_{};
  Instant reported_missed_{};
};

}  // namespace trifinger::camera
