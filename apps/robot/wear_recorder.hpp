// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "boards/board_robot.hpp"
#include "boards/wear_file.hpp"
#include "trifinger/base/time.hpp"
#include "trifinger/core/session.hpp"

namespace trifinger::apps {

// Keeps the running hours of a robot in a file of the log folder: at its start, once a minute, and
// after every session. The robot runs whatever happens to the file.
class WearRecorder {
 public:
  // Makes `driver` go on from the file. Call this before the robot runs. `driver` and `host` must
  // outlive the recorder.
  WearRecorder(const std::string& robot, boards::BoardRobot& driver, const SessionHost& host);
  // Writes what is left.
  ~WearRecorder();

  // Takes what was counted. Call this after a session, in the thread that ran it.
  void take();
  // Writes if it is time. Returns a message about the file if there is one, otherwise an empty
  // text.
  [[nodiscard]] std::string look();
  // Writes what is left, after the robot has run. Returns what `look` returns.
  [[nodiscard]] std::string finish() { return write(); }

 private:
  void open(const std::string& robot);
  [[nodiscard]] bool is_due() const;
  [[nodiscard]] std::string write();
  [[nodiscard]] std::optional<std::vector<std::byte>> newest();

  boards::BoardRobot& driver_;
  const SessionHost& host_;
  std::optional<boards::WearFile> file_;
  std::string message_;
  bool is_failing_{false};
  Instant written_;  // when it was tried last
  std::mutex mutex_;
  std::optional<std::vector<std::byte>> taken_;  // after a session, not written yet
};

}  // namespace trifinger::apps
