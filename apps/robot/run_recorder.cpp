// SPDX-License-Identifier: BSD-3-Clause
#include "robot/run_recorder.hpp"

#include <fmt/core.h>

#include <cstdint>
#include <exception>

#include "log/recorder.hpp"
#include "log/running_recorder.hpp"
#include "robot/recorder_process.hpp"
#include "trifinger/log/event.hpp"

namespace trifinger::apps {
namespace {

// A recorder gives a sign several times a second.
constexpr Nanoseconds kWorryingSilence = std::chrono::seconds(2);

// A recorder in a thread of this process. The back-end waits for it.
class RecorderInThread final : public RunRecorder {
 public:
  RecorderInThread(const std::string& robot, const std::filesystem::path& folder,
                   log::ImageStorage images, Backend& backend)
      : running_({robot}, options(folder, images)) {
    backend.follow(running_.recorder());
  }

  bool finish(Nanoseconds timeout) override {
    running_.recorder().request_stop();
    if (running_.has_ended(timeout)) {
      try {
        running_.require_success();
      } catch (const std::exception& error) {
        fail(error.what());
      }
      return true;
    }
    look_after();
    if (silence() < kTimeout) return false;
    fail("stands still");
    return true;
  }

 private:
  static log::RecorderOptions options(const std::filesystem::path& folder,
                                      log::ImageStorage images) {
    log::RecorderOptions options;
    options.folder = folder;
    options.images = images;
    options.is_follower = true;
    return options;
  }

  void look_after() override {
    const std::uint64_t progress = running_.recorder().state().progress;
    if (std::exchange(progress_, progress) != progress) see_sign();
    see_silence();
    for (log::Event& event : running_.take_events()) {
      // The program itself reports what the robot does.
      if (event.source == "recorder") say(std::move(event.text));
    }
  }

  RunningRecorder running_;
  std::uint64_t progress_{0};
};

}  // namespace

std::unique_ptr<RunRecorder> RunRecorder::start(const std::string& robot,
                                                const std::filesystem::path& folder,
                                                log::ImageStorage images,
                                                const BackendOptions& options, Backend& backend) {
  if (options.mode == BackendOptions::Mode::kNonRealTime) {
    return std::make_unique<RecorderInThread>(robot, folder, images, backend);
  }
  {
    // Any reason not to record is reported before the robot moves.
    const log::Recorder attempt({robot}, {.folder = folder});
  }
  return std::make_unique<RecorderProcess>(robot, folder, images);
}

void RunRecorder::see_sign() {
  begin_watch();
  if (error_.empty()) return;
  say(fmt::format("is well again after {}", duration_text(last_sign_ - error_since_)));
  error_.clear();
}

void RunRecorder::see_silence() {
  if (!error_.empty() || silence() <= kWorryingSilence) return;
  report_error("stands still",
               fmt::format("has stood still for {}: it was stopped, or its disk hangs. What it "
                           "misses is not lost as long as the history of the session holds it",
                           duration_text(kWorryingSilence)));
}

void RunRecorder::report_error(const std::string& error, const std::string& text) {
  if (error_.empty()) error_since_ = last_sign_;
  if (error_ != error) say(text, Style::kBad);
  error_ = error;
}

}  // namespace trifinger::apps
