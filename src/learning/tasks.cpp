// SPDX-License-Identifier: BSD-3-Clause
#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <iomanip>
#include <limits>
#include <memory>
#include <numbers>
#include <sstream>
#include <string>

#include "task.hpp"
#include "trifinger/base/error.hpp"
#include "trifinger/base/suggestion.hpp"

namespace trifinger::learning {
namespace {

constexpr int kDraws = 1000;  // Number of tries; if none fits, the last one is taken.

// ---- goals for tips ----

// Bounds of the drawn tip positions: each finger stays in its own third of the arena. They are
// those of the authors' simulation of this experiment, with room for the tip above the table.
constexpr double kHalfSector = 60.0 * kDegree;
constexpr double kInnerRadius = 0.02;  // [m]
constexpr double kOuterRadius = 0.2;
constexpr double kLowest = 0.02;

// How far a tip may be from its goal: the paper's ellipse [m].
constexpr double kReached = 0.02;

class Reach final : public Task {
 public:
  explicit Reach(int num_fingers) : num_fingers_(num_fingers) {}

  [[nodiscard]] bool has_goals_of_fingers() const noexcept override { return true; }

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

  void achieve(const View& view, Episode& /*episode*/,
               std::span<double> achieved) const noexcept override {
    std::ranges::copy(view.tips, achieved.begin());
  }

  // The mean distance, negated [m].
  [[nodiscard]] double reward(std::span<const double> achieved,
                              std::span<const double> desired) const noexcept override {
    double sum = 0.0;
    for (std::size_t i = 0; i < achieved.size(); i += 3) sum += distance(achieved, desired, i);
    return -sum / num_fingers_;
  }

  [[nodiscard]] bool is_success(std::span<const double> achieved, std::span<const double> desired,
                                const Episode& /*episode*/) const noexcept override {
    for (std::size_t i = 0; i < achieved.size(); i += 3) {
      // Written so that NaN fails.
      if (!(distance(achieved, desired, i) <= kReached)) return false;
    }
    return true;
  }

 private:
  static double distance(std::span<const double> a, std::span<const double> b,
                         std::size_t begin) noexcept {
    return std::hypot(a[begin] - b[begin], a[begin + 1] - b[begin + 1],
                      a[begin + 2] - b[begin + 2]);
  }

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

// ---- goals for the cube: the tasks of the Real Robot Challenge ----

constexpr double kCubeSize = 0.065;  // [m]
constexpr double kHalfCube = kCubeSize / 2;
const double kCubeRadius = kHalfCube * std::numbers::sqrt3;  // Sphere around the cube.
constexpr double kMostFar = 0.138708;                        // From the arena's centre [m].
constexpr double kHighest = 0.1;
// The cost divides distances by the width of the arena and by the range of heights of goals.
constexpr double kArenaWidth = 0.39;
constexpr double kHeightRange = 0.1;
constexpr double kCubeReached = 0.02;
constexpr double kCubeTurned = 22.0 * kDegree;
// The cube does not come back from beyond this radius.
constexpr double kOutside = 0.3;

// Uniform in a disc about the centre.
void draw_in_disc(Random& random, double radius, double* xy) noexcept {
  const double distance = radius * std::sqrt(random.uniform(0.0, 1.0));
  const double angle = random.uniform(0.0, 2 * std::numbers::pi);
  xy[0] = distance * std::cos(angle);
  xy[1] = distance * std::sin(angle);
}

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
      draw_in_disc(random, kMostFar, position.data());
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
    draw_in_disc(random, kMostFar, goal.data());
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
    constexpr double kFirst = 30.0;
    constexpr double kNext = 10.0;
    return time < kFirst ? 1 : 2 + static_cast<std::int64_t>((time - kFirst) / kNext);
  }

  void draw_start(const Workspace& /*workspace*/, Random& /*random*/,
                  Start& start) const noexcept override {
    start.object.position = {0.0, 0.0, kHalfCube};
  }
};

// ---- throwing ----

class Throw final : public Task {
 public:
  explicit Throw(double radius) : radius_(radius) {}

  [[nodiscard]] std::string_view object_name() const noexcept override { return "ball"; }

  [[nodiscard]] Entry goal() const override {
    return {.name = "goal", .unit = "m", .low = {-1.0, -1.0}, .high = {1.0, 1.0}};
  }

  void draw_start(const Workspace& /*workspace*/, Random& random,
                  Start& start) const noexcept override {
    constexpr double kSpread = 0.01;
    draw_in_disc(random, kSpread, start.object.position.data());
    start.object.position[2] = radius_;
  }

  void draw_goal(const Workspace& /*workspace*/, Random& random,
                 std::span<double> goal) const noexcept override {
    const double distance = random.uniform(0.3, 0.6);
    const double angle = random.uniform(0.0, 2 * std::numbers::pi);
    goal[0] = distance * std::cos(angle);
    goal[1] = distance * std::sin(angle);
  }

  // The achieved goal is where the ball landed. While it has not landed, it is where the ball is.
  void achieve(const View& view, Episode& episode,
               std::span<double> achieved) const noexcept override {
    const auto& position = view.object.position;
    constexpr double kFlying = 0.03;  // Above its place on the table [m].
    constexpr double kDown = 0.005;
    constexpr double kFree = 0.02;  // Distance from all tips.
    if (!episode.has_flown && position[2] > radius_ + kFlying) {
      double nearest = std::numeric_limits<double>::infinity();
      for (Eigen::Index i = 0; i < view.tips.size(); i += 3) {
        nearest =
            std::min(nearest, std::hypot(view.tips[i] - position[0], view.tips[i + 1] - position[1],
                                         view.tips[i + 2] - position[2]));
      }
      episode.has_flown = nearest > radius_ + kFree;
    }
    if (episode.has_flown && !episode.has_landed && position[2] < radius_ + kDown) {
      episode.has_landed = true;
      episode.landing = {position[0], position[1]};
    }
    achieved[0] = episode.has_landed ? episode.landing[0] : position[0];
    achieved[1] = episode.has_landed ? episode.landing[1] : position[1];
  }

