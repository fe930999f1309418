// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <functional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "trifinger/base/text.hpp"
#include "trifinger/base/time.hpp"
#include "trifinger/core/driver.hpp"
#include "trifinger/core/robot.hpp"
#include "trifinger/joint/counted.hpp"
#include "trifinger/joint/safety.hpp"
#include "trifinger/realtime/annotations.hpp"

namespace trifinger {

/// What all drivers of robots with counted joints have in common: the safety chain with its memory,
/// the texts of its faults and rejections with the names of the joints, and checks of users.
class CountedChain {
 public:
  /// A user's own check, see `SafetyChain::Check`. It sees the elements of the session.
  using Check = std::function<void(const void* observation, void* action)>;

  /// `types` are the elements of the session, `names` and `limits` those of the joints.
  /// @throws InvalidArgument
  CountedChain(RobotTypes types, std::vector<std::string> names,
               const std::vector<JointLimit>& limits);
  CountedChain(const CountedChain&) = delete;
  CountedChain& operator=(const CountedChain&) = delete;
  ~CountedChain() = default;

  [[nodiscard]] std::size_t size() const noexcept { return names_.size(); }
  [[nodiscard]] const RobotTypes& types() const noexcept { return types_; }
  [[nodiscard]] const std::vector<JointLimit>& limits() const noexcept { return safety_.limits(); }
  [[nodiscard]] const std::string& name(std::size_t joint) const noexcept { return names_[joint]; }

  /// Adds a check after the existing ones, before the first session. `write_observation` writes the
  /// observation that `apply` was given, as an element.
  void add_check(Check check, std::function<void(void* element)> write_observation);

  /// Finds the action to apply instead of `desired`: see `applied`. A report that is not ready says
  /// why the session ends; the action is then one that brakes.
  [[nodiscard]] DriverReport apply(const CountedAction& desired,
                                   const CountedObservation& observation,
                                   Nanoseconds elapsed) noexcept TRIFINGER_REALTIME;
  /// What the last call of `apply` has found.
  [[nodiscard]] const CountedAppliedAction& applied() const noexcept { return applied_; }
  [[nodiscard]] CountedAppliedAction& applied() noexcept { return applied_; }

  /// What the checks remember of each joint.
  [[nodiscard]] std::span<JointMemory> memory() noexcept { return memory_.joints; }
  [[nodiscard]] std::span<const JointMemory> memory() const noexcept { return memory_.joints; }
  void forget(double heat = 0.0) noexcept;

  /// For `UntypedDriver::fault_text` and `rejection_text`.
  [[nodiscard]] std::string_view fault_text() const noexcept { return fault_text_.view(); }
  [[nodiscard]] std::string_view rejection_text() const noexcept { return rejection_text_.view(); }
  void set_fault_text(const FixedText& text) noexcept { fault_text_ = text; }
  void set_rejection_text(const FixedText& text) noexcept { rejection_text_ = text; }

 private:
  RobotTypes types_;
  std::vector<std::string> names_;
  SafetyChain<CountedJoints> safety_;
  CountedSafetyState memory_;
  CountedAppliedAction applied_;
  std::vector<std::byte> check_observation_;  // elements for added checks
  std::vector<std::byte> check_action_;
  FixedText fault_text_;
  FixedText rejection_text_;
  FixedText thrown_;
};

}  // namespace trifinger
