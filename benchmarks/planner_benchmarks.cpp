// SPDX-License-Identifier: BSD-3-Clause
#include <fmt/format.h>
#include <mujoco/mjbatch.h>
#include <mujoco/mujoco.h>

#include <algorithm>
#include <ctime>
#include <memory>
#include <numeric>
#include <utility>
#include <vector>

#include "harness.hpp"
#include "trifinger/base/error.hpp"
#include "trifinger/control/predictive_planner.hpp"

namespace trifinger::benchmarks {
namespace {

using namespace control;

// A start of a plan, and the plan before it.
struct Start {
  PlanningState state;
  KnotSpline commands;
};

PlannerOptions options() { return {.num_threads = 1}; }

// Turns and pushes the cube.
PlanningTask task(const PlanningModel& model) {
  Pose goal = PlanningModel::object_pose(model.object("cube"), model.initial_state().position);
  goal.position += Eigen::Vector3d(0.04, 0.03, 0.0);
  goal.orientation = rotation_from_vector(Eigen::Vector3d(0, 0, 1)) * goal.orientation;
  return {
      .terms = {{.kind = CostKind::kObjectPosition, .weight = 10, .goal = goal},
                {.kind = CostKind::kObjectOrientation, .weight = 1, .goal = goal},
                {.kind = CostKind::kTipObject, .weight = 2, .distance = 0.046},
                {.kind = CostKind::kTargetDistance, .weight = 0.1, .shape = CostShape::kSquare},
                {.kind = CostKind::kObjectVelocity, .weight = 0.7, .shape = CostShape::kSquare},
                {.kind = CostKind::kObjectRotation, .weight = 0.002, .shape = CostShape::kSquare}},
      .late_factor = 3.0};
}

// Processor time of this process [s]. Time that others get in between does not count; both sides
// of the comparison use one thread.
double processor_seconds() {
  timespec time{};
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &time);
  return static_cast<double>(time.tv_sec) + 1e-9 * static_cast<double>(time.tv_nsec);
}

// Starts on the way of the cube, from the first touch on.
std::vector<Start> make_starts(const RobotDescription& description, int count) {
  constexpr int kApproach = 8;
  constexpr Seconds kPeriod{0.06};
  PlanningModel model(description);
  PlanningState state = model.initial_state();
  PlanningTask push = task(model);
  PredictivePlanner planner(std::move(model), std::move(push), options());
  std::vector<Start> starts;
  for (int i = 0; i < kApproach + count; ++i) {
    const KnotSpline& commands = planner.plan(state).commands;
    if (i >= kApproach) starts.push_back({state, commands});
    PlanningState next = state;
    (void)planner.simulate(state, commands, kPeriod, next);
    state = next;
  }
  return starts;
}

// The same steps with MuJoCo's batches alone: the torques of each rollout, in pieces.
class Bare {
 public:
  static constexpr int kPiece = 10;  // [steps]

  Bare(const PlanningModel& model, int samples) : samples_(samples) {
    mjBatchConfig config;
    mjb_defaultConfig(&config);
    config.nthread = 1;
    batch_.reset(mjb_makeBatch(model.mujoco(), samples, &config, nullptr, 0));
    if (batch_ == nullptr) throw Error("MuJoCo cannot make the simulations");
  }

  // `torques` are those of `RolloutBatch`. Returns the processor time of the steps [s].
  double run(const PlanningState& start, const std::vector<double>& torques, int steps,
             int joints) {
    for (int i = 0; i < samples_; ++i) {
      std::fill_n(row(mjSTATE_WARMSTART, i), start.velocity.size(), 0.0);
      std::ranges::copy(start.position, row(mjSTATE_QPOS, i));
      std::ranges::copy(start.velocity, row(mjSTATE_QVEL, i));
    }
    double time = 0.0;
    for (int done = 0; done < steps; done += kPiece) {
      for (int i = 0; i < samples_; ++i) {
        const auto at =
            static_cast<std::size_t>(i * (steps + 1) + done) * static_cast<std::size_t>(joints);
        std::copy_n(torques.data() + at, joints, row(mjSTATE_CTRL, i));
      }
      const double begin = processor_seconds();
      mjb_step(batch_.get(), nullptr, 0, std::min(kPiece, steps - done), mjSTAGE_NONE);
      time += processor_seconds() - begin;
    }
    return time;
  }

 private:
  [[nodiscard]] double* row(int component, int simulation) {
    int size = 0;
    return mjb_stateComponent(batch_.get(), component, &size) +
           std::ptrdiff_t{simulation} * mjb_nstate(batch_.get());
  }

  int samples_;
  std::unique_ptr<mjBatch, decltype(&mjb_deleteBatch)> batch_{nullptr, &mjb_deleteBatch};
};

}  // namespace

std::vector<Row> planner(const Effort& effort) {
  const RobotDescription description{.finger_height = 0.3};
  const std::vector<Start> starts = make_starts(description, effort.rounds > 1 ? 20 : 3);
  PlanningModel model(description);
  PlanningModel same(description);
  PlanningTask push = task(model);
  // The same rollouts again, which also keeps their torques.
  std::vector<double> torques;
  PlanningTask recorded = push;
  recorded.batch_cost = [&](const RolloutBatch& batch, std::span<double>) {
    if (batch.num_rollouts > 1) torques.assign(batch.torques.begin(), batch.torques.end());
  };
  PredictivePlanner planner(std::move(model), push, options());
  PredictivePlanner recorder(std::move(same), recorded, options());
  const int samples = options().samples;
  const int steps = planner.num_steps();
  Bare bare(planner.model(), samples);

  Samples rollouts;
  const auto plan_all = [&] {
    double time = 0.0;
    for (const Start& start : starts) {
      planner.begin_with(start.commands);
      const double begin = processor_seconds();
      (void)planner.plan(start.state);
      time += processor_seconds() - begin;
    }
    // Each plan ends with a rollout of itself.
    const double count = static_cast<double>(starts.size()) * (samples + 1);
    rollouts.add(count / time);
    return count * steps / time;
  };
  const auto step_all = [&] {
    double time = 0.0;
    for (const Start& start : starts) {
      recorder.begin_with(start.commands);
      (void)recorder.plan(start.state);
      time += bare.run(start.state, torques, steps, planner.model().num_joints());
    }
    return static_cast<double>(starts.size()) * samples * steps / time;
  };
  const Paired paired = alternate(effort.rounds, plan_all, step_all);
  Row row = make_row("planner: simulated steps, one thread", "steps/s", paired,
                     "bare mjb_step, the same model, starts and torques", ">= 0.9x",
                     paired.ratio.median() >= 0.9);
  row.remark = fmt::format("{} samples of {} steps of {:g} ms", samples, steps,
                           1e3 * planner.model().time_step().count());
  return {row, make_row("planner: rollouts of 0.5 s", "rollouts/s per core", rollouts, ">= 1500",
                        rollouts.median() >= 1500.0)};
}

}  // namespace trifinger::benchmarks
