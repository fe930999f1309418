// SPDX-License-Identifier: BSD-3-Clause
#include "trifinger/manipulation/run_skill.hpp"

#include <chrono>
#include <exception>
#include <optional>
#include <semaphore>
#include <string>
#include <thread>
#include <utility>

#include "object_reader.hpp"
#include "trifinger/base/error.hpp"
#include "trifinger/sim/robot_config.hpp"

namespace trifinger::manipulation {
namespace {

// Plans in its own thread, so that the loop can continue. The thread starts before the loop begins.
class BackgroundPlanner {
 public:
  explicit BackgroundPlanner(Skill& skill) : skill_(skill), thread_([this] { work(); }) {}
  ~BackgroundPlanner() {
    // The thread then waits for the next request, and looks at nothing meanwhile.
    if (is_busy_) made_.acquire();
    ends_ = true;
    wanted_.release();
    thread_.join();
  }

  [[nodiscard]] bool is_busy() const noexcept { return is_busy_; }
  void ask() noexcept {
    is_busy_ = true;
    wanted_.release();
  }
  // True if the plan is ready.
  [[nodiscard]] bool is_ready() noexcept { return made_.try_acquire(); }
  void wait() noexcept { made_.acquire(); }
  // Call this only once the plan is ready. Throws what the planning has thrown.
  void take() {
    is_busy_ = false;
    if (failure_) std::rethrow_exception(std::exchange(failure_, nullptr));
    skill_.begin();
  }

 private:
  void work() {
    for (;;) {
      wanted_.acquire();
      if (ends_) return;
      try {
        skill_.plan();
      } catch (...) {
        failure_ = std::current_exception();
      }
      made_.release();
    }
  }

  Skill& skill_;
  // The semaphores order all access to the following members.
  std::exception_ptr failure_;
  bool ends_{false};
  bool is_busy_{false};  // Used by the asking thread only.
  std::binary_semaphore wanted_{0};
  std::binary_semaphore made_{0};
  std::thread thread_;  // Last member, because the thread uses the others.
};

// Between what a skill thinks in, true torques and positions, and what the robot measures and
// takes.
class Corrections {
 public:
  explicit Corrections(const Identified& robot) {
    robot.validate(TriFinger::kJoints);
    for (std::size_t i = 0; i < TriFinger::kJoints; ++i) {
      const auto k = static_cast<Eigen::Index>(i);
      offset_[k] = Identified::of(robot.zero_offset, i, 0.0);
      scale_[k] = Identified::of(robot.torque_scale, i, 1.0);
    }
  }

  [[nodiscard]] control::JointState seen(const TriFinger::Observation& observation) const {
    return {.position = joint_values(observation.position) - offset_,
            .velocity = joint_values(observation.velocity),
            .torque = joint_values(observation.torque).cwiseProduct(scale_)};
  }
  [[nodiscard]] TriFinger::Action commanded(TriFinger::Action action) const {
    for (std::size_t i = 0; i < TriFinger::kJoints; ++i) {
      action.torque[i] /= scale_[static_cast<Eigen::Index>(i)];
      action.position[i] += offset_[static_cast<Eigen::Index>(i)];
    }
    return action;
  }

 private:
  JointValues offset_{JointValues::Zero(TriFinger::kJoints)};
  JointValues scale_{JointValues::Ones(TriFinger::kJoints)};
};

// Gives the skill the plan that it waits for. In real time the loop goes on meanwhile.
void plan(BackgroundPlanner& planner, bool is_real_time) {
  if (!planner.is_busy()) {
    planner.ask();
    if (is_real_time) return;
    planner.wait();
  } else if (!planner.is_ready()) {
    return;
  }
  planner.take();
}

}  // namespace

control::SafetyLimits safety_limits_of(const SimulationOptions& options) {
  const auto limits =
      limits_of<TriFinger::kJoints>(options.limits.value_or(default_limits(options.description)));
  return {.max_torque = values_of(limits, &JointLimit::max_torque),
          .safety_kd = values_of(limits, &JointLimit::safety_kd),
          .soft_lower = values_of(limits, &JointLimit::soft_lower),
          .soft_upper = values_of(limits, &JointLimit::soft_upper)};
}

SkillContext context_of(const Session& session) {
  const SimulationOptions options = robot_config_of(session).simulation;
  if (options.description.arrangement != Arrangement::kTriFinger) {
    throw InvalidArgument("the robot has not three fingers");
  }
  const SessionInfo info = session.info();
  return {.description = options.description,
          .limits = safety_limits_of(options),
          .period = info.period,
          .is_real_time = info.is_real_time};
}

SkillTrace run_skill(Frontend<TriFinger>& robot, Skill& skill, const SkillRunOptions& options) {
  using Clock = std::chrono::steady_clock;
  const SessionInfo session = robot.session().info();
  std::optional<ObjectReader> object;
  if (!skill.object().empty()) object.emplace(robot, std::string(skill.object()));
  BackgroundPlanner planner(skill);
  const Corrections corrections(options.identified);
  SkillTrace trace;
  trace.period = session.period;
  const auto most = static_cast<std::size_t>(skill.max_duration() / trace.period);
  trace.steps.reserve(most);
  trace.seen.reserve(most);

  // Called after the planner has started, because its thread must not inherit this priority.
  static_cast<void>(enter_realtime(options.realtime));

  TriFinger::Observation y = robot.latest_observation();
  TimeIndex t = -1;
  std::string_view phase = skill.state().phase;
  bool is_visible = true;
  while (!skill.state().has_ended) {
    const auto begin = Clock::now();
    if (const auto new_pose = object ? object->new_pose(t) : std::nullopt) {
      skill.see(new_pose->step, new_pose->pose);
      if (trace.seen.size() < most) trace.seen.push_back(*new_pose);
    }
    const TriFinger::Action& action = skill.update(t, corrections.seen(y));
    const SkillState& state = skill.state();
    const SkillStep step{.step = t,
                         .phase = state.phase,
                         .desired = state.desired.pose,
                         .estimated = state.object.pose,
                         .torque_share = state.torque_share,
                         .is_visible = state.is_visible,
                         .grasp = state.grasp,
                         .cycle_time = Clock::now() - begin};
    if (options.on_update) options.on_update(step);
    if (trace.steps.size() < most)
      trace.steps.push_back(step);
    else
      skill.stop();
    if (options.stop != nullptr && options.stop->load(std::memory_order_relaxed)) skill.stop();
    // A plan that is under way has to end before the skill may ask for the next one.
    if (skill.wants_plan() || planner.is_busy()) plan(planner, session.is_real_time);
    if (skill.state().phase != phase) {
      phase = skill.state().phase;
      if (options.on_phase) options.on_phase(skill);
    }
    if (skill.state().is_visible != is_visible) {
      is_visible = !is_visible;
      if (options.on_visibility) options.on_visibility(skill);
    }

    t = robot.append_desired_action(corrections.commanded(action));
    y = robot.get_observation(t);
    if (options.on_step) options.on_step(t);
  }
  trace.failure = skill.state().failure;
  robot.finish();
  return trace;
}

}  // namespace trifinger::manipulation
