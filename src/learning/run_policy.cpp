// SPDX-License-Identifier: BSD-3-Clause
#include "learning/run_policy.hpp"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <memory>
#include <optional>
#include <span>
#include <string_view>
#include <tuple>
#include <utility>
#include <vector>

#include "base/text_of.hpp"
#include "learning/colored_noise.hpp"
#include "trifinger/base/error.hpp"
#include "trifinger/base/time.hpp"
#include "trifinger/joint/safety.hpp"
#include "trifinger/joint/safety_checks.hpp"
#include "trifinger/sim/object_observation.hpp"

namespace trifinger::learning {
namespace {

using trifinger::detail::text_of;

// Layout of an element of a companion with a ball.
struct BallObservation {
  Stamp stamp;
  ObjectPose ball;

  static constexpr auto fields() {
    return std::tuple{field("stamp", &BallObservation::stamp),
                      field("ball", &BallObservation::ball)};
  }
};

using ObjectAt = std::function<std::optional<ObjectPose>(TimeIndex)>;

template <class Element>
ObjectAt look_at(UntypedFrontend poses, ObjectPose Element::* object) {
  return [companion = std::make_shared<Companion<Element>>(std::move(poses)), object](TimeIndex t) {
    const auto seen = companion->get_latest_at(t);
    return seen ? std::optional((*seen).*object) : std::nullopt;
  };
}

// Returns where the object of a task is; nothing for a task without an object.
template <class R>
ObjectAt object_of(const Frontend<R>& robot, std::string_view name) {
  if (name == "cube") return look_at(robot.companion("object"), &CubeObservation::cube);
  if (name == "ball") return look_at(robot.companion("object"), &BallObservation::ball);
  return {};
}

// Presents a robot as the decision process of its environment: docs/learning.md.
template <class R>
class Process {
 public:
  using Action = typename R::Action;
  using Observation = typename R::Observation;

  Process(Frontend<R>& robot, const EnvironmentOptions& options, Takeover<R>* takeover)
      : robot_(robot),
        takeover_(takeover),
        position_kp_(options.position_kp),
        is_augmented_(options.mapping == Mapping::kStateAugmentation),
        burst_(static_cast<std::size_t>(options.steps_per_action)) {}

  Observation begin() {
    const Action hold = hold_position(robot_.latest_observation());
    if (is_augmented_) return step(hold);
    t_ = last_ = robot_.append_desired_action(hold);
    return robot_.get_observation(t_);
  }

  Observation step(const Action& action) {
    std::ranges::fill(burst_, action);
    const TimeIndex first = robot_.append_desired_action(action);
    const TimeIndex last =
        burst_.size() == 1 ? first : robot_.append_desired_actions(std::span(burst_).subspan(1));
    return observe(first, last);
  }

  // Whether a person has taken over. `follow` then begins with the action seen here, so that one
  // who lets go in between has acted, too.
  [[nodiscard]] bool is_taken_over() noexcept {
    const Action* newest = takeover_ != nullptr ? takeover_->newest() : nullptr;
    if (newest != nullptr) persons_ = *newest;
    return newest != nullptr;
  }

  // Lets the person act, as `step` lets an action.
  Observation follow() {
    same_ = {};
    same_.position.fill(0.0);
    Action action = persons_;
    TimeIndex first = -1;
    for (std::size_t i = 0; i < burst_.size(); ++i) {
      const Observation y = robot_.get_observation(std::max(t_, last_ + 1 - kAhead));
      if (const Action* newest = takeover_->newest(); newest != nullptr) {
        action = *newest;
      } else if (i > 0) {
        let_go(action, y);
      }
      add(action, y);
      last_ = robot_.append_desired_action(action);
      if (i == 0) first = last_;
    }
    return observe(first, last_);
  }
  // What the last `follow` was like: the mean torque, and the mean of the positions that make the
  // robot's own controller give these torques.
  [[nodiscard]] const Action& same() const noexcept { return same_; }

  // Returns the step of the newest observation.
  [[nodiscard]] TimeIndex time_index() const noexcept { return t_; }
  // Returns the number of steps that passed without an action of their own.
  [[nodiscard]] TimeIndex repeated_steps() const noexcept { return repeated_; }

 private:
  // Actions of a person that wait for their step: one that is due, and one in case that we are
  // late.
  static constexpr TimeIndex kAhead = 2;

  // Remembers the steps of an action and returns what is observed of it.
  Observation observe(TimeIndex first, TimeIndex last) {
    last_ = last;
    const TimeIndex before = std::exchange(t_, is_augmented_ ? first : last);
    if (before >= 0) {
      repeated_ += t_ - before - static_cast<TimeIndex>(burst_.size());
    }
    return robot_.get_observation(t_);
  }

