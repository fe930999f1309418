// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string_view>
#include <vector>

#include "trifinger/core/backend.hpp"
#include "trifinger/core/driver.hpp"
#include "trifinger/core/frontend.hpp"
#include "trifinger/core/session.hpp"
#include "trifinger/log/log.hpp"

namespace trifinger::log {

/// Which part of a session to replay.
struct ReplayOptions {
  std::optional<TimeIndex> first{};  ///< Becomes step 0; default: the first one in the log.
  std::optional<TimeIndex> last{};   ///< The first one left out; default: all there are.
};

/// Plays a session of a log as if it were the robot, whatever its type: user code runs against it.
///
/// Step by step the observations, the elements of companions and the applied actions are those of
/// the log, whatever the user does. A step whose desired action is another one than in the log is
/// flagged `Status::kActionRejected`: what was applied is not what was asked. The session ends with
/// `Fault::Code::kExhausted` behind the last step, and can begin again.
///
/// The part is read into memory as a whole.
class ReplayDriver final : public UntypedDriver {
 public:
  /// @throws NotInLog if a step or an element is missing in the part, InvalidArgument if the part
  /// has no step or is larger than 4 GiB, SystemError
  explicit ReplayDriver(const LoggedSession& session, const ReplayOptions& options = {});

  [[nodiscard]] const RobotTypes& description() const noexcept override { return types_; }
  [[nodiscard]] std::span<const CompanionDescription> companions() const noexcept override {
    return descriptions_;
  }
  [[nodiscard]] DriverReport prepare(TimeIndex step) noexcept override;
  [[nodiscard]] DriverReport get_latest_observation(void* observation) noexcept override;
  [[nodiscard]] DriverReport apply_action(const void* desired, void* applied) noexcept override;
  [[nodiscard]] DriverReport hold(const void* observation, void* action) noexcept override;
  [[nodiscard]] DriverReport stop(TimeIndex step) noexcept override;
  void cut() noexcept override {}
  [[nodiscard]] bool get_companion_element(std::size_t index, TimeIndex time_index,
                                           void* element) noexcept override;

  /// Steps in the part: how many actions a session takes.
  [[nodiscard]] TimeIndex steps() const noexcept { return steps_; }
  /// How a back-end should run it: one step per action, as the user comes to it.
  [[nodiscard]] BackendOptions backend_options() const noexcept;
  /// The documents of the session that was recorded.
  [[nodiscard]] SessionOptions session_options() const;

 private:
  // The elements of a companion, with steps counted from the part's first.
  struct CompanionElements {
    std::size_t size;
    std::vector<std::byte> bytes;
    std::size_t next{0};
  };

  void load_companion(const LoggedSession& companion, TimeIndex first);

  RobotTypes types_;
  Nanoseconds period_;
  std::vector<Document> documents_;
  TimeIndex steps_{0};
  std::vector<std::byte> observations_;  // one more than steps
  std::vector<std::byte> desired_actions_;
  std::vector<std::byte> applied_actions_;
  std::vector<Status> statuses_;
  std::int32_t recorded_end_{0};
  std::vector<CompanionDescription> descriptions_;
  std::vector<CompanionElements> companions_;
  std::vector<std::byte> hold_action_;
  TimeIndex t_{0};
};

/// A log as a robot in this process, with its back-end inline. Copies refer to the same one; it
/// lives as long as one of them or one of its front-ends.
class Replay {
 public:
  /// @throws as ReplayDriver
  explicit Replay(const LoggedSession& session, const ReplayOptions& options = {})
      : parts_(std::make_shared<Parts>(session, options)) {}

  /// Steps that can be replayed.
  [[nodiscard]] TimeIndex steps() const noexcept { return parts_->driver.steps(); }

  /// Controls the robot in a new session, which begins with the part's first step.
  /// @throws IncompatibleSession if it is another robot, ControlHeld while another front-end
  /// controls it
  template <Robot R>
  [[nodiscard]] Frontend<R> connect(FrontendOptions options = {.strict = true}) const {
    return Frontend<R>(parts_->backend, options, parts_);
  }
  /// For programs that do not know the robot.
  [[nodiscard]] UntypedFrontend connect_untyped(FrontendOptions options = {.strict = true}) const {
    return UntypedFrontend(parts_->backend, options, parts_);
  }

 private:
  struct Parts {
    Parts(const LoggedSession& session, const ReplayOptions& options)
        : driver(session, options),
          host(SessionHost::anonymous(driver.session_options(), session.name())),
          backend(driver, host, driver.backend_options()) {}

    ReplayDriver driver;
    SessionHost host;
    Backend backend;
  };

  std::shared_ptr<Parts> parts_;
};

}  // namespace trifinger::log
