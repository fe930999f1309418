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
  kStopping,  ///< Observations after the end, one per period until the robot is at rest.
};
[[nodiscard]] std::string_view name_of(Series series) noexcept;

/// Facts about a session for everybody: name, type, period, who takes part. Reading them does not
/// need a front-end.
struct SessionInfo {
  enum class Phase : std::uint8_t { kPreparing, kHolding, kRunning, kEnded };

  std::string name;
  std::string type;  ///< Type of the robot, for example "trifinger", or of the companion.
  bool is_companion{false};
  std::uint64_t session_id{0};
  std::uint64_t robot_session_id{0};  ///< A companion's robot's session; a robot's own session.
  bool is_real_time{false};
  /// What keeps the loop of a robot in real-time mode from being a real-time thread. Each entry is
  /// a sentence with the remedy. Empty if nothing is missing.
  std::vector<std::string> realtime_warnings;
  Nanoseconds period{0};
  std::chrono::system_clock::time_point created;
  std::string host;
  ipc::ProcessIdentity backend;
  ipc::ProcessIdentity controller;  ///< pid 0 means that nobody controls.
  bool backend_is_alive{false};
  Nanoseconds since_heartbeat{0};  ///< Time since the loop's last sign of life.
  Phase phase{Phase::kPreparing};
  TimeIndex steps{0};  ///< Number of whole steps so far.
  /// Number of actions that wait for their step; 0 if this user may not look at them.
  TimeIndex waiting_actions{0};
  Fault fault;             ///< kNone before the end.
  std::string fault_text;  ///< A sentence; empty before the end.
  bool is_at_rest{false};  ///< The orderly stop is over; nothing more will come.
};
[[nodiscard]] std::string_view name_of(SessionInfo::Phase phase) noexcept;

/// The folder with the files of named sessions: $TRIFINGER_SESSION_DIR, default /dev/shm.
[[nodiscard]] std::filesystem::path session_folder();

/// A session that has been found. Copies refer to the same session. A front-end can be made from
/// it.
class Session {
 public:
  /// Finds the current session of the robot or companion `name`.
  /// @throws SessionNotFound with the names of running robots, IncompatibleSession,
  /// InvalidArgument, SystemError that says what lies in its place
  [[nodiscard]] static Session open(const std::string& name);

  [[nodiscard]] SessionInfo info() const;
  /// How well the session keeps its time. Nothing outside real-time mode and before the first whole
  /// step. It can always be read, also when the back-end has died.
  [[nodiscard]] std::optional<TimingRecord> timing() const;
  /// The types of the robot. For a companion, only the observation is filled.
  [[nodiscard]] const RobotTypes& description() const noexcept;
  /// The layout of the elements of one series.
  [[nodiscard]] const ElementDescription& element(Series series) const;
  /// The fields of a companion's payload, see payload.hpp; none if its elements have no payload.
  [[nodiscard]] const ElementDescription& payload() const noexcept;

  /// The documents that explain the robot, by name: "configuration.yml", "model.xml". Companions
  /// have none.
  /// @throws IncompatibleSession if the file is damaged
  [[nodiscard]] std::vector<Document> documents() const;
  /// Names of the companions of this robot's session, for example "object". A companion has none.
  [[nodiscard]] const std::vector<std::string>& companion_names() const noexcept;
  /// The companion `name` of exactly this session, not of a later one.
  /// @throws SessionNotFound with the names of its companions, RobotStopped if the next session has
  /// begun
  [[nodiscard]] Session companion(const std::string& name) const;

  /// Internal: the hosts of sessions call this.
  explicit Session(std::shared_ptr<const detail::SessionMapping> mapping);
  [[nodiscard]] const std::shared_ptr<const detail::SessionMapping>& mapping() const noexcept {
    return mapping_;
  }

 private:
  std::shared_ptr<const detail::SessionMapping> mapping_;
};

/// The process that runs the robot `name`, even if the files of its session were removed. Nothing
/// if there is no such process, or none that this user may see.
/// @throws InvalidArgument
[[nodiscard]] std::optional<ipc::ProcessIdentity> find_backend(const std::string& name);

/// All sessions in the session folder, robots and companions, sorted by name. Sessions whose
/// back-end died are included; sessions that cannot be opened are left out.
[[nodiscard]] std::vector<SessionInfo> list_sessions();

/// Which robot a command is for: `name`, or the only robot that runs on this machine if `name` is
/// empty. Looks once and never waits.
/// @throws SessionNotFound with the names of running robots and how to start one, InvalidArgument
/// with these names if several run and `name` is empty
[[nodiscard]] std::string running_robot(const std::string& name = {});

/// Clears the fault of the robot `name`, so that the next session begins. This is for an operator
/// who has looked at the robot.
/// @throws SessionNotFound, TimedOut, RobotStopped if the back-end is gone
void recover(const std::string& name, Timeout timeout = std::chrono::seconds(5));

/// Options for the memory of a session.
struct SessionOptions {
  std::size_t history{16384};  ///< Elements kept per series; rounded up to a power of two.
  std::size_t queue{4096};     ///< Actions that may wait; rounded up to a power of two.
  /// Permissions of the files. 0660 shares them with the group; only the back-end can write the
  /// state.
  unsigned mode{0600};
  std::vector<Document> documents{};  ///< These documents belong to every session of the robot.
};

/// The right to offer sessions under one name. Only one host per robot can have it, as long as the
/// object lives.
class SessionHost {
 public:
  /// Makes a host for front-ends in this process only. Companions are found with `open`. `name` is
  /// what logs call the robot; several robots may have the same name.
  [[nodiscard]] static SessionHost anonymous(SessionOptions options = {},
                                             const std::string& name = "anonymous");
  /// Makes a host for every process of this machine. Files that a dead back-end of that name left
  /// there are removed.
  /// @throws RobotOwned that names the owner, InvalidArgument if `name` cannot be used in a file
  /// name
  [[nodiscard]] static SessionHost named(const std::string& name, SessionOptions options = {});

  SessionHost(SessionHost&&) noexcept;
  SessionHost& operator=(SessionHost&&) noexcept;
  ~SessionHost();

  /// The current session, or one of its companions. Works in this process, for both kinds of hosts.
  /// @throws SessionNotFound before the back-end has begun a session
  [[nodiscard]] Session open(const std::string& companion = {}) const;

  /// Lets nobody find the sessions any more, as the destructor does: for a process that is about to
  /// end without it. Whoever has opened a session keeps it. Any thread may call it.
  void withdraw() noexcept;

  /// Internal: back-ends begin their sessions there.
  [[nodiscard]] detail::SessionPlace& place() const;

 private:
  explicit SessionHost(std::unique_ptr<detail::SessionPlace> place);

  std::unique_ptr<detail::SessionPlace> place_;
};

}  // namespace trifinger
