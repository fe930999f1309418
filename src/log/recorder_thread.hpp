// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <exception>
#include <filesystem>
#include <string>
#include <thread>
#include <vector>

#include "log/recorder.hpp"
#include "trifinger/core/follower.hpp"
#include "trifinger/ipc/fork.hpp"

namespace trifinger::log {

/// Records a robot of this process in a thread of its own. Outside real-time mode nothing is lost,
/// because the robot waits for the recorder.
class RecorderThread final : public Follower {
 public:
  /// Sets `options.is_follower`. The robot must be given the recorder:
  ///
  ///     trifinger::Simulation simulation;
  ///     auto recorder = std::make_shared<trifinger::log::RecorderThread>(
  ///         "sim", trifinger::log::RecorderOptions{.folder = "logs"});
  ///     simulation.follow(recorder);
  ///
  /// @throws AlreadyRecorded, InvalidArgument, SystemError
  explicit RecorderThread(const std::string& robot, RecorderOptions options = {});
  /// Stops. If something cannot be written, it is lost, and no error is reported.
  ~RecorderThread() override;

  /// Writes the available steps and finishes the file. Nothing is recorded after that, and no
  /// back-end waits. @throws SystemError if the end could not be written
  void stop();
  /// True in a forked child: the recorder belongs to the parent process.
  [[nodiscard]] bool is_inherited() const noexcept { return fork_.is_inherited(); }
  /// The newest file; empty before the first session.
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
