// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <mutex>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "log/format/image_messages.hpp"
#include "log/image_storage.hpp"
#include "log/log_writer.hpp"
#include "trifinger/core/frontend.hpp"
#include "trifinger/core/session.hpp"
#include "trifinger/ipc/fork.hpp"
#include "trifinger/log/session_header.hpp"

namespace trifinger::log::detail {

struct ImageOptions {
  ImageStorage storage{ImageStorage::kJpeg};
  int quality{90};  // of JPEG
  // All messages that nobody has taken may have this size together, as raw images: more than comes
  // in a second, while a disk synchronises or other programs take the processors.
  std::size_t max_size{std::size_t{128} << 20U};
};

// Makes the messages of a session's images, in threads of its own. Pixels are soon overwritten, so
// one thread copies them and does nothing else; another one compresses them. An image that cannot
// be had is left out and counted.
class ImageThread {
 public:
  // What has become of the images since the last call of `take`.
  struct Taken {
    std::vector<LogWriter::Image> images;  // without their time
    std::int64_t left_out{0};
    std::string error;  // a sentence; empty if there is none
  };

  // Begins with element `first` of `companion`, which has the images of `cameras`.
  ImageThread(const Session& companion, const SessionHeader& header, SessionCameras cameras,
              const ImageOptions& options, TimeIndex first);
  ~ImageThread();

  // Takes messages of `max_size` bytes together, or one that is larger. Their times are those on
  // the log's clock if step 0 was at 0.
  [[nodiscard]] Taken take(std::size_t max_size);
  // First element whose pixels are still needed.
  [[nodiscard]] TimeIndex next() const noexcept;

  // The threads shall end with the elements that are there now.
  void request_end() noexcept;
  // True when they have ended: `take` gives all that is left.
  [[nodiscard]] bool has_ended() const noexcept;
  // Waits until they have ended. What finds no room is left out.
  void end() noexcept;

 private:
  void grab();
  void grab(TimeIndex element);
  void compress();
  void compress(LogWriter::Image& image) const;
  [[nodiscard]] std::optional<LogWriter::Image> next_to_compress();
  [[nodiscard]] bool put(LogWriter::Image& image);
  void leave_out(std::int64_t count, const std::string& error = {});

  UntypedFrontend companion_;
  SessionHeader header_;  // its time offset is 0
  SessionCameras cameras_;
  std::vector<std::string> frames_;
  ImageOptions options_;
  bool is_patient_;  // the back-end waits for the images
  std::vector<std::byte> element_;
  std::atomic<TimeIndex> next_;
  std::atomic<bool> end_requested_{false};
  std::atomic<bool> is_hasty_{false};     // does not wait for room
  std::atomic<bool> has_grabbed_{false};  // all there is
  std::atomic<bool> has_ended_{false};

  std::mutex mutex_;
  // The mutex guards the following members.
  std::deque<LogWriter::Image> grabbed_;  // raw images that are to be compressed
  std::deque<LogWriter::Image> images_;
  std::size_t size_{0};  // of both
  std::int64_t left_out_{0};
  std::string error_;

  ipc::ForkGuard fork_;
  std::thread grabber_;
  std::thread compressor_;
};

}  // namespace trifinger::log::detail
