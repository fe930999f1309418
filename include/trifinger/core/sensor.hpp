// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "trifinger/base/time.hpp"
#include "trifinger/core/driver.hpp"

namespace trifinger {

namespace detail {
class SensorOfLoop;
class SensorWatcher;
}  // namespace detail

/// A sensor in a process of its own that belongs to a robot in another process, such as a tracker
/// of objects. What it writes are the elements of one of the robot's companions.
///
/// The robot need not run yet, and may be started again at any time. It gets what was written while
/// it runs. Nothing that this process does or fails to do can hold up the robot's loop.
class UntypedSensorWriter {
 public:
  /// Becomes the sensor `sensor` of `robot`, for example "object" of "sim". `element` begins with a
  /// `Stamp stamp`. Of elements that the robot has not read, only the newest `history` are kept.
  /// `payload` are the fields of their payloads, if they have any; a PayloadWriter makes these.
  /// @throws InvalidArgument, SystemError, Error if another process is this sensor already
  UntypedSensorWriter(const std::string& robot, const std::string& sensor,
                      const ElementDescription& element, std::size_t history = 64,
                      const ElementDescription& payload = {});
  ~UntypedSensorWriter();

  /// Hands over an element that was captured at this instant of the monotonic clock. Its stamp is
  /// not read. Does not block, allocate or throw. Without effect in a child process after fork.
  void write(Instant captured, const void* element) noexcept TRIFINGER_REALTIME;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

/// A sensor whose elements are of type T; see `UntypedSensorWriter`.
template <Described T>
class SensorWriter {
 public:
  /// @throws InvalidArgument, SystemError, Error if another process is this sensor already
  SensorWriter(const std::string& robot, const std::string& sensor, std::size_t history = 64)
      : untyped_(robot, sensor, describe<T>(), history) {}

  /// Hands over an element that was captured at this instant of the monotonic clock. Its stamp is
  /// not read. Does not block, allocate or throw.
  void write(Instant captured, const T& element) noexcept TRIFINGER_REALTIME {
    untyped_.write(captured, &element);
  }

 private:
  UntypedSensorWriter untyped_;
};

/// Reads a sensor in a process of its own without its robot: for programs that work before the
/// robot's first step, too, such as a tracker or a calibration. Nobody promises here that an answer
/// can be repeated: a controller reads the robot's companion instead.
class UntypedSensorReader {
 public:
  /// Reads the sensor `sensor` of `robot`. Its process need not run yet and may be started again at
  /// any time.
  /// @throws InvalidArgument
  UntypedSensorReader(const std::string& robot, const std::string& sensor,
                      const ElementDescription& element, const ElementDescription& payload = {});
  UntypedSensorReader(UntypedSensorReader&&) noexcept;
  UntypedSensorReader& operator=(UntypedSensorReader&&) noexcept;
  ~UntypedSensorReader();

  /// Copies the newest element if it is another one than at the last call; waits for it up to
  /// `timeout`. Its stamp has no steps. False if none has come or no process writes.
  /// @throws InvalidArgument if the process writes elements of another kind, SystemError
  [[nodiscard]] bool next(void* element, Timeout timeout);

 private:
  struct State;
  std::unique_ptr<State> state_;
};

/// Reads a sensor in a process of its own inside a driver that acts on what the sensor says, such
/// as a simulated robot that a hand pulls. `DriverWithSensors` is for sensors that are only
/// published.
///
/// The loop reads shared memory and nothing else. A thread of this object looks for the sensor's
/// process a few times per second.
class LoopSensorReader {
 public:
  /// Reads the sensor `sensor` of `robot`. Its process need not run yet, and may be started again
  /// at any time. A process that lives but has written nothing for `timeout` counts as gone until
  /// it writes again.
  /// @throws InvalidArgument
  LoopSensorReader(const std::string& robot, const std::string& sensor,
                   const ElementDescription& element, Timeout timeout = kForever);
  ~LoopSensorReader();

  /// Copies the newest element, also if it was read before. Its stamp has no steps. False if no
  /// process writes. For the loop: it does not block, allocate or throw.
  [[nodiscard]] bool read_newest(void* element) noexcept TRIFINGER_REALTIME;

  /// What has happened to the sensor since the last call, in sentences. Any thread may call this.
  [[nodiscard]] std::vector<std::string> take_messages();

 private:
  std::vector<std::unique_ptr<detail::SensorOfLoop>> sensors_;  // one
  std::unique_ptr<detail::SensorWatcher> watcher_;              // uses the sensor
};

/// A robot's driver with sensors in other processes: they become companions after the driver's own.
///
/// The loop reads shared memory and nothing else. A thread of this object looks for the sensors'
/// processes a few times per second, so they may come and go. While a sensor has no process, its
/// companion gets no elements.
///
/// A session begins with the newest element of each sensor, at step -1, and at step 0 with one that
/// was written since, however long the robot has held its pose. From then on each element arrives
/// at the first step after it was written, at most 16 per step: of more, as after a long step, the
/// oldest are lost. Of a process that comes during a session, the newest element counts first.
///
/// A sensor that is a record loses none: it gets everything that a process has written from its
/// first element on, as far as the process keeps it, at most 16 per step. What was written after
/// the end of a session comes at the begin of the next one.
class DriverWithSensors final : public UntypedDriver {
 public:
  /// `robot` is the name of the robot, under which its sensors look for it.
  /// @throws InvalidArgument if two companions have one name or an element has no stamp
  DriverWithSensors(std::unique_ptr<UntypedDriver> driver, const std::string& robot,
                    std::vector<CompanionDescription> sensors);
  ~DriverWithSensors() override;

  /// What has happened to the sensors since the last call, in sentences. Any thread may call this.
  [[nodiscard]] std::vector<std::string> take_messages();

  [[nodiscard]] const RobotTypes& description() const noexcept override;
  [[nodiscard]] std::span<const CompanionDescription> companions() const noexcept override;
  [[nodiscard]] DriverReport prepare(TimeIndex step) noexcept override;
  [[nodiscard]] DriverReport get_latest_observation(void* observation) noexcept override;
  [[nodiscard]] DriverReport apply_action(const void* desired, void* applied) noexcept override;
  [[nodiscard]] DriverReport hold(const void* observation, void* action) noexcept override;
  [[nodiscard]] DriverReport stop(TimeIndex step) noexcept override;
  void cut() noexcept override;
  [[nodiscard]] bool get_companion_element(std::size_t index, TimeIndex time_index,
                                           void* element) noexcept override;
  [[nodiscard]] std::string_view fault_text(std::int32_t fault_code) const noexcept override;
  [[nodiscard]] std::string_view rejection_text() const noexcept override;

 private:
  std::unique_ptr<UntypedDriver> driver_;
  std::vector<CompanionDescription> companions_;
  std::vector<std::unique_ptr<detail::SensorOfLoop>> sensors_;
  std::unique_ptr<detail::SensorWatcher> watcher_;  // uses the sensors
};

}  // namespace trifinger
