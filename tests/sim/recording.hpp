// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <cstring>
#include <numbers>
#include <random>
#include <string>
#include <type_traits>
#include <vector>

#include "trifinger/core/frontend.hpp"
#include "trifinger/joint/types.hpp"
#include "trifinger/model/kinematics.hpp"
#include "trifinger/sim/object_observation.hpp"

namespace trifinger::test {

/// Actions that poke about near the cube: links, cube, table and boundary touch all the time.
template <class R>
class Poking {
 public:
  /// Pokes around `centre` [m].
  Poking(const RobotDescription& description, const Triple& centre, std::uint32_t seed)
      : description_(description),
        kinematics_(description),
        centre_(centre.data()),
        random_(seed) {}

  Poking(const Poking& other)
      : description_(other.description_),
        kinematics_(description_),
        centre_(other.centre_),
        random_(other.random_),
        target_(other.target_),
        count_(other.count_) {}
  Poking& operator=(const Poking&) = delete;
  ~Poking() = default;

  typename R::Action operator()() {
    constexpr int kStepsPerTarget = 40;
    if (count_++ % kStepsPerTarget == 0) choose_targets();
    typename R::Action action = R::Action::of_position(target_);
    for (double& torque : action.torque) torque = 0.1 * uniform_(random_);
    return action;
  }

 private:
  void choose_targets() {
    for (std::size_t finger = 0; finger < R::kTips; ++finger) {
      const Eigen::Vector3d tip =
          centre_ + Eigen::Vector3d(0.06 * uniform_(random_), 0.06 * uniform_(random_),
                                    0.03 * uniform_(random_));
      const Eigen::Vector3d pose =
          kinematics_.inverse_kinematics(static_cast<int>(finger), tip).position;
      std::copy_n(pose.data(), kJointsPerFinger, &target_[finger * kJointsPerFinger]);
    }
  }

  RobotDescription description_;
  Kinematics kinematics_;
  Eigen::Vector3d centre_;
  std::mt19937 random_;
  std::uniform_real_distribution<double> uniform_{-1.0, 1.0};
  JointVector<R::kJoints> target_{};
  int count_{0};
};

/// What a program that reads by index has seen.
template <class R>
struct Recording {
  std::vector<typename R::Observation> observations;
  std::vector<typename R::AppliedAction> applied;
  std::vector<CubeObservation> cube;  // the one known at each step, without clock times
};

/// Runs `steps` steps with the actions of `policy` and appends what is seen to `recording`.
template <class R, class Policy>
void record(Frontend<R>& robot, Policy& policy, int steps, Recording<R>& recording) {
  const Companion<CubeObservation> cube(robot.companion("object"));
  for (int i = 0; i < steps; ++i) {
    const TimeIndex t = robot.append_desired_action(policy());
    recording.observations.push_back(robot.get_observation(t));
    recording.applied.push_back(robot.get_applied_action(t));
    CubeObservation element = cube.get_latest_at(t).value();
    element.stamp.arrival_time = element.stamp.capture_time = 0;
    recording.cube.push_back(element);
  }
}

/// Returns where two recordings begin to differ, even by a single bit: "observation 17", or
/// nothing.
template <class R>
std::string first_difference(const Recording<R>& a, const Recording<R>& b) {
  const auto compare = [](const std::string& what, const auto& left, const auto& right) {
    if (left.size() != right.size()) return "number of elements: " + what;
    for (std::size_t i = 0; i < left.size(); ++i) {
      if (std::memcmp(&left[i], &right[i], sizeof(left[i])) != 0) {
        return what + " " + std::to_string(i);
      }
    }
    return std::string();
  };
  for (const std::string& difference : {compare("observation", a.observations, b.observations),
                                        compare("applied action", a.applied, b.applied),
                                        compare("pose of the cube", a.cube, b.cube)}) {
    if (!difference.empty()) return difference;
  }
  return "";
}

}  // namespace trifinger::test
