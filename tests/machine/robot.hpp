// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <csignal>
#include <filesystem>
#include <optional>
#include <string>

#include "support/folder.hpp"
#include "support/program.hpp"
#include "trifinger/core/frontend.hpp"
#include "trifinger/joint/types.hpp"

namespace trifinger::test {

/// TriFingerEdu on motor boards, as users start it: one process is the boards, another one drives
/// them. They use the interfaces vcan0 to vcan5 of this machine.
class RobotOnBoards {
 public:
  static constexpr const char* kName = "trifinger-edu-can";

  /// Switches the boards on.
  void start_boards() {
    boards_.emplace(command("emulate"), folder_ / "boards");
    boards_->wait_for("6 emulated boards are on");
  }
  /// Starts the driver, and waits until the robot has homed and holds its pose.
  void start_driver() {
    driver_.emplace(command("run"), folder_ / "driver");
    driver_->wait_for("holds its pose");
  }
  void kill_boards() { boards_.reset(); }
  /// Stops the driver as Ctrl-C does, and returns its exit code.
  int stop_driver() {
    const int code = driver_->end(SIGINT);
    driver_.reset();
    return code;
  }

  /// Takes control, as soon as the robot holds its pose.
  [[nodiscard]] static Frontend<TriFinger> connect() {
    return trifinger::connect<TriFinger>(kName, {.timeout = std::chrono::minutes(2)});
  }
  static int recover() { return run({"trifinger", "recover", kName, "--timeout", "120"}); }

 private:
  // The settings are those of hardware, at 1 kHz. The end stops are those of the simulation. Each
  // self-test would take two minutes of the virtual machine; tests of boards have it.
  static Command command(const std::string& verb) {
    return {"trifinger",
            verb,
            "trifinger_edu_can",
            "--set",
            "boards.interfaces=[vcan0, vcan1, vcan2, vcan3, vcan4, vcan5]",
            "--set",
            "boards.homing.method=end_stop",
            "--set",
            "boards.homing.home_position=[1.8, 2.0, -3.4]",
            "--set",
            "boards.self_test=false",
            "--set",
            "boards.move_time=1"};
  }

  Folder folder_;
  std::optional<Program> boards_;
  std::optional<Program> driver_;
};

}  // namespace trifinger::test
