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
#include "trifinger/log/log_writer.hpp"
#include "trifinger/mcap/reader.hpp"

namespace trifinger::log {

namespace detail {
class LogData;
struct Stream;
}  // namespace detail

/// Elements that were asked for are not in the log. `LoggedSession::read` gives those that are.
class NotInLog : public Error {
 public:
  using Error::Error;
};

/// Elements of a session that are not in a log, both ends included.
struct Gap {
  TimeIndex first{0};
  TimeIndex last{0};
  std::string reason;

  friend bool operator==(const Gap&, const Gap&) = default;
};

/// Something that was told to people.
struct Event {
  std::int64_t time{0};  ///< Since 1970 [ns].
  LogWriter::Level level{LogWriter::Level::kInfo};
  std::string source;
  std::string text;
};

/// Bytes of one file that could not be used.
struct Damage {
  std::filesystem::path file;
  std::uint64_t offset{0};
  std::uint64_t size{0};
  std::string reason;  ///< A sentence.
};

/// A series to read, or some fields of it.
struct Column {
  Series series{Series::kObservation};
  std::vector<std::string> fields;  ///< "stamp" stands for all "stamp.…". None: all fields.
};

/// The element with no other fields than these, in its own order.
/// @throws InvalidArgument with the fields there are
[[nodiscard]] ElementDescription select(const ElementDescription& element,
                                        const std::vector<std::string>& fields);

/// Reads the elements of a session one after the other, several series at once. What is not in the
/// log is left out. Every chunk of the file is decompressed once, straight into the caller's
/// memory, so that a log may be larger than that.
class SeriesReader {
 public:
  /// Where rows go: arrays for as many as are asked for.
  struct Rows {
    TimeIndex* indices{nullptr};   ///< The step of each row; of a companion, the element's index.
    std::int64_t* times{nullptr};  ///< Since 1970 [ns].
    std::span<void* const> columns{};  ///< Elements, one address per column.
  };

  SeriesReader(SeriesReader&&) noexcept;
  SeriesReader& operator=(SeriesReader&&) noexcept;
  ~SeriesReader();

  /// The layout of the elements of column `i`.
  [[nodiscard]] const ElementDescription& element(std::size_t i) const;
  /// No more rows than these can come.
  [[nodiscard]] std::size_t max_rows() const noexcept;
  /// Fills the next rows, up to `count`; returns how many. Less only at the end.
  /// @throws SystemError
  std::size_t read(std::size_t count, const Rows& rows);

 private:
  friend class LoggedSession;
  class Implementation;
  explicit SeriesReader(std::unique_ptr<Implementation> implementation);

  std::unique_ptr<Implementation> implementation_;
};

/// A session as it is in a log, without types; a robot's, or that of one of its companions, which
/// has `kObservation` only and is counted by its own elements. Copies refer to the same log. Any
/// number of threads may read.
class LoggedSession {
 public:
  /// "sim", or "sim.object" for a companion.
  [[nodiscard]] const std::string& name() const noexcept;
  /// Of the robot, as in "trifinger"; of a companion, its own.
  [[nodiscard]] const std::string& type() const noexcept;
  [[nodiscard]] bool is_companion() const noexcept;
  /// What the log says of the session of the robot, with its documents.
  [[nodiscard]] const SessionHeader& header() const noexcept;
  /// Whole steps of the session; nothing if it went on when the recording ended.
  [[nodiscard]] std::optional<TimeIndex> steps() const noexcept;
  /// Why the session ended; `kNone` if it went on when the recording ended.
  [[nodiscard]] const Fault& fault() const noexcept;
  /// The same in a sentence.
  [[nodiscard]] const std::string& fault_text() const noexcept;

  /// False if the log has none, and so does not know what they are made of.
  [[nodiscard]] bool has_elements() const noexcept;
  /// The layout of the elements of one series. @throws InvalidArgument for one that is not there
  [[nodiscard]] const ElementDescription& element(Series series) const;
  /// The first index of `series` in the log, and the first behind the last. Observations and
  /// statuses may have one more than actions: those of the end.
  [[nodiscard]] std::pair<TimeIndex, TimeIndex> range(Series series) const;
  /// What is missing in the range of the applied actions, be it that the recorder said so or that
  /// the file is damaged. Looks at the whole log once.
  [[nodiscard]] std::vector<Gap> gaps() const;

