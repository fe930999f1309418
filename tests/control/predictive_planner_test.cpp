// SPDX-License-Identifier: BSD-3-Clause
#include "trifinger/control/predictive_planner.hpp"

#include <gtest/gtest.h>
#include <mujoco/mjbatch.h>
#include <mujoco/mujoco.h>

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numeric>
#include <string>

#include "random_grasps.hpp"
#include "support/allocation_counter.hpp"
#include "trifinger/base/error.hpp"

namespace trifinger::control {
namespace {

using test::Random;
using trifinger::test::AllocationCounter;
using Data = std::unique_ptr<mjData, decltype(&mj_deleteData)>;

constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr std::array kMethods{PlanningMethod::kPredictiveSampling, PlanningMethod::kCrossEntropy,
                              PlanningMethod::kPathIntegral};
constexpr std::array kKinds{SplineKind::kConstant, SplineKind::kLinear, SplineKind::kCubic};

// Pushes the cube aside.
PlanningTask push(const PlanningModel& model) {
  const int cube = 0;
  const Pose start =
      PlanningModel::object_pose(model.object("cube"), model.initial_state().position);
  Pose goal = start;
  goal.position += Eigen::Vector3d(0.03, 0.02, 0.0);
  goal.orientation = rotation_from_vector(Eigen::Vector3d(0, 0, 0.5)) * start.orientation;
  return {
      .terms = {{.kind = CostKind::kObjectPosition,
                 .weight = 10,
                 .end_weight = 1,
                 .index = cube,
                 .goal = goal},
                {.kind = CostKind::kObjectOrientation, .weight = 1, .index = cube, .goal = goal},
                {.kind = CostKind::kTipObject, .weight = 2, .index = cube, .distance = 0.046},
                {.kind = CostKind::kEffort, .weight = 0.01, .shape = CostShape::kSquare}},
      .late_share = 0.2,
      .late_factor = 3.0};
}

PlannerOptions small_options() {
  return {.samples = 12, .horizon = Seconds(0.12), .num_threads = 1, .seed = 1};
}

bool equal(std::span<const double> one, std::span<const double> other) {
  return std::ranges::equal(one, other);
}

// Simulates commands with `mj_step` alone, and adds up the cost of `push` anew.
double cost_of_push(const PlanningModel& model, const PlannerOptions& options,
                    const PlanningState& start, const KnotSpline& commands,
                    const PlanningTask& task) {
  const mjModel& mujoco = *model.mujoco();
  const Data data(mj_makeData(&mujoco), &mj_deleteData);
  std::ranges::copy(start.position, data->qpos);
  std::ranges::copy(start.velocity, data->qvel);
  const ObjectAddress& cube = model.object("cube");
  const int steps = static_cast<int>(std::lround(options.horizon / model.time_step()));
  const int late = static_cast<int>(std::lround(task.late_share * steps));
  double sum = 0;
  for (int k = 0; k <= steps; ++k) {
    const Data view(mj_makeData(&mujoco), &mj_deleteData);
    mju_copy(view->qpos, data->qpos, static_cast<int>(mujoco.nq));
    mj_forward(&mujoco, view.get());
    const Pose pose = PlanningModel::object_pose(
        cube, std::span(view->qpos, static_cast<std::size_t>(mujoco.nq)));
    const double off = (pose.position - task.terms[0].goal.position).norm();
    if (k == steps) return sum + off;
    std::vector<double> target(9);
    commands.at(start.time + k * model.time_step(), target);
    double effort = 0;
    for (std::size_t i = 0; i < 9; ++i) {
      const double most = model.joints()[i].max_torque;
      const double spring = options.kp * (target[i] - data->qpos[i]) - options.kd * data->qvel[i];
      data->ctrl[i] =
          std::clamp(options.command == PlannedCommand::kTorque ? target[i] : spring, -most, most);
      effort += data->ctrl[i] * data->ctrl[i];
    }
    double far = 0;
    for (const int site : model.tip_sites())
      far += std::max(0.0,
                      (Eigen::Vector3d(view->site_xpos + 3 * site) - pose.position).norm() - 0.046);
    const double angle = rotation_error(task.terms[1].goal.orientation, pose.orientation).norm();
    sum += mujoco.opt.timestep * (k >= steps - late ? 3.0 : 1.0) *
           (10 * off + angle + 2 * far + 0.01 * effort);
    mj_step(&mujoco, data.get());
  }
  return sum;
}

TEST(PredictivePlanner, PredictsTheCostOfAnIndependentSimulation) {
  for (const SplineKind kind : kKinds) {
    for (const PlannedCommand command : {PlannedCommand::kPosition, PlannedCommand::kTorque}) {
      PlanningModel model({});
      const PlanningTask task = push(model);
      PlannerOptions options = small_options();
      options.spline = kind;
      options.command = command;
      PlanningState start = model.initial_state();
      start.time = Seconds(7.5);
      start.velocity[1] = 0.3;
      PredictivePlanner planner(std::move(model), task, options);
      const Plan& plan = planner.plan(start);
      ASSERT_LT(plan.cost, kInfinity);
      EXPECT_EQ(plan.commands.begin(), start.time);
      EXPECT_NEAR(plan.cost, cost_of_push(planner.model(), options, start, plan.commands, task),
                  1e-9 * plan.cost);
      // Each rollout has the cost of its own knots.
      KnotSpline commands = plan.commands;
      std::ranges::copy(planner.knots_of(3), commands.values().begin());
      EXPECT_NEAR(planner.costs()[3], cost_of_push(planner.model(), options, start, commands, task),
                  1e-9 * plan.cost);
    }
  }
}

TEST(PredictivePlanner, PredictsTheStatesThatSimulateFinds) {
  PlanningModel model({});
  const PlanningTask task = push(model);
  const PlanningState start = model.initial_state();
  PredictivePlanner planner(std::move(model), task, small_options());
  const Plan plan = planner.plan(start);
  PlanningState end = start;
  const double cost = planner.simulate(start, plan.commands, Seconds(small_options().horizon), end);
  EXPECT_DOUBLE_EQ(cost, plan.cost);
  const std::span states(plan.states.positions);
  EXPECT_EQ(plan.states.count, static_cast<std::size_t>(planner.num_steps()) + 1);
  EXPECT_TRUE(equal(states.first(start.position.size()), start.position));
  const std::span last = states.last(end.position.size());
  for (std::size_t i = 0; i < last.size(); ++i) EXPECT_NEAR(last[i], end.position[i], 1e-12);
  // Nothing moves in no time, and times between two steps are possible.
  (void)planner.simulate(start, plan.commands, Seconds(0), end);
  EXPECT_TRUE(equal(end.position, start.position));
  (void)planner.simulate(start, plan.commands, Seconds(0.0155), end);
  EXPECT_DOUBLE_EQ(end.time.count(), 0.0155);
}

TEST(PredictivePlanner, PredictiveSamplingNeverGetsWorse) {
  PlanningModel model({});
  const PlanningTask task = push(model);
  const PlanningState start = model.initial_state();
  PlannerOptions options = small_options();
  options.method = PlanningMethod::kPredictiveSampling;
  PredictivePlanner planner(std::move(model), task, options);
  double least = planner.plan(start).cost;
  const double first = least;
  for (int i = 0; i < 10; ++i) {
    const Plan& plan = planner.plan(start);
    EXPECT_EQ(plan.previous_cost, least);
    EXPECT_LE(plan.cost, least);
    EXPECT_EQ(plan.cost, plan.least_cost);
    least = plan.cost;
  }
  EXPECT_LT(least, 0.97 * first);
}

TEST(PredictivePlanner, FindsTheSameWithAnyNumberOfThreads) {
  for (const PlanningMethod method : kMethods) {
    std::vector<Plan> plans;
    for (const int threads : {1, 3}) {
      PlanningModel model({});
      const PlanningTask task = push(model);
      PlannerOptions options = small_options();
      options.method = method;
      options.rounds = 2;
      options.num_threads = threads;
      PlanningState start = model.initial_state();
      PredictivePlanner planner(std::move(model), task, options);
      EXPECT_EQ(planner.num_threads(), threads);
      for (int i = 0; i < 3; ++i) {
        (void)planner.plan(start);
        start.time += Seconds(0.02);
      }
      plans.push_back(planner.newest());
    }
    EXPECT_TRUE(equal(plans[0].commands.values(), plans[1].commands.values()));
    EXPECT_TRUE(equal(plans[0].states.positions, plans[1].states.positions));
    EXPECT_EQ(plans[0].cost, plans[1].cost);
    EXPECT_EQ(plans[0].median_cost, plans[1].median_cost);
  }
}

TEST(PredictivePlanner, OtherSeedsFindOtherPlans) {
  std::vector<double> costs;
  for (const std::uint64_t seed : {1U, 2U}) {
    PlanningModel model({});
    const PlanningTask task = push(model);
    PlannerOptions options = small_options();
    options.seed = seed;
    const PlanningState start = model.initial_state();
    PredictivePlanner planner(std::move(model), task, options);
    costs.push_back(planner.plan(start).cost);
  }
  EXPECT_NE(costs[0], costs[1]);
}

// Masses on rails without friction or gravity: its steps are linear.
class Rails {
 public:
  static constexpr int kSteps = 20;
  static constexpr double kStep = 0.05;
  static constexpr int kKnots = 5;
  static constexpr double kMass = 2.0;

