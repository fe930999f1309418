// SPDX-License-Identifier: BSD-3-Clause
#include "trifinger/control/grasp_controller.hpp"

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <utility>

#include "base/moved.hpp"
#include "control/filters.hpp"
#include "control/friction_compensation.hpp"
#include "tip_path.hpp"
#include "trifinger/base/error.hpp"

namespace trifinger::control {
namespace {

using detail::require_positive;

using TipMotions = std::array<PointMotion, kContacts>;

constexpr Seconds kFirmTouch{0.02};    // A shorter touch counts as a knock.
constexpr double kTouchCutoff = 10.0;  // [Hz]
constexpr double kSlipCutoff = 5.0;    // Above the speed of slipping, below that of trembling [Hz].

Eigen::Vector3d across(const Eigen::Vector3d& vector, const Eigen::Vector3d& normal) {
  return vector - vector.dot(normal) * normal;
}

void check(const GraspControllerConfig& config) {
  require_positive("friction", config.friction);
  require_positive("slip_friction", config.slip_friction);
  require_positive("min_normal_force", config.min_normal_force);
  require_positive("touch_force", config.touch_force);
  require_positive("approach_speed", config.approach_speed);
  require_positive("closing_speed", config.closing_speed);
  require_positive("penetration", config.penetration);
  require_positive("closing_time", config.closing_time.count());
  require_positive("engage_time", config.engage_time.count());
  require_positive("roll_time", config.roll_time.count());
  require_positive("slip_speed", config.slip_speed);
  require_positive("lost_time", config.lost_time.count());
  require_positive("lost_distance", config.lost_distance);
  if (!(config.max_normal_force >= config.min_normal_force))
    throw InvalidArgument("max_normal_force is below min_normal_force");
  if (config.limits) validate(*config.limits);
}

}  // namespace

struct GraspController::State {
  State(const RobotDescription& description, RigidBody object,
        const GraspControllerConfig& settings)
      : config(settings),
        body(std::move(object)),
        kinematics(description),
        optimizer({.friction_sides = config.friction_sides}),
        path(config.approach_speed) {
    check(config);
    if (kinematics.num_fingers() != kContacts)
      throw InvalidArgument("a grasp needs a robot with three fingers");
    radius = figures(description).tip_radius;
    const SafetyLimits limits = config.limits.value_or(safety_limits(description));
    damping = JointValues::Map(limits.safety_kd.data(), kMaxJoints);
    torque_limits.limits = JointValues::Map(limits.max_torque.data(), kMaxJoints);
    torques.setZero(kMaxJoints);
  }

  void enter(GraspPhase phase) {
    state.phase = phase;
    time = Seconds(0);
  }

  void lose() {
    path.rest_at(tips);
    enter(GraspPhase::kLost);
  }

  // Computes where the tips are and what they feel.
  void sense(const JointState& joints, const Pose& object) {
    kinematics.update(joints.position);
    jacobians = kinematics.tip_jacobians();
    bias = kinematics.bias_torques(joints.velocity);
    tip_velocity = jacobians * joints.velocity;
    rotation = object.orientation.toRotationMatrix();
    for (int i = 0; i < kContacts; ++i) {
      const auto k = static_cast<std::size_t>(i);
      tips[k] = kinematics.tip_position(i);
      normals[k] = rotation * touches[k].normal;
      // The contact force is what gravity and movement do not explain of the torques.
      inverses[k] = jacobians.block<3, 3>(3 * i, 3 * i).inverse();
      const Eigen::Vector3d force =
          inverses[k].transpose() * (joints.torque.segment<3>(3 * i) - bias.segment<3>(3 * i));
      state.normal_forces[i] = force.dot(normals[k]);
      state.tangential_forces[i] = across(force, normals[k]).norm();
    }
    if (!has_sensed) path.rest_at(tips);
    has_sensed = true;
  }

  TipMotions close(Seconds elapsed, const Pose& object) {
    TipMotions motions;
    bool all_touch = true;
    // What trembles in single steps is the noise of velocities and motors.
    const Signal& felt = touch_filter.update(state.normal_forces, elapsed);
    for (std::size_t k = 0; k < motions.size(); ++k) {
      const Eigen::Vector3d inward = rest.orientation * touches[k].normal;
      // A face that has not been felt yet may be further away than a badly homed finger knows.
      const bool has_felt = touch_time[k] > kFirmTouch;
      const bool moves = depth[k] < kStandoff + (has_felt ? 1.0 : 2.0) * config.penetration;
      if (moves) depth[k] += config.closing_speed * elapsed.count();
      motions[k] = {.position = approach_to(touches[k], rest, radius).beside + depth[k] * inward,
                    .velocity = (moves ? config.closing_speed : 0.0) * inward,
                    .acceleration = Eigen::Vector3d::Zero()};
      // A force felt before this depth comes from something else.
      const bool feels = felt[static_cast<Eigen::Index>(k)] > config.touch_force &&
                         depth[k] > kStandoff - config.penetration;
      touch_time[k] = feels ? touch_time[k] + elapsed : Seconds(0);
      all_touch = all_touch && touch_time[k] > kFirmTouch;
    }
    if (all_touch) {
      for (std::size_t k = 0; k < tips.size(); ++k) {
        first_touch[k] = in_object(tips[k], object);
        targets[k] = in_object(motions[k].position, object);
      }
      numb_time.fill(Seconds(0));
      slip_filter.reset();
      enter(GraspPhase::kEngage);
    } else if (time > config.closing_time) {
      lose();
    }
    return motions;
  }

