// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <memory>
#include <string>

#include "trifinger/core/backend.hpp"
#include "trifinger/core/frontend.hpp"
#include "trifinger/ipc/fork.hpp"

namespace trifinger::bindings {

/// Starts the robot of `driver`, called `name`, inside the waits of the returned front-end.
[[nodiscard]] UntypedFrontend start_inline(const std::string& name,
                                           std::unique_ptr<UntypedDriver> driver,
                                           const BackendOptions& backend_options,
                                           const SessionOptions& session_options,
                                           const FrontendOptions& frontend_options);

/// A back-end in a thread of this process, offered to all processes under a name. Its functions are
/// called with the GIL held and release it while they wait.
class RunningBackend {
 public:
  /// Returns when the first session can be found.
  /// @throws RobotOwned, InvalidArgument, SystemError
  RunningBackend(const std::string& name, std::unique_ptr<UntypedDriver> driver,
                 const BackendOptions& backend_options, const SessionOptions& session_options);
  RunningBackend(const RunningBackend&) = delete;
  RunningBackend& operator=(const RunningBackend&) = delete;
  ~RunningBackend();

  [[nodiscard]] const std::string& name() const noexcept { return name_; }
  /// False after `stop`.
  [[nodiscard]] bool is_running() const noexcept { return parts_ != nullptr; }
  /// Waits until the back-end has ended. @throws what ended it, TimedOut
  void wait(Timeout timeout) const;
  /// Ends the session, brings the robot to rest and gives the name back. Does nothing when called
  /// again.
  void stop();

 private:
  struct Parts;
  friend void stop_backends_at_exit();
  [[nodiscard]] std::shared_ptr<Parts> own_parts() const;

  std::string name_;
  ipc::ForkGuard fork_;
  std::shared_ptr<Parts> parts_;  // null after stop; replaced under the GIL only
};

/// Makes the end of the program stop all back-ends, which brings their robots to rest.
void stop_backends_at_exit();

}  // namespace trifinger::bindings
