// SPDX-License-Identifier: BSD-3-Clause
#include "manipulation/parts/task.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>

#include "model/rotation_between.hpp"
#include "trifinger/base/error.hpp"

namespace trifinger::manipulation {
namespace {

using control::CircleTrajectory;
using control::PoseSequence;
using control::PoseTrajectory;

constexpr double kPi = std::numbers::pi;
// Speed and duration of abandoning a trajectory.
constexpr double kGivingUpSpeed = 0.1;  // [m/s]
constexpr Seconds kGivingUpTime{0.5};   // Minimum.
// Number of points at which a planner checks a trajectory.
constexpr int kPointsOfLead = 3;
constexpr int kPointsOfLine = 8;  // Even: the middle is fastest.
constexpr int kPointsOfTurn = 16;
constexpr int kPointsOfCarrying = 14;
constexpr double kLedHeight = 0.003;  // Above the table, of an object that was led [m].
constexpr Seconds kShortestCarrying{0.4};

Pose raised(Pose pose, double height) {
  pose.position.z() += height;
  return pose;
}

Pose turned(Pose pose, double angle) {
  pose.orientation = Eigen::AngleAxisd(angle, Eigen::Vector3d::UnitZ()) * pose.orientation;
  return pose;
}

bool is_same(const Pose& a, const Pose& b) {
  return (a.position - b.position).norm() == 0.0 &&
         control::rotation_error(a.orientation, b.orientation).norm() == 0.0;
}

// A way of a carried object from pose to pose.
PoseTrajectory carrying(const CarryTask& task, const Pose& from, const Pose& to) {
  const double distance = (to.position - from.position).norm();
  const double angle = control::rotation_error(to.orientation, from.orientation).norm();
  const Seconds duration(std::max(distance / task.speed, angle / task.turn_speed));
  return {from, to, std::max(duration, kShortestCarrying)};
}

Pose at_height(Pose pose, double height) {
  pose.position.z() = height;
  return pose;
}

// Up, to the goal's place and orientation, and down to its height if it is low.
PoseSequence trajectory_to(const CarryTask& task, const Pose& start, double height) {
  const Pose above = at_height(start, height);
  const Pose over_goal = at_height(task.goal, height);
  PoseSequence trajectory(carrying(task, start, above));
  trajectory.add(carrying(task, above, over_goal));
  if (task.goal.position.z() < height) trajectory.add(carrying(task, over_goal, task.goal));
  return trajectory;
}

// From a pose on the way to the goal, or at the goal, back to the start.
PoseSequence trajectory_back(const CarryTask& task, const Pose& from, const Pose& start,
                             double height) {
  const Pose above = at_height(start, height);
  if (from.position.z() >= height) {
    PoseSequence trajectory(carrying(task, from, above));
    trajectory.add(carrying(task, above, start));
    return trajectory;
  }
  const Pose raised_first = at_height(from, height);
  PoseSequence trajectory(carrying(task, from, raised_first));
  trajectory.add(carrying(task, raised_first, above));
  trajectory.add(carrying(task, above, start));
  return trajectory;
}

std::variant<PoseSequence, CircleTrajectory> follow_of(const Task& task, const Pose& begin,
                                                       double start_angle, double safe_height) {
  if (const auto* lift = std::get_if<LiftTask>(&task))
    return PoseSequence(PoseTrajectory(begin, raised(begin, lift->height), lift->lift_time));
  if (const auto* carry = std::get_if<CarryTask>(&task))
    return trajectory_to(*carry, begin, safe_height);
  const auto& slide = std::get<SlideTask>(task);
  return CircleTrajectory({.centre = {0.0, 0.0, begin.position.z()},
                           .radius = slide.radius,
                           .start_angle = start_angle,
                           .turns = slide.turns,
                           .period = slide.period,
                           .ramp_time = slide.ramp_time});
}

double safe_height_of(const Task& task, double radius) {
  const auto* carry = std::get_if<CarryTask>(&task);
  if (carry == nullptr) return 0.0;
  return std::max(carry->goal.position.z(), radius + carry->clearance);
}

// Returns the points that a planner has to check: the ends of all legs, and points between them.
std::vector<Motion> points_of(const ObjectTrajectory& trajectory, const Task& task) {
  std::vector<Motion> points;
  const auto add = [&](Leg leg, Leg next, int count) {
    const Seconds begin = trajectory.begin_of(leg);
    const Seconds duration = trajectory.begin_of(next) - begin;
    for (int i = 0; i <= count; ++i) points.push_back(trajectory.at(begin + duration * i / count));
  };
  if (trajectory.begin_of(Leg::kFollow) > Seconds(0)) add(Leg::kLead, Leg::kFollow, kPointsOfLead);
  if (const auto* slide = std::get_if<SlideTask>(&task)) {
    // One turn at full speed contains all points that matter.
    const Seconds begin = trajectory.begin_of(Leg::kFollow) + slide->ramp_time;
    points.push_back(trajectory.at(trajectory.begin_of(Leg::kFollow)));
    const double turns = std::min(std::abs(slide->turns), 1.0);
    for (int i = 0; i < kPointsOfTurn; ++i)
      points.push_back(trajectory.at(begin + turns * slide->period * i / kPointsOfTurn));
  } else if (std::holds_alternative<CarryTask>(task)) {
    add(Leg::kFollow, Leg::kHold, kPointsOfCarrying);  // The way back is the same.
  } else {
    add(Leg::kFollow, Leg::kHold, kPointsOfLine);
    add(Leg::kLower, Leg::kRest, kPointsOfLine);
  }
  return points;
}

}  // namespace

ObjectTrajectory::ObjectTrajectory(const Task& task, Seconds lead_time, const Pose& start,
                                   const Pose& begin, double start_angle, double radius)
    : start_(start),
      begin_(begin),
      safe_height_(safe_height_of(task, radius)),
      follow_(follow_of(task, begin, start_angle, safe_height_)) {
  if (!is_same(start, begin)) lead_.emplace(start, begin, lead_time);
  follow_begin_ = lead_ ? lead_time : Seconds(0);
  hold_begin_ =
      follow_begin_ + std::visit([](const auto& follow) { return follow.duration(); }, follow_);
  lower_begin_ = hold_begin_;
  end_ = hold_begin_;
  if (const auto* lift = std::get_if<LiftTask>(&task)) {
    if (!(lift->hold_time >= Seconds(0))) throw InvalidArgument("hold_time is below zero");
    lower_begin_ += lift->hold_time;
    lower_.emplace(PoseTrajectory(raised(begin, lift->height), at_height(begin, start.position.z()),
                                  lift->lower_time));
    end_ = lower_begin_ + lower_->duration();
  } else if (const auto* carry = std::get_if<CarryTask>(&task)) {
    if (!(carry->hold_time >= Seconds(0))) throw InvalidArgument("hold_time is below zero");
    carry_ = *carry;
    lower_begin_ += carry->hold_time;
    lower_.emplace(trajectory_back(*carry, carry->goal, start, safe_height_));
    end_ = lower_begin_ + lower_->duration();
  } else {
    weight_share_ = 1.0 - std::get<SlideTask>(task).table_share;
  }
}

Motion ObjectTrajectory::at(Seconds time) const noexcept {
  Motion motion;
  if (time < follow_begin_ && lead_) {
    motion = lead_->at(time);
  } else if (time >= lower_begin_ && lower_) {
    motion = lower_->at(time - lower_begin_);
  } else if (const auto* line = std::get_if<PoseSequence>(&follow_)) {
    motion = line->at(time - follow_begin_);
  } else {
    const control::PointMotion point = std::get<CircleTrajectory>(follow_).at(time - follow_begin_);
    motion = {.pose = {point.position, begin_.orientation},
              .twist = {.linear = point.velocity},
              .acceleration = {.linear = point.acceleration}};
  }
  // The fingers carry only their share of the weight; the table carries the rest.
  motion.acceleration.linear += (1.0 - weight_share_) * control::gravity();
  return motion;
}

Leg ObjectTrajectory::leg_at(Seconds time) const noexcept {
  if (time < follow_begin_) return Leg::kLead;
  if (time < hold_begin_) return Leg::kFollow;
  if (time < lower_begin_) return Leg::kHold;
  return time < end_ ? Leg::kLower : Leg::kRest;
}

Seconds ObjectTrajectory::begin_of(Leg leg) const noexcept {
  switch (leg) {
    case Leg::kLead:
      break;
    case Leg::kFollow:
      return follow_begin_;
    case Leg::kHold:
      return hold_begin_;
    case Leg::kLower:
      return lower_begin_;
    case Leg::kRest:
      return end_;
  }
  return Seconds(0);
}

void ObjectTrajectory::give_up(Seconds time) {
  if (leg_at(time) == Leg::kLower || leg_at(time) == Leg::kRest) return;
  const Pose from = at(time).pose;
  if (carry_) {
    lower_.emplace(trajectory_back(*carry_, from, start_, safe_height_));
  } else {
    const Pose table = at_height(from, start_.position.z());
    const Seconds duration =
        std::max(kGivingUpTime, Seconds((from.position - table.position).norm() / kGivingUpSpeed));
    lower_.emplace(PoseTrajectory(from, table, duration));
  }
  follow_begin_ = std::min(follow_begin_, time);
  hold_begin_ = std::min(hold_begin_, time);
  lower_begin_ = time;
  end_ = time + lower_->duration();
}

Pose upright(const Pose& pose) noexcept {
  const Eigen::Matrix3d rotation = pose.orientation.toRotationMatrix();
  Eigen::Index axis = 0;
  rotation.row(2).cwiseAbs().maxCoeff(&axis);
  const Eigen::Vector3d up = (rotation(2, axis) > 0.0 ? 1.0 : -1.0) * rotation.col(axis);
  return {pose.position,
          (rotation_between(up, Eigen::Vector3d::UnitZ()) * pose.orientation).normalized()};
}

TaskPlanner::TaskPlanner(const RobotDescription& description, ManipulationConfig config)
    : config_(std::move(config)), planner_(description, config_.object, config_.planner) {
  const auto object =
      std::ranges::find(description.objects, config_.object, &ObjectDescription::name);
  radius_ = Eigen::Vector3d::Map(object->size.data()).norm() / 2;
}

std::vector<TaskPlanner::Place> TaskPlanner::places(const Pose& start) const {
  // The way of a carried object turns it anyway.
  if (std::holds_alternative<CarryTask>(config_.task)) return {{start, 0.0, 0.0}};
  std::vector<Place> places;
  for (const double turn : config_.lead.turns) {
    const double cost = config_.lead.turn_cost * std::abs(turn);
    if (const auto* slide = std::get_if<SlideTask>(&config_.task)) {
      for (int i = 0; i < slide->start_angles; ++i) {
        const double angle = 2 * kPi * i / slide->start_angles;
        Pose begin = turned(start, turn);
        begin.position.head<2>() =
            slide->radius * Eigen::Vector2d(std::cos(angle), std::sin(angle));
        places.push_back({begin, angle, cost});
      }
    } else {
      for (const double distance : config_.lead.distances) {
        Pose begin = turned(start, turn);
        begin.position.head<2>() *= distance;
        if (turn != 0.0 || distance != 1.0) begin.position.z() += kLedHeight;
        places.push_back({begin, 0.0, cost});
      }
    }
  }
  return places;
}

std::optional<Plan> TaskPlanner::plan(const Pose& start, std::span<const control::Touches> tried) {
  std::optional<Plan> best;
  double best_cost = 0.0;
  for (const Place& place : places(start)) {
    if (best && place.cost >= best_cost) continue;
    const ObjectTrajectory trajectory(config_.task, config_.lead.time, start, place.begin,
                                      place.start_angle, radius_);
    const auto grasp = planner_.plan(points_of(trajectory, config_.task), tried);
    if (!grasp) continue;
    const double cost = place.cost + grasp->torque_share;
    if (best && cost >= best_cost) continue;
    best = Plan{grasp->touches, grasp->torque_share, start, trajectory};
    best_cost = cost;
  }
  return best;
}

double reachable_height(const RobotDescription& description, ManipulationConfig config) {
  constexpr int kYaws = 18;  // Over a quarter of a turn: after it a cube looks the same.
  constexpr double kStep = 0.005;
  auto& task = std::get<LiftTask>(config.task);
  const auto object =
      std::ranges::find(description.objects, config.object, &ObjectDescription::name);
  if (object == description.objects.end())
    throw InvalidArgument("the scene has no '" + config.object + "'");
  const auto reaches = [&](double height) {
    task.height = height;
    TaskPlanner planner(description, config);
    for (int i = 0; i < kYaws; ++i) {
      const Pose start{.position = {0.0, 0.0, object->size[2] / 2}};
      if (!planner.plan(turned(start, kPi / 2 * i / kYaws))) return false;
    }
    return true;
  };
  int low = 0;
  int high = 80;
  while (high - low > 1) {
    const int middle = (low + high) / 2;
    (reaches(kStep * middle) ? low : high) = middle;
  }
  return kStep * low;
}

}  // namespace trifinger::manipulation
