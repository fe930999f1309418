// SPDX-License-Identifier: BSD-3-Clause
#include <fmt/format.h>
#include <mujoco/mjbatch.h>
#include <mujoco/mujoco.h>

#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <cstddef>
#include <memory>
#include <span>
#include <vector>

#include "harness.hpp"
#include "support/allocation_counter.hpp"
#include "trifinger/base/random.hpp"
#include "trifinger/learning/environment.hpp"
#include "trifinger/learning/environment_batch.hpp"
#include "trifinger/learning/policy.hpp"
#include "trifinger/sim/simulation.hpp"

namespace trifinger::benchmarks {
namespace {

using namespace learning;

// Width of the layers. Inputs: positions and velocities of nine joints, goals of three tips and the
// last action. Outputs: nine torques. The widths between are those of Stable-Baselines3 for SAC.
constexpr std::array<Eigen::Index, 4> kWidths{36, 256, 256, 9};
constexpr int kCalls = 2000;

Network network() {
  Random random{.seed = 1};
  const auto numbers = [&](Eigen::Index rows, Eigen::Index columns) {
    const double deviation = std::sqrt(2.0 / static_cast<double>(columns));
    return Eigen::MatrixXf(Eigen::MatrixXf::NullaryExpr(rows, columns, [&](Eigen::Index) {
      return static_cast<float>(deviation * random.normal());
    }));
  };
  Network network;
  for (std::size_t i = 0; i + 1 < kWidths.size(); ++i) {
    network.layers.push_back(
        {.weights = numbers(kWidths[i + 1], kWidths[i]),
         .bias = numbers(kWidths[i + 1], 1),
         .activation = i + 2 < kWidths.size() ? Activation::kRelu : Activation::kTanh});
  }
  const Eigen::VectorXd ones = Eigen::VectorXd::Ones(kWidths[0]);
  network.normalization = {.mean = 0.1 * ones, .variance = 2.0 * ones};
  const Eigen::VectorXd torque = Eigen::VectorXd::Constant(kWidths.back(), 0.36);  // [Nm]
  network.bounds = {.low = -torque, .high = torque};
  return network;
}

Row policy_row(const Effort& effort, Precision precision) {
  const Network made_of = network();
  Policy policy(made_of, precision);
  Random random{.seed = 2};
  std::vector<double> observation(policy.num_inputs());
  std::vector<double> action(policy.num_outputs());
  std::size_t allocations = 0;
  double sum = 0;  // Used below, so that the compiler cannot remove the work.
  bool is_done = true;
  const auto inference = [&] {
    Samples times;
    for (int i = 0; i < kCalls; ++i) {
      for (double& number : observation) number = random.normal();
      const test::AllocationCounter counter;
      const auto begin = Clock::now();
      is_done = policy.evaluate(observation, action) && is_done;
      const auto end = Clock::now();
      allocations += counter.count();
      times.add(microseconds(end - begin));
      sum += action[0];
    }
    return times.median();
  };
  // Without double precision, activations, or any other work on the numbers.
  std::array<Eigen::VectorXf, kWidths.size()> values;
  for (std::size_t i = 0; i < kWidths.size(); ++i) values[i].setZero(kWidths[i]);
  const auto products = [&] {
    Samples times;
    for (int i = 0; i < kCalls; ++i) {
      for (float& number : values[0]) number = static_cast<float>(random.normal());
      const auto begin = Clock::now();
      for (std::size_t k = 0; k < made_of.layers.size(); ++k) {
        values[k + 1].noalias() = made_of.layers[k].weights * values[k];
      }
      times.add(microseconds(Clock::now() - begin));
      sum += static_cast<double>(values.back()[0]);
    }
    return times.median();
  };
  const Paired paired = alternate(effort.rounds, inference, products);
  const bool is_single = precision == Precision::kSingle;
  const bool is_fast = is_single ? paired.ratio.median() <= 1.6 : paired.measure.median() <= 20.0;
  Row row = make_row(fmt::format("C++ policy inference, 2 x 256 MLP, {} precision: p50",
                                 is_single ? "single" : "double"),
                     "us", paired, "bare Eigen products of the same matrices, single precision",
                     is_single ? "<= 1.6x, 0 allocations" : "<= 20 us, 0 allocations",
                     is_fast && allocations == 0 && is_done && std::isfinite(sum));
  row.remark = fmt::format("{} allocations", allocations);
  return row;
}

// ---- environments ----

constexpr int kSimulations = 64;
constexpr int kActions = 100;  // One episode.

SimulationOptions without_objects() {
  SimulationOptions options;
  options.description.objects.clear();
  return options;
}

// Returns actions that vary slowly, for each simulation.
std::vector<std::vector<float>> wandering(std::size_t count) {
  Random random{.seed = 4};
  std::vector<std::vector<float>> actions(kActions, std::vector<float>(count));
  std::vector<double> numbers(count);
  for (std::vector<float>& action : actions) {
    for (std::size_t i = 0; i < count; ++i) {
      numbers[i] = std::clamp(numbers[i] + 0.2 * random.normal(), -1.0, 1.0);
      action[i] = static_cast<float>(numbers[i]);
    }
  }
  return actions;
}

// Does the same steps without an environment: batches of MuJoCo, with the checks and the motors in
// each, and nothing else.
class DirectSteps {
 public:
  explicit DirectSteps(int threads)
      : environment_("reach", learning::default_options("reach"), model_.description()),
        runs_(kSimulations) {
    mjBatchConfig config;
    mjb_defaultConfig(&config);
    config.nthread = threads;
    batch_.reset(mjb_makeBatch(model_.mujoco(), kSimulations, &config, nullptr, 0));
  }