  /// Copies the elements [first, first + count) of `series`.
  /// @throws NotInLog if one of them is not there, SystemError
  void get(Series series, TimeIndex first, std::size_t count, void* elements) const;
  /// The same with some fields only: `elements` are laid out as `select` says.
  void get(const Column& column, TimeIndex first, std::size_t count, void* elements) const;
  /// Companions: copies the newest element that arrived at or before the robot's step `t`. False
  /// if there was none by then. @throws InvalidArgument for a robot
  [[nodiscard]] bool get_latest_at(TimeIndex t, void* element) const;
  /// Reads what there is of the whole steps from `first` to before `last`.
  [[nodiscard]] SeriesReader read(const std::vector<Column>& columns, TimeIndex first = 0,
                                  TimeIndex last = std::numeric_limits<TimeIndex>::max()) const;
  /// The status of the end of a robot's session, in which no action was applied, and its step;
  /// nothing if it is not in the log, or of another version.
  [[nodiscard]] std::optional<std::pair<TimeIndex, Status>> end_status() const;
  /// How the session kept its time from step `first` to before `last`, the status of its end
  /// included: what its back-end has noted, if no step is missing. Nothing outside real-time mode,
  /// and if statuses are of another version. Reads all of them.
  [[nodiscard]] std::optional<TimingRecord> timing(
      TimeIndex first = 0, TimeIndex last = std::numeric_limits<TimeIndex>::max()) const;
  /// The first index that was measured at or after `time`, since 1970 [ns]; the end of the range if
  /// there is none.
  [[nodiscard]] TimeIndex find(std::int64_t time) const;
  /// The range of what was measured from `begin` to before `end`, counted from the first element in
  /// the log.
  [[nodiscard]] std::pair<TimeIndex, TimeIndex> between(Nanoseconds begin, Nanoseconds end) const;

  /// The companions of a robot.
  [[nodiscard]] std::vector<LoggedSession> companions() const;
  /// One of them: "object", or its full name. @throws InvalidArgument with the names there are
  [[nodiscard]] LoggedSession companion(const std::string& name) const;

  /// Internal: made by `Log`.
  LoggedSession(std::shared_ptr<detail::LogData> log, const detail::Stream& stream);

 private:
  std::shared_ptr<detail::LogData> log_;
  const detail::Stream* stream_;
};

/// `path`, or the .mcap files in that folder, in the order of their names.
/// @throws SystemError, InvalidArgument if there are none
[[nodiscard]] std::vector<std::filesystem::path> files_of(const std::filesystem::path& path);

/// A recording: one file, or all its parts.
///
/// Opening reads no messages if the files were finished and are whole. What is damaged is left out
/// and named; everything else is read.
class Log {
 public:
  /// Opens a file, or the newest recording in a folder with all its parts.
  /// @throws mcap::FormatError if it is no log, or one of a later version; InvalidArgument if the
  /// folder has no recording; SystemError
  explicit Log(const std::filesystem::path& path);
  /// Opens the parts of one recording, in any order.
  /// @throws as above; InvalidArgument if they are of several recordings
  explicit Log(const std::vector<std::filesystem::path>& parts);

  /// In the order of the parts.
  [[nodiscard]] const std::vector<std::filesystem::path>& files() const noexcept;
  /// Of all files [bytes].
  [[nodiscard]] std::uint64_t size() const noexcept;
  /// Every file has the summary that is written at its end.
  [[nodiscard]] bool is_finished() const noexcept;
  /// Who wrote the log and where: the record `trifinger.log` of docs/log_format.md.
  [[nodiscard]] const std::map<std::string, std::string>& origin() const noexcept;

  /// Those of robots, in the order in which they began.
  [[nodiscard]] std::vector<LoggedSession> sessions() const;
  /// The newest session of the robot or companion `name` that has steps; of the only robot in the
  /// log, if empty.
  /// @throws InvalidArgument with the names there are
  [[nodiscard]] LoggedSession session(const std::string& name = {}) const;

  // These look at the whole log once.

  [[nodiscard]] std::vector<Event> events() const;
  [[nodiscard]] std::vector<Damage> damage() const;
  /// Bytes of the files that could not be used.
  [[nodiscard]] std::uint64_t lost_bytes() const;

 private:
  std::shared_ptr<detail::LogData> data_;
};

/// @throws IncompatibleSession with the first difference if `session` is not one of the robot
/// `expected`
void require_same_robot(const LoggedSession& session, const RobotTypes& expected);
/// The same for the elements of a companion.
void require_same_elements(const LoggedSession& session, const ElementDescription& expected);

/// The session of robot R in a log, with the functions of `Frontend`. Those with one `t` give one
/// element, the others fill a range; all throw NotInLog for what is not there.
template <Robot R>
class LoggedRobot {
 public:
  using Action = typename R::Action;
  using AppliedAction = AppliedActionOf<R>;
  using Observation = typename R::Observation;

  /// @throws IncompatibleSession if it is a session of another robot
  explicit LoggedRobot(LoggedSession session) : session_(std::move(session)) {
    require_same_robot(session_, describe_robot<R>());
  }
  /// The newest session of the robot `name` in `log`; of the only robot, if empty.
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

/// The elements of a companion in a log with their type.
template <Described T>
class LoggedCompanion {
 public:
  /// @throws IncompatibleSession if the elements are not of type T
  explicit LoggedCompanion(LoggedSession session) : session_(std::move(session)) {
    require_same_elements(session_, describe<T>());
  }

  /// Returns the newest element that arrived at or before the robot's step `t`; nothing if none had
  /// arrived by then.
  [[nodiscard]] std::optional<T> get_latest_at(TimeIndex t) const {
    T element;
    if (!session_.get_latest_at(t, &element)) return std::nullopt;
    return element;
  }
  /// Fills `elements` from number `first` on.
  void get_observations(TimeIndex first, std::span<T> elements) const {
    session_.get(Series::kObservation, first, elements.size(), elements.data());
  }
  [[nodiscard]] const LoggedSession& session() const noexcept { return session_; }

 private:
  LoggedSession session_;
};

}  // namespace trifinger::log
