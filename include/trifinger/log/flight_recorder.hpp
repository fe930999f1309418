// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <chrono>
#include <cstddef>
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

/// Writes the newest `length` of a session, as far as its history goes, into the new log `file`,
/// with its companions, documents and end; and, as two more companions, what was measured before
/// step 0 and while the robot came to rest: `holding` and `stopping`.
///
/// Reads what a dead back-end has left as well. What it was writing when it died is left out.
/// @throws SystemError
void write_last(const Session& robot, const std::vector<Session>& companions,
                const std::filesystem::path& file, Nanoseconds length, std::string_view event);

/// Writes what a killed back-end of the robot `name` has left in memory: its newest `length`.
/// `file`: default is one in `log_folder()`. Returns the file.
/// @throws SessionNotFound, InvalidArgument if the session goes on: then it can be recorded;
/// SystemError
std::filesystem::path rescue(const std::string& name, std::optional<std::filesystem::path> file,
                             Nanoseconds length);

/// The log that was made when the session of `name` ended that began at `created`; nothing if there
/// is none.
[[nodiscard]] std::optional<std::filesystem::path> find_fault_log(
    const std::filesystem::path& folder, const std::string& name,
    std::chrono::system_clock::time_point created);

struct FlightRecorderOptions {
  std::filesystem::path folder{};  ///< Must be there; default: `log_folder()`.
  Nanoseconds length{std::chrono::seconds(10)};
  std::size_t max_files{20};  ///< Of all robots together; the oldest are removed.
};

/// Leaves a log behind every session that ends with a fault: `NAME_2026-11-20_09-05-12_fault.mcap`.
///
/// Until then it does nothing: the history of the session is the recording. Follows a back-end,
/// which never waits for it.
class FlightRecorder final : public Follower {
 public:
  explicit FlightRecorder(FlightRecorderOptions options);

  void begin_session(const Session& robot,
                     const std::vector<Session>& companions) noexcept override;
  [[nodiscard]] TimeIndex next_step() const noexcept TRIFINGER_REALTIME override {
    return std::numeric_limits<TimeIndex>::max();
  }

  /// What a fault has left.
  struct Left {
    std::filesystem::path file;
    std::string trouble;  ///< Why there is no such file, or not a whole one; empty if all is well.
  };
  /// Writes the logs of the sessions that have ended with a fault since the last call, once their
  /// robot is at rest. Takes as long as the disk does: not for the thread of the back-end.
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
  std::vector<Followed> sessions_;  // the last one may go on
};

}  // namespace trifinger::log