  [[nodiscard]] static PlanningModel model() {
    const std::string text = R"(<mujoco><option timestep="0.05" gravity="0 0 0"/><worldbody>
      <body><joint name="x" type="slide" axis="1 0 0"/><geom size=".1" mass="2"/></body>
      <body><joint name="y" type="slide" axis="0 1 0"/><geom size=".1" mass="2" contype="0"
       conaffinity="0"/></body></worldbody><actuator><motor joint="x"/><motor joint="y"/></actuator>
      </mujoco>)";
    char error[200] = "";
    const std::unique_ptr<mjSpec, decltype(&mj_deleteSpec)> spec(
        mj_parseXMLString(text.c_str(), nullptr, error, sizeof(error)), &mj_deleteSpec);
    const SceneModel::Compiled compiled(mj_compile(spec.get(), nullptr));
    const std::array joints{PlannedJoint{-1e3, 1e3, 1e3}, PlannedJoint{-1e3, 1e3, 1e3}};
    return {*compiled, joints};
  }

  [[nodiscard]] static PlanningTask task() {
    return {.terms = {{.kind = CostKind::kJointPosition,
                       .weight = 1,
                       .end_weight = 4,
                       .shape = CostShape::kSquare,
                       .joints = {1.0, -2.0}},
                      {.kind = CostKind::kJointVelocity,
                       .weight = 0,
                       .end_weight = 2,
                       .shape = CostShape::kSquare},
                      {.kind = CostKind::kEffort, .weight = 0.02, .shape = CostShape::kSquare}}};
  }

