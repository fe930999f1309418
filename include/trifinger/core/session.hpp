// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <chrono>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "trifinger/base/time.hpp"
#include "trifinger/core/document.hpp"
#include "trifinger/core/fault.hpp"
#include "trifinger/core/robot.hpp"
#include "trifinger/core/timing.hpp"
#include "trifinger/ipc/process.hpp"

namespace trifinger {

namespace detail {
class SessionMapping;
class SessionPlace;
}  // namespace detail

/// The time series of a session. Companions have `kObservation` only.
enum class Series : std::uint8_t {
  kDesiredAction,
  kAppliedAction,
  kObservation,
  kStatus,
  kHolding,   ///< Observations before step 0; only the newest few are kept.
  kStopping,  ///< Observations behind the end, one per period until the robot is at rest.
};
[[nodiscard]] std::string_view name_of(Series series) noexcept;

/// What anybody may know about a session without taking part in it.
struct SessionInfo {
  enum class Phase : std::uint8_t { kPreparing, kHolding, kRunning, kEnded };

  std::string name;
  std::string type;  ///< Of the robot, as in "trifinger"; of a companion, its own.
  bool is_companion{false};
  std::uint64_t session_id{0};
  std::uint64_t robot_session_id{0};  ///< Of a companion: its robot's session; of a robot: its own.
  bool is_real_time{false};
  /// Of a robot in real-time mode: what its loop lacks to be a real-time thread, a sentence each
  /// with the remedy; empty if it lacks nothing.
  std::vector<std::string> realtime_lacks;
  Nanoseconds period{0};
  std::chrono::system_clock::time_point created;
  std::string host;
  ipc::ProcessIdentity backend;
  ipc::ProcessIdentity controller;  ///< pid 0: nobody controls.
  bool backend_is_alive{false};
  Nanoseconds since_heartbeat{0};  ///< How long ago the loop gave its last sign of life.
  Phase phase{Phase::kPreparing};
  TimeIndex steps{0};      ///< Whole steps so far.
  Fault fault;             ///< kNone before the end.
  std::string fault_text;  ///< A sentence; empty before the end.
  bool is_at_rest{false};  ///< The orderly stop is over; nothing more will come.
};
[[nodiscard]] std::string_view name_of(SessionInfo::Phase phase) noexcept;

/// Where the files of named sessions are: $TRIFINGER_SESSION_DIR, default /dev/shm.
[[nodiscard]] std::filesystem::path session_folder();

/// A session that has been found. Copies refer to the same session; the front-end is made of one.
class Session {
 public:
  /// Finds the current session of the robot or companion `name`.
  /// @throws SessionNotFound with the names that there are, IncompatibleSession, InvalidArgument,
  /// SystemError that says what lies in its place
  [[nodiscard]] static Session open(const std::string& name);

  [[nodiscard]] SessionInfo info() const;
  /// How the session keeps its time; nothing outside real-time mode and before the first whole
  /// step. Can be read for ever, also when the back-end has died.
  [[nodiscard]] std::optional<TimingRecord> timing() const;
  /// The types of the robot; of a companion, only the observation.
  [[nodiscard]] const RobotTypes& description() const noexcept;
  /// The layout of the elements of one series.
  [[nodiscard]] const ElementDescription& element(Series series) const;

  /// What explains the robot: configuration, model. Companions have none.
  /// @throws IncompatibleSession if the file is damaged
  [[nodiscard]] std::vector<Document> documents() const;
  /// The companions of this robot's session, as in "object". A companion has none.
  [[nodiscard]] const std::vector<std::string>& companion_names() const noexcept;
  /// The companion `name` of this very session, not of a later one.
  /// @throws SessionNotFound with the names there are, RobotStopped if the next session has begun
  [[nodiscard]] Session companion(const std::string& name) const;

  /// Internal: made by the hosts of sessions.
  explicit Session(std::shared_ptr<const detail::SessionMapping> mapping);
  [[nodiscard]] const std::shared_ptr<const detail::SessionMapping>& mapping() const noexcept {
    return mapping_;
  }

 private:
  std::shared_ptr<const detail::SessionMapping> mapping_;
};

/// The process that runs the robot `name`, whatever has become of the files of its session. Nothing
/// if there is none, or none that this user may look at.
/// @throws InvalidArgument
[[nodiscard]] std::optional<ipc::ProcessIdentity> find_backend(const std::string& name);

/// What is in the session folder, robots and companions, in the order of their names. Sessions
/// whose back-end died are included; what cannot be opened is not.
[[nodiscard]] std::vector<SessionInfo> list_sessions();

/// Clears the fault of the robot `name`, as the operator who has looked at it; the next session
/// begins.
/// @throws SessionNotFound, TimedOut, RobotStopped if the back-end is gone
void recover(const std::string& name, Timeout timeout = std::chrono::seconds(5));

/// Options of the memory of a session.
struct SessionOptions {
  std::size_t history{16384};  ///< Elements kept per series; rounded up to a power of two.
  std::size_t queue{4096};     ///< Actions that may wait for their turn; rounded up likewise.
  /// Permissions of the files; 0660 shares them with the group, but the state is the back-end's.
  unsigned mode{0600};
  std::vector<Document> documents{};  ///< Go along with every session of the robot.
};

/// The right to offer sessions under one name. There is one per robot; it lasts as long as the
/// object.
class SessionHost {
 public:
  /// For front-ends in this process only. Companions are found with `open`.
  /// `name` is what logs call the robot; several may have the same.
  [[nodiscard]] static SessionHost anonymous(SessionOptions options = {},
                                             const std::string& name = "anonymous");
  /// For every process of this machine. What a dead back-end of that name left behind is removed.
  /// @throws RobotOwned naming the owner, InvalidArgument for a name that cannot be a file's
  [[nodiscard]] static SessionHost named(const std::string& name, SessionOptions options = {});

  SessionHost(SessionHost&&) noexcept;
  SessionHost& operator=(SessionHost&&) noexcept;
  ~SessionHost();

  /// The current session, or one of its companions. Works in this process, for both kinds.
  /// @throws SessionNotFound before the back-end has begun one
  [[nodiscard]] Session open(const std::string& companion = {}) const;

  [[nodiscard]] detail::SessionPlace& place() const noexcept { return *place_; }

 private:
  explicit SessionHost(std::unique_ptr<detail::SessionPlace> place);

  std::unique_ptr<detail::SessionPlace> place_;
};

}  // namespace trifinger
