// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <bitset>
#include <cstddef>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "trifinger/guiding/guided_robot.hpp"
#include "trifinger/model/frames.hpp"
#include "trifinger/model/kinematics.hpp"
#include "trifinger/model/scene_model.hpp"

namespace trifinger::guiding::detail {

// A point that a frame shall go to, in the world frame [m].
struct FrameGoal {
  int frame{0};
  Eigen::Vector3d point{Eigen::Vector3d::Zero()};
};

// Where the frames of a robot are, which joints bring them to points, and what the model says of
// weight and friction. Only the constructor allocates memory or throws.
class FrameKinematics {
 public:
  explicit FrameKinematics(const GuidedRobot& robot);

  [[nodiscard]] int num_joints() const noexcept { return static_cast<int>(limits_.size()); }
  [[nodiscard]] int num_frames() const noexcept { return static_cast<int>(moves_.size()); }
  // True if the motor of `joint` moves `frame`.
  [[nodiscard]] bool moves(int joint, int frame) const noexcept {
    return moves_[static_cast<std::size_t>(frame)].test(static_cast<std::size_t>(joint));
  }
  // Frames that share joints, and those that share joints with these, are a group: its first frame.
  [[nodiscard]] int group(int frame) const noexcept {
    return groups_[static_cast<std::size_t>(frame)];
  }
  [[nodiscard]] bool moves_with(int frame, int other) const noexcept {
    return group(frame) == group(other);
  }

  // Sets the measured pose. `all` are the positions of all hinges and slides of the model, in its
  // order, if somebody measures them. Joints that nobody measures stay where sessions begin.
  void measure(const GuidedJoints& position, std::span<const double> all) noexcept;
  // Torques that carry the measured pose.
  void weight(GuidedJoints& torque) noexcept;
  // The torque of a motor against viscous friction, for a velocity of 1 [Nms/rad], [Ns/m].
  [[nodiscard]] double damping(int joint) const noexcept { return damping_[joint]; }
  // The torque of a motor against dry friction [Nm], [N].
  [[nodiscard]] double friction(int joint) const noexcept { return friction_[joint]; }

  // Where a frame is with the driven joints at `position`, and all others as they were measured.
  [[nodiscard]] Eigen::Vector3d point(int frame, const GuidedJoints& position) noexcept;
  void points(const GuidedJoints& position, FramePoints& points) noexcept;

  // Changes joints so that frames come nearer to their goals: one step of damped least squares
  // within the soft limits. Returns the largest distance before the step [m].
  double approach(std::span<const FrameGoal> goals, GuidedJoints& position) noexcept;
  // How many systems of equations the last `approach` has solved: at most `kMaxTurns`.
  [[nodiscard]] int num_turns() const noexcept { return num_turns_; }
  static constexpr int kMaxTurns = 4;
  // Changes the joints of one frame to another posture, in which it is at its goal. Returns false
  // if none is known: only tips of a TriFinger have a closed form.
  [[nodiscard]] bool find_posture(const FrameGoal& goal, GuidedJoints& position) noexcept;

  // What counts as one radian of a joint: 1 rad, or that many metres of a slide.
  [[nodiscard]] double radian(int joint) const noexcept { return radians_[joint]; }

 private:
  static constexpr int kMaxRows = 3 * kMaxGuidedFrames;
  using Columns =
      Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, 0, kMaxRows, kMaxCountedJoints>;
  using Rows = Eigen::Matrix<double, Eigen::Dynamic, 1, 0, kMaxRows, 1>;
  using Square = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, 0, kMaxRows, kMaxRows>;

  void find_friction();
  void find_moved(const GuidedRobot& robot);
  void find_groups();
  void pose(const GuidedJoints& position) noexcept;
  void add_columns(const FrameGoal& goal, int row) noexcept;
  // Moves joints that the step would move beyond their limits to these, and takes them out of this
  // step and the next. Returns false if there are none.
  bool stop_at_limits(GuidedJoints& position) noexcept;
  [[nodiscard]] bool is_within_limits(const GuidedJoints& position) const noexcept;

  std::shared_ptr<const SceneModel> model_;
  std::vector<JointLimit> limits_;
  Frames frames_;
  std::optional<Kinematics> closed_form_;              // of the tips of fingers
  std::vector<std::bitset<kMaxCountedJoints>> moves_;  // for each frame
  std::vector<int> groups_;                            // for each frame
  GuidedJoints radians_, damping_, friction_;
  SceneModel::Data data_;              // in the measured pose, at rest
  std::vector<double> configuration_;  // of one pose, in the order of MuJoCo's `qpos`
  std::vector<double> rows_;           // the Jacobian of one frame by MuJoCo's degrees of freedom
  // One step: the Jacobian of all goals by the driven joints [m for each radian], what is missing
  // [m], and how the joints move [radians].
  Columns columns_;
  Rows error_, solved_;
  Square square_;
  Eigen::LDLT<Square> solver_;
  GuidedJoints step_;
  int num_turns_{0};
};

}  // namespace trifinger::guiding::detail
