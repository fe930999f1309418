// SPDX-License-Identifier: BSD-3-Clause
// The tasks of D'Claw, with the observations, rewards and scores that were published with it (M.
// Ahn et al.: ROBEL: Robotics benchmarks for learning with low-cost robots. CoRL 2019).
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <functional>
#include <memory>
#include <numbers>
#include <string>
#include <string_view>
#include <utility>

#include "tasks.hpp"
#include "trifinger/base/error.hpp"

namespace trifinger::learning {
namespace {

using std::numbers::pi;

// ---- defaults ----

// What of an episode is random.
enum class Luck : std::uint8_t {
  kFixed,     // as little as possible
  kRandom,    // start and goal
  kDynamics,  // joints, motors, surfaces and measurements, too
};

EnvironmentOptions defaults(int steps_per_action, double duration, Luck luck) {
  EnvironmentOptions options{
      .steps_per_action = steps_per_action, .action = ActionKind::kPosition, .duration = duration};
  if (luck == Luck::kDynamics) {
    options.position_noise = 0.05;
    options.joint_damping = {0.05, 1.0};  // 0.005 to 0.1 Nms/rad
    options.joint_friction = {0.001, 0.005};
    options.motor_gain = {0.5, 1.5};  // a stiffness of 1 to 3 Nm/rad
    options.friction = {4.0, 6.0};    // 0.8 to 1.2 between tips and valve
  }
  return options;
}

// ---- the robot ----

constexpr std::size_t kJoints = 9;
using Joints = std::array<double, kJoints>;

// From the plate to the tip, finger by finger.
constexpr std::array<std::string_view, kJoints> kNames{"FFJ10", "FFJ11", "FFJ12", "MFJ20", "MFJ21",
                                                       "MFJ22", "THJ30", "THJ31", "THJ32"};
// What actions from -1 to 1 mean for the three joints of a finger: plus or minus this [rad].
constexpr std::array<double, 3> kRange{0.48, pi / 3, pi / 2};
constexpr Joints kNominal{0, -pi / 3, pi / 3, 0, -pi / 3, pi / 3, 0, -pi / 3, pi / 3};
// What is near a limit, fast, or a high current.
constexpr double kNear = 5.0 * kDegree;
constexpr double kFast = 1.0;  // [rad/s]
// 200 mA of a motor that gives 3 Nm at 2.3 A [Nm].
constexpr double kHighTorque = 0.2 * 3.0 / 2.3;

// The norm of those numbers that are at least as large as `least`.
double norm_of_large(std::span<const double> numbers, double least) noexcept {
  double square = 0.0;
  for (const double number : numbers) {
    if (std::abs(number) >= least) square += number * number;
  }
  return std::sqrt(square);
}

Entry entry_of(const char* name, const char* unit, std::size_t size, double bound) {
  return {.name = name,
          .unit = unit,
          .low = std::vector<double>(size, -bound),
          .high = std::vector<double>(size, bound)};
}

// What all tasks of D'Claw have in common.
class DClawTask : public Task {
 public:
  // Sets the range of actions.
  explicit DClawTask(Workspace& robot) {
    for (std::size_t i = 0; i < kJoints; ++i) {
      const std::size_t joint = robot.file->joint(kNames[i]);
      if (joint != i || robot.low.size() != kJoints) {
        throw InvalidArgument(
            "the tasks of D'Claw are for a robot with its nine joints, FFJ10 to THJ32");
      }
      const JointLimit& limit = robot.file->limits()[i];
      position_.low.push_back(limit.hard_lower);
      position_.high.push_back(limit.hard_upper);
      range_[i] = kRange[i % 3];
      // A pose beyond the soft limits cannot be reached.
      lowest_[i] = std::max(-range_[i], robot.low[i]);
      highest_[i] = std::min(range_[i], robot.high[i]);
      robot.low[i] = -range_[i];
      robot.high[i] = range_[i];
    }
  }

  void draw_start(const Workspace& /*workspace*/, Random& /*random*/,
                  Start& /*start*/) const noexcept override {
    // `begin` does.
  }
  void draw_goal(const Workspace& /*workspace*/, Random& /*random*/,
                 std::span<double> /*goal*/) const noexcept override {
    // `begin` does; a goal that moves is no other goal.
  }

  [[nodiscard]] std::vector<std::string> scores() const override {
    return {"points", "joints_near_limit", "fast_joints", "high_currents"};
  }
  void score(const View& view, std::span<const double> achieved, std::span<const double> desired,
             std::span<double> scores) const noexcept override {
    scores[0] = points(distance(achieved, desired));
    std::fill(scores.begin() + 1, scores.end(), 0.0);
    for (std::size_t i = 0; i < kJoints; ++i) {
      if (std::abs(view.position[i]) > range_[i] - kNear) scores[1] += 1.0;
      if (std::abs(view.velocity[i]) > kFast) scores[2] += 1.0;
      if (std::abs(view.torque[i]) > kHighTorque) scores[3] += 1.0;
    }
  }