  // A person has let go in the midst of an action: the robot goes to the last positions.
  static void let_go(Action& action, const Observation& y) noexcept {
    for (std::size_t i = 0; i < R::kJoints; ++i) {
      if (!std::isnan(action.position[i])) continue;
      action.torque[i] = 0.0;
      action.position[i] = y.position[i];
    }
  }

  void add(const Action& action, const Observation& y) noexcept {
    const double share = 1.0 / static_cast<double>(burst_.size());
    for (std::size_t i = 0; i < R::kJoints; ++i) {
      const JointLimit& own = takeover_->limits()[i];
      const double torque =
          torque_of(with_default_gains(trifinger::detail::command_of(action, i), own),
                    y.position[i], y.velocity[i]);
      const double kp = position_kp_ > 0.0 ? position_kp_ : own.default_kp;
      const double offset = kp > 0.0 ? (torque + own.default_kd * y.velocity[i]) / kp : 0.0;
      same_.torque[i] += share * std::clamp(torque, -own.max_torque, own.max_torque);
      same_.position[i] +=
          share * std::clamp(y.position[i] + offset, own.soft_lower, own.soft_upper);
    }
  }

  Frontend<R>& robot_;
  Takeover<R>* takeover_;
  double position_kp_;  // of the policy's actions; 0: that of the robot
  bool is_augmented_;
  std::vector<Action> burst_;
  Action persons_;
  Action same_;
  TimeIndex t_{-1};
  TimeIndex last_{-1};  // of the newest action
  TimeIndex repeated_{0};
};

// Computes actions with the newest policy, which one finger may share with the others.
class Actor {
 public:
  // Throws InvalidArgument if the policies do not fit the environment.
  Actor(const Environment& environment, PolicySource& source, std::size_t num_joints, bool explores)
      : source_(source),
        explores_(explores),
        input_(environment.observation_size()),
        output_(num_joints),
        noise_(num_joints) {
    if (environment.options().layout != Layout::kFlat) {
      throw InvalidArgument("policies run on flat observations; this one was trained on others");
    }
    const Policy& policy = source.newest().policy;
    const std::size_t inputs = policy.num_inputs();
    const std::size_t outputs = policy.num_outputs();
    sharing_ = input_.size() / inputs;
    if (sharing_ > 1 && policy.has_state()) {
      throw InvalidArgument("a policy with a state cannot be shared by the fingers");
    }
    if (sharing_ * inputs != input_.size() || sharing_ * outputs != output_.size()) {
      throw InvalidArgument(text_of(
          "the policy has ", inputs, " inputs and ", outputs, " outputs; the environment has ",
          input_.size(), " numbers in an observation and ", output_.size(), " in an action"));
    }
  }

  void begin(std::uint64_t seed, std::uint64_t episode) noexcept {
    noise_.begin(seed, episode);
    source_.newest().policy.reset();
  }

  // Says in `told` what was chosen, and by which policy.
  template <class Action>
  [[nodiscard]] Action act(const Environment& environment, std::span<const float> observation,
                           Episode& episode, Experience& told) {
    PolicySource::Numbered& newest = source_.newest();
    Policy& policy = newest.policy;
    told.policy = newest.number;
    const std::size_t inputs = policy.num_inputs();
    const std::size_t outputs = policy.num_outputs();
    std::ranges::copy(observation, input_.begin());
    bool is_done = true;
    for (std::size_t part = 0; part < sharing_; ++part) {
      is_done = policy.evaluate(std::span(input_).subspan(part * inputs, inputs),
                                std::span(output_).subspan(part * outputs, outputs)) &&
                is_done;
    }
    if (explores_) noise_.advance(newest.noise_color);
    for (std::size_t i = 0; i < output_.size(); ++i) {
      if (explores_) output_[i] = std::clamp(output_[i] + newest.noise * noise_[i], -1.0, 1.0);
      told.action[i] = static_cast<float>(output_[i]);
    }
    const std::span numbers(told.action.data(), output_.size());
    Action action;
    if (!is_done || !environment.take_action(numbers, episode, action.torque, action.position)) {
      throw Error("the policy has given a number that is not finite");
    }
    action.position_kp.fill(environment.position_kp());
    return action;
  }

 private:
  PolicySource& source_;
  bool explores_;
  std::size_t sharing_{1};
  std::vector<double> input_;
  std::vector<double> output_;
  ColoredNoise noise_;
};

// Tells learners what happens, in a companion of the robot, and knows what the robot has taken.
class Teller {
 public:
  template <class R>
  Teller(const Frontend<R>& robot, SensorWriter<Experience>* writer) : writer_(writer) {
    if (writer != nullptr) taken_.emplace(robot.companion(Experience::kCompanion));
  }