  // The distance, negated [m].
  [[nodiscard]] double reward(std::span<const double> achieved,
                              std::span<const double> desired) const noexcept override {
    return -std::hypot(achieved[0] - desired[0], achieved[1] - desired[1]);
  }

  [[nodiscard]] bool is_success(std::span<const double> achieved, std::span<const double> desired,
                                const Episode& episode) const noexcept override {
    constexpr double kHit = 0.1;
    return episode.has_landed && -reward(achieved, desired) <= kHit;
  }

  [[nodiscard]] bool has_ended(const View& /*view*/,
                               const Episode& episode) const noexcept override {
    return episode.has_landed;
  }

 private:
  double radius_;
};

// ---- names ----

using Goal = MoveCube::Goal;

struct NamedTask {
  std::string_view name;
  EnvironmentOptions options;
  std::vector<std::string> config_overrides;
  int num_fingers;  // 0 for any
  std::unique_ptr<const Task> (*make)(const RobotDescription& description);
};

std::unique_ptr<const Task> make_reach(const RobotDescription& description) {
  return std::make_unique<Reach>(trifinger::num_fingers(description));
}

template <Goal kGoal>
std::unique_ptr<const Task> make_move_cube(const RobotDescription& /*description*/) {
  return std::make_unique<MoveCube>(kGoal);
}

const std::vector<NamedTask>& tasks() {
  static const std::vector<NamedTask> all_tasks = [] {
    const std::vector<std::string> nothing{"objects=[]"};
    const std::vector<std::string> a_cube{R"(objects=[{"name": "cube", "type": "cube"}])"};
    const auto for_seconds = [](double duration, ActionKind action) {
      EnvironmentOptions options;
      options.duration = duration;
      options.action = action;
      return options;
    };
    constexpr auto kChange = ActionKind::kPositionChange;
    std::vector<NamedTask> all;
    all.push_back({"reach", for_seconds(2, ActionKind::kPosition), nothing, 3, make_reach});
    all.push_back({"finger_reach",
                   for_seconds(2, ActionKind::kPosition),
                   {R"(robot.arrangement="finger")", "objects=[]"},
                   1,
                   make_reach});
    all.push_back({"push", for_seconds(15, kChange), a_cube, 3, make_move_cube<Goal::kOnTable>});
    all.push_back({"lift", for_seconds(30, kChange), a_cube, 3, make_move_cube<Goal::kPosition>});
    all.push_back({"lift_pose", for_seconds(30, kChange), a_cube, 3, make_move_cube<Goal::kPose>});
    all.push_back({"move_cube_on_trajectory", for_seconds(120, kChange), a_cube, 3,
                   [](const RobotDescription&) -> std::unique_ptr<const Task> {
                     return std::make_unique<MoveCubeOnTrajectory>();
                   }});
    all.push_back({"throw",
                   for_seconds(3, kChange),
                   {R"(objects=[{"name": "ball", "type": "ball"}])", "boundary=false"},
                   3,
                   [](const RobotDescription& description) -> std::unique_ptr<const Task> {
                     return std::make_unique<Throw>(description.objects.front().size[0] / 2);
                   }});
    return all;
  }();
  return all_tasks;
}

const NamedTask& find_task(std::string_view name) {
  const auto found = std::ranges::find(tasks(), name, &NamedTask::name);
  if (found == tasks().end()) {
    std::vector<std::string_view> names;
    for (const NamedTask& task : tasks()) names.push_back(task.name);
    throw InvalidArgument("there is no task '" + std::string(name) + "'; there are " +
                          quoted_list(names, "and"));
  }
  return *found;
}

}  // namespace

std::span<const std::string_view> task_names() noexcept {
  static const std::vector<std::string_view> all_names = [] {
    std::vector<std::string_view> names;
    names.reserve(tasks().size());
    for (const NamedTask& task : tasks()) names.push_back(task.name);
    return names;
  }();
  return all_names;
}

EnvironmentOptions default_options(std::string_view task) { return find_task(task).options; }

std::vector<std::string> config_overrides(std::string_view task,
                                          const EnvironmentOptions& options) {
  std::vector<std::string> overrides = find_task(task).config_overrides;
  const auto add = [&overrides](const char* name, double value) {
    std::ostringstream text;
    text << "simulation.object_" << name << "=" << std::setprecision(17) << value;
    overrides.push_back(text.str());
  };
  add("period", options.object_period);
  add("delay", options.object_delay);
  add("position_noise", options.object_position_noise);
  add("orientation_noise", options.object_orientation_noise);
  return overrides;
}

std::unique_ptr<const Task> make_task(std::string_view name, const RobotDescription& description) {
  const NamedTask& named = find_task(name);
  if (named.num_fingers != num_fingers(description)) {
    throw InvalidArgument("the task '" + std::string(name) + "' is for a robot with " +
                          std::to_string(named.num_fingers) + " fingers, this one has " +
                          std::to_string(num_fingers(description)));
  }
  auto task = named.make(description);
  const std::string_view object = task->object_name();
  const bool has_object =
      object.empty() || std::ranges::any_of(description.objects, [&](const auto& candidate) {
        return candidate.name == object;
      });
  if (!has_object) {
    throw InvalidArgument("the task '" + std::string(name) + "' needs an object called '" +
                          std::string(object) + "' in the robot's configuration");
  }
  return task;
}

}  // namespace trifinger::learning
