// SPDX-License-Identifier: BSD-3-Clause
#include "trifinger/manipulation/run.hpp"

#include <chrono>
#include <optional>
#include <semaphore>
#include <thread>
#include <utility>

#include "trifinger/sim/object_observation.hpp"

namespace trifinger::manipulation {
namespace {

// Plans in its own thread, so that the loop can continue. The thread starts before the loop begins.
class BackgroundPlanner {
 public:
  BackgroundPlanner(const RobotDescription& description, const ManipulationConfig& config)
      : planner_(description, config), thread_([this] { work(); }) {}
  BackgroundPlanner(const BackgroundPlanner&) = delete;
  BackgroundPlanner& operator=(const BackgroundPlanner&) = delete;
  ~BackgroundPlanner() {
    ends_ = true;
    wanted_.release();
    thread_.join();
  }

  [[nodiscard]] bool is_busy() const noexcept { return is_busy_; }
  void ask(const Pose& pose) {
    pose_ = pose;
    is_busy_ = true;
    wanted_.release();
  }
  // True if the plan is ready.
  [[nodiscard]] bool is_ready() noexcept { return is_busy_ && made_.try_acquire(); }
  void wait() noexcept { made_.acquire(); }
  // Call this only once the plan is ready.
  [[nodiscard]] const std::optional<Plan>& take() noexcept {
    is_busy_ = false;
    return plan_;
  }

 private:
  void work() {
    for (;;) {
      wanted_.acquire();
      if (ends_) return;
      plan_ = planner_.plan(pose_);
      made_.release();
    }
  }

  TaskPlanner planner_;
  // The semaphores order all access to the following members.
  Pose pose_;
  std::optional<Plan> plan_;
  bool ends_{false};
  bool is_busy_{false};  // Used by the asking thread only.
  std::binary_semaphore wanted_{0};
  std::binary_semaphore made_{0};
  std::thread thread_;  // Last member, because the thread uses the others.
};

control::JointState joints_of(const TriFinger::Observation& observation) {
  constexpr auto kJoints = static_cast<Eigen::Index>(TriFinger::kJoints);
  return {.position = JointValues::Map(observation.position.data(), kJoints),
          .velocity = JointValues::Map(observation.velocity.data(), kJoints),
          .torque = JointValues::Map(observation.torque.data(), kJoints)};
}

Pose pose_of(const ObjectPose& object) {
  const auto& q = object.orientation;
  return {.position = Eigen::Vector3d::Map(object.position.data()),
          .orientation = Eigen::Quaterniond(q[0], q[1], q[2], q[3]).normalized()};
}

// Hands a new pose of the object to the manipulation and to the trace.
void see_object(const Companion<CubeObservation>& object, TimeIndex t, std::size_t most,
                Manipulation& manipulation, Trace& trace) {
  const auto seen = object.get_latest_at(t);
  if (!seen) return;
  const TimeIndex captured = seen->stamp.capture_index;
  if (!trace.seen.empty() && captured <= trace.seen.back().step) return;
  const Pose pose = pose_of(seen->cube);
  manipulation.see(captured, pose);
  if (trace.seen.size() < most) trace.seen.push_back({captured, pose});
}

// Gives the manipulation the plan that it waits for. In real time the loop goes on meanwhile.
void plan(BackgroundPlanner& planner, bool is_real_time, Manipulation& manipulation) {
  if (!planner.is_busy()) {
    planner.ask(manipulation.resting_pose());
    if (is_real_time) return;
    planner.wait();
  } else if (!planner.is_ready()) {
    return;
  }
  manipulation.begin(planner.take());
}

TraceStep traced(TimeIndex step, const Manipulation& manipulation, Seconds cycle_time) {
  const control::GraspState& grasp = manipulation.grasp();
  return {.step = step,
          .phase = manipulation.phase(),
          .desired = manipulation.desired().pose,
          .estimated = manipulation.object().pose,
          .normal_forces = grasp.normal_forces,
          .tangential_forces = grasp.tangential_forces,
          .travel = grasp.travel,
          .is_in_sight = manipulation.is_in_sight(),
          .is_slipping = grasp.is_slipping,
          .torque_share = grasp.torque_share,
          .status = grasp.wanted.status,
          .cycle_time = cycle_time};
}

}  // namespace

Trace run(Frontend<TriFinger>& robot, const RobotDescription& description,
          const ManipulationConfig& config, const RunOptions& options) {
  using Clock = std::chrono::steady_clock;
  const SessionInfo session = robot.session().info();
  const Seconds period = session.period;
  const Companion<CubeObservation> object(robot.companion("object"));
  Manipulation manipulation(description, config, period);
  BackgroundPlanner planner(description, config);
  Trace trace;
  trace.period = period;
  const auto most = static_cast<std::size_t>(config.max_duration / period);
  trace.steps.reserve(most);
  trace.seen.reserve(most);

  // Called after the planner has started, because its thread must not inherit this priority.
  static_cast<void>(enter_realtime(options.realtime));

  TriFinger::Observation y = robot.latest_observation();
  TimeIndex t = -1;
  Phase phase = manipulation.phase();
  bool is_in_sight = true;
  while (!manipulation.has_ended()) {
    const auto begin = Clock::now();
    see_object(object, t, most, manipulation, trace);
    TriFinger::Action action;
    const JointValues& torques = manipulation.update(t, joints_of(y));
    JointValues::Map(action.torque.data(), torques.size()) = torques;
    const Seconds cycle_time = Clock::now() - begin;
    if (trace.steps.size() < most)
      trace.steps.push_back(traced(t, manipulation, cycle_time));
    else
      manipulation.stop();
    if (options.stop != nullptr && options.stop->load(std::memory_order_relaxed))
      manipulation.stop();
    if (manipulation.phase() == Phase::kPlan) plan(planner, session.is_real_time, manipulation);
    if (manipulation.phase() != phase) {
      phase = manipulation.phase();
      if (options.on_phase) options.on_phase(manipulation);
    }
    if (manipulation.is_in_sight() != is_in_sight) {
      is_in_sight = manipulation.is_in_sight();
      if (options.on_sight) options.on_sight(manipulation);
    }

    t = robot.append_desired_action(action);
    y = robot.get_observation(t);
    if (options.on_step) options.on_step(t);
  }
  trace.end = manipulation.phase();
  trace.failure = manipulation.failure();
  trace.grasps = manipulation.grasps();
  if (manipulation.plan()) trace.planned_torque_share = manipulation.plan()->torque_share;
  robot.finish();
  return trace;
}

}  // namespace trifinger::manipulation
