// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "log/message_layout.hpp"
#include "trifinger/base/time.hpp"
#include "trifinger/core/fault.hpp"
#include "trifinger/core/status.hpp"
#include "trifinger/log/event.hpp"
#include "trifinger/log/session_header.hpp"
#include "trifinger/mcap/records.hpp"
#include "trifinger/mcap/sink.hpp"
#include "trifinger/mcap/writer.hpp"

namespace trifinger::log {

struct LogOptions {
  Precision precision{Precision::kDouble};
  mcap::Compression compression{mcap::Compression::kZstd};
  int level{1};
  std::string recording;  ///< Id of the recording, equal in all its files.
  int part{0};            ///< Number of this file in the recording.
  /// How often 3D viewers get the poses of a robot's links [1/s]; 0: never. The robot must have the
  /// documents "robot.urdf" and "frames.txt".
  double viewer_rate{8.0};
};

/// Writes sessions into one file, in the format of a log. The caller knows where the elements come
/// from and how many files there are.
///
/// If the sink throws SystemError, nothing is lost: the same call tries again. `write_steps` and
/// `write_companion` do not throw as long as there is room in the open chunk. When they throw, some
/// of the elements may have been written.
class LogWriter {
 public:
  /// Begins a file. `sink` must be empty and outlive the writer.
  LogWriter(mcap::Sink& sink, const LogOptions& options);
  /// Continues an unfinished file of the same precision.
  LogWriter(mcap::Sink& sink, const LogOptions& options, const mcap::Contents& contents);
  LogWriter(LogWriter&&) noexcept;
  LogWriter& operator=(LogWriter&&) noexcept;
  ~LogWriter();

  /// Begins a session, or continues one that is in the file. Returns the number that the functions
  /// below need.
  /// @throws InvalidArgument if a type or field has a name that is not allowed in a log
  std::size_t begin_session(const SessionHeader& header);

  /// Pointers to `count` elements each, for the steps from `first` on.
  struct Steps {
    TimeIndex first{0};
    std::size_t count{0};
    const void* desired_actions{nullptr};
    const void* applied_actions{nullptr};
    const void* observations{nullptr};
    const void* statuses{nullptr};
  };
  void write_steps(std::size_t session, const Steps& steps);
  void write_companion(std::size_t session, std::size_t companion, TimeIndex first,
                       std::size_t count, const void* elements);
  /// Writes y_N and its status. `observation` is nullptr if the driver could not deliver it.
  void write_end(std::size_t session, TimeIndex time_index, const void* observation,
                 const Status& status);
  /// Ends a session. No more of it may be written.
  void end_session(std::size_t session, TimeIndex steps, const Fault& fault,
                   std::string_view fault_text);
  /// Says that the steps `first` to `last`, both included, are not in the file.
  void write_gap(std::size_t session, TimeIndex first, TimeIndex last, std::string_view reason);
  /// Says that these elements of a companion are not in the file.
  void write_companion_gap(std::size_t session, std::size_t companion, TimeIndex first,
                           TimeIndex last, std::string_view reason);

  /// An image of one camera, as the message that the log has of it.
  struct Image {
    std::size_t camera{0};  ///< Its number in the calibration among the session's documents.
    TimeIndex element{0};   ///< Number of the element of the companion "cameras".
    std::int64_t time{0};   ///< Middle of the exposure, since 1970 [ns].
    bool is_compressed{true};
    std::vector<std::byte> message{};  ///< In CDR. Its time is filled in when it is written.
  };
  /// Takes an image. The next `flush` writes it, in a chunk of its own that is not compressed, so
  /// images make nothing else larger or slower to read. Never throws because of the disk.
  /// @throws InvalidArgument if the session has no such camera
  void write_image(std::size_t session, Image image);
  /// Size of the images that wait for `flush` [bytes].
  [[nodiscard]] std::size_t waiting_images_size() const noexcept;

  /// Writes a sentence for people. `time` is since 1970 [ns].
  void write_event(Level level, std::string_view source, std::string_view text, std::int64_t time);

  /// Closes the open chunk and hands it to the sink.
  void flush();
  /// Closes the open chunk, hands it to the sink, and writes the summary.
  void finish();
  /// Size of the messages in the open chunk [bytes]. Above `kMaxChunkSize` it is closed
  /// automatically.
  [[nodiscard]] std::size_t open_chunk_size() const noexcept;
  static constexpr std::size_t kMaxChunkSize = std::size_t{1} << 20U;

 private:
  class Implementation;
  std::unique_ptr<Implementation> implementation_;
};

}  // namespace trifinger::log
