// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <concepts>
#include <cstdint>
#include <limits>
#include <span>
#include <string>
#include <string_view>
#include <utility>

#include "trifinger/base/text.hpp"
#include "trifinger/base/time.hpp"
#include "trifinger/core/description.hpp"
#include "trifinger/core/errors.hpp"
#include "trifinger/core/robot.hpp"
#include "trifinger/realtime/annotations.hpp"

namespace trifinger {

/// The report of a driver about one call. Plain data, made in the loop.
struct DriverReport {
  enum class State : std::uint8_t {
    kReady,        ///< Done.
    kBusy,         ///< For `prepare` and `stop`: call again in the next period.
    kFault,        ///< The robot cannot go on; the session ends with `fault_code`.
    kEnd,          ///< For `get_latest_observation`: y_t is the last observation; the session ends
                   ///< without a fault.
    kInterrupted,  ///< The user interrupts, for example by Ctrl-C: the session ends (`kDetached`)
                   ///< without a fault.
  };

  State state{State::kReady};
  /// For `apply_action`: the action could not be applied as it is, and a safe one was applied
  /// instead. See `UntypedDriver::rejection_text`.
  bool action_rejected{false};
  std::int32_t fault_code{0};       ///< The driver's own code; see `UntypedDriver::fault_text`.
  std::int64_t measurement_age{0};  ///< Age of the oldest measurement in y [ns].
  std::uint32_t lost_frames{0};     ///< Number of messages lost since the session began.

  [[nodiscard]] static constexpr DriverReport ready() noexcept { return {}; }
  [[nodiscard]] static constexpr DriverReport busy() noexcept { return {.state = State::kBusy}; }
  [[nodiscard]] static constexpr DriverReport fault(std::int32_t code) noexcept {
    return {.state = State::kFault, .fault_code = code};
  }
  [[nodiscard]] static constexpr DriverReport end() noexcept { return {.state = State::kEnd}; }
  [[nodiscard]] static constexpr DriverReport interrupted() noexcept {
    return {.state = State::kInterrupted};
  }
};

/// When an element of a companion was measured and when it became known. This is the first member
/// of every element of a companion.
struct Stamp {
  /// A driver that knows only the time of capture sets `capture_index` to this. The back-end then
  /// finds the step: the newest one that had begun at `capture_time`.
  static constexpr TimeIndex kFromTime = std::numeric_limits<TimeIndex>::min();

  TimeIndex arrival_index{-1};  ///< Robot step at which the element became known; -1 before step 0.
  TimeIndex capture_index{-1};  ///< Robot step at which it was measured.
  std::int64_t arrival_time{0};  ///< Monotonic clock [ns]; set by the back-end.
  std::int64_t capture_time{0};  ///< Monotonic clock [ns]; set by the back-end to the tick of
                                 ///< `capture_index` unless the driver has set it.

  static constexpr auto fields() {
    return std::tuple{field("arrival_index", &Stamp::arrival_index),
                      field("capture_index", &Stamp::capture_index),
                      field("arrival_time", &Stamp::arrival_time, "ns"),
                      field("capture_time", &Stamp::capture_time, "ns")};
  }
};

/// A sensor that belongs to a robot and has its own rate, such as an object tracker or a camera.
/// The session "ROBOT.NAME" holds its elements.
struct CompanionDescription {
  std::string name;            ///< For example "object".
  std::string type;            ///< Name of the element's type, for example "object_observation".
  ElementDescription element;  ///< Begins with a `Stamp stamp`.
  std::size_t history{1024};   ///< Number of elements kept.
  /// Fields of the payload, see payload.hpp; none if the elements have no payload.
  ElementDescription payload{};
  /// Of a sensor in another process: whether each of its elements counts, as in a record, not only
  /// the newest ones; see DriverWithSensors.
  bool is_record{false};
};

/// The robot as the back-end sees it, without types. Robots derive from `Driver` instead.
///
/// Except for the constructor, all functions run in the loop. They must not block, sleep, print,
/// allocate or throw, and must not use a clock of their own. One thread calls them; only `cut` is
/// called by another.
class UntypedDriver {
 public:
  UntypedDriver() = default;
  UntypedDriver(const UntypedDriver&) = delete;
  UntypedDriver& operator=(const UntypedDriver&) = delete;
  virtual ~UntypedDriver() = default;