  void reset() {
    mjb_reset(batch_.get(), nullptr, 0, nullptr, mjSTAGE_NONE);
    int size = 0;
    double* const position = mjb_stateComponent(batch_.get(), mjSTATE_QPOS, &size);
    for (std::size_t i = 0; i < kSimulations; ++i) {
      Run& run = runs_[i];
      const learning::Start start = environment_.begin(i, 0, run.episode);
      std::copy_n(start.position.begin(), TriFinger::kJoints,
                  position + static_cast<std::size_t>(mjb_nstate(batch_.get())) * i);
      run.safety = {};
      std::copy_n(start.position.begin(), TriFinger::kJoints, run.action.position.begin());
    }
  }

  void step(const std::vector<float>& actions) {
    actions_ = actions;
    mjb_apply(batch_.get(), nullptr, 0, &DirectSteps::step_one, this, 1);
  }

  void step_bare() { mjb_step(batch_.get(), nullptr, 0, kStepsPerAction, mjSTAGE_NONE); }

 private:
  static constexpr int kStepsPerAction = 20;

  struct Run {
    learning::Episode episode;
    SafetyState<TriFinger::kJoints> safety;
    TriFinger::Action action;
  };
  struct DeleteBatch {
    void operator()(mjBatch* batch) const noexcept { mjb_deleteBatch(batch); }
  };

  static void step_one(const mjModel* model, mjData* data, int index, void* self) {
    auto& all = *static_cast<DirectSteps*>(self);
    const auto i = static_cast<std::size_t>(index);
    Run& run = all.runs_[i];
    TriFinger::Observation observation;
    TriFinger::AppliedAction applied;
    for (int k = 0; k < kStepsPerAction; ++k) {
      if (k == 1) {
        (void)all.environment_.take_action(all.actions_.subspan(9 * i, 9), run.episode,
                                           run.action.torque, run.action.position);
      }
      std::copy_n(data->qpos, TriFinger::kJoints, observation.position.begin());
      std::copy_n(data->qvel, TriFinger::kJoints, observation.velocity.begin());
      (void)all.chain_.apply(run.action, observation, std::chrono::milliseconds(1), run.safety,
                             applied);
      for (std::size_t joint = 0; joint < TriFinger::kJoints; ++joint) {
        data->ctrl[joint] = available_torque(all.motors_, applied.torque[joint], data->qvel[joint]);
      }
      mj_step(model, data);
    }
  }

