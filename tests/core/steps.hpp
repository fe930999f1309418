// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <gtest/gtest.h>

#include <cstddef>
#include <cstring>
#include <optional>
#include <utility>
#include <vector>

#include "trifinger/base/time.hpp"
#include "trifinger/core/fault.hpp"
#include "trifinger/core/frontend.hpp"
#include "trifinger/core/status.hpp"

// How tests go through the steps of a session, and what holds at its end. Long functions without
// types are compiled once, in steps.cpp.

namespace trifinger::test {

using Bytes = std::vector<std::byte>;

template <class T>
[[nodiscard]] Bytes bytes_of(const T& element) {
  Bytes bytes(sizeof(T));
  std::memcpy(bytes.data(), &element, sizeof(T));
  return bytes;
}

template <class Robot>
[[nodiscard]] bool has_flag(const Robot& robot, TimeIndex t, Status::Flag flag) {
  return (robot.get_status(t).flags & flag) != 0;
}

/// Appends the actions `first` to `last` of the driver's traits. Each follows the observation
/// before it.
template <class Traits, class Robot>
void run_steps(Robot& robot, TimeIndex first, TimeIndex last) {
  for (TimeIndex t = first; t <= last; ++t) {
    if (t > 0) static_cast<void>(robot.get_observation(t - 1));
    ASSERT_EQ(robot.append_desired_action(Traits::action(t)), t);
  }
}

/// Appends actions of the driver's traits without waiting, as many as the queue takes.
template <class Traits, class Robot>
void append_ahead(Robot& robot, TimeIndex first, TimeIndex last) {
  for (TimeIndex t = first; t <= last; ++t) {
    ASSERT_EQ(robot.append_desired_action(Traits::action(t), Timeout::zero()), t);
  }
}

/// What a Frontend shows of any robot. Elements are bytes.
class AnyObserver {
 public:
  virtual ~AnyObserver() = default;

  [[nodiscard]] virtual Bytes get_observation(TimeIndex t, Timeout timeout = kForever) const = 0;
  [[nodiscard]] virtual Bytes get_desired_action(TimeIndex t, Timeout timeout = kForever) const = 0;
  [[nodiscard]] virtual Bytes get_applied_action(TimeIndex t, Timeout timeout = kForever) const = 0;
  [[nodiscard]] virtual Status get_status(TimeIndex t, Timeout timeout = kForever) const = 0;
  virtual void wait_until_time_index(TimeIndex t, Timeout timeout = kForever) const = 0;
  [[nodiscard]] virtual TimeIndex current_time_index() const = 0;
  [[nodiscard]] virtual std::optional<Fault> fault() const = 0;
};

/// A Frontend as an AnyObserver, or as an `Interface` derived from it. `Handle` is the Frontend, or
/// a reference to one.
template <class Interface, class Handle>
class ErasedObserver : public Interface {
 public:
  explicit ErasedObserver(Handle robot) : robot_(std::forward<Handle>(robot)) {}

  [[nodiscard]] Bytes get_observation(TimeIndex t, Timeout timeout) const final {
    return bytes_of(robot_.get_observation(t, timeout));
  }
  [[nodiscard]] Bytes get_desired_action(TimeIndex t, Timeout timeout) const final {
    return bytes_of(robot_.get_desired_action(t, timeout));
  }
  [[nodiscard]] Bytes get_applied_action(TimeIndex t, Timeout timeout) const final {
    return bytes_of(robot_.get_applied_action(t, timeout));
  }
  [[nodiscard]] Status get_status(TimeIndex t, Timeout timeout) const final {
    return robot_.get_status(t, timeout);
  }
  void wait_until_time_index(TimeIndex t, Timeout timeout) const final {
    robot_.wait_until_time_index(t, timeout);
  }
  [[nodiscard]] TimeIndex current_time_index() const final { return robot_.current_time_index(); }
  [[nodiscard]] std::optional<Fault> fault() const final { return robot_.fault(); }

 protected:
  Handle robot_;
};

/// The law of every end: with N applied actions, steps 0 to N - 1 are whole. Step N has the last
/// observation and the status with the reason. Nothing follows.
void expect_end(const AnyObserver& robot, TimeIndex steps, const Fault& expected,
                bool has_last_observation = true);

template <class R>
void expect_end(const Frontend<R>& robot, TimeIndex steps, const Fault& expected) {
  expect_end(ErasedObserver<AnyObserver, const Frontend<R>&>(robot), steps, expected);
}

}  // namespace trifinger::test