  [[nodiscard]] virtual const RobotTypes& description() const noexcept = 0;
  /// Sensors with their own rate. The answer must never change.
  [[nodiscard]] virtual std::span<const CompanionDescription> companions() const noexcept {
    return {};
  }

  /// Brings the robot to a pose where it can hold (alignment, homing). The back-end calls it before
  /// every session, once per period with a count from 0, until the driver is ready.
  [[nodiscard]] virtual DriverReport prepare(TimeIndex step) noexcept TRIFINGER_REALTIME = 0;
  /// Writes the newest measurement y_t. Its torques and forces belong to the period before t.
  [[nodiscard]] virtual DriverReport get_latest_observation(void* observation) noexcept
      TRIFINGER_REALTIME = 0;
  /// Checks `desired`, applies a safe action and writes the applied action to `applied`.
  [[nodiscard]] virtual DriverReport apply_action(const void* desired,
                                                  void* applied) noexcept TRIFINGER_REALTIME = 0;
  /// Writes the action that keeps the pose of `observation`. The back-end applies it before step 0.
  [[nodiscard]] virtual DriverReport hold(const void* observation,
                                          void* action) noexcept TRIFINGER_REALTIME = 0;
  /// Brings the robot to rest and releases it. The back-end calls it once per period with a count
  /// from 0 until the driver is ready. Measurements continue in between, for those who examine the
  /// end later.
  [[nodiscard]] virtual DriverReport stop(TimeIndex step) noexcept TRIFINGER_REALTIME = 0;
  /// Cuts the power when one of the calls above hangs. This is the last resort; another thread
  /// calls it.
  virtual void cut() noexcept = 0;

  /// Writes the next element of companion `index` that arrives at or before step `time_index`, and
  /// sets `stamp.arrival_index` and `stamp.capture_index`; see `Stamp::kFromTime` for a sensor that
  /// knows no steps. The back-end calls it before it publishes y_t, until the answer is false.
  /// Before step 0, `time_index` is -1.
  [[nodiscard]] virtual bool get_companion_element(std::size_t index, TimeIndex time_index,
                                                   void* element) noexcept TRIFINGER_REALTIME {
    static_cast<void>(index), static_cast<void>(time_index), static_cast<void>(element);
    return false;
  }

  /// Describes the last fault, which had this code, for example "joint 3 is beyond its hard limit".
  /// The loop asks when it ends the session, and copies the text. `RobotStopped`, `trifinger
  /// status` and logs show up to `FixedText::kCapacity` bytes of it. The driver owns the text and
  /// keeps it until its next fault.
  [[nodiscard]] virtual std::string_view fault_text(std::int32_t fault_code) const noexcept {
    static_cast<void>(fault_code);
    return {};
  }
  /// Says what was wrong with the last rejected action and what is allowed, for example
  /// "position_kd of joint 3 is 1 Nms/rad, allowed are 0 to 0.5". The loop asks when it ends the
  /// session, and copies the text. The driver owns the text and keeps it until the next action is
  /// rejected.
  [[nodiscard]] virtual std::string_view rejection_text() const noexcept { return {}; }
};

/// A driver for the robot R, with the full interface, for hardware and simulators.
template <Robot R>
class Driver : public UntypedDriver {
 public:
  using Action = typename R::Action;
  using Observation = typename R::Observation;
  using AppliedAction = AppliedActionOf<R>;

  [[nodiscard]] virtual DriverReport get_latest_observation(Observation& observation) noexcept
      TRIFINGER_REALTIME = 0;
  [[nodiscard]] virtual DriverReport apply_action(
      const Action& desired, AppliedAction& applied) noexcept TRIFINGER_REALTIME = 0;
  [[nodiscard]] virtual DriverReport hold(const Observation& observation,
                                          Action& action) noexcept TRIFINGER_REALTIME = 0;

