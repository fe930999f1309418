// SPDX-License-Identifier: BSD-3-Clause
#include "evaluation/skill_trial.hpp"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <memory>
#include <numbers>
#include <optional>
#include <utility>

#include "evaluation/board_world.hpp"
#include "evaluation/contact.hpp"
#include "sim/boards_config.hpp"
#include "trifinger/base/error.hpp"
#include "trifinger/core/driver.hpp"
#include "trifinger/core/session.hpp"
#include "trifinger/manipulation/skills.hpp"
#include "trifinger/model/kinematics.hpp"
#include "trifinger/realtime/thread.hpp"
#include "trifinger/rendering/simulation_with_cameras.hpp"
#include "trifinger/sim/robot_config.hpp"
#include "trifinger/sim/simulation.hpp"

namespace trifinger::evaluation {
namespace {

control::Pose pose_of(const ObjectPose& object) {
  const auto& q = object.orientation;
  return {.position = Eigen::Vector3d::Map(object.position.data()),
          .orientation = Eigen::Quaterniond(q[0], q[1], q[2], q[3])};
}

// How the robot of a trial differs from its description.
Variation robot_of(const SkillTrial& trial) {
  Random random{.seed = trial.simulation.seed, .episode = 1};
  Variation robot = draw(trial.condition, random);
  if (trial.changes.empty()) return robot;
  robot.seed = static_cast<std::uint64_t>(random.integer(0, 1'000'000'000));
  for (const auto& [name, value] : trial.changes) set_value(robot, name, value);
  return robot;
}

// Notes what is true in a simulation.
class TruthObserver {
 public:
  TruthObserver(const SkillTrial& trial, const SimulatedRobot& robot, const std::string& object)
      : robot_(robot),
        kinematics_(trial.simulation.description),
        tip_radius_(robot_of(trial).tip_radius *
                    variant_figures(trial.simulation.description.variant).tip_radius) {
    const auto& objects = trial.simulation.description.objects;
    const auto found = std::ranges::find(objects, object, &ObjectDescription::name);
    if (found != objects.end()) object_ = *found;
  }

  // The simulation is one step ahead of the newest observation, `t`.
  [[nodiscard]] TrueStep look(TimeIndex t) {
    TrueStep truth{.step = t + 1};
    const TipPositions tips = kinematics_.tip_positions(joint_values(robot_.true_position()));
    for (std::size_t i = 0; i < truth.tips.size(); ++i)
      truth.tips[i] = tips.segment<3>(static_cast<Eigen::Index>(3 * i));
    if (!object_) return truth;
    // Tips and object at the same instant: that of the observation.
    const control::Pose observed = pose_of(robot_.observed_object_pose(object_->name));
    for (std::size_t i = 0; i < truth.tips.size(); ++i)
      truth.tip_distances[i] = distance_to_surface(*object_, observed, truth.tips[i]) - tip_radius_;
    truth.object = pose_of(robot_.object_pose(object_->name));
    const ObjectVelocity velocity = robot_.object_velocity(object_->name);
    truth.twist = {.linear = Eigen::Vector3d::Map(velocity.linear.data()),
                   .angular = Eigen::Vector3d::Map(velocity.angular.data())};
    return truth;
  }

 private:
  const SimulatedRobot& robot_;
  Kinematics kinematics_;
  double tip_radius_;
  std::optional<ObjectDescription> object_;
};

// Notes what a trial demands of robot and object.
class StrainObserver {
 public:
  explicit StrainObserver(const SkillTrial& trial)
      : limits_(manipulation::safety_limits_of(trial.simulation)) {}

  void look(const TriFinger::Observation& seen, const TriFinger::AppliedAction& applied,
            double contact_depth = 0.0) noexcept {
    bool is_at_limit = false;
    for (std::size_t i = 0; i < applied.torque.size(); ++i) {
      is_at_limit |= std::abs(applied.torque[i]) >= limits_.max_torque[i] - kTiny;
      strain_.speed = std::max(strain_.speed, std::abs(seen.velocity[i]));
      strain_.thermal_margin = std::min(strain_.thermal_margin, applied.thermal_margin[i]);
    }
    strain_.contact_depth = std::max(strain_.contact_depth, contact_depth);
    ++steps_;
    if (is_at_limit) ++at_limit_;
  }
  [[nodiscard]] Strain strain() const noexcept {
    Strain strain = strain_;
    strain.torque_limit = steps_ > 0 ? at_limit_ / steps_ : 0.0;
    return strain;
  }

 private:
  static constexpr double kTiny = 1e-9;  // [Nm]

  control::SafetyLimits limits_;
  Strain strain_;
  double steps_{0.0};
  double at_limit_{0.0};
};

// A robot and observers of each of its steps, in the thread of the back-end.
class ObservedRobot final : public Driver<TriFinger> {
 public:
  ObservedRobot(SimulatedRobot& robot, TruthObserver& observer, StrainObserver& strain,
                std::size_t most_steps)
      : robot_(robot), observer_(observer), strain_(strain) {
    truth_.reserve(most_steps);
  }
  // What was true at each step. Call it when the back-end has ended.
  [[nodiscard]] std::vector<TrueStep>& truth() noexcept { return truth_; }
  [[nodiscard]] std::size_t steps() const noexcept {
    // Relaxed: it is only a number, and the step itself is read later.
    return steps_.load(std::memory_order_relaxed);
  }

  using Driver::apply_action;
  using Driver::get_latest_observation;
  using Driver::hold;

  [[nodiscard]] DriverReport prepare(TimeIndex step) noexcept override {
    return robot_.prepare(step);
  }
  [[nodiscard]] DriverReport get_latest_observation(Observation& observation) noexcept override {
    const DriverReport report = robot_.get_latest_observation(&observation);
    seen_ = observation;
    return report;
  }
  [[nodiscard]] DriverReport apply_action(const Action& desired,
                                          AppliedAction& applied) noexcept override {
    const DriverReport report = robot_.apply_action(&desired, &applied);
    strain_.look(seen_, applied, robot_.contact_depth());
    if (truth_.size() < truth_.capacity())
      truth_.push_back(observer_.look(static_cast<TimeIndex>(truth_.size()) - 1));
    steps_.store(truth_.size(), std::memory_order_relaxed);
    return report;
  }
  [[nodiscard]] DriverReport hold(const Observation& observation,
                                  Action& action) noexcept override {
    return robot_.hold(&observation, &action);
  }
  [[nodiscard]] DriverReport stop(TimeIndex step) noexcept override { return robot_.stop(step); }
  [[nodiscard]] std::span<const CompanionDescription> companions() const noexcept override {
    return robot_.companions();
  }
  [[nodiscard]] bool get_companion_element(std::size_t index, TimeIndex time_index,
                                           void* element) noexcept override {
    return robot_.get_companion_element(index, time_index, element);
  }
  [[nodiscard]] std::string_view fault_text(std::int32_t fault_code) const noexcept override {
    return robot_.fault_text(fault_code);
  }
  [[nodiscard]] std::string_view rejection_text() const noexcept override {
    return robot_.rejection_text();
  }

 private:
  SimulatedRobot& robot_;
  TruthObserver& observer_;
  StrainObserver& strain_;
  Observation seen_;
  std::vector<TrueStep> truth_;
  std::atomic<std::size_t> steps_{0};
};

std::unique_ptr<manipulation::Skill> make(const SkillTrial& trial) {
  const manipulation::SkillContext context{
      .description = trial.believed,
      .limits = manipulation::safety_limits_of(trial.simulation),
      .period = trial.simulation.period,
      .is_real_time = trial.real_time.has_value()};
  return trial.is_taught ? manipulation::make_taught_skill(trial.skill, context, {}, trial.settings)
                         : manipulation::make_skill(trial.skill, context, {}, trial.settings);
}

std::vector<manipulation::Figure> figures_of(const manipulation::Skill& skill,
                                             const SkillTrialResult& result) {
  std::vector<manipulation::SeenPose> poses;
  poses.reserve(result.end);
  for (std::size_t i = 0; i < result.end; ++i)
    poses.push_back({result.truth[i].step, result.truth[i].object});
  return skill.figures(result.trace, poses);
}

// A robot on emulated motor boards, in time of its own.
SkillTrialResult run_on_boards(const SkillTrial& trial) {
  if (trial.interfere) throw InvalidArgument("nobody meddles beside emulated boards");
  if (trial.condition != Condition::kAsDocumented || !trial.changes.empty()) {
    throw InvalidArgument("joints on emulated boards are as documented");
  }
  ManualClock clock;
  BoardWorld world(*trial.boards, trial.simulation, clock);
  SessionHost host = SessionHost::anonymous();
  Backend backend(world, host,
                  {.mode = BackendOptions::Mode::kNonRealTime, .period = trial.simulation.period},
                  clock);
  Frontend<TriFinger> robot(backend, {.strict = true});
  const auto skill = make(trial);
  const std::string object(skill->object());
  StrainObserver strain(trial);
  SkillTrialResult result;
  result.trace = manipulation::run_skill(
      robot, *skill, {.identified = trial.known, .on_step = [&](TimeIndex t) {
                        strain.look(robot.get_observation(t), robot.get_applied_action(t));
                        result.truth.push_back(
                            {.step = t + 1, .object = pose_of(world.plant().object_pose(object))});
                      }});
  result.strain = strain.strain();
  result.end = result.truth.size();
  result.figures = figures_of(*skill, result);
  return result;
}

Simulation simulation_of(const SkillTrial& trial) {
  if (!trial.vision) return Simulation(trial.simulation);
  RobotConfig config = trial.vision->config;
  config.simulation = trial.simulation;
  return rendering::make_simulation(config, trial.vision->rendering);
}

// A back-end in a thread of its own, the skill in this one.
SkillTrialResult run_in_real_time(const SkillTrial& trial) {
  SimulatedRobot simulation(trial.simulation);
  simulation.vary(robot_of(trial));
  simulation.reset();
  const auto skill = make(trial);
  TruthObserver observer(trial, simulation, std::string(skill->object()));
  // The robot holds before the first action and after the last one; these steps count, too.
  constexpr control::Seconds kSpare{5.0};
  const auto most = static_cast<std::size_t>((skill->max_duration() + trial.after + kSpare) /
                                             trial.simulation.period);
  StrainObserver strain(trial);
  ObservedRobot robot(simulation, observer, strain, most);
  SessionHost host =
      SessionHost::anonymous({.documents = model_documents(trial.simulation)}, "skill-trial");
  Backend backend(robot, host, *trial.real_time);
  // The world goes on from where a session has left it.
  backend.set_after_session([&](const Fault&) { simulation.restore(simulation.save()); });
  SkillTrialResult result;
  {
    BackendThread thread(backend, {.demand = Demand::kTry});
    std::optional<Session> session;
    {
      Frontend<TriFinger> frontend(host);
      session.emplace(frontend.session());
      // One below the back-end, as `trifinger manipulate` runs.
      result.trace = manipulation::run_skill(
          frontend, *skill, {.realtime = {.priority = 70}, .identified = trial.known});
    }
    leave_realtime();
    result.timing = session->timing();
    result.end = robot.steps();
    Frontend<TriFinger> frontend(host);
    const auto hold = hold_position(frontend.latest_observation());
    const auto after = static_cast<TimeIndex>(trial.after / trial.simulation.period);
    for (TimeIndex i = 0; i < after; ++i) {
      const TimeIndex t = frontend.append_desired_action(hold);
      frontend.wait_until_time_index(t);
    }
    frontend.finish();
    thread.stop();
  }
  result.truth = std::move(robot.truth());
  result.strain = strain.strain();
  result.end = std::min(result.end, result.truth.size());
  result.figures = figures_of(*skill, result);
  return result;
}

}  // namespace

double TrialRandom::between(double low, double high) {
  // SplitMix64, whose numbers are public domain (Steele, Lea, Flood 2014).
  std::uint64_t z = (state_ += 0x9e3779b97f4a7c15ULL);
  z = (z ^ (z >> 30U)) * 0xbf58476d1ce4e5b9ULL;
  z = (z ^ (z >> 27U)) * 0x94d049bb133111ebULL;
  z ^= z >> 31U;
  return low + (high - low) * 0x1p-53 * static_cast<double>(z >> 11U);
}

void vary_physics(SkillTrial& trial, TrialRandom& random, double least_friction) {
  SimulationOptions& simulation = trial.simulation;
  for (ObjectDescription& object : simulation.description.objects)
    object.mass *= random.between(0.8, 1.2);
  simulation.description.contact.tip_friction = random.between(least_friction, 1.0);
  simulation.object_delay = std::lround(random.between(9.5, 30.5));
  simulation.object_position_noise = 1e-3;
  simulation.object_orientation_noise = 0.5 * std::numbers::pi / 180;
  simulation.seed = static_cast<std::uint64_t>(random.between(0, 1e9));
}

void vary_place(SkillTrial& trial, TrialRandom& random, double radius) {
  ObjectDescription& object = trial.simulation.description.objects.front();
  const double distance = radius * std::sqrt(random.between(0, 1));
  const double azimuth = random.between(-std::numbers::pi, std::numbers::pi);
  Triple position = object.position.value_or(Triple{0, 0, object.size[2] / 2});
  position[0] += distance * std::cos(azimuth);
  position[1] += distance * std::sin(azimuth);
  object.position = position;
  const double yaw = random.between(-std::numbers::pi, std::numbers::pi);
  const auto& q = object.orientation;
  const Eigen::Quaterniond turned =
      Eigen::AngleAxisd(yaw, Eigen::Vector3d::UnitZ()) * Eigen::Quaterniond(q[0], q[1], q[2], q[3]);
  object.orientation = {turned.w(), turned.x(), turned.y(), turned.z()};
}

void vary_place_and_physics(SkillTrial& trial, std::uint64_t seed) {
  TrialRandom random(seed);
  vary_place(trial, random);
  vary_physics(trial, random);
}

SkillTrial make_skill_trial(const std::string& robot, const std::string& skill,
                            const std::vector<std::string>& robot_settings,
                            const std::vector<std::string>& skill_settings) {
  RobotConfig config = load_robot_config(robot, robot_settings);
  const SimulationOptions& simulation = config.simulation;
  if (description_of(config).arrangement != Arrangement::kTriFinger) {
    throw InvalidArgument("'" + robot + "' has not three fingers");
  }
  SkillTrial trial{.skill = skill,
                   .settings = skill_settings,
                   .simulation = simulation,
                   .believed = simulation.description};
  if (config.boards) trial.boards = config.boards->options;
  if (config.tracks_objects) trial.vision = SkillTrial::Vision{.config = std::move(config)};
  return trial;
}

SkillTrial in_real_time(SkillTrial trial, const std::string& robot) {
  trial.real_time = load_robot_config(robot).backend;
  return trial;
}

const TrueStep& SkillTrialResult::truth_at(TimeIndex step) const {
  const TimeIndex first = truth.front().step;
  const auto last = static_cast<TimeIndex>(truth.size()) - 1;
  return truth[static_cast<std::size_t>(std::clamp<TimeIndex>(step - first, 0, last))];
}

double Report::at(std::string_view name) const {
  const auto found = std::ranges::find(figures, name, &manipulation::Figure::name);
  return found == figures.end() ? 0.0 : found->value;
}

SkillTrialResult run_skill_trial(const SkillTrial& trial) {
  if (trial.real_time) return run_in_real_time(trial);
  if (trial.boards) return run_on_boards(trial);
  const Simulation simulation = simulation_of(trial);
  simulation.robot().vary(robot_of(trial));
  simulation.robot().reset();
  const auto skill = make(trial);
  TruthObserver observer(trial, simulation.robot(), std::string(skill->object()));
  StrainObserver strain(trial);
  SkillTrialResult result;
  const auto after = static_cast<TimeIndex>(trial.after / trial.simulation.period);
  {
    auto robot = simulation.connect();
    result.trace = manipulation::run_skill(
        robot, *skill, {.identified = trial.known, .on_step = [&](TimeIndex t) {
                          strain.look(robot.get_observation(t), robot.get_applied_action(t),
                                      simulation.robot().contact_depth());
                          result.truth.push_back(observer.look(t));
                          if (trial.interfere)
                            trial.interfere(simulation.robot(), t, skill->state());
                        }});
  }
  result.end = result.truth.size();
  result.strain = strain.strain();
  result.figures = figures_of(*skill, result);
  if (after == 0) return result;
  // The world goes on from where the session has left it.
  simulation.robot().restore(simulation.robot().save());
  {
    auto robot = simulation.connect();
    const auto hold = hold_position(robot.latest_observation());
    for (TimeIndex i = 0; i < after; ++i) {
      const TimeIndex t = robot.append_desired_action(hold);
      (void)robot.get_observation(t);
      TrueStep truth = observer.look(t);
      truth.step = result.truth.empty() ? 0 : result.truth.back().step + 1;
      result.truth.push_back(truth);
    }
    robot.finish();
  }
  return result;
}

}  // namespace trifinger::evaluation
