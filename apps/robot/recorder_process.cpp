// SPDX-License-Identifier: BSD-3-Clause
#include "robot/recorder_process.hpp"

#include <fmt/core.h>
#include <sys/wait.h>
#include <unistd.h>

#include <chrono>
#include <csignal>
#include <thread>
#include <utility>

#include "trifinger/base/error.hpp"
#include "trifinger/ipc/process.hpp"

namespace trifinger::apps {
namespace {

// Pause before the next start, if a recorder died without having given a sign.
constexpr Nanoseconds kPause = std::chrono::seconds(1);
// Number of recorders that may try to write the end.
constexpr int kMaxEndings = 2;

// Beginnings of the lines that a recorder prints.
constexpr std::string_view kMessage = "recorder: ";
constexpr std::string_view kFailure = "trifinger record: ";

}  // namespace

RecorderProcess::RecorderProcess(std::string robot, std::filesystem::path folder,
                                 log::ImageStorage images)
    : robot_(std::move(robot)), folder_(std::move(folder)), images_(images) {
  spawn();
}

bool RecorderProcess::finish(Nanoseconds timeout) {
  is_ending_ = true;
  const Deadline deadline(timeout);
  look_after();
  while (!is_over_ && !deadline.passed()) {
    notify_child();
    end_silence();
    if (child_) {
      child_->program.wait(deadline.remaining(timeout));
    } else {
      std::this_thread::sleep_for(deadline.remaining(timeout));
    }
    look_after();
  }
  return is_over_;
}

void RecorderProcess::look_after() {
  if (is_over_) return;
  if (!child_) {
    if (now() >= next_start_) start_again();
    return;
  }
  read_output();
  const std::optional<int> status = child_->program.has_ended();
  if (!status) {
    see_silence();
    return;
  }
  read_output();
  replace(*status);
}

void RecorderProcess::spawn() {
  const auto self = ipc::ProcessIdentity::of_this_process();
  child_.emplace(ChildProgram({"record", robot_, "-o", folder_.string(), "--images",
                               std::string(log::name_of(images_)), "--with-process",
                               fmt::format("{}:{}", self.pid, self.start_time)}));
  begin_watch();
}

void RecorderProcess::start_again() {
  try {
    spawn();
  } catch (const SystemError& error) {
    report_error("cannot be started", error.what());
    next_start_ = now() + kPause;
    if (is_ending_ && ++endings_ >= kMaxEndings) give_up(error.what());
  }
}

void RecorderProcess::read_output() {
  // Lines that this program writes itself are skipped.
  for (const std::string& line : child_->program.take_lines()) {
    if (line == kRecorderSign) {
      child_->has_given_sign = true;
      see_sign();
    } else if (line.starts_with(kMessage)) {
      say(line.substr(kMessage.size()));
    } else if (line.starts_with(kFailure)) {
      child_->last_words = line.substr(kFailure.size());
    }
  }
}

// The new recorder continues where the file was cut off.
void RecorderProcess::replace(int status) {
  const Child child = std::move(*child_);
  child_.reset();
  if (WIFEXITED(status) && WEXITSTATUS(status) == 0) {
    is_over_ = true;
    return;
  }
  const std::string how = child.was_killed ? "stood still at the end and was killed"
                          : WIFSIGNALED(status) || child.last_words.empty()
                              ? ending_text(status)
                              : "has failed: " + child.last_words;
  if (is_ending_ && ++endings_ >= kMaxEndings) {
    give_up(how);
    return;
  }
  report_error("is gone", how + "; another one goes on");
  // If a recorder fails at once, the next one is started only after a pause.
  next_start_ = child.has_given_sign ? Instant{} : now() + kPause;
  if (now() >= next_start_) start_again();
}

// Tells the child that the robot has stopped.
void RecorderProcess::notify_child() {
  if (!child_ || child_->is_notified) return;
  // If the child is gone, `look_after` will notice.
  static_cast<void>(::write(child_->program.input(), "", 1));
  child_->is_notified = true;
}

// Ends a silence at the end of the program: a recorder that hangs is killed, and another one takes
// over. If the system cannot kill it, recording is given up.
void RecorderProcess::end_silence() {
  if (!child_ || silence() < kTimeout) return;
  if (child_->was_killed) {
    give_up(fmt::format("stands still, and process {} cannot be killed", child_->program.pid()));
    return;
  }
  child_->program.signal(SIGKILL);
  child_->was_killed = true;
  begin_watch();
}

void RecorderProcess::give_up(const std::string& why) {
  is_over_ = true;
  fail(why);
}

}  // namespace trifinger::apps
