// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <future>
#include <limits>
#include <memory>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "trifinger/base/time.hpp"
#include "trifinger/core/driver.hpp"
#include "trifinger/core/fault.hpp"
#include "trifinger/core/follower.hpp"
#include "trifinger/core/session.hpp"
#include "trifinger/realtime/clock.hpp"
#include "trifinger/realtime/thread.hpp"

namespace trifinger {

/// How a back-end keeps time and how it treats late users and drivers.
struct BackendOptions {
  enum class Mode : std::uint8_t {
    kNonRealTime,  ///< Waits for every action as long as necessary. For simulation.
    kRealTime,     ///< Does one step per period, whether or not the user has appended an action.
  };

  static constexpr std::uint32_t kUnlimited = std::numeric_limits<std::uint32_t>::max();

  Mode mode{Mode::kNonRealTime};
  Nanoseconds period{std::chrono::milliseconds(1)};

  // Real-time mode only:
  std::uint32_t max_action_repeats{
      0};  ///< How often in a row the previous action may replace a missing one.
  std::uint32_t max_skipped_ticks{
      5};  ///< Number of periods that the back-end itself may miss at once.
  std::optional<Nanoseconds> late_after{};  ///< A step that begins later than this after its
                                            ///< deadline counts as late; default: half a period.
  std::uint32_t max_late_steps{
      kUnlimited};  ///< Number of steps in a row in which the back-end itself may be late.
  Timeout first_action_timeout{kForever};  ///< How long the robot may hold before step 0.
  Timeout driver_timeout{
      std::chrono::seconds(1)};  ///< The power is cut if one call of the driver takes longer.

  // Non-real-time mode only:
  Timeout max_follower_wait{
      std::chrono::seconds(1)};  ///< How long to wait for a follower that lags a whole history and
                                 ///< does not move. Then it loses steps. The back-end waits for it
                                 ///< again once it is back in the history.

  std::uint32_t max_rejected_actions{10};  ///< Actions in a row that the driver may reject.
  Timeout max_measurement_age{
      kForever};  ///< Largest allowed age of the oldest measurement in an observation.
  Timeout max_stop_time{
      std::chrono::seconds(10)};  ///< Time that the orderly stop may take before the power is cut.

  /// @throws InvalidArgument that names the option, the value found and the values allowed.
  void validate() const;
};

/// What one call of `Backend::advance` did.
enum class Progress : std::uint8_t {
  kStepped,  ///< It did something; call again.
  kWaiting,  ///< It did nothing: the action for the next step is missing.
  kHeldUp,   ///< It only waited a moment for a follower; call again.
  kEnded,    ///< The session has ended and the robot is at rest.
};

/// Owns the robot: takes the actions that the user appends, lets the driver check and apply them,
/// and fills the series.
///
/// One function does one tick. Three ways call it: `run` in a real-time thread, `run` in an
/// ordinary thread, or inline. Inline means that the waits of a front-end in the same thread call
/// `advance`.
///
/// Sessions follow each other. After a clean end the next one begins at once; after a fault it
/// begins when the fault is cleared by `recover`.
class Backend {
 public:
  /// `driver`, `host` and `clock` must outlive the back-end.
  /// @throws InvalidArgument
  Backend(UntypedDriver& driver, SessionHost& host, BackendOptions options = {},
          Clock& clock = MonotonicClock::instance());
  /// Ends the session (`kStopped`) and brings the robot to rest.
  ~Backend();

  /// Lets `follower` see every session from the next one on. It must outlive the back-end. Call
  /// this in the thread of the back-end, or before that thread runs.
  void follow(Follower& follower);

  /// Runs session after session in the calling thread, until `request_stop`. After the first
  /// session has begun, a lack of memory no longer ends this call: the robot stays at rest until
  /// the next session gets its memory.
  /// @throws SystemError if a session cannot be made
  void run();
  /// Makes `run` call `function` after every session, in the thread of `run`. During the call the
  /// robot is at rest, nobody else uses the driver, and the next session waits. Use it to save what
  /// a fault has left in a driver, or to reset a simulation. Set it before `run`. An exception that
  /// it throws ends `run`.
  void set_after_session(std::function<void(const Fault&)> function);
  /// Makes `run` call `function` with a sentence, in the thread of `run`, when the next session has
  /// to wait for memory. Set it before `run`. An exception that it throws ends `run`.
  void set_on_waiting(std::function<void(const std::string&)> function);
  /// Makes `run` return after an orderly stop. May be called from any thread or signal handler.
  void request_stop() noexcept;

  /// Inline: begins a session unless one is running.
  /// @throws RobotStopped if the last session ended with a fault that has not been recovered
  void begin_session();
  /// Inline: does the next piece of work without waiting for actions. Non-real-time mode only.
  [[nodiscard]] Progress advance() noexcept;
  /// Inline or in the function after a session: clears the fault, so the next one can begin.
  void recover() noexcept;

  [[nodiscard]] const SessionHost& host() const noexcept;
  [[nodiscard]] const BackendOptions& options() const noexcept;

 private:
  class Implementation;
  std::unique_ptr<Implementation> implementation_;
};

/// Runs a back-end in a thread of its own as long as the object lives.
class BackendThread {
 public:
  /// Calls `on_end`, if given, in the thread when the back-end has ended for any reason. It must
  /// not throw. @throws Error if `realtime` requires a setting that the machine refuses
  explicit BackendThread(Backend& backend,
                         const RealtimeOptions& realtime = {.demand = Demand::kOff},
                         std::function<void()> on_end = {});
  /// Stops the back-end in an orderly way and waits for it.
  ~BackendThread();

  /// Waits until the back-end has ended. False if it still runs after `timeout`.
  [[nodiscard]] bool wait_for_end(Timeout timeout) const;
  /// Stops the back-end in an orderly way and waits for it. @throws what ended `Backend::run`
  void stop();

  /// The settings that the machine refused, one sentence each.
  [[nodiscard]] const std::vector<std::string>& refused() const noexcept { return refused_; }

 private:
  Backend& backend_;
  std::vector<std::string> refused_;
  std::shared_future<void> end_;
  std::jthread thread_;
};

}  // namespace trifinger
