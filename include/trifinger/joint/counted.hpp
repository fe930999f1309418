// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "trifinger/core/robot.hpp"
#include "trifinger/joint/limits.hpp"
#include "trifinger/joint/safety_checks.hpp"
#include "trifinger/joint/types.hpp"
#include "trifinger/realtime/annotations.hpp"

/// \file
/// Robots whose joints are counted when they are made, such as simulated ones. Users see the
/// same elements as those of a `JointRobot` with as many joints: `JointAction<N>` and so on. Inside
/// the driver they are the types below, so that one `SafetyChain` serves robots of any number.

namespace trifinger {

/// The most joints that such a robot may have.
inline constexpr std::size_t kMaxCountedJoints = 128;

/// One value for each of up to `kMaxCountedJoints` joints. Needs no memory from the heap, and
/// copies only the values that it has.
template <class T>
class PerJoint {
 public:
  // NOLINTBEGIN(readability-identifier-naming): the standard library wants these names.
  using value_type = T;
  using iterator = T*;
  using const_iterator = const T*;
  // NOLINTEND(readability-identifier-naming)

  PerJoint() noexcept = default;
  /// `size` must be at most `kMaxCountedJoints`.
  PerJoint(std::size_t size, T value) noexcept : size_(size) { std::ranges::fill(*this, value); }
  /// There must be at most `kMaxCountedJoints` values.
  explicit PerJoint(std::span<const T> values) noexcept : size_(values.size()) {
    std::ranges::copy(values, begin());
  }
  PerJoint(const PerJoint& other) noexcept : size_(other.size_) { copy(other); }
  PerJoint& operator=(const PerJoint& other) noexcept {
    if (this == &other) return *this;
    size_ = other.size_;
    copy(other);
    return *this;
  }
  ~PerJoint() = default;

  [[nodiscard]] std::size_t size() const noexcept { return size_; }
  [[nodiscard]] T& operator[](std::size_t joint) noexcept { return values_[joint]; }
  [[nodiscard]] const T& operator[](std::size_t joint) const noexcept { return values_[joint]; }
  [[nodiscard]] T* begin() noexcept { return values_.data(); }
  [[nodiscard]] T* end() noexcept { return values_.data() + size_; }
  [[nodiscard]] const T* begin() const noexcept { return values_.data(); }
  [[nodiscard]] const T* end() const noexcept { return values_.data() + size_; }

 private:
  void copy(const PerJoint& other) noexcept { std::copy(other.begin(), other.end(), begin()); }

  std::size_t size_{0};
  std::array<T, kMaxCountedJoints> values_;  // Nobody sees the values behind the last joint.
};

/// `JointAction` for joints that are counted at run time.
struct CountedAction {
  PerJoint<double> torque;
  PerJoint<double> position;
  PerJoint<double> position_kp;
  PerJoint<double> position_kd;

  CountedAction() noexcept = default;
  /// Asks for no torque, like `JointAction{}`.
  explicit CountedAction(std::size_t joints) noexcept
      : torque(joints, 0.0),
        position(joints, kNotGiven),
        position_kp(joints, kNotGiven),
        position_kd(joints, kNotGiven) {}
};

/// `JointObservation` for joints that are counted at run time.
struct CountedObservation {
  PerJoint<double> position;
  PerJoint<double> velocity;
  PerJoint<double> torque;

  CountedObservation() noexcept = default;
  explicit CountedObservation(std::size_t joints) noexcept
      : position(joints, 0.0), velocity(joints, 0.0), torque(joints, 0.0) {}
};

/// The action that keeps the measured pose with the robot's own gains.
[[nodiscard]] inline CountedAction hold_position(const CountedObservation& observation) noexcept {
  CountedAction action(observation.position.size());
  action.position = observation.position;
  return action;
}

/// `AppliedJointAction` for joints that are counted at run time.
struct CountedAppliedAction {
  PerJoint<double> torque;
  PerJoint<double> position;
  PerJoint<double> position_kp;
  PerJoint<double> position_kd;
  PerJoint<std::uint64_t> reasons;
  PerJoint<double> thermal_margin;

  CountedAppliedAction() noexcept = default;
  explicit CountedAppliedAction(std::size_t joints) noexcept
      : torque(joints, 0.0),
        position(joints, kNotGiven),
        position_kp(joints, kNotGiven),
        position_kd(joints, kNotGiven),
        reasons(joints, 0),
        thermal_margin(joints, 1.0) {}
};

/// What the safety chain remembers of such a robot.
struct CountedSafetyState {
  std::vector<JointMemory> joints;
};

/// The types of such a robot, for `SafetyChain`.
struct CountedJoints {
  using Action = CountedAction;
  using Observation = CountedObservation;
  using AppliedAction = CountedAppliedAction;
  using Limits = std::vector<JointLimit>;
  using SafetyState = CountedSafetyState;
};

/// @name Elements of a session
/// In a session, the values of an element stand one after the other, as in `JointAction<N>`.
/// `element` begins with that many bytes; what follows it is left alone. Those that read fill in
/// the values of as many joints as `target` has.
/// @{
void read_element(const void* element, CountedAction& target) noexcept TRIFINGER_REALTIME;
void read_element(const void* element, CountedObservation& target) noexcept TRIFINGER_REALTIME;
void write_element(const CountedAction& action, void* element) noexcept TRIFINGER_REALTIME;
void write_element(const CountedObservation& observation,
                   void* element) noexcept TRIFINGER_REALTIME;
void write_element(const CountedAppliedAction& applied, void* element) noexcept TRIFINGER_REALTIME;
/// For a robot that measures more than its driven joints: `joint_position` and `joint_velocity` of
/// all its joints, and `tip_force`, follow the observation.
void write_element(const CountedObservation& observation, std::span<const double> joint_position,
                   std::span<const double> joint_velocity, std::span<const double> tip_force,
                   void* element) noexcept TRIFINGER_REALTIME;
/// @}

/// How a joint moves.
enum class JointKind : std::uint8_t {
  kHinge,  ///< It turns: rad, Nm.
  kSlide,  ///< It slides: m, N.
};

/// Describes these elements for a robot of `type` with such joints. A robot that has both kinds has
/// units such as "rad or m". `more` follows in the observation; its offsets are set here.
/// @throws InvalidArgument if there are no joints, more than `kMaxCountedJoints`, or two fields of
/// a name
[[nodiscard]] RobotTypes describe_counted(std::string type, std::span<const JointKind> joints,
                                          std::span<const FieldDescription> more = {});

}  // namespace trifinger