  // The cost of constant forces between knots, from equations of motion.
  [[nodiscard]] static double cost(const Eigen::VectorXd& knots) {
    const Eigen::Vector2d goal(1, -2);
    Eigen::Vector2d position(0, 0);
    Eigen::Vector2d velocity(0.5, 0);
    double sum = 0;
    for (int k = 0; k < kSteps; ++k) {
      const Eigen::Vector2d force = knots.segment<2>(2 * (k / (kSteps / kKnots)));
      sum += kStep * ((position - goal).squaredNorm() + 0.02 * force.squaredNorm());
      velocity += kStep / kMass * force;
      position += kStep * velocity;
    }
    return sum + 4 * (position - goal).squaredNorm() + 2 * velocity.squaredNorm();
  }

  // The least cost of all: the cost is a quadratic function, so differences give it exactly.
  [[nodiscard]] static double least_cost() {
    constexpr int kSize = 2 * kKnots;
    const auto unit = [](int i) { return Eigen::VectorXd(Eigen::VectorXd::Unit(kSize, i)); };
    const double zero = cost(Eigen::VectorXd::Zero(kSize));
    Eigen::MatrixXd hessian(kSize, kSize);
    Eigen::VectorXd gradient(kSize);
    for (int i = 0; i < kSize; ++i) {
      gradient[i] = (cost(unit(i)) - cost(-unit(i))) / 2;
      for (int j = 0; j < kSize; ++j)
        hessian(i, j) = cost(unit(i) + unit(j)) - cost(unit(i)) - cost(unit(j)) + zero;
    }
    return cost(-hessian.ldlt().solve(gradient));
  }

