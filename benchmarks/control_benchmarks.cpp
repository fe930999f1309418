// SPDX-License-Identifier: BSD-3-Clause
#include <fmt/format.h>
#include <mujoco/mujoco.h>
#include <time.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <memory>
#include <optional>
#include <vector>

#include "harness.hpp"
#include "support/allocation_counter.hpp"
#include "trifinger/control/grasp_controller.hpp"
#include "trifinger/control/pose_estimator.hpp"
#include "trifinger/control/trajectories.hpp"
#include "trifinger/model/kinematics.hpp"
#include "trifinger/model/robot_model.hpp"
#include "trifinger/sim/simulation.hpp"

namespace trifinger::benchmarks {
namespace {

using namespace control;

constexpr int kCycles = 3000;  // A lift of 3 s.
constexpr Seconds kCyclePeriod{1e-3};

RobotDescription description() { return {.finger_height = 0.3}; }

// What a controller gets in one step.
struct Input {
  JointState joints;
  std::optional<Pose> seen;  // Pose of the cube, every 10 ms.
  Motion desired;
};

// A controller and its estimator. The controller approaches a cube, grasps it and lifts it by 10
// cm.
class Controller {
 public:
  explicit Controller(const Pose& rest)
      : lift_(rest, {rest.position + Eigen::Vector3d(0, 0, 0.1), rest.orientation},
              kCycles * kCyclePeriod) {
    const std::vector<Motion> trajectory{lift_.at(Seconds(0)), lift_.at(lift_.duration())};
    controller_.grasp(GraspPlanner(description()).plan(trajectory).value().touches, rest);
  }

  // Returns where the cube should be in the next cycle.
  [[nodiscard]] Motion desired() const { return lift_.at(held_ * kCyclePeriod); }

  const JointValues& cycle(const Input& input) {
    time_ += kCyclePeriod;
    if (input.seen) (void)estimator_.update(time_, *input.seen, input.desired);
    const JointValues& torques = controller_.update(
        kCyclePeriod, input.joints, estimator_.predict(time_, input.desired), input.desired);
    if (controller_.state().phase == GraspPhase::kHold) ++held_;
    return torques;
  }

  // Returns for how many cycles the cube has been held.
  [[nodiscard]] int held() const noexcept { return held_; }
  // True if the wrench of the last cycle was the wanted one.
  [[nodiscard]] bool is_exact() const noexcept {
    return static_cast<bool>(controller_.state().wanted);
  }

 private:
  PoseTrajectory lift_;
  GraspController controller_{description(), rigid_body(cube())};
  PoseEstimator estimator_;
  Seconds time_{0};
  int held_{0};
};

// A lift in simulation. It contains what the controller got in each step, so that others can repeat
// it.
struct Recording {
  Pose rest;
  std::vector<Input> inputs;
};

Recording record_lift() {
  const Simulation simulation({.description = description()});
  const auto cube_pose = [&] {
    const auto [position, orientation] = simulation.robot().object_pose("cube");
    const auto& [w, x, y, z] = orientation;
    return Pose{Eigen::Vector3d(position.data()), Eigen::Quaterniond(w, x, y, z)};
  };
  Frontend<TriFinger> robot = simulation.connect();
  Recording recording{.rest = cube_pose(), .inputs = {}};
  Controller controller(recording.rest);
  TriFinger::Observation y = robot.latest_observation();
  TriFinger::Action action = hold_position(y);
  while (controller.held() < kCycles) {
    const TimeIndex t = robot.append_desired_action(action);
    y = robot.get_observation(t);
    Input& input = recording.inputs.emplace_back();
    input.joints = {joint_values(y.position), joint_values(y.velocity), joint_values(y.torque)};
    if (t % 10 == 0) input.seen = cube_pose();
    input.desired = controller.desired();
    action = {};
    std::ranges::copy(controller.cycle(input), action.torque.begin());
  }
  return recording;
}

// MuJoCo's part of a cycle, written as short as possible: kinematics and the Jacobians of the tips.
class Bare {
 public:
  double cycle(const JointValues& position) {
    const mjModel* model = model_.mujoco();
    Eigen::Map<Eigen::VectorXd>(data_->qpos, position.size()) = position;
    mj_kinematics(model, data_.get());
    mj_comPos(model, data_.get());
    for (const int site : model_.tip_sites())
      mj_jacSite(model, data_.get(), jacobian_.data(), nullptr, site);
    return jacobian_[0];
  }

 private:
  RobotModel model_{{.finger_height = 0.3, .boundary = false, .objects = {}}};
  std::unique_ptr<mjData, decltype(&mj_deleteData)> data_{mj_makeData(model_.mujoco()),
                                                          &mj_deleteData};
  std::array<double, 3 * kMaxJoints> jacobian_{};
};

// Returns the processor time of this thread. Time that other threads got in between does not count.
double processor_microseconds() {
  timespec time{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &time);
  return 1e6 * static_cast<double>(time.tv_sec) + 1e-3 * static_cast<double>(time.tv_nsec);
}

}  // namespace

std::vector<Row> control_cycle(const Effort& effort) {
  const Recording recording = record_lift();
  Bare bare;
  Samples slowest;
  std::size_t allocations = 0;
  int cycles = 0;
  int exact = 0;
  double sum = 0;  // Used below, so that the compiler cannot remove the work.
  const auto full = [&] {
    Samples times;
    Samples processor_times;
    Controller controller(recording.rest);
    for (const Input& input : recording.inputs) {
      const test::AllocationCounter counter;
      const double processor_begin = processor_microseconds();
      const auto begin = Clock::now();
      sum += controller.cycle(input)[0];
      const auto end = Clock::now();
      const double processor_end = processor_microseconds();
      allocations += counter.count();
      if (controller.held() == 0) continue;
      ++cycles;
      exact += controller.is_exact() ? 1 : 0;
      processor_times.add(processor_end - processor_begin);
      times.add(microseconds(end - begin));
    }
    slowest.add(processor_times.quantile(0.999));
    return times.median();
  };
  const auto kinematics_alone = [&] {
    Samples times;
    for (const Input& input : recording.inputs) {
      const auto begin = Clock::now();
      sum += bare.cycle(input.joints.position);
      times.add(microseconds(Clock::now() - begin));
    }
    return times.median();
  };
  const Paired paired = alternate(effort.rounds, full, kinematics_alone);
  Row row = make_row("control cycle, lifting a cube: p50", "us", paired,
                     "bare mj_kinematics, mj_comPos and mj_jacSite", "<= 15 us, 0 allocations",
                     paired.measure.median() <= 15.0 && allocations == 0 && std::isfinite(sum));
  row.remark =
      fmt::format("{} allocations, {} % of the wrenches exact", allocations, 100 * exact / cycles);
  return {row, make_row("control cycle: p99.9, processor time", "us", slowest, "<= 40 us",
                        slowest.median() <= 40.0)};
}

}  // namespace trifinger::benchmarks
