// SPDX-License-Identifier: BSD-3-Clause
// A robot from a file, D'Claw, beside the bare physics: the same torques in the same states.
#include <fmt/format.h>
#include <mujoco/mujoco.h>

#include <algorithm>
#include <chrono>
#include <cstddef>
#include <span>
#include <string>
#include <variant>
#include <vector>

#include "harness.hpp"
#include "trifinger/base/random.hpp"
#include "trifinger/learning/environment_batch.hpp"
#include "trifinger/sim/robot_config.hpp"
#include "trifinger/sim/simulation.hpp"

namespace trifinger::benchmarks {
namespace {

using namespace learning;

constexpr const char* kTask = "dclaw_turn_fixed";
constexpr double kLeast = 0.8;  // of bare steps

// Actions that vary slowly, a row for each simulation, the same in every call.
std::vector<std::vector<float>> wandering(std::size_t actions, std::size_t count) {
  Random random{.seed = 4};
  std::vector<std::vector<float>> all(actions, std::vector<float>(count));
  std::vector<double> numbers(count);
  for (std::vector<float>& action : all) {
    for (std::size_t i = 0; i < count; ++i) {
      numbers[i] = std::clamp(numbers[i] + 0.2 * random.normal(), -1.0, 1.0);
      action[i] = static_cast<float>(numbers[i]);
    }
  }
  return all;
}

// An episode of D'Claw in the physics alone.
class BareEpisode {
 public:
  // Finds the torques of an episode with these actions. `place` is that of its simulation in them.
  BareEpisode(const SimulationOptions& robot, const std::vector<std::vector<float>>& actions,
              std::size_t place)
      : model_(*robot.file->mujoco()) {
    const Simulator simulator(robot);
    const Environment environment(kTask, default_options(kTask), robot);
    const SceneModel::Data data = robot.file->make_data();
    Simulator::State state = simulator.make_state();
    Episode episode;
    const Start start = environment.begin(place, 0, episode);
    const std::size_t joints = simulator.num_joints();
    simulator.reset(std::span(start.position).first(joints), start.random, *data, state,
                    std::span(start.model_position).first(state.model_position.size()));
    begin_.assign(data->qpos, data->qpos + model_.nq);
    CountedAction action = hold_position(state.observation);
    CountedAppliedAction applied(joints);
    for (const std::vector<float>& numbers : actions) {
      CountedAction next = action;
      (void)environment.take_action(std::span(numbers).subspan(place * joints, joints), episode,
                                    next.torque, next.position);
      for (int k = 0; k < environment.options().steps_per_action; ++k) {
        if (k == 1) action = next;
        (void)simulator.step(action, model_, *data, state, applied);
        simulator.observe(*data, state);
        torques_.insert(torques_.end(), data->ctrl, data->ctrl + model_.nu);
      }
    }
  }

  // Does the steps of the episode again.
  void run(mjData& data) const {
    mj_resetData(&model_, &data);
    std::ranges::copy(begin_, data.qpos);
    for (auto torque = torques_.begin(); torque != torques_.end(); torque += model_.nu) {
      std::copy_n(torque, model_.nu, data.ctrl);
      mj_step(&model_, &data);
    }
  }

  [[nodiscard]] std::size_t steps() const noexcept {
    return torques_.size() / static_cast<std::size_t>(model_.nu);
  }

 private:
  const mjModel& model_;
  std::vector<double> begin_;
  std::vector<double> torques_;
};

double per_second(std::size_t steps, Clock::time_point begin) {
  return static_cast<double>(steps) / std::chrono::duration<double>(Clock::now() - begin).count();
}

Row row_of(const char* name, const Paired& paired) {
  return make_row(name, "steps/s", paired, "bare mj_step with the same torques",
                  fmt::format(">= {:.1f}x", kLeast), paired.ratio.median() >= kLeast);
}

}  // namespace

std::vector<Row> any_robot(const Effort& effort) {
  const SimulationOptions robot = load_robot_config("dclaw").simulation;
  const std::size_t joints = robot.limits->size();
  constexpr std::size_t kSimulations = 16;
  const auto actions = wandering(40, kSimulations * joints);
  std::vector<BareEpisode> bare;
  bare.reserve(kSimulations);
  for (std::size_t i = 0; i < kSimulations; ++i) bare.emplace_back(robot, actions, i);
  const SceneModel::Data data = robot.file->make_data();
  const std::size_t steps = bare.front().steps();
  const auto bare_steps = [&](std::size_t episodes) {
    const auto begin = Clock::now();
    for (std::size_t i = 0; i < episodes; ++i) bare[i].run(*data);
    return per_second(episodes * steps, begin);
  };

  EnvironmentBatch batch(kTask, default_options(kTask), robot, kSimulations, 1);
  const auto environments = [&] {
    for (std::size_t i = 0; i < kSimulations; ++i) batch.seed(i, i);
    batch.reset();
    const auto begin = Clock::now();
    for (const std::vector<float>& action : actions) batch.step(action);
    return per_second(kSimulations * steps, begin);
  };
  const Simulation simulation(robot, {.history = 1024});
  const Environment environment(kTask, default_options(kTask), robot);
  const auto session = [&] {
    simulation.robot().reset();
    UntypedFrontend frontend = simulation.connect_untyped();
    Episode episode;
    (void)environment.begin(0, 0, episode);
    CountedAction action(joints);
    std::vector<std::byte> element(simulation.robot().description().action.size());
    std::vector<std::byte> observation(simulation.robot().description().observation.size());
    const auto begin = Clock::now();
    for (const std::vector<float>& numbers : actions) {
      (void)environment.take_action(std::span(numbers).first(joints), episode, action.torque,
                                    action.position);
      write_element(action, element.data());
      for (int k = 0; k < environment.options().steps_per_action; ++k) {
        const TimeIndex t = frontend.append_desired_action(element.data(), kForever);
        frontend.get(Series::kObservation, t, observation.data(), kForever);
      }
    }
    const double speed = per_second(steps, begin);
    frontend.finish(kForever);
    return speed;
  };
  return {row_of("D'Claw from its file, one robot with a session, 1 step per action",
                 alternate(effort.rounds, session, [&] { return bare_steps(1); })),
          row_of("D'Claw from its file, vector environment of 16 x turn, 1 thread",
                 alternate(effort.rounds, environments, [&] { return bare_steps(kSimulations); }))};
}

}  // namespace trifinger::benchmarks
