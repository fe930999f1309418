// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <limits>
#include <mutex>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "trifinger/base/time.hpp"
#include "trifinger/core/follower.hpp"
#include "trifinger/core/session.hpp"

namespace trifinger::log {

/// Writes the newest `length` of a session, as far as its history reaches, into the new log `file`,
/// with its companions, documents and end. Two more companions hold the measurements before step 0
/// (`holding`) and while the robot came to rest (`stopping`).
///
/// It also reads what a dead back-end has left. An element that the back-end was writing when it
/// died is left out.
/// @throws SystemError
void write_last(const Session& robot, const std::vector<Session>& companions,
                const std::filesystem::path& file, Nanoseconds length, std::string_view event);

/// Writes the newest `length` that a killed back-end of the robot `name` has left in memory.
/// Returns the file; `file` defaults to one in `log_folder()`.
/// @throws SessionNotFound, InvalidArgument if the session is still running: then it can be
/// recorded; SystemError
std::filesystem::path rescue(const std::string& name, std::optional<std::filesystem::path> file,
                             Nanoseconds length);

/// The log that was written at the end of the session `session_id` of the robot `name`. Nothing if
/// there is none, or if the robot has left a newer one.
[[nodiscard]] std::optional<std::filesystem::path> find_fault_log(
    const std::filesystem::path& folder, const std::string& name, std::uint64_t session_id);

struct FlightRecorderOptions {
  std::filesystem::path folder{};  ///< Must exist; default: `log_folder()`.
  Nanoseconds length{std::chrono::seconds(10)};
  std::size_t max_files{20};  ///< Number of files for all robots together; the oldest are removed.
};

/// Writes a log after every session that ends with a fault: `NAME_2026-11-20_09-05-12_fault.mcap`.
///
/// It does nothing until the fault, because the history of the session has the last seconds. It
/// follows a back-end, which never waits for it.
class FlightRecorder final : public Follower {
 public:
  explicit FlightRecorder(FlightRecorderOptions options);

  void begin_session(const Session& robot,
                     const std::vector<Session>& companions) noexcept override;
  [[nodiscard]] TimeIndex next_step() const noexcept TRIFINGER_REALTIME override {
    return std::numeric_limits<TimeIndex>::max();
  }

  /// The log of one fault.
  struct Left {
    std::filesystem::path file;
    std::string error;  ///< Why the file is missing or incomplete; empty if it is complete.
  };
  /// Writes logs of the sessions that have ended with a fault since the last call and whose robot
  /// is at rest. Do not call it in the thread of the back-end: it takes as long as the disk needs.
  [[nodiscard]] std::vector<Left> write();

 private:
  struct Followed {
    Session robot;
    std::vector<Session> companions;
  };
  [[nodiscard]] std::vector<Followed> take_ended();
  void remove_oldest() const;

  FlightRecorderOptions options_;
  std::mutex mutex_;
  std::vector<Followed> sessions_;  // only the last one may still be running
};

}  // namespace trifinger::log
