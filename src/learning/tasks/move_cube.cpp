// SPDX-License-Identifier: BSD-3-Clause
// The tasks of the Real Robot Challenge 2020: goals for a cube.
#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <memory>
#include <numbers>

#include "drawing.hpp"
#include "tasks.hpp"

namespace trifinger::learning {
namespace {

// ---- defaults ----

constexpr const char* kObjects = R"(objects=[{"name": "cube", "type": "cube"}])";

EnvironmentOptions move_cube_defaults(double duration) {
  return {.action = ActionKind::kPositionChange, .duration = duration};
}

// ---- the tasks ----

constexpr double kCubeSize = 0.065;  // [m]
constexpr double kHalfCube = kCubeSize / 2;
const double kCubeRadius = kHalfCube * std::numbers::sqrt3;  // Sphere around the cube.
constexpr double kMaxDistance = 0.138708;                    // From the arena's centre [m].
constexpr double kHighest = 0.1;
// The cost divides distances by the width of the arena and by the range of heights of goals.
constexpr double kArenaWidth = 0.39;
constexpr double kHeightRange = 0.1;
constexpr double kCubeReached = 0.02;
constexpr double kCubeTurned = 22.0 * kDegree;
// The cube does not come back from beyond this radius.
constexpr double kOutside = 0.3;

void write_quaternion(const Eigen::Quaterniond& rotation, double* wxyz) noexcept {
  // A quaternion and its negative mean the same; the one with w >= 0 is written.
  const double sign = rotation.w() < 0.0 ? -1.0 : 1.0;
  wxyz[0] = sign * rotation.w();
  wxyz[1] = sign * rotation.x();
  wxyz[2] = sign * rotation.y();
  wxyz[3] = sign * rotation.z();
}

double angle_between(const double* a, const double* b) noexcept {
  const double cosine = std::abs(a[0] * b[0] + a[1] * b[1] + a[2] * b[2] + a[3] * b[3]);
  return 2.0 * std::acos(std::min(cosine, 1.0));
}

class MoveCube : public Task {
 public:
  enum class Goal : std::uint8_t { kOnTable, kPosition, kPose };

  explicit MoveCube(Goal goal) : goal_(goal) {}

  [[nodiscard]] std::string_view object_name() const noexcept override { return "cube"; }
  [[nodiscard]] double object_reach() const noexcept override { return kMaxDistance; }

  [[nodiscard]] Entry goal() const override {
    Entry entry{.name = "goal", .unit = "m", .low = {-0.3, -0.3, 0.0}, .high = {0.3, 0.3, 0.3}};
    if (goal_ == Goal::kPose) {
      entry.unit = "m, 1";
      entry.low.insert(entry.low.end(), 4, -1.0);
      entry.high.insert(entry.high.end(), 4, 1.0);
    }
    return entry;
  }

  void draw_start(const Workspace& workspace, Random& random,
                  Start& start) const noexcept override {
    const auto size = static_cast<Eigen::Index>(workspace.low.size());
    const TipPositions tips =
        workspace.kinematics->tip_positions(JointValues::Map(start.position.data(), size));
    auto& position = start.object.position;
    position[2] = kHalfCube;
    for (int draw = 0; draw < kDraws; ++draw) {
      draw_in_disc(random, kMaxDistance, position.data());
      if (is_clear(tips, position)) break;
    }
    Eigen::Quaterniond rotation(Eigen::AngleAxisd(
        random.uniform(-std::numbers::pi, std::numbers::pi), Eigen::Vector3d::UnitZ()));
    // Only tasks with a goal orientation vary the face that is up.
    if (goal_ == Goal::kPose) rotation = rotation * face_up(random.integer(0, 6));
    write_quaternion(rotation, start.object.orientation.data());
  }

  void draw_goal(const Workspace& /*workspace*/, Random& random,
                 std::span<double> goal) const noexcept override {
    draw_in_disc(random, kMaxDistance, goal.data());
    switch (goal_) {
      case Goal::kOnTable:
        goal[2] = kHalfCube;
        break;
      case Goal::kPosition:
        goal[2] = random.uniform(kHalfCube, kHighest);
        break;
      case Goal::kPose:
        goal[2] = random.uniform(kCubeRadius, kHighest);
        write_quaternion(random_rotation(random), &goal[3]);
        break;
    }
  }

  void achieve(const View& view, Episode& /*episode*/,
               std::span<double> achieved) const noexcept override {
    std::ranges::copy(view.object.position, achieved.begin());
    if (goal_ == Goal::kPose) std::ranges::copy(view.object.orientation, achieved.begin() + 3);
  }

