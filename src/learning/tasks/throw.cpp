// SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <memory>
#include <numbers>

#include "drawing.hpp"
#include "tasks.hpp"

namespace trifinger::learning {
namespace {

// ---- defaults ----

EnvironmentOptions throw_defaults() {
  return {.action = ActionKind::kPositionChange, .duration = 3};
}

// ---- the task ----

constexpr double kSpread = 0.01;  // How far from the middle the ball begins [m].

// What happened to the object so far.
struct Flight {
  bool has_flown;
  bool has_landed;
  std::array<double, 2> landing;  // Where it came down [m].
};

class Throw final : public Task {
 public:
  explicit Throw(double radius) : radius_(radius) {}

  [[nodiscard]] std::string_view object_name() const noexcept override { return "ball"; }
  [[nodiscard]] double object_reach() const noexcept override { return kSpread; }

  [[nodiscard]] Entry goal() const override {
    return {.name = "goal", .unit = "m", .low = {-1.0, -1.0}, .high = {1.0, 1.0}};
  }

  void draw_start(const Workspace& /*workspace*/, Random& random,
                  Start& start) const noexcept override {
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
    auto& flight = episode.memory.as<Flight>();
    const auto& position = view.object.position;
    constexpr double kFlying = 0.03;  // Above its place on the table [m].
    constexpr double kDown = 0.005;
    constexpr double kFree = 0.02;  // Distance from all tips.
    if (!flight.has_flown && position[2] > radius_ + kFlying) {
      double nearest = std::numeric_limits<double>::infinity();
      for (Eigen::Index i = 0; i < view.tips.size(); i += 3) {
        nearest =
            std::min(nearest, std::hypot(view.tips[i] - position[0], view.tips[i + 1] - position[1],
                                         view.tips[i + 2] - position[2]));
      }
      flight.has_flown = nearest > radius_ + kFree;
    }
    if (flight.has_flown && !flight.has_landed && position[2] < radius_ + kDown) {
      flight.has_landed = true;
      flight.landing = {position[0], position[1]};
    }
    achieved[0] = flight.has_landed ? flight.landing[0] : position[0];
    achieved[1] = flight.has_landed ? flight.landing[1] : position[1];
  }

  // Whether the ball has left the fingers: then its first touch of the table counts.
  [[nodiscard]] std::vector<Entry> memory_entries() const override {
    return {{.name = "has_flown", .unit = "1", .low = {0.0}, .high = {1.0}}};
  }
  void show_memory(const View& /*view*/, const Episode& episode,
                   std::span<double> shown) const noexcept override {
    shown[0] = episode.memory.as<Flight>().has_flown ? 1.0 : 0.0;
  }

  // The distance, negated [m].
  [[nodiscard]] double reward(std::span<const double> achieved,
                              std::span<const double> desired) const noexcept override {
    return -std::hypot(achieved[0] - desired[0], achieved[1] - desired[1]);
  }

  [[nodiscard]] bool is_success(std::span<const double> achieved, std::span<const double> desired,
                                const Episode& episode) const noexcept override {
    constexpr double kHit = 0.1;
    return episode.memory.as<Flight>().has_landed && -reward(achieved, desired) <= kHit;
  }

  [[nodiscard]] bool has_ended(const View& /*view*/,
                               const Episode& episode) const noexcept override {
    return episode.memory.as<Flight>().has_landed;
  }

 private:
  double radius_;
};

}  // namespace

std::vector<TaskDescription> throw_tasks() {
  return {{.name = "throw",
           .options = throw_defaults(),
           .config_overrides = {R"(objects=[{"name": "ball", "type": "ball"}])", "boundary=false"},
           .make = [](const Workspace& robot) {
             const auto& objects = robot.kinematics->description().objects;
             return std::make_unique<Throw>(objects.front().size[0] / 2);
           }}};
}

}  // namespace trifinger::learning
