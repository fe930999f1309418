// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <exception>
#include <filesystem>
#include <string>
#include <thread>
#include <vector>

#include "trifinger/core/follower.hpp"
#include "trifinger/ipc/fork.hpp"
#include "trifinger/log/recorder.hpp"

namespace trifinger::log {

/// Records a robot of this process in a thread of its own. Outside real-time mode nothing is lost,
/// however fast time goes:
///
///     trifinger::Simulation<trifinger::TriFinger> simulation;
///     auto recorder = std::make_shared<trifinger::log::RecorderThread>(
///         "sim", trifinger::log::RecorderOptions{.folder = "logs"});
///     simulation.follow(recorder);
class RecorderThread final : public Follower {
 public:
  /// `options.is_follower` is set. @throws AlreadyRecorded, InvalidArgument, SystemError
  explicit RecorderThread(const std::string& robot, RecorderOptions options = {});
  /// Stops; what could not be written is lost without a word.
  ~RecorderThread() override;

  /// Writes what is there and finishes the file. Nothing is recorded from then on, and no back-end
  /// waits. @throws SystemError if the end could not be written
  void stop();
  /// True in a forked child: the recorder is its parent's.
  [[nodiscard]] bool is_inherited() const noexcept { return fork_.is_inherited(); }
  /// The newest file; none before the first session.
  [[nodiscard]] std::filesystem::path file() const;

  void begin_session(const Session& robot,
                     const std::vector<Session>& companions) noexcept override;
  [[nodiscard]] TimeIndex next_step() const noexcept TRIFINGER_REALTIME override;

 private:
  Recorder recorder_;
  ipc::ForkGuard fork_;
  std::exception_ptr failure_;
  std::thread thread_;
};

}  // namespace trifinger::log