 protected:
  // Points for a distance from the goal: 1 at the goal, 0 far away.
  [[nodiscard]] virtual double points(double distance) const noexcept = 0;

  [[nodiscard]] const Entry& position_entry() const noexcept { return position_; }

  // A pose that does not tangle the fingers: middle joints go outward.
  [[nodiscard]] Joints draw_pose(Random& random) const noexcept {
    Joints pose{};
    for (std::size_t i = 0; i < kJoints; ++i) {
      const double highest = i % 3 == 1 ? 0.0 : highest_[i];
      pose[i] = random.uniform(lowest_[i], highest);
    }
    return pose;
  }

 private:
  Entry position_{.name = "joint_position", .unit = "rad", .low = {}, .high = {}};
  Joints range_{};
  Joints lowest_{};
  Joints highest_{};
};

// ---- turn and screw ----

// Turn the valve to an angle, which may move.
class TurnValve final : public DClawTask {
 public:
  enum class Kind : std::uint8_t { kTurn, kScrew };

  TurnValve(Workspace& robot, Kind kind, Luck luck)
      : DClawTask(robot), kind_(kind), luck_(luck), valve_(robot.file->model_joint("valve")) {
    if (valve_ >= kMaxCountedJoints)
      throw InvalidArgument("the valve is not among the first joints");
  }

  [[nodiscard]] Entry goal() const override { return entry_of("goal", "rad", 1, 10.0); }

  void begin(const Workspace& /*workspace*/, Start& start, Episode& episode,
             std::span<double> goal) const noexcept override {
    std::ranges::copy(kNominal, start.position.begin());
    Random& random = episode.random;
    auto& motion = episode.memory.as<Motion>();
    const bool is_fixed = luck_ == Luck::kFixed;
    double valve = 0.0;
    if (kind_ == Kind::kTurn) {
      constexpr double kSpread = 60.0 * kDegree;
      if (!is_fixed) valve = random.uniform(-kSpread, kSpread);
      motion.begin = is_fixed ? pi : pi + random.uniform(-kSpread, kSpread);
    } else {
      if (!is_fixed) valve = random.uniform(-pi, pi);
      motion.begin = valve;
      motion.speed = is_fixed ? 0.5 : random.uniform(-0.75, 0.75);
    }
    start.model_position[valve_] = valve;
    goal[0] = motion.begin;
  }

  // The goal moves by itself. What is achieved is the angle of the valve, less the whole turns that
  // it is away from the goal.
  void achieve(const View& view, Episode& episode,
               std::span<double> achieved) const noexcept override {
    const auto& motion = episode.memory.as<Motion>();
    episode.goal[0] = motion.begin + motion.speed * view.time;
    achieved[0] = episode.goal[0] - error(view, episode);
  }

  [[nodiscard]] double reward(std::span<const double> achieved,
                              std::span<const double> desired) const noexcept override {
    const double error = distance(achieved, desired);
    return -5.0 * error + (error < 0.25 ? 10.0 : 0.0) + (error < 0.1 ? 50.0 : 0.0);
  }
  [[nodiscard]] double cost(const View& view) const noexcept override {
    Joints away{};
    std::ranges::transform(view.position, kNominal, away.begin(), std::minus<>());
    return norm_of_large(away, 0.0) + norm_of_large(view.velocity, 0.5);
  }
  [[nodiscard]] bool is_success(std::span<const double> achieved, std::span<const double> desired,
                                const Episode& /*episode*/) const noexcept override {
    return distance(achieved, desired) < (kind_ == Kind::kTurn ? 0.1 : 0.2);
  }

  [[nodiscard]] std::vector<Entry> entries() const override {
    return {position_entry(), entry_of("valve", "1", 2, 1.0), entry_of("action", "1", kJoints, 1.0),
            entry_of("error", "rad", 1, pi)};
  }
  void show(const View& view, const Episode& episode,
            std::span<double> shown) const noexcept override {
    auto next = std::ranges::copy(view.position, shown.begin()).out;
    *next++ = std::cos(view.model_position[valve_]);
    *next++ = std::sin(view.model_position[valve_]);
    next = std::copy_n(episode.action.begin(), kJoints, next);
    *next = error(view, episode);
  }

 protected:
  [[nodiscard]] double points(double distance) const noexcept override {
    return 1.0 - distance / pi;
  }

 private:
  // How the goal moves.
  struct Motion {
    double begin;  // [rad]
    double speed;  // [rad/s]
  };

  // From the valve to the goal, the shorter way [rad].
  [[nodiscard]] double error(const View& view, const Episode& episode) const noexcept {
    return std::remainder(episode.goal[0] - view.model_position[valve_], 2 * pi);
  }

