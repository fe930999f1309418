// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "boards/board_robot.hpp"
#include "commands.hpp"
#include "robot/runnable_robot.hpp"
#include "robot/wear_recorder.hpp"
#include "shared/signals.hpp"
#include "shared/terminal.hpp"
#include "trifinger/base/time.hpp"
#include "trifinger/core/session.hpp"
#include "trifinger/realtime/thread.hpp"

// What the commands have in common that look after a robot on motor boards while nobody uses it:
// home, calibrate, self-test.
namespace trifinger::apps {

struct MaintenanceOptions {
  std::string robot;
  std::optional<std::string> name;
  std::vector<std::string> overrides;
  RealtimeOptions realtime;
};

// Adds the options to a command.
void add_maintenance(CLI::App& command, MaintenanceOptions& options);

// A robot on motor boards, as long as the object lives; no other program can run it meanwhile.
class ServicedRobot {
 public:
  // Throws InvalidArgument for a robot without boards, and what `make_robot` and
  // `SessionHost::named` throw. If `is_calibrated` is false, its calibration does not count.
  explicit ServicedRobot(const MaintenanceOptions& options, bool is_calibrated = true);

  [[nodiscard]] boards::BoardRobot& boards() const noexcept { return *robot_.boards; }

  // Prepares the robot as its driver was told, and brings it to rest. Prints what it does. Calls
  // `while_ready` when the robot is ready. If the driver waits for a reference, a person is asked
  // for it. Throws Error with the text of a fault, or if somebody has pressed Ctrl-C; a second one
  // kills.
  void prepare(const std::function<void()>& while_ready = [] {});

  [[nodiscard]] const std::string& name() const noexcept { return robot_.name; }
  [[nodiscard]] const SessionHost& host() const noexcept { return host_; }
  void print(const std::string& text, Style style = Style::kPlain) {
    console_.print(robot_.name, text, style);
  }

 private:
  enum class Question : unsigned char { kNone, kIsAtReference, kIsFree };

  // True if the session holds. Throws Error if it has ended with a fault.
  [[nodiscard]] bool is_ready() const;
  void ask_for_reference();
  // True when somebody has pressed Enter.
  [[nodiscard]] static bool was_enter_pressed();
  void print_warning(const std::string& warning) {
    if (!warning.empty()) print(warning, Style::kWarning);
  }

  const Signals signals_;  // before any thread
  RealtimeOptions realtime_;
  RunnableRobot robot_;
  SessionHost host_;
  WearRecorder wear_;
  Question question_{Question::kNone};
  Console console_;
};

}  // namespace trifinger::apps
