// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <limits>
#include <map>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "trifinger/base/error.hpp"
#include "trifinger/core/fault.hpp"
#include "trifinger/core/robot.hpp"
#include "trifinger/core/session.hpp"
#include "trifinger/core/status.hpp"
#include "trifinger/core/timing.hpp"
#include "trifinger/log/event.hpp"
#include "trifinger/log/session_header.hpp"
#include "trifinger/mcap/reader.hpp"

namespace trifinger::log {

namespace detail {
class LogData;
struct Stream;
}  // namespace detail

/// Requested elements are not in the log. `LoggedSession::read` gives those that are.
class NotInLog : public Error {
 public:
  using Error::Error;
};

/// Elements of a session that are not in a log, from `first` to `last`, both included.
struct Gap {
  TimeIndex first{0};
  TimeIndex last{0};
  std::string reason;

  friend bool operator==(const Gap&, const Gap&) = default;
};

/// Bytes of one file that could not be used.
struct Damage {
  std::filesystem::path file;
  std::uint64_t offset{0};
  std::uint64_t size{0};
  std::string reason;  ///< A sentence.
};

/// A series to read, or some of its fields.
struct Column {
  Series series{Series::kObservation};
  std::vector<std::string> fields;  ///< "stamp" stands for all fields "stamp.…". Empty: all fields.
};

/// The element with only these fields, in its own order.
/// @throws InvalidArgument with the existing fields
[[nodiscard]] ElementDescription select(const ElementDescription& element,
                                        const std::vector<std::string>& fields);

/// Reads the elements of a session one after the other, several series at once. Elements that are
/// not in the log are left out. Every chunk of the file is decompressed once, directly into the
/// caller's memory, so a log may be larger than the memory.
class SeriesReader {
 public:
  /// Where rows are written. Each array needs room for the requested number of rows.
  struct Rows {
    TimeIndex* indices{nullptr};       ///< Step of each row; for a companion, the element's index.
    std::int64_t* times{nullptr};      ///< Since 1970 [ns].
    std::span<void* const> columns{};  ///< Elements, one address per column.
  };

  SeriesReader(SeriesReader&&) noexcept;
  SeriesReader& operator=(SeriesReader&&) noexcept;
  ~SeriesReader();

  /// The layout of the elements of column `i`.
  [[nodiscard]] const ElementDescription& element(std::size_t i) const;
  /// Upper bound of the number of rows that can come.
  [[nodiscard]] std::size_t max_rows() const noexcept;
  /// Fills the next rows, up to `count`, and returns their number. It is smaller only at the end.
  /// @throws SystemError
  std::size_t read(std::size_t count, const Rows& rows);

 private:
  friend class LoggedSession;
  class Implementation;
  SeriesReader(std::shared_ptr<detail::LogData> log, const detail::Stream& stream,
               const std::vector<Column>& columns, TimeIndex first, TimeIndex last);

  std::unique_ptr<Implementation> implementation_;
};

/// A session in a log. It belongs to a robot or to one of its companions. A
/// companion has only observations and counts its own elements. Copies refer to the same log. Any
/// number of threads may read.
class LoggedSession {
 public:
  /// Name of the session, "sim", or "sim.object" for a companion.
  [[nodiscard]] const std::string& name() const noexcept;
  /// Type of the robot, for example "trifinger", or of the companion.
  [[nodiscard]] const std::string& type() const noexcept;
  [[nodiscard]] bool is_companion() const noexcept;
  /// What the log says about the robot's session, with its documents.
  [[nodiscard]] const SessionHeader& header() const noexcept;
  /// Number of whole steps of the session. Nothing if it was still running when the recording
  /// ended.
  [[nodiscard]] std::optional<TimeIndex> steps() const noexcept;
  /// Why the session ended; `kNone` if it was still running when the recording ended.
  [[nodiscard]] const Fault& fault() const noexcept;
  /// The reason of `fault` as a sentence.
  [[nodiscard]] const std::string& fault_text() const noexcept;

  /// False if the log has no elements and therefore does not know their layout.
  [[nodiscard]] bool has_elements() const noexcept;
  /// The layout of the elements of one series. @throws InvalidArgument for a missing series
  [[nodiscard]] const ElementDescription& element(Series series) const;
  /// The first index of `series` in the log, and the first index after the last one. Observations
  /// and statuses may have one more element than actions: that of the end.
  [[nodiscard]] std::pair<TimeIndex, TimeIndex> range(Series series) const;
  /// Elements that are missing in the range of the applied actions, because the recorder said so or
  /// because the file is damaged. Reads the whole log once.
  [[nodiscard]] std::vector<Gap> gaps() const;