  RobotModel model_{without_objects().description};
  learning::Environment environment_;
  SafetyChain<TriFinger> chain_{
      limits_of<TriFinger::kJoints>(default_limits(model_.description()))};
  ActuatorParameters motors_{actuator(model_.description())};
  std::vector<Run> runs_;
  std::unique_ptr<mjBatch, DeleteBatch> batch_;
  std::span<const float> actions_;
};

template <class Step>
double steps_per_second(int actions, const Step& step) {
  const auto begin = Clock::now();
  for (int i = 0; i < actions; ++i) step(static_cast<std::size_t>(i));
  const double time = std::chrono::duration<double>(Clock::now() - begin).count();
  return static_cast<double>(kSimulations) * actions / time;
}

Row vector_row(const Effort& effort, int threads) {
  learning::EnvironmentBatch batch("reach", learning::default_options("reach"), without_objects(),
                                   kSimulations, threads);
  for (std::size_t i = 0; i < kSimulations; ++i) batch.seed(i, i);
  DirectSteps direct(threads);
  const auto actions = wandering(std::size_t{kSimulations} * TriFinger::kJoints);
  const int count = static_cast<int>(kActions * effort.share);
  Samples bare_ratios;
  double environments = 0.0;
  const auto environment = [&] {
    for (std::size_t i = 0; i < kSimulations; ++i) batch.seed(i, i);
    batch.reset();
    environments = steps_per_second(count, [&](std::size_t i) { batch.step(actions[i]); });
    return environments;
  };
  const auto direct_steps = [&] {
    direct.reset();
    const double steps = steps_per_second(count, [&](std::size_t i) { direct.step(actions[i]); });
    direct.reset();
    bare_ratios.add(environments /
                    steps_per_second(count, [&](std::size_t) { direct.step_bare(); }));
    return steps;
  };
  const Paired paired = alternate(effort.rounds, environment, direct_steps);
  Row row =
      make_row(fmt::format("vector environment, {} x reach at 50 Hz, {} thread{}", kSimulations,
                           threads, threads == 1 ? "" : "s"),
               "actions/s", paired, "the same steps with safety chain and motors alone, in C++",
               ">= 0.9x", paired.ratio.median() >= 0.9);
  row.remark = fmt::format("20 steps per action; {:.2f}x of bare mjb_step, whose fingers fall",
                           bare_ratios.median());
  return row;
}

}  // namespace

std::vector<Row> policy(const Effort& effort) { return {policy_row(effort, Precision::kDouble)}; }
std::vector<Row> single_precision_policy(const Effort& effort) {
  return {policy_row(effort, Precision::kSingle)};
}

std::vector<Row> vector_environment_1_thread(const Effort& effort) {
  return {vector_row(effort, 1)};
}
std::vector<Row> vector_environment_2_threads(const Effort& effort) {
  return {vector_row(effort, 2)};
}

// Does what `trifinger.environments.Environment` does, in C++.
std::vector<Row> environment(const Effort& effort) {
  const learning::Environment task("reach", learning::default_options("reach"),
                                   without_objects().description);
  const Simulation simulation(without_objects(), {.history = 1024});
  const auto actions = wandering(TriFinger::kJoints);
  std::vector<float> observation(task.observation_size());
  std::vector<double> achieved(task.goal_size());
  std::vector<double> desired(task.goal_size());
  std::array<TriFinger::Action, 20> burst{};
  Samples samples;
  double sum = 0.0;
  for (int round = 0; round < effort.rounds; ++round) {
    report_progress(round, effort.rounds);
    learning::Episode episode;
    const learning::Start start = task.begin(0, 0, episode);
    JointVector<TriFinger::kJoints> position{};
    std::copy_n(start.position.begin(), position.size(), position.begin());
    simulation.robot().reset(position, start.random);
    auto robot = simulation.connect();
    TimeIndex t = robot.append_desired_action(hold_position(robot.latest_observation()));
    const auto begin = Clock::now();
    for (const std::vector<float>& action : actions) {
      (void)task.take_action(action, episode, burst[0].torque, burst[0].position);
      burst.fill(burst[0]);
      t = robot.append_desired_actions(burst);
      const auto y = robot.get_observation(t);
      sum += task.observe({.position = y.position, .velocity = y.velocity}, episode, observation,
                          achieved, desired)
                 .reward;
    }
    samples.add(kActions / std::chrono::duration<double>(Clock::now() - begin).count());
    robot.finish();
  }
  return {
      make_row("environment, reach at 50 Hz, C++", "actions/s", samples, {}, std::isfinite(sum))};
}

}  // namespace trifinger::benchmarks
