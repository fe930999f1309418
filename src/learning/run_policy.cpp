// SPDX-License-Identifier: BSD-3-Clause
#include "learning/run_policy.hpp"

#include <algorithm>
#include <memory>
#include <optional>
#include <span>
#include <string_view>
#include <tuple>
#include <utility>
#include <vector>

#include "base/text_of.hpp"
#include "trifinger/base/error.hpp"
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

  Process(Frontend<R>& robot, const EnvironmentOptions& options)
      : robot_(robot),
        is_augmented_(options.mapping == Mapping::kStateAugmentation),
        burst_(static_cast<std::size_t>(options.steps_per_action)) {}

  Observation begin() {
    const Action hold = hold_position(robot_.latest_observation());
    if (is_augmented_) return step(hold);
    t_ = robot_.append_desired_action(hold);
    return robot_.get_observation(t_);
  }

  Observation step(const Action& action) {
    std::ranges::fill(burst_, action);
    const TimeIndex first = robot_.append_desired_action(action);
    const TimeIndex last =
        burst_.size() == 1 ? first : robot_.append_desired_actions(std::span(burst_).subspan(1));
    const TimeIndex before = std::exchange(t_, is_augmented_ ? first : last);
    if (before >= 0) {
      repeated_ += t_ - before - static_cast<TimeIndex>(burst_.size());
    }
    return robot_.get_observation(t_);
  }

  // Returns the step of the newest observation.
  [[nodiscard]] TimeIndex time_index() const noexcept { return t_; }
  // Returns the number of steps that passed without an action of their own.
  [[nodiscard]] TimeIndex repeated_steps() const noexcept { return repeated_; }

 private:
  Frontend<R>& robot_;
  bool is_augmented_;
  std::vector<Action> burst_;
  TimeIndex t_{-1};
  TimeIndex repeated_{0};
};

// Computes actions with the newest policy, which one finger may share with the others.
class Actor {
 public:
  // Throws InvalidArgument if the policies do not fit the environment.
  Actor(const Environment& environment, PolicySource& source, std::size_t num_joints)
      : source_(source),
        input_(environment.observation_size()),
        output_(num_joints),
        numbers_(num_joints) {
    if (environment.options().layout != Layout::kFlat) {
      throw InvalidArgument("policies run on flat observations; this one was trained on others");
    }
    const Policy& policy = source.newest().policy;
    const std::size_t inputs = policy.num_inputs();
    const std::size_t outputs = policy.num_outputs();
    sharing_ = input_.size() / inputs;
    if (sharing_ * inputs != input_.size() || sharing_ * outputs != output_.size()) {
      throw InvalidArgument(text_of(
          "the policy has ", inputs, " inputs and ", outputs, " outputs; the environment has ",
          input_.size(), " numbers in an observation and ", output_.size(), " in an action"));
    }
  }

  // Says in `chosen_by` which policy acts.
  template <class Action>
  [[nodiscard]] Action act(const Environment& environment, std::span<const float> observation,
                           Episode& episode, std::int64_t& chosen_by) {
    PolicySource::Numbered& newest = source_.newest();
    Policy& policy = newest.policy;
    chosen_by = newest.number;
    const std::size_t inputs = policy.num_inputs();
    const std::size_t outputs = policy.num_outputs();
    std::ranges::copy(observation, input_.begin());
    bool is_done = true;
    for (std::size_t part = 0; part < sharing_; ++part) {
      is_done = policy.evaluate(std::span(input_).subspan(part * inputs, inputs),
                                std::span(output_).subspan(part * outputs, outputs)) &&
                is_done;
    }
    std::ranges::transform(output_, numbers_.begin(),
                           [](double number) { return static_cast<float>(number); });
    Action action;
    if (!is_done || !environment.take_action(numbers_, episode, action.torque, action.position)) {
      throw Error("the policy has given a number that is not finite");
    }
    return action;
  }

 private:
  PolicySource& source_;
  std::size_t sharing_{1};
  std::vector<double> input_;
  std::vector<double> output_;
  std::vector<float> numbers_;
};

}  // namespace

template <class R>
void run_policy(Frontend<R>& robot, const Environment& environment, PolicySource& source,
                const PolicyRunOptions& options) {
  Actor actor(environment, source, R::kJoints);
  const ObjectAt object_at = object_of(robot, environment.object_name());
  const auto must_stop = [&] {
    return options.stop != nullptr && options.stop->load(std::memory_order_relaxed);
  };

  std::vector<float> observation(environment.observation_size());
  std::vector<double> achieved(environment.goal_size());
  std::vector<double> desired(environment.goal_size());
  Process<R> process(robot, environment.options());
  Episode episode;
  const auto look = [&](const typename R::Observation& y) {
    std::optional<ObjectPose> object;
    if (object_at) {
      object = object_at(process.time_index());
      if (!object) throw InvalidArgument("nobody has said where the object is");
    }
    return environment.observe({.position = y.position,
                                .velocity = y.velocity,
                                .object = object ? &*object : nullptr,
                                .torque = y.torque},
                               episode, observation, achieved, desired);
  };

  auto y = process.begin();
  for (std::uint64_t i = 0; i < options.episodes && !must_stop(); ++i) {
    EpisodeReport report{.number = options.first_episode + i};
    const Start start = environment.begin(options.seed, report.number, episode);
    const auto from = y.position;
    for (std::int64_t k = 0; k < environment.approach_actions() && !must_stop(); ++k) {
      typename R::Action action;
      environment.approach_point(from, start, k, action.position);
      y = process.step(action);
    }
    const TimeIndex repeated_before = process.repeated_steps();
    report.first_step = process.time_index();
    report.outcome = look(y);
    const auto has_ended = [&] { return report.outcome.terminated || report.outcome.truncated; };
    while (!has_ended() && !must_stop()) {
      y = process.step(
          actor.template act<typename R::Action>(environment, observation, episode, report.policy));
      report.outcome = look(y);
      report.total_reward += report.outcome.reward;
    }
    if (!has_ended()) break;
    report.last_step = process.time_index();
    report.actions = episode.actions;
    report.repeated_steps = process.repeated_steps() - repeated_before;
    if (options.on_episode) options.on_episode(report);
  }
  robot.finish();
}

template void run_policy(Frontend<TriFinger>&, const Environment&, PolicySource&,
                         const PolicyRunOptions&);
template void run_policy(Frontend<Finger>&, const Environment&, PolicySource&,
                         const PolicyRunOptions&);

}  // namespace trifinger::learning
