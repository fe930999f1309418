// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "trifinger/core/fault.hpp"
#include "trifinger/core/robot.hpp"
#include "trifinger/core/session.hpp"
#include "trifinger/log/log_writer.hpp"
#include "trifinger/mcap/reader.hpp"

namespace trifinger::log {

/// Steps that are not in a log, both ends included.
struct Gap {
  TimeIndex first{0};
  TimeIndex last{0};
  std::string reason;
};

/// A session as it is in a log.
struct LoggedSession {
  SessionHeader header;
  std::optional<TimeIndex> steps;  ///< Whole steps of the session; nothing if its end is not there.
  Fault fault;
  std::string fault_text;
  TimeIndex first_index{0};  ///< First step in the log.
  TimeIndex end_index{0};    ///< Behind the last step in the log.
  std::vector<Gap> gaps;     ///< Written down, and those found because of damage.
};

/// Something that was told to people.
struct Event {
  std::int64_t time{0};  ///< Since 1970 [ns].
  LogWriter::Level level{LogWriter::Level::kInfo};
  std::string source;
  std::string text;
};

/// A recording: one file, or all parts of it in a folder.
///
/// Opening reads no messages if the file was finished. What is damaged or missing is said by
/// `damage()` and by the gaps of the sessions; the rest is read.
class Log {
 public:
  /// @throws mcap::FormatError if it is no log, or one of a later version; SystemError
  explicit Log(const std::filesystem::path& path);
  Log(Log&&) noexcept;
  Log& operator=(Log&&) noexcept;
  ~Log();

  [[nodiscard]] const std::vector<LoggedSession>& sessions() const noexcept;
  /// The newest session of the robot `name`; of the only robot in the log, if empty.
  /// @throws InvalidArgument with the names there are
  [[nodiscard]] const LoggedSession& session(const std::string& name = {}) const;

  /// Copies the steps [first, first + count) of one series into `elements`. Missing steps are left
  /// as they are. Returns the number of steps found.
  std::size_t get(const LoggedSession& session, Series series, TimeIndex first, std::size_t count,
                  void* elements) const;

  // Implementation notes and further functions are added by the reader's author.
 private:
  class Implementation;
  std::unique_ptr<Implementation> implementation_;
};

}  // namespace trifinger::log
