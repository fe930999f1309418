// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "trifinger/core/backend.hpp"
#include "trifinger/core/driver.hpp"
#include "trifinger/core/frontend.hpp"
#include "trifinger/core/session.hpp"
#include "trifinger/log/log.hpp"

namespace trifinger::log {

/// Selects the part of a session to replay.
struct ReplayOptions {
  std::optional<TimeIndex> first{};  ///< The step that becomes step 0; default: the first one.
  std::optional<TimeIndex> last{};   ///< First step left out; default: none.
  /// Name of the robot under which other processes find its images. Empty: only readers in this
  /// process see them.
  std::string images_of{};
};

/// Plays a session of a log as if it were the robot, whatever its type, so that user code runs
/// against it.
///
/// In every step the observations, the companions' elements and the applied actions are those of
/// the log, whatever the user does. If a desired action differs from the logged one, the step has
/// the flag `Status::kActionRejected`: the applied action is not the requested one. The session
/// ends with `Fault::Code::kExhausted` after the last step, and can begin again.
///
/// The whole part is read into memory, except for images. They are read when they are due; one that
/// is not in the log is one that has not come.
class ReplayDriver final : public UntypedDriver {
 public:
  /// @throws NotInLog if a step or an element of the part is missing, InvalidArgument if the part
  /// has no step or is larger than 4 GiB, SystemError, Error if the library for JPEG is missing
  explicit ReplayDriver(const LoggedSession& session, const ReplayOptions& options = {});
  ~ReplayDriver() override;

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

  /// Number of steps in the part, which is the number of actions that a session takes.
  [[nodiscard]] TimeIndex steps() const noexcept { return steps_; }
  /// Options for a back-end that runs this driver: one step per action, at the user's speed.
  [[nodiscard]] BackendOptions backend_options() const noexcept;
  /// The documents of the recorded session.
  [[nodiscard]] SessionOptions session_options() const;

 private:
  // The elements of a companion. Their steps count from the first step of the part.
  struct CompanionElements {
    std::size_t size;
    std::vector<std::byte> bytes;
    TimeIndex first{0};  // number of the first element in the log
    std::size_t next{0};
  };
  struct Images;

  void load_companion(const LoggedSession& companion, TimeIndex first);
  void load_images(const LoggedSession& session, const std::string& images_of);

  RobotTypes types_;
  Nanoseconds period_;
  std::vector<Document> documents_;
  TimeIndex steps_{0};
  std::vector<std::byte> observations_;  // one more than the number of steps
  std::vector<std::byte> desired_actions_;
  std::vector<std::byte> applied_actions_;
  std::vector<Status> statuses_;
  std::int32_t recorded_end_{0};
  std::vector<CompanionDescription> descriptions_;
  std::vector<CompanionElements> companions_;
  std::unique_ptr<Images> images_;
  std::vector<std::byte> hold_action_;
  TimeIndex t_{0};
};

/// A log as a robot in this process, with an inline back-end. Copies refer to the same replay. It
/// lives as long as one of the copies or one of its front-ends.
class Replay {
 public:
  /// @throws like ReplayDriver
  explicit Replay(const LoggedSession& session, const ReplayOptions& options = {})
      : parts_(std::make_shared<Parts>(session, options)) {}

  /// Number of steps that can be replayed.
  [[nodiscard]] TimeIndex steps() const noexcept { return parts_->driver.steps(); }

  /// Controls the robot in a new session, which begins with the part's first step.
  /// @throws IncompatibleSession if it is another robot, ControlHeld while another front-end
  /// controls it
  template <Robot R>
  [[nodiscard]] Frontend<R> connect(FrontendOptions options = {.strict = true}) const {
    return Frontend<R>(parts_->backend, options, parts_);
  }
  /// Controls the robot in programs that do not know its type.
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