  [[nodiscard]] DriverReport prepare(TimeIndex) noexcept TRIFINGER_REALTIME override {
    return DriverReport::ready();
  }
  [[nodiscard]] DriverReport stop(TimeIndex) noexcept TRIFINGER_REALTIME override {
    return DriverReport::ready();
  }
  void cut() noexcept override {}

  [[nodiscard]] const RobotTypes& description() const noexcept final { return describe_robot<R>(); }
  [[nodiscard]] DriverReport get_latest_observation(void* observation) noexcept
      TRIFINGER_REALTIME final {
    return get_latest_observation(*static_cast<Observation*>(observation));
  }
  [[nodiscard]] DriverReport apply_action(const void* desired,
                                          void* applied) noexcept TRIFINGER_REALTIME final {
    return apply_action(*static_cast<const Action*>(desired),
                        *static_cast<AppliedAction*>(applied));
  }
  [[nodiscard]] DriverReport hold(const void* observation,
                                  void* action) noexcept TRIFINGER_REALTIME final {
    return hold(*static_cast<const Observation*>(observation), *static_cast<Action*>(action));
  }
};

/// The paper's two functions: a simple robot needs only these.
template <class D, class R>
concept SimpleDriverOf = Robot<R> && std::same_as<AppliedActionOf<R>, typename R::Action> &&
                         requires(D driver, const typename R::Action& action) {
                           {
                             driver.get_latest_observation()
                           } -> std::same_as<typename R::Observation>;
                           { driver.apply_action(action) } -> std::same_as<typename R::Action>;
                         };

/// Makes a full driver from a class with the paper's two functions. Before step 0 the robot
/// receives `hold(observation)` if D has that function, otherwise `Action{}`.
///
/// An exception from one of the functions ends the session with a fault. The fault's text names the
/// function and contains the text of the exception. `Interrupted` ends the session without a fault.
/// If `hold` throws, the robot still receives `Action{}`.
template <Robot R, SimpleDriverOf<R> D>
class SimpleDriver final : public Driver<R> {
 public:
  using typename Driver<R>::Action;
  using typename Driver<R>::Observation;

  template <class... Args>
  explicit SimpleDriver(Args&&... args) : driver_(std::forward<Args>(args)...) {}

  [[nodiscard]] D& get() noexcept { return driver_; }

  using Driver<R>::get_latest_observation;
  using Driver<R>::apply_action;
  using Driver<R>::hold;

  [[nodiscard]] DriverReport get_latest_observation(Observation& observation) noexcept override {
    return guarded("get_latest_observation",
                   [&] { observation = driver_.get_latest_observation(); });
  }
  [[nodiscard]] DriverReport apply_action(const Action& desired,
                                          Action& applied) noexcept override {
    return guarded("apply_action", [&] { applied = driver_.apply_action(desired); });
  }
  [[nodiscard]] DriverReport hold(const Observation& observation,
                                  Action& action) noexcept override {
    action = Action{};
    if constexpr (requires {
                    { driver_.hold(observation) } -> std::same_as<Action>;
                  }) {
      const DriverReport held = guarded("hold", [&] { action = driver_.hold(observation); });
      if (held.state != DriverReport::State::kReady) {
        // No other action follows this one. If this call throws, too, the text of `hold` says more.
        const FixedText first = fault_text_;
        static_cast<void>(apply_action(Action{}, action));
        fault_text_ = first;
      }
      return held;
    }
    return DriverReport::ready();
  }
  [[nodiscard]] std::string_view fault_text(std::int32_t) const noexcept override {
    return fault_text_.view();
  }

 private:
  template <class Function>
  DriverReport guarded(std::string_view name, const Function& function) noexcept {
    try {
      function();
      return DriverReport::ready();
    } catch (const Interrupted&) {
      return DriverReport::interrupted();
    } catch (...) {
      fault_text_ = FixedText(name);
      fault_text_.append(" ").append_exception();
      return DriverReport::fault(1);
    }
  }

  FixedText fault_text_;
  D driver_;
};

}  // namespace trifinger
