// SPDX-License-Identifier: BSD-3-Clause
#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "base/moved.hpp"
#include "environment_implementation.hpp"

namespace trifinger::learning {
namespace {

double distance_between(std::span<const double> a, std::span<const double> b) noexcept {
  double square = 0.0;
  for (std::size_t i = 0; i < a.size(); ++i) square += (a[i] - b[i]) * (a[i] - b[i]);
  return std::sqrt(square);
}

// A quaternion and its negative mean the same; the one with w >= 0 is shown.
ObjectPose upward(const ObjectPose& pose) noexcept {
  ObjectPose shown = pose;
  if (shown.orientation[0] < 0.0) {
    for (double& value : shown.orientation) value = -value;
  }
  return shown;
}

ObjectPose pose_of(std::span<const double> goal) noexcept {
  ObjectPose pose;
  std::copy_n(goal.begin(), 3, pose.position.begin());
  std::copy_n(goal.begin() + 3, 4, pose.orientation.begin());
  return pose;
}

// Writes the corners of a cube and returns where the next number comes.
double* write_corners(const ObjectPose& pose, double* next) noexcept {
  constexpr double kHalf = 0.0325;  // of a cube of 65 mm [m]
  const auto& [w, x, y, z] = pose.orientation;
  const Eigen::Matrix3d rotation = Eigen::Quaterniond(w, x, y, z).toRotationMatrix();
  for (unsigned corner = 0; corner < kCorners; ++corner) {
    const auto side = [corner](unsigned axis) {
      return (corner >> axis & 1U) == 0 ? -kHalf : kHalf;
    };
    Eigen::Map<Eigen::Vector3d>(next + 3 * corner) =
        Eigen::Vector3d(pose.position.data()) +
        rotation * Eigen::Vector3d(side(0), side(1), side(2));
  }
  return next + 3 * kCorners;
}

// Writes the offsets from the object to the tips, from where a tip would push the object to its
// goal to the tips, and from the object to its goal, and the direction of the latter.
double* write_offsets(const Observed& one, double* next) noexcept {
  constexpr double kPushedFrom = 0.045;  // from a tip to the middle of a cube that it pushes [m]
  constexpr double kNear = 0.01;         // Nearer goals have less direction [m].
  const Eigen::Vector3d object(one.shown_object.position.data());
  const Eigen::Vector3d way = Eigen::Vector3d(one.episode->goal.data()) - object;
  Eigen::Vector3d behind = object;
  behind.head<2>() -= kPushedFrom / std::max(way.head<2>().norm(), kPushedFrom) * way.head<2>();
  const auto write = [&next](const Eigen::Vector3d& offset) {
    next = std::ranges::copy(offset, next).out;
  };
  for (const Eigen::Vector3d& from : {object, behind}) {
    for (Eigen::Index i = 0; i < one.view.tips.size(); i += 3) {
      write(one.view.tips.segment<3>(i) - from);
    }
  }
  write(way);
  write(way / std::max(way.norm(), kNear));
  return next;
}

// Turns `count` points about the vertical axis.
void turn_points(double cosine, double sine, std::size_t count, double* points) noexcept {
  for (double* const end = points + 3 * count; points != end; points += 3) {
    const auto [x, y] = std::pair(points[0], points[1]);
    points[0] = cosine * x - sine * y;
    points[1] = sine * x + cosine * y;
  }
}

// Turns a quaternion (w, x, y, z) by `angle` about the vertical axis; of the two that mean the
// same, that with w >= 0.
void turn_rotation(double angle, double* wxyz) noexcept {
  const Eigen::Quaterniond turned = Eigen::AngleAxisd(angle, Eigen::Vector3d::UnitZ()) *
                                    Eigen::Quaterniond(wxyz[0], wxyz[1], wxyz[2], wxyz[3]);
  const double sign = turned.w() < 0.0 ? -1.0 : 1.0;
  wxyz[0] = sign * turned.w();
  for (int i = 0; i < 3; ++i) wxyz[i + 1] = sign * turned.vec()[i];
}

// Writes how a cube lies, whatever the colours of its faces: fourth moments of its axes, which are
// the same for all 24 orientations that look alike and change smoothly with the cube. The others
// follow from these nine.
double* write_faces(const double* wxyz, double* next) noexcept {
  const Eigen::Matrix3d axes =
      Eigen::Quaterniond(wxyz[0], wxyz[1], wxyz[2], wxyz[3]).toRotationMatrix();
  const Eigen::Matrix3d squares = axes.cwiseAbs2();
  for (const auto& [a, b] : {std::pair{0, 1}, std::pair{0, 2}, std::pair{1, 2}}) {
    const Eigen::RowVector3d both = axes.row(a).cwiseProduct(axes.row(b));
    *next++ = both.squaredNorm();
    *next++ = both.dot(squares.row(a));
    *next++ = both.dot(squares.row(b));
  }
  return next;
}

}  // namespace

std::size_t Environment::Implementation::first_finger(const Episode& episode) const noexcept {
  if (!options.symmetric_view) return 0;
  const auto distance = [&](std::size_t finger) {
    const double azimuth = kinematics->finger_azimuth(static_cast<int>(finger));
    return -(episode.goal[0] * std::cos(azimuth) + episode.goal[1] * std::sin(azimuth));
  };
  std::size_t nearest = 0;
  for (std::size_t finger = 1; finger < turns.size(); ++finger) {
    if (distance(finger) < distance(nearest)) nearest = finger;
  }
  return nearest;
}

double Environment::Implementation::view_angle(const Episode& episode) const noexcept {
  return options.symmetric_view ? turns[first_finger(episode)] : 0.0;
}

void Environment::Implementation::turn(const Episode& episode, double* values) const noexcept {
  const std::size_t first = first_finger(episode);
  if (first == 0) return;
  const double angle = turns[first];
  const double cosine = std::cos(angle);
  const double sine = std::sin(angle);
  for (std::size_t i = 0; i < entries.size(); ++i) {
    const std::size_t size = entries[i].low.size();
    switch (turnings[i]) {
      case Turning::kNone:
        break;
      case Turning::kTips:
        turn_points(cosine, sine, size / 3, values);
        [[fallthrough]];
      case Turning::kJoints:
        std::rotate(values, values + 3 * first, values + size);
        break;
      case Turning::kPoints:
        turn_points(cosine, sine, size / 3, values);
        break;
      case Turning::kPose:
        turn_points(cosine, sine, 1, values);
        turn_rotation(angle, values + 3);
        break;
      case Turning::kRotation:
        turn_rotation(angle, values);
        break;
    }
    values += size;
  }
}

double distance_of_places(std::span<const double> achieved,
                          std::span<const double> desired) noexcept {
  const std::size_t size = std::min<std::size_t>(achieved.size(), 3);
  return distance_between(achieved.first(size), desired.first(size));
}

double Task::distance(std::span<const double> achieved,
                      std::span<const double> desired) const noexcept {
  return distance_of_places(achieved, desired);
}

void Environment::Implementation::show_goal(const Episode& episode, double* shown) const noexcept {
  std::copy_n(episode.goal.begin(), goal.low.size(), shown);
  if (!options.per_finger) return;
  for (std::size_t finger = 0; finger < turns.size(); ++finger) {
    const double cosine = std::cos(turns[finger]);
    const double sine = std::sin(turns[finger]);
    double* const xy = shown + 3 * finger;
    const auto [x, y] = std::pair(xy[0], xy[1]);
    xy[0] = cosine * x - sine * y;
    xy[1] = sine * x + cosine * y;
  }
}

void Environment::Implementation::find_points(const Measurement& measurement,
                                              View& view) const noexcept {
  if (kinematics) {
    view.tips = kinematics->tip_positions(
        JointValues::Map(view.position.data(), static_cast<Eigen::Index>(num_joints)));
    return;
  }
  view.tips.resize(static_cast<Eigen::Index>(3 * num_points));
  file->find_frames(
      view.position,
      measurement.model_position.empty() ? std::span<const double>() : view.model_position,
      view.bodies, {view.tips.data(), 3 * num_points});
}

void Environment::Implementation::look(Observed& one) const noexcept {
  const Measurement& measurement = one.measurement;
  const std::size_t n = num_joints;
  const std::size_t num_model = measurement.model_position.size();
  std::ranges::copy(measurement.position, one.position.begin());
  std::ranges::copy(measurement.velocity, one.velocity.begin());
  std::ranges::copy(measurement.model_position, one.model_position.begin());
  const auto add_noise = [&one](std::span<double> numbers, double deviation) {
    if (!(deviation > 0.0)) return;
    for (double& value : numbers) value += deviation * one.episode->noise.normal();
  };
  add_noise(std::span(one.position).first(n), options.position_noise);
  add_noise(std::span(one.velocity).first(n), options.velocity_noise);
  add_noise(std::span(one.model_position).first(num_model), options.position_noise);
  if (options.action == ActionKind::kRelativePosition) hold(one.position, *one.episode);
  if (options.action == ActionKind::kPositionChange) pull_back(one.position, *one.episode);

  View& view = one.view;
  view.object = {};
  view.time = time_of(*one.episode);
  view.position = std::span(one.position).first(n);
  view.velocity = std::span(one.velocity).first(n);
  view.torque = measurement.torque;
  view.model_position = std::span(one.model_position).first(num_model);
  view.model_velocity = measurement.model_velocity;
  view.bodies = measurement.bodies;
  if (num_model == 0) {
    view.model_position = view.position;
    view.model_velocity = view.velocity;
  }
  find_points(measurement, view);
  if (measurement.object == nullptr) return;
  one.shown_object = upward(*measurement.object);
  view.object =
      measurement.true_object != nullptr ? upward(*measurement.true_object) : one.shown_object;
}

void Environment::Implementation::judge(Observed& one) const noexcept {
  Episode& episode = *one.episode;
  Outcome& outcome = one.outcome;
  of_one->achieve(one.view, episode, one.achieved);
  std::copy_n(episode.goal.begin(), goal.low.size(), one.desired.begin());
  outcome = {};
  outcome.reward = of_one->reward(one.achieved, one.desired) - of_one->cost(one.view);
  outcome.success = of_one->is_success(one.achieved, one.desired, episode);
  outcome.terminated = of_one->has_ended(one.view, episode);
  of_one->score(one.view, one.achieved, one.desired,
                std::span(outcome.scores).first(scores.size()));
  one.goals = of_one->num_goals(one.view.time);
}

void Environment::Implementation::complete(Observed& one) const noexcept {
  const Episode& episode = *one.episode;
  Outcome& outcome = one.outcome;
  outcome.terminated = outcome.terminated && episode.actions > 0;
  outcome.truncated = !outcome.terminated && episode.actions >= episode_actions;
  if (!task->has_goals_of_fingers()) {
    outcome.distance[0] = of_one != nullptr ? of_one->distance(one.achieved, one.desired)
                                            : distance_of_places(one.achieved, one.desired);
    return;
  }
  for (std::size_t i = 0; i < num_parts; ++i) {
    outcome.distance[i] =
        distance_between(one.achieved.subspan(3 * i, 3), one.desired.subspan(3 * i, 3));
    outcome.finger_rewards[i] = -outcome.distance[i];
  }
}

bool Environment::Implementation::takes_next_goal(const Observed& one) noexcept {
  if (one.outcome.truncated || one.episode->goals >= one.goals) return false;
  ++one.episode->goals;
  return true;
}

void Environment::Implementation::write(const Observed& one,
                                        std::span<const double> shown) const noexcept {
  std::array<double, kMaxValues> values;  // NOLINT(*-member-init)
  double* next = std::ranges::copy(shown, values.data()).out;
  if (!has_own_entries) {
    next = std::ranges::copy(one.view.position, next).out;
    next = std::ranges::copy(one.view.velocity, next).out;
    if (!task->object_name().empty()) next = std::ranges::copy(one.view.tips, next).out;
    if (shows_object()) {
      next = std::ranges::copy(one.shown_object.position, next).out;
      std::array<double, 4> orientation = one.shown_object.orientation;
      if (options.symmetric_object) {
        turn_rotation(view_angle(*one.episode), orientation.data());
        next = write_faces(orientation.data(), next);
      } else if (options.keypoints) {
        next = write_corners(one.shown_object, next);
      } else {
        next = std::ranges::copy(orientation, next).out;
      }
    }
    if (options.keypoints && goal.low.size() == 7) {
      next = write_corners(pose_of(one.episode->goal), next);
    }
    if (options.object_offsets) next = write_offsets(one, next);
  }
  if (shows_action) next = std::copy_n(one.episode->action.begin(), num_joints, next);
  if (shows_tracking_error) {
    next = std::ranges::transform(one.view.position, one.episode->target, next,
                                  [](double position, double target) { return target - position; })
               .out;
  }
  if (memory_values > 0) {
    of_one->show_memory(one.view, *one.episode, {next, memory_values});
    next += memory_values;
  }
  if (options.layout != Layout::kGoal && !has_own_entries) show_goal(*one.episode, next);
  if (options.symmetric_view) turn(*one.episode, values.data());

  for (std::size_t i = 0; i < flat.size(); ++i) {
    const std::size_t k = flat[i];
    const double value = std::clamp(values[k], low[k], high[k]);
    const double scaled = 2.0 * (value - low[k]) / (high[k] - low[k]) - 1.0;
    one.observation[i] = static_cast<float>(is_flat() ? scaled : value);
  }
}

void Environment::Implementation::observe(Observed& one) const noexcept {
  look(one);
  // The outcome is judged by the goal that was shown before this action.
  judge(one);
  complete(one);
  while (takes_next_goal(one)) {
    of_one->draw_goal(workspace, one.episode->random, goal_of(*one.episode));
  }
  std::array<double, kMaxValues> shown;  // NOLINT(*-member-init)
  if (has_own_entries) of_one->show(one.view, *one.episode, std::span(shown).first(own_values));
  write(one, std::span(shown).first(own_values));
}

void Environment::show_hidden(const HiddenState& state, const Episode& episode,
                              std::span<float> shown) const noexcept {
  const Implementation& self = *checked(implementation_);
  auto next = shown.begin();
  if (!self.task->object_name().empty()) {
    std::array<double, 9> object{};
    auto* const velocity = std::ranges::copy(state.object.position, object.begin()).out;
    auto* const rotation = std::ranges::copy(state.object_velocity.linear, velocity).out;
    std::ranges::copy(state.object_velocity.angular, rotation);
    const double angle = self.view_angle(episode);
    turn_points(std::cos(angle), std::sin(angle), 3, object.data());
    next = std::ranges::transform(object, next, [](double number) {
             return static_cast<float>(number);
           }).out;
  }
  for_each_number(state.variation, [&next](std::string_view /*name*/, double number) {
    *next++ = static_cast<float>(number);
  });
}

}  // namespace trifinger::learning