  [[nodiscard]] static PlannerOptions options(PlanningMethod method) {
    return {.method = method,
            .samples = 64,
            .rounds = 3,
            .horizon = Seconds(kSteps * kStep),
            .knots = kKnots,
            .spline = SplineKind::kConstant,
            .command = PlannedCommand::kTorque,
            .least_sigma = 0.02,
            .most_sigma = 10.0,
            .num_threads = 1};
  }

  [[nodiscard]] static PlanningState start(const PlanningModel& model) {
    PlanningState state = model.initial_state();
    state.velocity[0] = 0.5;
    return state;
  }
};

TEST(PredictivePlanner, ComesCloseToTheKnownOptimumOfALinearSystem) {
  const double least = Rails::least_cost();
  ASSERT_GT(least, 0);
  for (const PlanningMethod method : kMethods) {
    PlanningModel model = Rails::model();
    const PlanningState start = Rails::start(model);
    PlannerOptions options = Rails::options(method);
    options.rounds = 100;
    PredictivePlanner planner(std::move(model), Rails::task(), options);
    const double first = planner.plan(start).previous_cost;
    const double last = planner.plan(start).cost;
    EXPECT_GE(last, least * (1 - 1e-9));
    EXPECT_LT(last - least, 0.01 * (first - least)) << static_cast<int>(method);
  }
}

TEST(PredictivePlanner, MovesThePreviousPlanInTime) {
  PlanningModel model = Rails::model();
  PlanningState start = Rails::start(model);
  PlannerOptions options = Rails::options(PlanningMethod::kPredictiveSampling);
  options.samples = 1;  // the previous plan alone
  PredictivePlanner planner(std::move(model), Rails::task(), options);
  KnotSpline given(SplineKind::kConstant, Rails::kKnots, 2, Seconds(0.2), start.time);
  std::iota(given.values().begin(), given.values().end(), 1.0);
  planner.begin_with(given);
  EXPECT_TRUE(equal(planner.plan(start).commands.values(), given.values()));
  start.time += Seconds(0.4 + 1e-9);
  const Plan& plan = planner.plan(start);
  EXPECT_EQ(plan.commands.begin(), start.time);
  for (int i = 0; i < Rails::kKnots; ++i)
    EXPECT_TRUE(equal(plan.commands.knot(i), given.knot(std::min(i + 2, Rails::kKnots - 1))));
  planner.restart();
  for (const double value : planner.plan(start).commands.values()) EXPECT_EQ(value, 0.0);
}

TEST(PredictivePlanner, BeginsWhereTheJointsAre) {
  PlanningModel model({});
  PlanningState start = model.initial_state();
  PlannerOptions options = small_options();
  options.samples = 1;
  PlanningTask task = push(model);
  PredictivePlanner planner(std::move(model), std::move(task), options);
  start.position[4] += 0.1;
  const Plan& plan = planner.plan(start);
  for (int i = 0; i < plan.commands.num_knots(); ++i)
    EXPECT_TRUE(equal(plan.commands.knot(i), std::span(start.position).first(9)));
}

TEST(PredictivePlanner, ChangesOneFingerOrAllKnotsEquallyIfToldTo) {
  PlanningModel model({});
  const PlanningTask task = push(model);
  const PlanningState start = model.initial_state();
  PlannerOptions options = small_options();
  options.one_finger_share = 1.0;
  options.constant_share = 1.0;
  options.method = PlanningMethod::kPredictiveSampling;
  PredictivePlanner planner(std::move(model), task, options);
  (void)planner.plan(start);
  std::array<int, 3> changes{};
  const std::span before = planner.knots_of(0);
  for (int i = 1; i < options.samples; ++i) {
    const std::span knots = planner.knots_of(i);
    int moved = 0;
    for (std::size_t finger = 0; finger < 3; ++finger) {
      const bool has_moved = knots[3 * finger] != before[3 * finger];
      moved += has_moved ? 1 : 0;
      changes[finger] += has_moved ? 1 : 0;
    }
    EXPECT_EQ(moved, 1);
    for (std::size_t k = 9; k < knots.size(); ++k) EXPECT_EQ(knots[k], knots[k - 9]);
  }
  for (const int count : changes) EXPECT_GT(count, 0);
}

TEST(PredictivePlanner, StaysWithinTheRangesOfTheJoints) {
  PlanningModel model({});
  const PlanningTask task = push(model);
  const PlanningState start = model.initial_state();
  PlannerOptions options = small_options();
  options.least_sigma = options.most_sigma = 5.0;
  PredictivePlanner planner(std::move(model), task, options);
  (void)planner.plan(start);
  bool is_at_limit = false;
  for (int i = 0; i < options.samples; ++i) {
    const std::span knots = planner.knots_of(i);
    for (std::size_t k = 0; k < knots.size(); ++k) {
      const PlannedJoint& joint = planner.model().joints()[k % 9];
      EXPECT_GE(knots[k], joint.lower);
      EXPECT_LE(knots[k], joint.upper);
      is_at_limit = is_at_limit || knots[k] == joint.upper;
    }
  }
  EXPECT_TRUE(is_at_limit);
}

TEST(PredictivePlanner, MasksRolloutsWhoseCostIsNotFinite) {
  for (const PlanningMethod method : kMethods) {
    PlanningModel model = Rails::model();
    const PlanningState start = Rails::start(model);
    PlanningTask task = Rails::task();
    // Nobody knows what is there; the goal is on the other side.
    task.cost = [](const CostInput& input) {
      return input.data.qpos[1] > 0.2 ? std::nan("") : 0.0;
    };
    PredictivePlanner planner(std::move(model), task, Rails::options(method));
    const Plan& plan = planner.plan(start);
    EXPECT_LT(plan.cost, kInfinity);
    int masked = 0;
    for (std::size_t i = 0; i < planner.costs().size(); ++i) {
      if (std::isfinite(planner.costs()[i])) continue;
      ++masked;
      EXPECT_EQ(planner.costs()[i], kInfinity);
      EXPECT_EQ(planner.weights()[i], 0.0);
    }
    EXPECT_EQ(plan.num_masked, masked);
    EXPECT_NEAR(std::accumulate(planner.weights().begin(), planner.weights().end(), 0.0), 1.0,
                1e-12);
  }
}

TEST(PredictivePlanner, MasksRolloutsThatDiverge) {
  PlanningModel model = Rails::model();
  model.mujoco()->opt.gravity[0] = 1e300;
  const PlanningState start = Rails::start(model);
  PlannerOptions options = Rails::options(PlanningMethod::kPathIntegral);
  PredictivePlanner planner(std::move(model), Rails::task(), options);
  const Plan& plan = planner.plan(start);
  EXPECT_EQ(plan.cost, kInfinity);
  EXPECT_EQ(plan.num_masked, options.samples);
  // The plan stays what it was.
  for (const double value : plan.commands.values()) EXPECT_EQ(value, 0.0);
}

TEST(PredictivePlanner, CostsOfTermsFunctionsAndBatchesAreTheSame) {
  std::vector<double> costs;
  for (const int way : {0, 1, 2}) {
    PlanningModel model = Rails::model();
    const PlanningState start = Rails::start(model);
    PlanningTask task = Rails::task();
    task.terms.erase(task.terms.begin() + 1);
    if (way == 1) {
      task.terms.clear();
      task.cost = [](const CostInput& input) {
        const double off =
            std::pow(input.data.qpos[0] - 1, 2) + std::pow(input.data.qpos[1] + 2, 2);
        const double effort = std::pow(input.data.ctrl[0], 2) + std::pow(input.data.ctrl[1], 2);
        return input.is_end ? 4 * off : off + 0.02 * effort;
      };
    } else if (way == 2) {
      task.terms.clear();
      task.batch_cost = [](const RolloutBatch& batch, std::span<double> sums) {
        ASSERT_EQ(static_cast<std::size_t>(batch.num_rollouts), sums.size());
        for (int i = 0; i < batch.num_rollouts; ++i) {
          for (int k = 0; k < batch.num_states; ++k) {
            const auto at = 2 * static_cast<std::size_t>(i * batch.num_states + k);
            const double off =
                std::pow(batch.positions[at] - 1, 2) + std::pow(batch.positions[at + 1] + 2, 2);
            const double effort =
                std::pow(batch.torques[at], 2) + std::pow(batch.torques[at + 1], 2);
            const bool is_end = k + 1 == batch.num_states;
            sums[static_cast<std::size_t>(i)] +=
                is_end ? 4 * off : batch.time_step.count() * (off + 0.02 * effort);
          }
        }
      };
    }
    PredictivePlanner planner(std::move(model), task,
                              Rails::options(PlanningMethod::kPathIntegral));
    costs.push_back(planner.plan(start).cost);
    EXPECT_EQ(planner.newest().states.positions.size(), 2U * (Rails::kSteps + 1));
  }
  EXPECT_NEAR(costs[0], costs[1], 1e-12 * costs[0]);
  EXPECT_NEAR(costs[0], costs[2], 1e-12 * costs[0]);
}

// What MuJoCo's batches allocate for the calls of one plan and one `simulate`.
std::size_t allocations_of_batch(const mjModel& model, int samples) {
  mjBatchConfig config;
  mjb_defaultConfig(&config);
  config.nthread = 1;
  const std::unique_ptr<mjBatch, decltype(&mjb_deleteBatch)> batch(
      mjb_makeBatch(&model, samples + 2, &config, nullptr, 0), &mjb_deleteBatch);
  std::vector<int> all(static_cast<std::size_t>(samples));
  std::iota(all.begin(), all.end(), 0);
  const auto nothing = [](const mjModel*, mjData*, int, void*) {};
  const auto apply = [&](std::span<const int> ids) {
    mjb_apply(batch.get(), ids.data(), static_cast<int>(ids.size()), nothing, nullptr, 0);
  };
  const auto apply_all = [&] {
    apply(all);
    apply(std::span(all).first(1));
    apply(std::span(all).first(1));
  };
  apply_all();
  const AllocationCounter counter;
  apply_all();
  return counter.count();
}

TEST(PredictivePlanner, AllocatesNothingAfterItsFirstPlan) {
  for (const PlanningMethod method : kMethods) {
    PlanningModel model({});
    const PlanningTask task = push(model);
    PlanningState start = model.initial_state();
    PlanningState end = start;
    PlannerOptions options = small_options();
    options.method = method;
    PredictivePlanner planner(std::move(model), task, options);
    (void)planner.plan(start);
    (void)planner.simulate(start, planner.newest().commands, Seconds(0.01), end);
    planner.set_terms(task.terms);
    const std::size_t of_batch = allocations_of_batch(*planner.model().mujoco(), options.samples);
    const AllocationCounter counter;
    for (int i = 0; i < 2; ++i) {
      start.time += Seconds(0.01);
      (void)planner.simulate(start, planner.newest().commands, Seconds(0.01), end);
      planner.set_terms(task.terms);
      (void)planner.plan(start);
    }
    EXPECT_EQ(counter.count(), 2 * of_batch);
  }
}

TEST(PredictivePlanner, RefusesWhatMakesNoSense) {
  const auto refuses = [](auto change) {
    PlannerOptions options;
    change(options);
    EXPECT_THROW(validate(options), InvalidArgument);
  };
  EXPECT_NO_THROW(validate(PlannerOptions{}));
  refuses([](PlannerOptions& o) { o.samples = 0; });
  refuses([](PlannerOptions& o) { o.rounds = 0; });
  refuses([](PlannerOptions& o) { o.horizon = Seconds(0); });
  refuses([](PlannerOptions& o) { o.knots = 0; });
  refuses([](PlannerOptions& o) { o.kp = -1; });
  refuses([](PlannerOptions& o) { o.least_sigma = 0; });
  refuses([](PlannerOptions& o) { o.most_sigma = 0.01; });
  refuses([](PlannerOptions& o) { o.one_finger_share = 1.1; });
  refuses([](PlannerOptions& o) { o.constant_share = std::nan(""); });
  refuses([](PlannerOptions& o) { o.temperature = 0; });
  refuses([](PlannerOptions& o) { o.elites = 0; });
  refuses([](PlannerOptions& o) { o.num_threads = -1; });
  const auto plans = [](const CostTerm& term) {
    const PredictivePlanner planner(PlanningModel({}), {.terms = {term}}, {.num_threads = 1});
  };
  EXPECT_THROW(plans({.kind = CostKind::kObjectPosition, .index = 1}), InvalidArgument);
  EXPECT_THROW(plans({.kind = CostKind::kTipPosition, .index = 3}), InvalidArgument);
  EXPECT_THROW(plans({.weight = std::nan("")}), InvalidArgument);
  PredictivePlanner planner(PlanningModel({}), {}, {.num_threads = 1});
  EXPECT_THROW((void)planner.plan({}), InvalidArgument);
  EXPECT_THROW(planner.begin_with(KnotSpline(SplineKind::kLinear, 2, 3, Seconds(1))),
               InvalidArgument);
}

TEST(PathIntegralWeights, DependOnlyOnDistancesBetweenCosts) {
  Random random(1);
  for (int i = 0; i < 100; ++i) {
    std::vector<double> costs(20);
    for (double& cost : costs) cost = random.between(0, 3);
    if (i % 2 == 0) costs[4] = std::nan("");
    const double offset = random.between(-100, 100);
    const double factor = random.between(0.1, 10);
    std::vector<double> moved = costs;
    for (double& cost : moved) cost = factor * cost + offset;
    std::vector<double> weights(costs.size());
    std::vector<double> same(costs.size());
    path_integral_weights(costs, 0.1, weights);
    path_integral_weights(moved, 0.1, same);
    EXPECT_NEAR(std::accumulate(weights.begin(), weights.end(), 0.0), 1.0, 1e-12);
    for (std::size_t k = 0; k < costs.size(); ++k) {
      EXPECT_NEAR(weights[k], same[k], 1e-9);
      if (std::isnan(costs[k])) {
        EXPECT_EQ(weights[k], 0.0);
      }
      for (std::size_t j = 0; j < costs.size(); ++j) {
        if (costs[k] < costs[j]) {
          EXPECT_GE(weights[k], weights[j]);
        }
      }
    }
  }
}

TEST(PathIntegralWeights, ScaleWithTheMedian) {
  const std::array costs{3.0, 1.0, 2.0, 5.0, 9.0};  // the median is 3
  std::array<double, 5> weights{};
  path_integral_weights(costs, 0.5, weights);
  for (std::size_t i = 0; i < costs.size(); ++i)
    EXPECT_NEAR(std::log(weights[1] / weights[i]), costs[i] - 1.0, 1e-9);
}

TEST(PathIntegralWeights, AreEqualForTheBestIfHalfOfAllAreEqual) {
  const std::array costs{1.0, 1.0, 1.0, 5.0, 9.0};
  std::array<double, 5> weights{};
  path_integral_weights(costs, 0.1, weights);
  for (std::size_t i = 0; i < 3; ++i) EXPECT_DOUBLE_EQ(weights[i], 1.0 / 3);
  EXPECT_EQ(weights[3] + weights[4], 0.0);
  const std::array bad{std::nan(""), kInfinity};
  std::array<double, 2> none{1, 1};
  path_integral_weights(bad, 0.1, none);
  EXPECT_EQ(none[0] + none[1], 0.0);
}

TEST(EliteWeights, AreEqualForTheLeastCosts) {
  const std::array costs{3.0, std::nan(""), 1.0, 3.0, -kInfinity, 2.0};
  std::array<double, 6> weights{};
  elite_weights(costs, 3, weights);
  const std::array expected{1.0 / 3, 0.0, 1.0 / 3, 0.0, 0.0, 1.0 / 3};
  for (std::size_t i = 0; i < costs.size(); ++i) EXPECT_DOUBLE_EQ(weights[i], expected[i]);
  elite_weights(costs, 100, weights);
  EXPECT_DOUBLE_EQ(weights[0], 0.25);
}

}  // namespace
}  // namespace trifinger::control
