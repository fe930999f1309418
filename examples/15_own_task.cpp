// SPDX-License-Identifier: BSD-3-Clause
// A task of your own for many simulations at once: hold the middle of the three tips at a goal. The
// task says what a goal is, what is achieved, and how good that is. Everything else is the
// environment's.
#include <cstdlib>
#include <iostream>
#include <memory>
#include <random>
#include <vector>

#include "trifinger/learning/environment_batch.hpp"
#include "trifinger/learning/task.hpp"

using namespace trifinger::learning;

namespace {

using Goal = Eigen::Map<const Eigen::Vector3d>;

class Middle final : public Task {
 public:
  [[nodiscard]] Entry goal() const override {
    return {.name = "goal", .unit = "m", .low = {-0.05, -0.05, 0.08}, .high = {0.05, 0.05, 0.14}};
  }

  void draw_start(const Workspace& /*workspace*/, trifinger::Random& /*random*/,
                  Start& /*start*/) const noexcept override {
    // The usual position is a good start, and there is no object.
  }
  void draw_goal(const Workspace& /*workspace*/, trifinger::Random& random,
                 std::span<double> goal) const noexcept override {
    goal[0] = random.uniform(-0.05, 0.05);
    goal[1] = random.uniform(-0.05, 0.05);
    goal[2] = random.uniform(0.08, 0.14);
  }

  void achieve(const View& view, Episode& /*episode*/,
               std::span<double> achieved) const noexcept override {
    Eigen::Map<Eigen::Vector3d>(achieved.data()) = view.tips.reshaped(3, 3).rowwise().mean();
  }
  [[nodiscard]] double reward(std::span<const double> achieved,
                              std::span<const double> desired) const noexcept override {
    return -(Goal(achieved.data()) - Goal(desired.data())).norm();
  }
  [[nodiscard]] bool is_success(std::span<const double> achieved, std::span<const double> desired,
                                const Episode& /*episode*/) const noexcept override {
    return reward(achieved, desired) >= -0.02;
  }
};

}  // namespace

int main() {
  const EnvironmentOptions options{.action = ActionKind::kPositionChange, .duration = 2.0};
  add_task({.name = "middle", .options = options, .make = [](const Workspace&) {
              return std::make_unique<Middle>();
            }});

  constexpr int kSimulations = 16;
  trifinger::SimulationOptions simulation;
  simulation.description.objects.clear();
  EnvironmentBatch batch("middle", options, simulation, kSimulations);
  for (std::size_t i = 0; i < batch.size(); ++i) batch.seed(i, 1 + i);
  batch.reset();

  std::mt19937 random(1);
  std::uniform_real_distribution<float> uniform(-1.0F, 1.0F);
  std::vector<float> actions(batch.size() * batch.environment().num_joints());
  double total = 0.0;
  const std::int64_t steps = batch.environment().episode_actions();
  for (std::int64_t step = 0; step < steps; ++step) {
    for (float& action : actions) action = uniform(random);
    batch.step(actions);
    for (const double reward : batch.results().reward) total += reward;
  }
  const double distance = -total / static_cast<double>(steps * kSimulations);
  std::cout << kSimulations << " simulations of " << steps << " random actions: mean distance "
            << 1e3 * distance << " mm\n";
  return distance > 0.0 && distance < 0.3 ? EXIT_SUCCESS : EXIT_FAILURE;
}
