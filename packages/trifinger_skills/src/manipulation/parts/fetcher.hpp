// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <cstdint>

#include "manipulation/parts/object_observer.hpp"
#include "trifinger/joint/types.hpp"
#include "trifinger/manipulation/skill.hpp"
#include "trifinger/model/kinematics.hpp"

namespace trifinger::manipulation {

// Drags a box over the table with one finger, which goes over it, down behind it, and towards the
// goal. For boxes that are so far away that short plans do not get there.
class Fetcher {
 public:
  // Throws InvalidArgument if the scene has no such box.
  Fetcher(const SkillContext& context, const ObjectDescription& box, const Servo& servo);

  // Drags the box, which lies at `object`, towards `goal`. False if no finger reaches that way;
  // then nothing changes.
  [[nodiscard]] bool begin(Seconds now, const control::JointState& joints, const Pose& object,
                           const Eigen::Vector3d& goal) noexcept;
  // The action of the next step.
  const TriFinger::Action& update(Seconds now, const control::JointState& joints,
                                  const Pose& object) noexcept;
  // Goes back from the box at once, and up.
  void stop() noexcept;
  [[nodiscard]] bool has_ended() const noexcept { return leg_ == Leg::kEnd; }
  [[nodiscard]] double torque_share() const noexcept { return torque_share_; }

 private:
  enum class Leg : std::uint8_t { kUp, kOver, kDown, kDrag, kBack, kLift, kEnd };

  void begin_leg(Leg leg) noexcept;
  void next_leg() noexcept;
  // The box's half width across the table in a direction.
  [[nodiscard]] double half_width(const Pose& object,
                                  const Eigen::Vector3d& direction) const noexcept;
  [[nodiscard]] FingerPose pose_for(int finger, const Eigen::Vector3d& tip,
                                    const Eigen::Vector3d& near) const noexcept;

  Kinematics kinematics_;
  control::SafetyLimits limits_;
  Servo servo_;
  Eigen::Vector3d half_;
  JointValues rest_;  // Where the other fingers wait.

  Leg leg_{Leg::kEnd};
  int finger_{0};
  Eigen::Vector3d goal_{Eigen::Vector3d::Zero()};
  Eigen::Vector3d direction_{Eigen::Vector3d::UnitX()};
  Eigen::Vector3d behind_{Eigen::Vector3d::Zero()};
  Eigen::Vector3d from_{Eigen::Vector3d::Zero()};
  Eigen::Vector3d to_{Eigen::Vector3d::Zero()};
  Eigen::Vector3d tip_{Eigen::Vector3d::Zero()};  // Where the tip should be.
  Seconds now_{0};
  Seconds leg_begin_{0};
  Seconds leg_time_{0};
  JointValues begin_;    // Of all joints.
  JointValues targets_;  // Of all joints.
  Seconds begin_time_{0};
  double torque_share_{0.0};
  TriFinger::Action action_{};
};

}  // namespace trifinger::manipulation