  void tell(const Experience& one) {
    if (writer_ == nullptr) return;
    writer_->write(std::chrono::steady_clock::now(), one);
    session_ = one.session;
    step_ = one.step;
    ++untaken_;
  }

  // Whether the robot has taken all of it by step t, or may take the rest later.
  [[nodiscard]] bool is_up_to_date(TimeIndex t, std::size_t may_be_left) {
    if (writer_ == nullptr || untaken_ == 0) return true;
    const std::optional<Experience> newest = taken_->get_latest_at(t);
    if (newest && newest->session == session_ && newest->step == step_) untaken_ = 0;
    return untaken_ <= may_be_left;
  }

 private:
  SensorWriter<Experience>* writer_;
  std::optional<Companion<Experience>> taken_;
  std::uint64_t session_{0};
  TimeIndex step_{-1};
  std::size_t untaken_{0};  // elements of which the robot may not know yet
};

// Number of numbers in an observation. Throws InvalidArgument if an element has no room for them.
std::size_t checked_size(const Environment& environment) {
  const std::size_t size = environment.observation_size();
  if (size <= Experience::kMaxObserved) return size;
  throw InvalidArgument(text_of("observations have ", size, " numbers; a robot's experience has ",
                                "room for ", Experience::kMaxObserved));
}

// Replaces what a task says by what somebody else says.
void judge(Verdict verdict, bool is_over, Outcome& outcome) noexcept {
  outcome.success = verdict == Verdict::kSuccess;
  outcome.reward = outcome.success ? 1.0 : 0.0;
  outcome.terminated = verdict != Verdict::kNone;
  outcome.truncated = !outcome.terminated && is_over;
}

// Why the robot needs care after an episode.
std::optional<NeedsCare> needed_care(const PolicyRunOptions& options,
                                     const Environment& environment,
                                     std::span<const double> thermal_margin,
                                     const std::optional<ObjectPose>& object) {
  constexpr double kBeyond = 0.02;
  const double margin = std::ranges::min(thermal_margin);
  if (margin < options.rest_below) {
    return NeedsCare{NeedsCare::Kind::kWarmMotors, text_of("the motors are warm: thermal margin ",
                                                           std::round(100 * margin) / 100)};
  }
  if (!options.ends_out_of_reach || !object) return std::nullopt;
  const double distance = std::hypot(object->position[0], object->position[1]);
  if (distance <= environment.object_reach() + kBeyond) return std::nullopt;
  return NeedsCare{NeedsCare::Kind::kObjectOutOfReach,
                   text_of("the ", environment.object_name(), " lies ", std::round(100 * distance),
                           " cm from the middle, out of reach")};
}

}  // namespace

template <class R>
std::optional<NeedsCare> run_policy(Frontend<R>& robot, const Environment& environment,
                                    PolicySource& source, const PolicyRunOptions& options,
                                    Takeover<R>* takeover) {
  using Action = typename R::Action;
  Actor actor(environment, source, R::kJoints, options.explores);
  const ObjectAt object_at = object_of(robot, environment.object_name());
  const auto must_stop = [&] {
    return options.stop != nullptr && options.stop->load(std::memory_order_relaxed);
  };

  // What is told after each action. The actor writes the action into it.
  Experience told{.session = robot.session().info().session_id,
                  .process = options.process,
                  .seed = options.seed,
                  .num_observed = static_cast<std::uint32_t>(environment.observation_size()),
                  .num_acted = R::kJoints,
                  .num_goal = static_cast<std::uint32_t>(environment.goal_size())};
  const std::span observation = std::span(told.observation).first(checked_size(environment));
  std::vector<double> achieved(environment.goal_size());
  std::vector<double> desired(environment.goal_size());
  Process<R> process(robot, environment.options(), takeover);
  Teller teller(robot, options.experience);
  Episode episode;
  TimeIndex repeated = 0;
  // Actions of an episode in which a verdict is one on the episode before.
  const std::int64_t unjudged = std::min(
      static_cast<std::int64_t>(std::chrono::milliseconds(300) / robot.session().info().period) /
          environment.options().steps_per_action,
      environment.episode_actions() / 2);
  std::optional<ObjectPose> object;
  // `flags` are more of Experience::Flag.
  const auto look = [&](const typename R::Observation& y, std::uint32_t flags) {
    if (object_at) {
      object = object_at(process.time_index());
      if (!object) throw InvalidArgument("nobody has said where the object is");
    }
    Outcome outcome = environment.observe({.position = y.position,
                                           .velocity = y.velocity,
                                           .object = object ? &*object : nullptr,
                                           .torque = y.torque},
                                          episode, observation, achieved, desired);
    if (options.verdict != nullptr) {
      // relaxed: no other data depends on it.
      const Verdict verdict = options.verdict->exchange(Verdict::kNone, std::memory_order_relaxed);
      judge(episode.actions > unjudged ? verdict : Verdict::kNone,
            episode.actions >= environment.episode_actions(), outcome);
      flags |= Experience::kJudged;
    }
    const bool is_late = process.repeated_steps() > repeated;
    repeated = process.repeated_steps();
    told.step = process.time_index();
    told.actions = episode.actions;
    told.reward = outcome.reward;
    told.flags = flags | (outcome.terminated ? Experience::kTerminated : 0U) |
                 (outcome.truncated ? Experience::kTruncated : 0U) |
                 (outcome.success ? Experience::kSuccess : 0U) | (is_late ? Experience::kLate : 0U);
    std::ranges::copy(achieved, told.achieved.begin());
    std::ranges::copy(desired, told.desired.begin());
    teller.tell(told);
    return outcome;
  };
  // Holds the robot until its companion has what was told.
  const auto hold = [&](typename R::Observation y) {
    const Deadline deadline(std::chrono::seconds(10));
    const Action still = hold_position(y);
    while (!teller.is_up_to_date(process.time_index(), 0)) {
      if (deadline.passed()) {
        throw Error("the robot does not take what it is told about its experience");
      }
      y = process.step(still);
    }
    return y;
  };
  // Lets the person act, and says which action of the environment that was like.
  const auto follow = [&] {
    const auto y = process.follow();
    const Action& same = process.same();
    const std::span numbers = std::span(told.action).first(R::kJoints);
    environment.invert_action(same.torque, same.position, episode, numbers);
    Action action;
    static_cast<void>(environment.take_action(numbers, episode, action.torque, action.position));
    environment.begin_at(same.position, episode);  // the policy will go on from there
    told.policy = -1;
    return y;
  };

  std::optional<NeedsCare> care;
  auto y = process.begin();
  for (std::uint64_t i = 0; i < options.episodes && !must_stop() && !care; ++i) {
    EpisodeReport report{.number = options.first_episode + i};
    const Start start = environment.begin(options.seed, report.number, episode);
    actor.begin(options.seed, report.number);
    bool is_at_start = false;
    if (i % options.approach_every == 0) {
      const auto from = y.position;
      const std::int64_t count = environment.approach_actions();
      std::int64_t k = 0;
      for (; k < count && !must_stop() && !process.is_taken_over(); ++k) {
        Action action;
        environment.approach_point(from, start, k, action.position);
        y = process.step(action);
      }
      is_at_start = k == count;
    }
    if (process.is_taken_over()) {
      y = process.follow();
      environment.begin_at(process.same().position, episode);
    } else if (!is_at_start) {
      const Action still = hold_position(y);
      y = process.step(still);
      environment.begin_at(still.position, episode);
    }
    if (must_stop()) break;
    if (!teller.is_up_to_date(process.time_index(), Experience::kKept / 2)) y = hold(y);
    repeated = process.repeated_steps();
    const TimeIndex repeated_before = repeated;
    report.first_step = process.time_index();
    told.episode = report.number;
    told.policy = -1;
    told.action = {};
    report.outcome = look(y, 0);
    const auto has_ended = [&] { return report.outcome.terminated || report.outcome.truncated; };
    while (!has_ended() && !must_stop()) {
      const bool follows = process.is_taken_over();
      y = follows
              ? follow()
              : process.step(actor.template act<Action>(environment, observation, episode, told));
      report.interventions += follows ? 1 : 0;
      report.outcome = look(y, follows ? Experience::kIntervention : 0U);
      report.total_reward += report.outcome.reward;
    }
    if (!has_ended()) break;
    report.policy = told.policy;
    report.last_step = process.time_index();
    report.actions = episode.actions;
    report.repeated_steps = repeated - repeated_before;
    if (options.on_episode) options.on_episode(report);
    care = needed_care(options, environment,
                       robot.get_applied_action(process.time_index()).thermal_margin, object);
  }
  hold(y);
  robot.finish();
  return care;
}

template std::optional<NeedsCare> run_policy(Frontend<TriFinger>&, const Environment&,
                                             PolicySource&, const PolicyRunOptions&,
                                             Takeover<TriFinger>*);
template std::optional<NeedsCare> run_policy(Frontend<Finger>&, const Environment&, PolicySource&,
                                             const PolicyRunOptions&, Takeover<Finger>*);

}  // namespace trifinger::learning
