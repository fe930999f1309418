// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <atomic>
#include <chrono>
#include <cstdint>
#include <exception>
#include <functional>
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

/// How a back-end treats time and those who are late.
struct BackendOptions {
  enum class Mode : std::uint8_t {
    kNonRealTime,  ///< Wait for every action, as long as it takes. For simulation.
    kRealTime,     ///< One step per period, whatever the user does.
  };

  static constexpr std::uint32_t kUnlimited = std::numeric_limits<std::uint32_t>::max();

  Mode mode{Mode::kNonRealTime};
  Nanoseconds period{std::chrono::milliseconds(1)};

  // Real-time mode only:
  std::uint32_t max_action_repeats{
      0};  ///< How often in a row a missing action may be replaced by the one before.
  std::uint32_t max_skipped_ticks{
      5};  ///< By how many periods at once the back-end itself may be late.
  std::optional<Nanoseconds> late_after{};  ///< A step that begins later than this after its
                                            ///< deadline counts as late; by default half a period.
  std::uint32_t max_late_steps{
      kUnlimited};  ///< How many steps in a row the back-end itself may be late.
  Timeout first_action_timeout{kForever};  ///< How long to hold before step 0.
  Timeout driver_timeout{
      std::chrono::seconds(1)};  ///< After this time in one call of the driver the power is cut.

  // Non-real-time mode only:
  Timeout max_follower_wait{
      std::chrono::seconds(1)};  ///< How long to wait for a follower that is a whole history behind
                                 ///< and does not move. Then it loses steps, and is waited for
                                 ///< again once it is back in the history.

  std::uint32_t max_rejected_actions{10};  ///< How many actions in a row the driver may reject.
  Timeout max_measurement_age{
      kForever};  ///< How old the oldest measurement of an observation may be.
  Timeout max_stop_time{
      std::chrono::seconds(10)};  ///< How long the orderly stop may take before the power is cut.

  /// @throws InvalidArgument naming the option, the value found and the values allowed.
  void validate() const;
};

/// What one call of `Backend::advance` has done.
enum class Progress : std::uint8_t {
  kStepped,  ///< Something; call again.
  kWaiting,  ///< Nothing: the action for the next step is missing.
  kHeldUp,   ///< Nothing: it has waited a moment for a follower; call again.
  kEnded,    ///< The session has ended and the robot is at rest.
};

/// Owns the robot: takes the actions that the user appends, lets the driver check and apply them,
/// and fills the series.
///
/// One function does one tick; three ways call it: `run` in a real-time thread, `run` in an
/// ordinary thread, or inline, where the waits of a front-end in the same thread call `advance`.
///
/// Sessions follow each other. After a clean end the next one begins at once, after a fault when it
/// is recovered.
class Backend {
 public:
  /// `driver`, `host` and `clock` must outlive the back-end.
  /// @throws InvalidArgument
  Backend(UntypedDriver& driver, SessionHost& host, BackendOptions options = {},
          Clock& clock = MonotonicClock::instance());
  Backend(const Backend&) = delete;
  Backend& operator=(const Backend&) = delete;
  /// Ends the session (`kStopped`) and brings the robot to rest.
  ~Backend();

  /// Lets `follower`, which must outlive the back-end, see every session from the next one on. To
  /// be called by the thread of the back-end, or before it runs.
  void follow(Follower& follower);

  /// Runs session after session in the calling thread, until `request_stop`. Once one has begun, a
  /// lack of memory ends nothing: the robot stays at rest until the next session has its memory.
  /// @throws SystemError if a session cannot be made
  void run();
  /// Makes `run` call `function` behind every session, in its own thread: the robot is at rest, the
  /// driver is nobody else's, and the next session waits. The place to save what a fault has left
  /// in a driver, or to reset a simulation. To be set before `run`; what it throws ends `run`.
  void set_after_session(std::function<void(const Fault&)> function);
  /// Makes `run` call `function` with a sentence, in its own thread, when the next session has to
  /// wait for memory. To be set before `run`; what it throws ends `run`.
  void set_on_waiting(std::function<void(const std::string&)> function);
  /// Makes `run` return after an orderly stop. May be called from any thread or signal handler.
  void request_stop() noexcept;

  /// Inline: begins a session unless one goes on.
  /// @throws RobotStopped if the last one ended with a fault that has not been recovered
  void begin_session();
  /// Inline: does the next piece of work without waiting for actions. Non-real-time mode only.
  [[nodiscard]] Progress advance() noexcept;
  /// Inline: clears the fault, so that the next session can begin.
  void recover() noexcept;

  [[nodiscard]] const SessionHost& host() const noexcept;
  [[nodiscard]] const BackendOptions& options() const noexcept;

 private:
  class Implementation;
  std::unique_ptr<Implementation> implementation_;
};

/// Runs a back-end in a thread of its own, for as long as the object lives.
class BackendThread {
 public:
  /// @throws Error if `realtime` requires what the machine refuses
  explicit BackendThread(Backend& backend,
                         const RealtimeOptions& realtime = {.demand = Demand::kOff});
  BackendThread(const BackendThread&) = delete;
  BackendThread& operator=(const BackendThread&) = delete;
  /// Stops the back-end in an orderly way and waits for it.
  ~BackendThread();

  /// Stops and waits as the destructor does. @throws what ended `Backend::run`
  void stop();

  /// What the machine refused, a sentence each.
  [[nodiscard]] const std::vector<std::string>& refused() const noexcept { return refused_; }

 private:
  Backend& backend_;
  std::vector<std::string> refused_;
  std::exception_ptr failure_;
  std::thread thread_;
};

}  // namespace trifinger