  TipMotions hold(Seconds elapsed, const Motion& object, const Motion& desired,
                  const JointValues& velocity) {
    double share = 1.0;
    if (state.phase == GraspPhase::kEngage) {
      share = minimum_jerk(time, config.engage_time).value;
      if (time >= config.engage_time) enter(GraspPhase::kHold);
    }
    Grasp grasp;
    for (std::size_t k = 0; k < grasp.size(); ++k) {
      grasp[k] = {.position = tips[k] + radius * normals[k],
                  .normal = normals[k],
                  .friction = config.friction,
                  .min_normal_force =
                      config.touch_force + share * (config.min_normal_force - config.touch_force),
                  .max_normal_force = config.max_normal_force};
    }
    Wrench wrench = object_impedance(desired, object.pose, object.twist, body, config.object);
    wrench.force *= share;
    wrench.moment *= share;
    torque_limits.jacobians = jacobians;
    torque_limits.bias = bias + damping.cwiseProduct(velocity);
    state.felt = twist_of(grasp, object.pose.position, rolling_velocities(velocity));
    state.wanted = optimizer.solve(grasp, object.pose.position, wrench, torque_limits);

    TipMotions motions;
    bool is_lost = (object.pose.position - desired.pose.position).norm() > config.lost_distance;
    const double follow = std::min(elapsed / config.roll_time, 1.0);
    for (std::size_t k = 0; k < motions.size(); ++k) {
      const auto i = static_cast<Eigen::Index>(k);
      const Eigen::Vector3d tip = in_object(tips[k], object.pose);
      targets[k] += follow * (tip - targets[k]);
      motions[k] = point_of_body(desired, targets[k]);
      state.travel[i] = across(tip - first_touch[k], touches[k].normal).norm();
      const Eigen::Vector3d face =
          object.twist.linear + object.twist.angular.cross(tips[k] - object.pose.position);
      along_faces.segment<3>(3 * i) = across(tip_velocity.segment<3>(3 * i) - face, normals[k]);
      const bool feels = state.normal_forces[i] > 0.3 * config.touch_force;
      numb_time[k] = feels ? Seconds(0) : numb_time[k] + elapsed;
      is_lost = is_lost || numb_time[k] > config.lost_time;
    }
    const Signal& slow = slip_filter.update(along_faces, elapsed);
    for (int i = 0; i < kContacts; ++i) state.slip_speeds[i] = slow.segment<3>(3 * i).norm();
    state.is_slipping = state.slip_speeds.maxCoeff() > config.slip_speed;
    if (is_lost) lose();
    return motions;
  }

  // The velocities of the tips' surfaces where they touch.
  [[nodiscard]] ContactForces rolling_velocities(const JointValues& velocity) const {
    ContactForces velocities;
    for (int i = 0; i < kContacts; ++i) {
      const Eigen::Vector3d turning = kinematics.tip_rotation_jacobian(i) * velocity;
      velocities.segment<3>(3 * i) = tip_velocity.segment<3>(3 * i) +
                                     turning.cross(radius * normals[static_cast<std::size_t>(i)]);
    }
    return velocities;
  }

  void plan_approach() {
    TipPath::Points above;
    TipPath::Points beside;
    for (std::size_t k = 0; k < touches.size(); ++k) {
      const Approach approach = approach_to(touches[k], rest, radius);
      above[k] = approach.above;
      beside[k] = approach.beside;
    }
    path.begin({above, beside});
  }

  void plan_release() {
    TipPath::Points back;
    TipPath::Points up;
    for (std::size_t k = 0; k < tips.size(); ++k) {
      back[k] = tips[k] - kStandoff * normals[k];
      up[k] = back[k];
      up[k].z() = std::max(back[k].z(), kApproachHeight);
    }
    path.rest_at(tips);
    path.begin({back, up});
  }

  [[nodiscard]] Eigen::Vector3d in_object(const Eigen::Vector3d& point, const Pose& object) const {
    return rotation.transpose() * (point - object.position);
  }

  // Sets the forces of the tips on their surroundings that make the tips follow `motions`.
  void press(const TipMotions& motions, bool holds) {
    forces.setZero(3 * kContacts);
    if (holds) forces = state.wanted.forces;
    for (int i = 0; i < kContacts; ++i) {
      const auto k = static_cast<std::size_t>(i);
      auto force = forces.segment<3>(3 * i);
      force += tip_impedance(motions[k], tips[k], tip_velocity.segment<3>(3 * i), config.tips);
      if (!holds) continue;
      // The sum of the wanted forces and the impedance must not make a tip slip.
      const double normal = std::max(force.dot(normals[k]), config.touch_force);
      const Eigen::Vector3d tangential = across(force, normals[k]);
      const double most = config.slip_friction * normal;
      const double length = tangential.norm();
      force = normal * normals[k] + (length > most ? most / length : 1.0) * tangential;
    }
  }