  // The cost of the challenge, negated.
  [[nodiscard]] double reward(std::span<const double> achieved,
                              std::span<const double> desired) const noexcept override {
    const double aside = std::hypot(achieved[0] - desired[0], achieved[1] - desired[1]);
    const double above = std::abs(achieved[2] - desired[2]);
    const double position = 0.5 * (aside / kArenaWidth + above / kHeightRange);
    if (goal_ != Goal::kPose) return -position;
    return -0.5 * (position + angle_between(&achieved[3], &desired[3]) / std::numbers::pi);
  }

  [[nodiscard]] bool is_success(std::span<const double> achieved, std::span<const double> desired,
                                const Episode& /*episode*/) const noexcept override {
    const double distance =
        std::hypot(achieved[0] - desired[0], achieved[1] - desired[1], achieved[2] - desired[2]);
    if (!(distance <= kCubeReached)) return false;
    return goal_ != Goal::kPose || angle_between(&achieved[3], &desired[3]) <= kCubeTurned;
  }

  [[nodiscard]] bool has_ended(const View& view,
                               const Episode& /*episode*/) const noexcept override {
    const auto& position = view.object.position;
    return std::hypot(position[0], position[1]) > kOutside || position[2] < 0.0;
  }

 private:
  static bool is_clear(const TipPositions& tips, const std::array<double, 3>& position) noexcept {
    constexpr double kGap = 0.02;  // A tip's radius and some margin.
    for (Eigen::Index i = 0; i < tips.size(); i += 3) {
      if (std::hypot(tips[i] - position[0], tips[i + 1] - position[1]) <
          kHalfCube * std::numbers::sqrt2 + kGap) {
        return false;
      }
    }
    return true;
  }

  static Eigen::Quaterniond face_up(std::int64_t face) noexcept {
    const double quarter = std::numbers::pi / 2;
    if (face < 4) {
      return Eigen::Quaterniond(
          Eigen::AngleAxisd(static_cast<double>(face) * quarter, Eigen::Vector3d::UnitX()));
    }
    return Eigen::Quaterniond(
        Eigen::AngleAxisd(face == 4 ? quarter : -quarter, Eigen::Vector3d::UnitY()));
  }

  // Four normal numbers point in any direction of four dimensions with equal probability.
  static Eigen::Quaterniond random_rotation(Random& random) noexcept {
    std::array<double, 4> numbers{};
    for (double& number : numbers) number = random.normal();
    return Eigen::Quaterniond(numbers[0], numbers[1], numbers[2], numbers[3]).normalized();
  }

  Goal goal_;
};

// The first goal for 30 s, then another one every 10 s.
class MoveCubeOnTrajectory final : public MoveCube {
 public:
  MoveCubeOnTrajectory() : MoveCube(Goal::kPosition) {}

  [[nodiscard]] std::int64_t num_goals(double time) const noexcept override {
    return time < kFirst ? 1 : 2 + static_cast<std::int64_t>((time - kFirst) / kNext);
  }
  // The time that is left for the goal.
  [[nodiscard]] std::vector<Entry> memory_entries() const override {
    return {{.name = "goal_time", .unit = "s", .low = {0.0}, .high = {kFirst}}};
  }
  void show_memory(const View& view, const Episode& /*episode*/,
                   std::span<double> shown) const noexcept override {
    shown[0] = kFirst + static_cast<double>(num_goals(view.time) - 1) * kNext - view.time;
  }

  void draw_start(const Workspace& /*workspace*/, Random& /*random*/,
                  Start& start) const noexcept override {
    start.object.position = {0.0, 0.0, kHalfCube};
  }

 private:
  static constexpr double kFirst = 30.0;  // [s]
  static constexpr double kNext = 10.0;
};

using Goal = MoveCube::Goal;

TaskDescription move_cube(std::string name, double duration, Goal goal) {
  return {.name = std::move(name),
          .options = move_cube_defaults(duration),
          .config_overrides = {kObjects},
          .make = [goal](Workspace&) { return std::make_unique<MoveCube>(goal); }};
}

}  // namespace

std::vector<TaskDescription> move_cube_tasks() {
  return {move_cube("push", 15, Goal::kOnTable),
          move_cube("lift", 30, Goal::kPosition),
          move_cube("lift_pose", 30, Goal::kPose),
          {.name = "move_cube_on_trajectory",
           .options = move_cube_defaults(120),
           .config_overrides = {kObjects},
           .make = [](Workspace&) { return std::make_unique<MoveCubeOnTrajectory>(); }}};
}

}  // namespace trifinger::learning
