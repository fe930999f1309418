// SPDX-License-Identifier: BSD-3-Clause
#include "log/recorder_thread.hpp"

#include <utility>

#include "trifinger/core/errors.hpp"

namespace trifinger::log {
namespace {

RecorderOptions following(RecorderOptions options) {
  options.is_follower = true;
  return options;
}

}  // namespace

RecorderThread::RecorderThread(const std::string& robot, RecorderOptions options)
    : recorder_({robot}, following(std::move(options))), thread_([this] {
        try {
          recorder_.run();
        } catch (...) {
          failure_ = std::current_exception();
        }
      }) {}

RecorderThread::~RecorderThread() {
  if (fork_.is_inherited()) {
    // The thread belongs to the parent process.
    if (thread_.joinable()) thread_.detach();
    return;
  }
  try {
    stop();
  } catch (const Error&) {  // NOLINT(bugprone-empty-catch): `stop` says it to those who ask
  }
}

void RecorderThread::stop() {
  if (fork_.is_inherited())
    throw InheritedHandle("the recorder runs in the process that was forked");
  if (!thread_.joinable()) return;
  recorder_.request_stop();
  thread_.join();
  if (failure_) std::rethrow_exception(std::exchange(failure_, nullptr));
}

std::filesystem::path RecorderThread::file() const { return recorder_.state().file; }

void RecorderThread::begin_session(const Session& robot,
                                   const std::vector<Session>& companions) noexcept {
  recorder_.begin_session(robot, companions);
}

TimeIndex RecorderThread::next_step() const noexcept { return recorder_.next_step(); }

}  // namespace trifinger::log