  /// Copies the elements [first, first + count) of `series`.
  /// @throws NotInLog if one of them is missing, SystemError
  void get(Series series, TimeIndex first, std::size_t count, void* elements) const;
  /// Copies only some fields of these elements. `elements` have the layout that `select` gives.
  void get(const Column& column, TimeIndex first, std::size_t count, void* elements) const;
  /// For companions: copies the newest element that arrived at or before the robot's step `t`.
  /// False if none had arrived by then. `index` gets its number, unless it is nullptr.
  /// @throws InvalidArgument for a robot
  [[nodiscard]] bool get_latest_at(TimeIndex t, void* element, TimeIndex* index = nullptr) const;
  /// Reads the existing whole steps from `first` to before `last`.
  [[nodiscard]] SeriesReader read(const std::vector<Column>& columns, TimeIndex first = 0,
                                  TimeIndex last = std::numeric_limits<TimeIndex>::max()) const;
  /// The status of the end of a robot's session, where no action was applied, and its step. Nothing
  /// if the log does not have it or has it in another version.
  [[nodiscard]] std::optional<std::pair<TimeIndex, Status>> end_status() const;
  /// How well the session kept its time from step `first` to before `last`, including the status of
  /// its end. It equals the back-end's own record if no step is missing. Nothing outside real-time
  /// mode, or if the statuses have another version. Reads all statuses.
  [[nodiscard]] std::optional<TimingRecord> timing(
      TimeIndex first = 0, TimeIndex last = std::numeric_limits<TimeIndex>::max()) const;
  /// The first index that was measured at or after `time`, since 1970 [ns]. The end of the range if
  /// there is none.
  [[nodiscard]] TimeIndex find(std::int64_t time) const;
  /// The range of the elements measured from `begin` to before `end`. Both count from the first
  /// element in the log.
  [[nodiscard]] std::pair<TimeIndex, TimeIndex> between(Nanoseconds begin, Nanoseconds end) const;

  /// The companions of a robot.
  [[nodiscard]] std::vector<LoggedSession> companions() const;
  /// One companion, by "object" or its full name. @throws InvalidArgument with the existing names
  [[nodiscard]] LoggedSession companion(const std::string& name) const;

  /// Internal: `Log` calls this.
  LoggedSession(std::shared_ptr<detail::LogData> log, const detail::Stream& stream);

 private:
  friend class LoggedCameras;

  std::shared_ptr<detail::LogData> log_;
  const detail::Stream* stream_;
};

/// The file `path` or, if it is a folder, the .mcap files in it, sorted by name.
/// @throws SystemError, InvalidArgument if there are none
[[nodiscard]] std::vector<std::filesystem::path> files_of(const std::filesystem::path& path);

/// A recording: one file, or all its parts.
///
/// If the files are finished and whole, opening reads no messages. Damaged pieces are left out and
/// named (`damage`, `lost_bytes`, and `gaps` of the sessions); everything else is read.
class Log {
 public:
  /// Opens a file, or the newest recording in a folder with all its parts.
  /// @throws mcap::FormatError if it is not a log or is one of a later version; InvalidArgument if
  /// the folder has no recording; SystemError
  explicit Log(const std::filesystem::path& path);
  /// Opens the parts of one recording, in any order.
  /// @throws mcap::FormatError and SystemError as above; InvalidArgument if the parts belong to
  /// several recordings
  explicit Log(const std::vector<std::filesystem::path>& parts);

  /// The files, in the order of the parts.
  [[nodiscard]] const std::vector<std::filesystem::path>& files() const noexcept;
  /// Size of all files together [bytes].
  [[nodiscard]] std::uint64_t size() const noexcept;
  /// True if every file has the summary that is written at its end.
  [[nodiscard]] bool is_finished() const noexcept;
  /// The program and machine that wrote the log: "trifinger_version", "host", "kernel", "created".
  /// "began" orders the recordings of a folder, even if the clock was set back.
  [[nodiscard]] const std::map<std::string, std::string>& origin() const noexcept;