  GraspControllerConfig config;
  RigidBody body;
  Kinematics kinematics;
  ForceOptimizer optimizer;
  TorqueLimits torque_limits;
  double radius;  // Radius of the tips.
  JointValues damping;

  GraspState state;
  Seconds time{0};  // Time since this phase began.
  bool has_sensed{false};

  Touches touches;
  Pose rest;  // Pose of the object until it is held.
  TipPath path;
  bool is_path_planned{true};

  JointMatrix jacobians;
  std::array<Eigen::Matrix3d, kContacts> inverses;  // Inverse of each finger's own Jacobian.
  JointValues bias;
  JointValues tip_velocity;
  Eigen::Matrix3d rotation;
  std::array<Eigen::Vector3d, kContacts> tips;
  std::array<Eigen::Vector3d, kContacts> normals;

  std::array<double, kContacts> depth{};        // How far each closing tip is past the standoff.
  std::array<Seconds, kContacts> touch_time{};  // How long each tip has felt its face.
  std::array<Seconds, kContacts> numb_time{};   // How long each tip has not felt its face.
  // Centres of the tips, in the object's frame.
  std::array<Eigen::Vector3d, kContacts> first_touch;
  std::array<Eigen::Vector3d, kContacts> targets;

  Signal along_faces{JointValues::Zero(3 * kContacts)};  // Velocities of the tips [m/s].
  LowPassFilter slip_filter{kSlipCutoff};
  LowPassFilter touch_filter{kTouchCutoff};
  FrictionCompensation friction;

  JointValues forces;
  JointValues torques;
};

GraspController::GraspController(const RobotDescription& description, const RigidBody& body,
                                 const GraspControllerConfig& config)
    : state_(std::make_unique<State>(description, body, config)) {}
GraspController::GraspController(GraspController&&) noexcept = default;
GraspController& GraspController::operator=(GraspController&&) noexcept = default;
GraspController::~GraspController() = default;

void GraspController::grasp(const Touches& touches, const Pose& object) noexcept {
  State& s = *checked(state_);
  s.touches = touches;
  s.rest = object;
  s.depth.fill(0.0);
  s.touch_time.fill(Seconds(0));
  s.touch_filter.reset();
  s.is_path_planned = false;
  s.enter(GraspPhase::kApproach);
}

void GraspController::release() noexcept {
  checked(state_)->is_path_planned = false;
  checked(state_)->enter(GraspPhase::kRelease);
}

const GraspState& GraspController::state() const noexcept { return checked(state_)->state; }

const JointValues& GraspController::update(Seconds elapsed, const JointState& joints,
                                           const Motion& object, const Motion& desired) noexcept {
  State& s = *checked(state_);
  s.time += elapsed;
  s.sense(joints, object.pose);
  s.state.wanted = {};
  s.state.felt = {};
  s.state.slip_speeds.setZero();
  s.state.is_slipping = false;

  TipMotions motions;
  const GraspPhase phase = s.state.phase;
  switch (phase) {
    case GraspPhase::kIdle:
    case GraspPhase::kLost:
      motions = s.path.advance(elapsed);
      break;
    case GraspPhase::kApproach:
      if (!std::exchange(s.is_path_planned, true)) s.plan_approach();
      motions = s.path.advance(elapsed);
      if (s.path.is_complete()) s.enter(GraspPhase::kClose);
      break;
    case GraspPhase::kClose:
      motions = s.close(elapsed, object.pose);
      break;
    case GraspPhase::kEngage:
    case GraspPhase::kHold:
      motions = s.hold(elapsed, object, desired, joints.velocity);
      break;
    case GraspPhase::kRelease:
      if (!std::exchange(s.is_path_planned, true)) s.plan_release();
      motions = s.path.advance(elapsed);
      if (s.path.is_complete()) s.enter(GraspPhase::kIdle);
      break;
  }
  s.press(motions, phase == GraspPhase::kEngage || phase == GraspPhase::kHold);

  const TipPositions drift = s.kinematics.tip_accelerations(joints.velocity);
  JointValues acceleration(3 * kContacts);
  JointValues rates(3 * kContacts);
  for (int i = 0; i < kContacts; ++i) {
    const auto k = static_cast<std::size_t>(i);
    acceleration.segment<3>(3 * i) =
        s.inverses[k] * (motions[k].acceleration - drift.segment<3>(3 * i));
    rates.segment<3>(3 * i) = s.inverses[k] * motions[k].velocity;
  }
  const JointValues pushed = s.jacobians.transpose() * s.forces;
  s.torques = pushed + s.friction.torques(rates, pushed, phase == GraspPhase::kApproach, elapsed) +
              s.kinematics.mass_matrix() * acceleration + s.bias +
              s.damping.cwiseProduct(joints.velocity);
  s.state.torque_share = s.torques.cwiseQuotient(s.torque_limits.limits).cwiseAbs().maxCoeff();
  return s.torques;
}

}  // namespace trifinger::control