  Kind kind_;
  Luck luck_;
  std::size_t valve_;  // its place among all hinges
};

// ---- pose ----

// Bring the joints to a pose, which may move.
class Pose final : public DClawTask {
 public:
  Pose(Workspace& robot, Luck luck) : DClawTask(robot), luck_(luck) {}

  [[nodiscard]] Entry goal() const override { return entry_of("goal", "rad", kJoints, pi / 2); }

  void begin(const Workspace& /*workspace*/, Start& start, Episode& episode,
             std::span<double> goal) const noexcept override {
    Random& random = episode.random;
    auto& motion = episode.memory.as<Motion>();
    const Joints first = draw_pose(random);
    const Joints second = draw_pose(random);
    for (std::size_t i = 0; i < kJoints; ++i) {
      start.position[i] = first[i];
      motion.middle[i] = second[i];
      if (luck_ == Luck::kFixed) continue;
      motion.middle[i] = start.position[i] = 0.5 * (first[i] + second[i]);
      motion.rate[i] = random.uniform(0.5, 2.0);
      motion.amplitude[i] = std::min(0.5 * std::abs(second[i] - first[i]), pi / 6 / motion.rate[i]);
    }
    std::ranges::copy(motion.middle, goal.begin());
  }

  void achieve(const View& view, Episode& episode,
               std::span<double> achieved) const noexcept override {
    const auto& motion = episode.memory.as<Motion>();
    for (std::size_t i = 0; i < kJoints; ++i) {
      episode.goal[i] =
          motion.middle[i] + motion.amplitude[i] * std::sin(motion.rate[i] * view.time);
    }
    std::ranges::copy(view.position, achieved.begin());
  }

  [[nodiscard]] double reward(std::span<const double> achieved,
                              std::span<const double> desired) const noexcept override {
    Joints error{};
    std::ranges::transform(desired, achieved, error.begin(), std::minus<>());
    return -norm_of_large(error, 0.0);
  }
  [[nodiscard]] double cost(const View& view) const noexcept override {
    return 0.1 * norm_of_large(view.velocity, pi);
  }
  // The mean error of the joints [rad].
  [[nodiscard]] double distance(std::span<const double> achieved,
                                std::span<const double> desired) const noexcept override {
    double sum = 0.0;
    for (std::size_t i = 0; i < kJoints; ++i) sum += std::abs(desired[i] - achieved[i]);
    return sum / kJoints;
  }
  [[nodiscard]] bool is_success(std::span<const double> achieved, std::span<const double> desired,
                                const Episode& /*episode*/) const noexcept override {
    return distance(achieved, desired) < 10.0 * kDegree;
  }

  [[nodiscard]] std::vector<Entry> entries() const override {
    return {position_entry(), entry_of("action", "1", kJoints, 1.0),
            entry_of("error", "rad", kJoints, pi)};
  }
  void show(const View& view, const Episode& episode,
            std::span<double> shown) const noexcept override {
    auto next = std::ranges::copy(view.position, shown.begin()).out;
    next = std::copy_n(episode.action.begin(), kJoints, next);
    std::transform(episode.goal.begin(), episode.goal.begin() + kJoints, view.position.begin(),
                   next, std::minus<>());
  }

 protected:
  [[nodiscard]] double points(double distance) const noexcept override {
    return 1.0 - std::min(distance / (45.0 * kDegree), 1.0);
  }

 private:
  // How the goal moves: like a sine about the middle.
  struct Motion {
    Joints middle;
    Joints amplitude;  // [rad]
    Joints rate;       // [rad/s]
  };

  Luck luck_;
};

}  // namespace

std::vector<TaskDescription> dclaw_tasks() {
  std::vector<TaskDescription> tasks;
  const auto add = [&tasks](const std::string& name, const std::string& robot, int steps,
                            double duration, Luck luck, auto make) {
    tasks.push_back({.name = name,
                     .options = defaults(steps, duration, luck),
                     .config_overrides = {},
                     .num_fingers = 0,
                     .is_for_files = true,
                     .robot = robot,
                     .make = std::move(make)});
  };
  using Kind = TurnValve::Kind;
  for (const auto& [suffix, luck] :
       {std::pair("_fixed", Luck::kFixed), std::pair("_random", Luck::kRandom),
        std::pair("_random_dynamics", Luck::kDynamics)}) {
    const std::string end(suffix);
    add("dclaw_pose" + end, "dclaw_without_valve", 20, 4.0, luck,
        [which = luck](Workspace& robot) { return std::make_unique<Pose>(robot, which); });
    add("dclaw_turn" + end, "dclaw", 40, 4.0, luck, [which = luck](Workspace& robot) {
      return std::make_unique<TurnValve>(robot, Kind::kTurn, which);
    });
    add("dclaw_screw" + end, "dclaw", 40, 8.0, luck, [which = luck](Workspace& robot) {
      return std::make_unique<TurnValve>(robot, Kind::kScrew, which);
    });
  }
  return tasks;
}

}  // namespace trifinger::learning