  /// The sessions of robots, in the order in which they began.
  [[nodiscard]] std::vector<LoggedSession> sessions() const;
  /// The newest session with steps of the robot or companion `name`. With an empty name, that of
  /// the only robot in the log.
  /// @throws InvalidArgument with the existing names
  [[nodiscard]] LoggedSession session(const std::string& name = {}) const;

  /// Messages for people. Reads the whole log once.
  [[nodiscard]] std::vector<Event> events() const;
  /// Pieces of the files that could not be read. Reads the whole log once.
  [[nodiscard]] std::vector<Damage> damage() const;
  /// Number of bytes of the files that could not be used. Reads the whole log once.
  [[nodiscard]] std::uint64_t lost_bytes() const;

 private:
  std::shared_ptr<detail::LogData> data_;
};

/// @throws IncompatibleSession with the first difference if `session` does not belong to the robot
/// `expected`
void require_same_robot(const LoggedSession& session, const RobotTypes& expected);
/// @throws IncompatibleSession if the elements of the companion `session` are not `expected`
void require_same_elements(const LoggedSession& session, const ElementDescription& expected);

/// The session of robot R in a log, with the functions of `Frontend`. Functions with one `t` return
/// one element; the others fill a range. All throw NotInLog for missing elements.
template <Robot R>
class LoggedRobot {
 public:
  using Action = typename R::Action;
  using AppliedAction = AppliedActionOf<R>;
  using Observation = typename R::Observation;

  /// @throws IncompatibleSession if the session belongs to another robot
  explicit LoggedRobot(LoggedSession session) : session_(std::move(session)) {
    require_same_robot(session_, describe_robot<R>());
  }
  /// The newest session of the robot `name` in `log`; with an empty name, of the only robot.
  explicit LoggedRobot(const Log& log, const std::string& name = {})
      : LoggedRobot(log.session(name)) {}

  [[nodiscard]] Observation get_observation(TimeIndex t) const {
    return get<Observation>(Series::kObservation, t);
  }
  [[nodiscard]] Action get_desired_action(TimeIndex t) const {
    return get<Action>(Series::kDesiredAction, t);
  }
  [[nodiscard]] AppliedAction get_applied_action(TimeIndex t) const {
    return get<AppliedAction>(Series::kAppliedAction, t);
  }
  [[nodiscard]] Status get_status(TimeIndex t) const { return get<Status>(Series::kStatus, t); }

  void get_observations(TimeIndex first, std::span<Observation> elements) const {
    session_.get(Series::kObservation, first, elements.size(), elements.data());
  }
  void get_desired_actions(TimeIndex first, std::span<Action> elements) const {
    session_.get(Series::kDesiredAction, first, elements.size(), elements.data());
  }
  void get_applied_actions(TimeIndex first, std::span<AppliedAction> elements) const {
    session_.get(Series::kAppliedAction, first, elements.size(), elements.data());
  }
  void get_statuses(TimeIndex first, std::span<Status> elements) const {
    session_.get(Series::kStatus, first, elements.size(), elements.data());
  }

  [[nodiscard]] LoggedSession companion(const std::string& name) const {
    return session_.companion(name);
  }
  [[nodiscard]] const LoggedSession& session() const noexcept { return session_; }

 private:
  template <class T>
  [[nodiscard]] T get(Series series, TimeIndex t) const {
    T element;
    session_.get(series, t, 1, &element);
    return element;
  }

  LoggedSession session_;
};

/// The elements of a companion in a log, with their type.
template <Described T>
class LoggedCompanion {
 public:
  /// @throws IncompatibleSession if the elements are not of type T
  explicit LoggedCompanion(LoggedSession session) : session_(std::move(session)) {
    require_same_elements(session_, describe<T>());
  }

  /// Returns the newest element that arrived at or before the robot's step `t`. Nothing if none had
  /// arrived by then.
  [[nodiscard]] std::optional<T> get_latest_at(TimeIndex t) const {
    T element;
    if (!session_.get_latest_at(t, &element)) return std::nullopt;
    return element;
  }
  /// Fills `elements`, beginning with element number `first`.
  void get_observations(TimeIndex first, std::span<T> elements) const {
    session_.get(Series::kObservation, first, elements.size(), elements.data());
  }
  [[nodiscard]] const LoggedSession& session() const noexcept { return session_; }

 private:
  LoggedSession session_;
};

}  // namespace trifinger::log
