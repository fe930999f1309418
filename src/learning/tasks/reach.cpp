// SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <cmath>
#include <memory>
#include <numbers>

#include "drawing.hpp"
#include "tasks.hpp"
#include "trifinger/base/error.hpp"

namespace trifinger::learning {
namespace {

// ---- defaults ----

EnvironmentOptions reach_defaults() { return {.action = ActionKind::kPosition, .duration = 2}; }

// ---- the task ----

// Bounds of the drawn tip positions: each finger stays in its own third of the arena. They are
// those of the authors' simulation of this experiment, with room for the tip above the table.
constexpr double kHalfSector = 60.0 * kDegree;
constexpr double kInnerRadius = 0.02;  // [m]
constexpr double kOuterRadius = 0.2;
constexpr double kLowest = 0.02;

// How far a tip may be from its goal: the paper's ellipse [m].
constexpr double kReached = 0.02;

double distance_at(std::span<const double> a, std::span<const double> b,
                   std::size_t begin) noexcept {
  return std::hypot(a[begin] - b[begin], a[begin + 1] - b[begin + 1], a[begin + 2] - b[begin + 2]);
}

// Goals for points, whatever they are.
class Reach : public Task {
 public:
  [[nodiscard]] bool has_goals_of_fingers() const noexcept override { return true; }

  void achieve(const View& view, Episode& /*episode*/,
               std::span<double> achieved) const noexcept override {
    std::ranges::copy(view.tips, achieved.begin());
  }

  // The mean distance, negated [m].
  [[nodiscard]] double reward(std::span<const double> achieved,
                              std::span<const double> desired) const noexcept override {
    double sum = 0.0;
    for (std::size_t i = 0; i < achieved.size(); i += 3) sum += distance_at(achieved, desired, i);
    return -sum / (static_cast<double>(achieved.size()) / 3.0);
  }

  [[nodiscard]] bool is_success(std::span<const double> achieved, std::span<const double> desired,
                                const Episode& /*episode*/) const noexcept override {
    for (std::size_t i = 0; i < achieved.size(); i += 3) {
      // Written so that NaN fails.
      if (!(distance_at(achieved, desired, i) <= kReached)) return false;
    }
    return true;
  }
};

// The paper's task: each tip has a goal within the third of the arena that belongs to its finger.
class ReachOfTips final : public Reach {
 public:
  explicit ReachOfTips(int num_fingers) : num_fingers_(num_fingers) {}

  [[nodiscard]] Entry goal() const override {
    Entry entry{.name = "goal", .unit = "m", .low = {}, .high = {}};
    for (int finger = 0; finger < num_fingers_; ++finger) {
      entry.low.insert(entry.low.end(), {-0.3, -0.3, 0.0});
      entry.high.insert(entry.high.end(), {0.3, 0.3, 0.5});
    }
    return entry;
  }

  void draw_start(const Workspace& workspace, Random& random,
                  Start& start) const noexcept override {
    JointValues position(kJointsPerFinger * num_fingers_);
    draw_poses(workspace, random, position);
    std::ranges::copy(position, start.position.begin());
  }

  void draw_goal(const Workspace& workspace, Random& random,
                 std::span<double> goal) const noexcept override {
    JointValues position(kJointsPerFinger * num_fingers_);
    std::ranges::copy(draw_poses(workspace, random, position), goal.begin());
  }

 private:
  // Draws poses of all fingers. Fingers cannot meet, since each stays in its own sector. Returns
  // the positions of the tips.
  TipPositions draw_poses(const Workspace& workspace, Random& random,
                          JointValues& position) const noexcept {
    TipPositions tips(3 * num_fingers_);
    for (int finger = 0; finger < num_fingers_; ++finger) {
      for (int draw = 0; draw < kDraws; ++draw) {
        for (int joint = 0; joint < kJointsPerFinger; ++joint) {
          const int i = kJointsPerFinger * finger + joint;
          const auto k = static_cast<std::size_t>(i);
          position[i] = random.uniform(workspace.low[k], workspace.high[k]);
        }
        // The joints that are not drawn yet belong to other fingers and do not matter.
        JointValues all = position;
        all.tail((num_fingers_ - finger - 1) * kJointsPerFinger).setZero();
        tips.segment<3>(3 * finger) =
            workspace.kinematics->tip_positions(all).segment<3>(3 * finger);
        if (is_separated(*workspace.kinematics, finger, tips.segment<3>(3 * finger))) break;
      }
    }
    return tips;
  }

  [[nodiscard]] bool is_separated(const Kinematics& kinematics, int finger,
                                  const Eigen::Vector3d& tip) const noexcept {
    if (tip.z() < kLowest) return false;
    if (num_fingers_ == 1) return true;
    const double radius = std::hypot(tip.x(), tip.y());
    const double azimuth = std::atan2(tip.y(), tip.x()) - kinematics.finger_azimuth(finger);
    return radius > kInnerRadius && radius < kOuterRadius &&
           std::abs(std::remainder(azimuth, 2 * std::numbers::pi)) < kHalfSector;
  }

  int num_fingers_;
};

// Each frame of a robot from a file has a goal. All goals of an episode can be reached at once,
// because a pose of the robot that touches nothing has them.
class ReachOfFrames final : public Reach {
 public:
  explicit ReachOfFrames(const Workspace& workspace)
      : body_(*workspace.file), goal_(body_.frame_bounds("goal", workspace.low, workspace.high)) {}

  [[nodiscard]] Entry goal() const override { return goal_; }

  void draw_start(const Workspace& /*workspace*/, Random& /*random*/,
                  Start& /*start*/) const noexcept override {
    // The robot begins where its configuration says.
  }

  void draw_goal(const Workspace& workspace, Random& random,
                 std::span<double> goal) const noexcept override {
    body_.draw_pose(workspace.low, workspace.high, random, goal);
  }

 private:
  const FileBody& body_;
  Entry goal_;
};

std::unique_ptr<const Task> make_reach(const Workspace& robot) {
  if (robot.file == nullptr) {
    return std::make_unique<ReachOfTips>(robot.kinematics->num_fingers());
  }
  if (robot.file->num_frames() == 0) {
    throw InvalidArgument(
        "reach needs the names of the sites, bodies or geoms that shall reach a goal: the option "
        "frames, as in frames=[\"gripper\"]");
  }
  return std::make_unique<ReachOfFrames>(robot);
}

}  // namespace

std::vector<TaskDescription> reach_tasks() {
  return {{.name = "reach", .options = reach_defaults(), .is_for_files = true, .make = make_reach},
          {.name = "finger_reach",
           .options = reach_defaults(),
           .config_overrides = {R"(robot.arrangement="finger")", "objects=[]"},
           .num_fingers = 1,
           .make = make_reach}};
}

}  // namespace trifinger::learning
