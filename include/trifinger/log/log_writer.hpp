// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "trifinger/base/time.hpp"
#include "trifinger/core/document.hpp"
#include "trifinger/core/fault.hpp"
#include "trifinger/core/robot.hpp"
#include "trifinger/core/session.hpp"
#include "trifinger/core/status.hpp"
#include "trifinger/log/message_layout.hpp"
#include "trifinger/mcap/writer.hpp"

namespace trifinger::log {

/// What a log says of a session at its beginning; docs/log_format.md.
struct SessionHeader {
  std::string name;
  std::uint64_t session_id{0};
  bool is_real_time{false};
  Nanoseconds period{0};
  std::int64_t created{0};      ///< Since 1970 [ns].
  std::int64_t time_offset{0};  ///< From `status.time`, or from simulated time, to 1970 [ns].
  std::string host;
  std::int64_t backend_pid{0};
  RobotTypes types;
  struct Companion {
    std::string name;  ///< As in "sim.object".
    std::string type;
    ElementDescription element;
  };
  std::vector<Companion> companions;
  std::vector<Document> documents;
  TimeIndex first_index{0};

  /// What a session says of itself.
  [[nodiscard]] static SessionHeader of(const Session& robot, const std::vector<Session>& companions);
};

struct LogOptions {
  Precision precision{Precision::kDouble};
  mcap::Compression compression{mcap::Compression::kZstd};
  int level{1};
  std::string recording;  ///< The same for all files of a recording.
  int part{0};            ///< Number of this file among them.
};

/// Writes sessions into one file; knows the format, but neither where the elements come from nor how
/// many files there are.
class LogWriter {
 public:
  LogWriter(mcap::Sink& sink, const LogOptions& options);
  /// Goes on with a file that was not finished.
  LogWriter(mcap::Sink& sink, const LogOptions& options, const mcap::Contents& contents);

  /// Begins, or goes on with, a session. Returns the number that the functions below want.
  std::size_t begin_session(const SessionHeader& header);

  /// Pointers to `count` elements each, of the steps from `first` on.
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
  /// y_N and its status; `observation` is nullptr where the driver could not deliver it.
  void write_end(std::size_t session, TimeIndex time_index, const void* observation,
                 const Status& status);
  void end_session(std::size_t session, TimeIndex steps, const Fault& fault,
                   std::string_view fault_text);
  /// The steps `first` to `last`, both included, are not in the file.
  void write_gap(std::size_t session, TimeIndex first, TimeIndex last, std::string_view reason);

  enum class Level : std::uint8_t { kInfo = 20, kWarning = 30, kError = 40 };
  /// A sentence for people, at the present time.
  void write_event(Level level, std::string_view source, std::string_view text);

  void flush();
  void finish();
  [[nodiscard]] std::size_t open_chunk_size() const noexcept;

 private:
  class Implementation;
  std::unique_ptr<Implementation> implementation_;
};

}  // namespace trifinger::log
