// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <span>
#include <string>
#include <vector>

#include "log/logged_images.hpp"
#include "trifinger/base/time.hpp"
#include "trifinger/camera/source.hpp"
#include "trifinger/log/log.hpp"

namespace trifinger::log {

struct ImageSourceOptions {
  bool repeats{true};  ///< Begins anew after the last image; otherwise the source ends.
};

/// Shows the images of a log as if they came from cameras now: at their distances in time, with
/// their exposures, and with the same ones missing or damaged. An image that the log lacks is
/// missing, too.
class ImageSource final : public camera::Source {
 public:
  /// @throws InvalidArgument if the log has no images of this robot
  explicit ImageSource(const LoggedSession& robot, const ImageSourceOptions& options = {});
  ~ImageSource() override;

  /// The cameras as they were calibrated then.
  [[nodiscard]] const camera::Calibration& calibration() const noexcept {
    return cameras_.calibration();
  }
  [[nodiscard]] const std::vector<std::string>& names() const noexcept override { return names_; }
  [[nodiscard]] const std::vector<camera::ImageFormat>& formats() const noexcept override {
    return formats_;
  }
  [[nodiscard]] bool grab(std::span<const std::span<std::byte>> images,
                          std::span<camera::Frame> frames, Timeout timeout) override;
  [[nodiscard]] bool has_ended() const noexcept override;
  [[nodiscard]] std::vector<std::string> take_messages() override;

 private:
  void go_on() noexcept;
  void leave_out_what_is_over(Instant now);

  // An element of the log.
  struct Set {
    TimeIndex index;
    Nanoseconds time;  // of its capture, from the first one
  };

  LoggedCameras cameras_;
  ImageSourceOptions options_;
  std::vector<Set> sets_;
  std::vector<std::string> names_;
  std::vector<camera::ImageFormat> formats_;
  Nanoseconds round_{0};              // from the beginning to the next one
  std::vector<std::int64_t> counts_;  // images of each camera in a round
  std::vector<std::string> messages_;
  Instant begin_{};
  std::size_t next_{0};
  std::int64_t rounds_{0};
};

}  // namespace trifinger::log
