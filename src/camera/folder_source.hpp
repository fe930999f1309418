// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <filesystem>
#include <set>
#include <span>
#include <string>
#include <vector>

#include "trifinger/base/time.hpp"
#include "trifinger/camera/camera.hpp"
#include "trifinger/camera/source.hpp"

namespace trifinger::camera {

struct FolderOptions {
  std::filesystem::path folder;
  Nanoseconds period{std::chrono::milliseconds(100)};  ///< Time between two images.
  bool repeats{true};  ///< Begins anew after the last image; otherwise the source ends.
  /// Leaves images out if nobody takes them in time, as cameras do, except the last one of a source
  /// that ends. Otherwise all are shown, later.
  bool keeps_pace{true};
};

/// Shows a folder of PNG and JPEG images as if they came from cameras now.
///
/// The images of camera60 are the files in the subfolder "camera60", or else the files whose names
/// begin with "camera60", in the order of their names: numbers in names count as numbers. The first
/// of each camera belong together, and so on. If every name ends in a time in nanoseconds, of 12
/// digits or more, images are shown at the distances of these times, and those of one time belong
/// together. An image that cannot be read is `kDamaged`.
class FolderSource final : public Source {
 public:
  /// @throws InvalidArgument if there are no images of a camera
  FolderSource(const std::vector<Camera>& cameras, FolderOptions options);
  ~FolderSource() override;

  [[nodiscard]] const std::vector<std::string>& names() const noexcept override;
  [[nodiscard]] const std::vector<ImageFormat>& formats() const noexcept override;
  [[nodiscard]] bool grab(std::span<const std::span<std::byte>> images, std::span<Frame> frames,
                          Timeout timeout) override;
  [[nodiscard]] bool has_ended() const noexcept override;
  [[nodiscard]] std::vector<std::string> take_messages() override;

 private:
  // The files of one time; an empty path where a camera has none.
  struct Set {
    std::vector<std::filesystem::path> files;
    Nanoseconds time{0};  // from the first set
  };

  [[nodiscard]] std::int64_t size() const noexcept {
    return static_cast<std::int64_t>(sets_.size());
  }
  // When the images `count` are shown, counted from 0 over all rounds.
  [[nodiscard]] Instant due(std::int64_t count) const noexcept;
  // Leaves out images if there are newer ones.
  void catch_up(Instant now) noexcept;

  std::vector<Set> sets_;
  std::vector<std::string> names_;
  std::vector<ImageFormat> formats_;
  FolderOptions options_;
  std::vector<std::string> messages_;
  std::set<const Set*> reported_;  // whose files were looked at
  Instant begin_{};
  std::int64_t count_{0};
};

}  // namespace trifinger::camera
