// SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <array>
#include <cstddef>

#include "manipulation/parts/towards.hpp"
#include "manipulation/skills/draw/draw.hpp"
#include "trifinger/control/impedance.hpp"

namespace trifinger::manipulation {
namespace {

using control::PointMotion;
using control::Progress;
using Eigen::Quaterniond;
using Eigen::Vector3d;

constexpr Seconds kRollTime{0.3};      // In which the tips' places in the grip follow rolling tips.
constexpr double kSqueezeRate = 2.0;   // [N/s]
constexpr double kMaxNibError = 0.02;  // A pen that is held is nearer to where it should be [m].
constexpr double kMaxTiltError = 0.5;  // [rad]
constexpr double kMaxShift = 0.02;     // That the feedback makes up for [m].
constexpr double kYieldRate = 10.0;    // How fast the tips go along with a lean [1/s].
constexpr double kYieldShare = 0.3;    // With which share of it.
constexpr double kMaxTilt = 0.35;      // [rad]
// A nib that floats higher than kFelt above the paper is pressed down with this stiffness, and
// harder for as long as it is not kSunk below it, where a nib that is pressed is. With more the
// grip would need more force than it has.
constexpr double kFloating = 1000;       // [N/m]
constexpr double kFloatingGain = 3000;   // [N/ms]
constexpr double kFelt = 1e-4;           // [m]
constexpr double kSunk = 7e-5;           // [m]
constexpr double kMaxExtraPress = 0.25;  // [N]
// Each of the two tips on one side presses with at least this share of the first tip's force.
constexpr double kMinShare = 0.4;
// Faster tips are not damped more: a motor that hangs free in the play of its belt would be driven
// to and fro by its own damping, which comes too late for so little inertia [m/s].
constexpr double kMaxRate = 0.1;
constexpr double kSafePress = 5.0;  // Largest force of a tip on the pen [N].

}  // namespace

// Corrects the estimate by what a pose shows of the time when it was captured.
void Draw::correct(TimeIndex captured, const PenAxis& seen) noexcept {
  if (captured < 0 || clock_.step() - captured >= static_cast<TimeIndex>(history_.size())) return;
  // A pose of this very step comes before its joints.
  const PenAxis& then = captured > clock_.step()
                            ? felt_
                            : history_[static_cast<std::size_t>(captured) % history_.size()];
  const Vector3d error = seen.nib - then.nib;
  const Vector3d turn = then.up.cross(seen.up);
  is_lost_ = error.norm() > kMaxNibError || turn.norm() > kMaxTiltError;
  const Seconds since = clock_.period() * static_cast<double>(captured - last_seen_);
  const double share = std::min(config_.sight_gain * since.count(), 0.2);
  felt_.nib += share * error;
  felt_.up = control::rotation_from_vector(share * turn) * felt_.up;
}

// The tips roll on the pen without slipping: how the pen moves follows from how they move and turn.
// Positions of joints say that, not their velocities, whose noise would add up.
void Draw::feel(const JointValues& moved) noexcept {
  control::Grasp grasp;
  control::ContactForces displacements;
  for (std::size_t k = 0; k < 3; ++k) {
    const int of = grip_.fingers[k];
    const Vector3d arm = servo_.tip_radius() * normal_at(k);
    grasp[k].position = servo_.tip(of) + arm;
    const Vector3d turn = servo_.kinematics().tip_rotation_jacobian(of) * moved;
    twist_ += (k == 0 ? 0.5 : 0.25) * turn.dot(inward_);
    displacements.segment<3>(3 * static_cast<Eigen::Index>(k)) =
        servo_.tip(of) - last_tips_[k] + turn.cross(arm);
  }
  const control::Twist twist = control::twist_of(grasp, felt_.nib, displacements);
  felt_.nib += twist.linear;
  felt_.up = (control::rotation_from_vector(twist.angular) * felt_.up).normalized();
  const auto now = static_cast<std::size_t>(std::max<TimeIndex>(clock_.step(), 0));
  history_[now % history_.size()] = felt_;
}

// Moves the tips against the errors that are felt.
void Draw::make_up(Seconds elapsed) noexcept {
  if (phase_ == Phase::kLift || phase_ == Phase::kLower) return;  // The holder leads it, too.
  Vector3d error = nib_.position - felt_.nib;
  if (phase_ == Phase::kDraw) error.z() = 0.0;  // There a force acts.
  shift_ += config_.nib_gain * elapsed.count() * error;
  shift_ = shift_.cwiseMax(-kMaxShift).cwiseMin(kMaxShift);
  const Vector3d turn = felt_.up.cross(turn_ * Vector3d::UnitZ());
  // Turned about the direction of the grip against a pen that leans, the two tips come to lie
  // beside it and push it over all the more. There they go along with a part of the lean.
  const Vector3d lean = turn.dot(inward_) * inward_;
  const Vector3d aside = correction_.dot(inward_) * inward_;
  correction_ += elapsed.count() *
                 (config_.tilt_gain * (turn - lean) - kYieldRate * (kYieldShare * lean + aside));
  if (correction_.norm() > kMaxTilt) correction_ *= kMaxTilt / correction_.norm();
}

// Sets where the nib and the pen should be now.
void Draw::lead(Seconds elapsed) noexcept {
  Quaterniond turn = control::rotation_from_vector(tilt_);
  if (phase_ == Phase::kDraw) {
    const NibMotion motion = strokes_[stroke_][part_].at(clock_.in_phase());
    nib_ = {.position = on_paper(motion.position, 0.0),
            .velocity = {motion.velocity.x(), motion.velocity.y(), 0.0},
            .acceleration = {motion.acceleration.x(), motion.acceleration.y(), 0.0}};
  } else {
    nib_ = nib_trajectory_.advance(elapsed);
  }
  if (phase_ == Phase::kCarry || phase_ == Phase::kReturn) {
    const Progress progress = control::minimum_jerk(clock_.in_phase(), Seconds(1.5));
    turn = control::rotation_from_vector((1.0 - progress.value) * tilt_);
  } else if (phase_ != Phase::kLift) {
    turn = Quaterniond::Identity();
  }
  // Tips of rubber twist the pen with them. It leans with the links, which are turned on the way:
  // held upright against them, it would slip.
  turn_ = control::rotation_from_vector(twist_ * grip_.inward) * turn;
}

// The forces of the tips that hold the pen: the weight, what the paper does, and the grip.
void Draw::add_grip(TipVectors& forces) noexcept {
  const auto now = tips();
  const double share = std::min(squeeze_ / config_.grip.force, 1.0);
  control::Grasp grasp;
  Vector3d centre = Vector3d::Zero();
  for (std::size_t k = 0; k < 3; ++k) {
    const Vector3d normal = normal_at(k);
    grasp[k] = {.position = now[k] + servo_.tip_radius() * normal,
                .normal = normal,
                .friction = config_.friction,
                .min_normal_force = k == 0 ? squeeze_ : kMinShare * squeeze_,
                .max_normal_force = kSafePress};
    centre += grasp[k].position / 3;
  }
  const Quaterniond turn = corrected_turn();
  const Vector3d nib = nib_.position + shift_;
  const Vector3d middle = nib + reach_ * (turn * Vector3d::UnitZ());
  const Vector3d weight = share * pen_.mass * control::gravity();
  Vector3d paper = press_ * Vector3d::UnitZ();
  const double speed = nib_.velocity.norm();
  // A nib that hardly moves rubs less.
  constexpr double kSliding = 2e-3;  // [m/s]
  paper -= config_.paper_friction * press_ * nib_.velocity / std::max(speed, kSliding);
  const control::Wrench wrench{
      .force = -weight - paper,
      .moment = -(middle - centre).cross(weight) - (nib - centre).cross(paper)};
  const control::ForceDistribution wanted = optimizer_.solve(grasp, centre, wrench);
  for (std::size_t k = 0; k < 3; ++k)
    forces[finger(k)] += wanted.forces.segment<3>(3 * static_cast<Eigen::Index>(k));
}

// The forces of tips that do not touch the pen.
void Draw::follow_trajectories(TipsCommand& command, Seconds elapsed) noexcept {
  command.are_free = phase_ == Phase::kApproach;
  for (int i = 0; i < control::kContacts; ++i) {
    const auto k = static_cast<std::size_t>(i);
    const PointMotion motion = trajectories_[k].advance(elapsed);
    command.forces[k] =
        control::tip_impedance(motion, servo_.tip(i), servo_.velocity(i), config_.tips);
    command.velocities[k] = motion.velocity;
    command.accelerations[k] = motion.acceleration;
  }
}

// How tips that touch the pen should move, in the order of the grip.
std::array<PointMotion, 3> Draw::motions_with_pen(Seconds elapsed) noexcept {
  std::array<PointMotion, 3> motions;
  for (std::size_t k = 0; k < 3; ++k) motions[k].position = touch_[k];
  if (leads()) {
    lead(elapsed);
    make_up(elapsed);
    const Quaterniond turn = corrected_turn();
    inward_ = turn * grip_.inward;
    for (std::size_t k = 0; k < 3; ++k) {
      motions[k] = nib_;
      motions[k].position += shift_ + turn * arms_[k];
    }
  }
  if (phase_ == Phase::kDraw) {
    // On the paper a force acts instead of a height: the tips keep their heights among each other.
    const auto now = tips();
    double above = 0.0;
    for (std::size_t k = 0; k < 3; ++k) above += (motions[k].position - now[k]).z() / 3;
    for (PointMotion& motion : motions) motion.position.z() -= above;
    shift_.z() -= above;
  }
  return motions;
}

// Tips roll differently. What moves them against each other must not become a force, so their
// places in the grip follow.
void Draw::let_roll(const std::array<Vector3d, 3>& errors, Seconds elapsed) noexcept {
  const auto now = tips();
  control::Grasp places;
  control::ContactForces all;
  for (std::size_t k = 0; k < 3; ++k) {
    places[k].position = now[k];
    all.segment<3>(3 * static_cast<Eigen::Index>(k)) = errors[k];
  }
  const control::Twist together = control::twist_of(places, now[0], all);
  const Quaterniond turn = corrected_turn();
  const double share = std::min(elapsed / kRollTime, 1.0);
  for (std::size_t k = 0; k < 3; ++k) {
    const Vector3d rest = errors[k] - together.linear - together.angular.cross(now[k] - now[0]);
    arms_[k] -= share * (turn.conjugate() * rest);
  }
}

void Draw::press(TipsCommand& command, Seconds elapsed) noexcept {
  if (!grips()) {
    follow_trajectories(command, elapsed);
    return;
  }
  TipVectors& forces = command.forces;
  const std::array<PointMotion, 3> motions = motions_with_pen(elapsed);
  const double height = felt_.nib.z() - pen_radius_;
  double wanted_press = 0.0;
  if (phase_ == Phase::kDraw) {
    extra_press_ += kFloatingGain * elapsed.count() * (height + kSunk);
    extra_press_ = std::clamp(extra_press_, 0.0, kMaxExtraPress);
    const double pushed_down = extra_press_ + kFloating * std::max(height - kFelt, 0.0);
    wanted_press = config_.press + std::min(pushed_down, kMaxExtraPress);
  }
  constexpr double kPressRate = 2.0;  // [N/s]
  press_ = towards(press_, wanted_press, kPressRate * elapsed.count());
  squeeze_ = phase_ == Phase::kClose
                 ? closing_.pull()
                 : towards(squeeze_, config_.grip.force, kSqueezeRate * elapsed.count());

  std::array<Vector3d, 3> errors;
  std::array<Vector3d, 3> rates;
  const auto now = tips();
  const auto speeds = velocities();
  for (std::size_t k = 0; k < 3; ++k) {
    errors[k] = motions[k].position - now[k];
    rates[k] = motions[k].velocity - speeds[k];
    rates[k] *= kMaxRate / std::max(rates[k].norm(), kMaxRate);
  }
  if (leads()) let_roll(errors, elapsed);
  const double gap_error = gap(errors);
  const double gap_rate = gap(rates);
  for (std::size_t k = 0; k < 3; ++k) {
    const double side = k == 0 ? 1.0 : -1.0;
    const double share = k == 0 ? 1.0 : 0.5;
    const Vector3d error = errors[k] + side * gap_error / 2 * inward_;
    const Vector3d rate = rates[k] + side * gap_rate / 2 * inward_;
    forces[finger(k)] = config_.tips.stiffness * error + config_.tips.damping * rate -
                        side * share * config_.tips.damping * gap_rate / 2 * inward_;
    command.velocities[finger(k)] = motions[k].velocity;
    command.accelerations[finger(k)] = motions[k].acceleration;
    if (phase_ == Phase::kClose) forces[finger(k)] += side * share * squeeze_ * inward_;
  }
  if (phase_ != Phase::kClose) add_grip(forces);
}

Motion Draw::desired() const noexcept {
  Motion desired{.pose = rest_};
  if (leads()) {
    desired.pose.orientation = turn_ * upright_;
    desired.pose.position = nib_.position - reach_ * (desired.pose.orientation * Vector3d::UnitX());
    desired.twist.linear = nib_.velocity;
  }
  return desired;
}

}  // namespace trifinger::manipulation
