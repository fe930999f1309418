// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <span>

#include "trifinger/control/grasp_controller.hpp"
#include "trifinger/control/knot_spline.hpp"
#include "trifinger/control/motion.hpp"
#include "trifinger/control/planning_model.hpp"

struct mjData_;

namespace trifinger::manipulation {

// The joints as measured at one time.
struct JointSample {
  control::Seconds time{0};
  control::JointState joints{};
};

// How joints follow targets.
struct Servo {
  double kp;  // [Nm/rad]
  double kd;  // [Nms/rad]
};

// Estimates where an object is that the fingers push, from poses that are late and noisy.
//
// Between two poses it simulates the object while the joints move as they were measured. So what a
// tip pushes moves at once, and what nobody touches stays. A new pose corrects the estimate by a
// share of its deviation: position and orientation by `gain`, velocities by gain^2 / (2 - gain)
// over the time between two poses (an alpha-beta filter, whose prediction is the simulation).
class ObjectObserver {
 public:
  // `object` is an index in the model's list. Throws Error if there is no memory.
  ObjectObserver(control::PlanningModel model, std::size_t object, double gain);

  // Takes `pose` as it is: the object rests there.
  void restart(control::Seconds captured, const control::Pose& pose);
  // Corrects the estimate by a pose that was measured at `captured`, newer than those before it.
  // `history` has the joints from before the previous pose on, in order.
  void correct(control::Seconds captured, const control::Pose& pose,
               std::span<const JointSample> history);

  // The state at the newest sample of `history`.
  const control::PlanningState& now(std::span<const JointSample> history);
  // The state at `time` if the joints follow `targets` after `now`. Torques are clipped as in
  // plans.
  const control::PlanningState& ahead(control::Seconds time, const control::KnotSpline& targets,
                                      const Servo& servo);

  [[nodiscard]] control::Motion motion_of(const control::PlanningState& state) const;

 private:
  void load(const control::PlanningState& state);
  void keep(control::Seconds time, control::PlanningState& state) const;
  void put_joints(const JointSample& sample);
  void follow(control::Seconds from, control::Seconds to, std::span<const JointSample> history);

  control::PlanningModel model_;
  ObjectAddress object_;
  double gain_;
  SceneModel::Data data_;
  bool is_known_{false};
  control::PlanningState seen_;   // At the newest pose.
  control::PlanningState state_;  // What was asked for last.
};

}  // namespace trifinger::manipulation
