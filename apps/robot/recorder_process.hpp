// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <utility>

#include "robot/run_recorder.hpp"
#include "shared/child_program.hpp"
#include "trifinger/base/time.hpp"

namespace trifinger::apps {

// The line that a recorder of `trifinger run` prints as long as it makes progress.
inline constexpr std::string_view kRecorderSign = "goes on";

// `trifinger record` as a child process. It notices by itself when this process has ended. A byte
// on its standard input tells it that the robot has stopped. On its output it gives a sign while it
// makes progress.
class RecorderProcess final : public RunRecorder {
 public:
  // Throws SystemError. The child continues until this process has ended.
  RecorderProcess(std::string robot, std::filesystem::path folder, log::ImageStorage images);

  [[nodiscard]] bool finish(Nanoseconds timeout) override;

 private:
  struct Child {
    explicit Child(ChildProgram started) : program(std::move(started)) {}

    ChildProgram program;
    std::string last_words{};
    bool has_given_sign{false};
    bool is_notified{false};  // that the robot has stopped
    bool was_killed{false};
  };

  // Starts a recorder if there is none.
  void look_after() override;
  void spawn();
  void start_again();
  void read_output();
  // Replaces the child, which has ended with `status`, unless its work is done.
  void replace(int status);
  void notify_child();
  void end_silence();
  void give_up(const std::string& why);

  std::string robot_;
  std::filesystem::path folder_;
  log::ImageStorage images_;
  std::optional<Child> child_;
  Instant next_start_;
  bool is_ending_{false};
  int endings_{0};  // number of endings that have failed
  bool is_over_{false};
};

}  // namespace trifinger::apps
