// SPDX-License-Identifier: BSD-3-Clause
#include "manipulation/parts/pinched_handling.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <utility>

#include "manipulation/parts/object_of.hpp"
#include "manipulation/parts/plan_untried.hpp"
#include "manipulation/parts/settings.hpp"
#include "manipulation/parts/soft_limits.hpp"
#include "manipulation/parts/torque_figure.hpp"
#include "manipulation/parts/towards.hpp"
#include "trifinger/control/impedance.hpp"

namespace trifinger::manipulation {
namespace {

using config::Range;
using control::PointMotion;
using Eigen::Vector3d;

constexpr Seconds kLongestPinch{5.0};
constexpr Seconds kPinchCheckTime{1.0};
constexpr double kPinchRate = 3.0;  // [N/s]
constexpr double kCarryRate = 2.5;  // Of the share of the weight [1/s].
constexpr double kPinchFit = 8e-3;  // Largest error of the distance of tips that pinch [m].
constexpr Seconds kPinchNumbTime{0.05};
// The tip that turns is this far from the face before and after a turn [m].
constexpr double kHover = 0.015;
constexpr double kLowerSpeed = 0.04;  // [m/s]
// The tip that turns pushes along the face with at most this share of the force with which it
// presses on the face. Our choice: less than half of what friction bears in the simulation.
constexpr double kSlipRatio = 0.45;
constexpr double kPress = 1.5e-3;     // Below the table, so that the box surely rests on it [m].
constexpr double kMaxIntegral = 0.5;  // Of the integral of the angle's error [rad].
constexpr int kMaxCorrections = 4;
constexpr int kPosesForAngle = 20;
constexpr Seconds kCorrectionTime{1.0};  // The tips that hold the box lose it in a faster one.

Vector3d flat(const Vector3d& vector) noexcept {
  return Vector3d(vector.x(), vector.y(), 0.0).normalized();
}

double half_height(const ObjectDescription& box, const Eigen::Quaterniond& orientation) noexcept {
  const Eigen::Matrix3d rotation = orientation.toRotationMatrix();
  double height = 0.0;
  for (int i = 0; i < 3; ++i)
    height += std::abs(rotation(2, i)) * box.size[static_cast<std::size_t>(i)] / 2;
  return height;
}

// The force of a tip on a face, whose inward normal is `normal`, that makes it neither slip nor
// pull. A tip that slips hops: it loses the face many times a second.
Vector3d within_friction(const Vector3d& force, const Vector3d& normal) noexcept {
  const double press = std::max(force.dot(normal), 0.0);
  const Vector3d along = force - force.dot(normal) * normal;
  const double length = along.norm();
  const double most = kSlipRatio * press;
  return press * normal + (length > most ? most / length : 1.0) * along;
}

// The place where the tip that turns waits.
Vector3d waiting_place(const Pinch& pinch, double height) noexcept {
  constexpr double kDistance = 0.055;
  Vector3d place = pinch.centre + (pinch.length / 2 + kDistance) * pinch.forward;
  place.z() = height;
  return place;
}

Vector3d touch_of_pusher(const Pinch& pinch, const PinchedHandlingConfig& config, double radius,
                         double angle, double distance) noexcept {
  return turn_by(pinch, angle) *
         (config.arm * pinch.forward + (pinch.above + radius + distance) * Vector3d::UnitZ());
}

Vector3d beside(const Pinch& pinch, double distance, double side) noexcept {
  return pinch.centre + side * (pinch.width / 2 + distance) * pinch.axis;
}

// Checks whether fingers reach points.
class ReachCheck {
 public:
  ReachCheck(const Kinematics& kinematics, const control::SafetyLimits& limits)
      : kinematics_(kinematics), limits_(limits) {}

  [[nodiscard]] bool reaches(int finger, const Vector3d& point) const noexcept {
    const FingerPose pose = kinematics_.inverse_kinematics(finger, point);
    return pose && is_within_soft_limits(pose, finger, limits_, kLimitMargin);
  }

 private:
  const Kinematics& kinematics_;
  const control::SafetyLimits& limits_;
};

bool reaches_all(const ReachCheck& check, const Pinch& pinch, const PinchedHandlingConfig& config,
                 double radius) noexcept {
  const Vector3d up = (config.lift_height - pinch.centre.z()) * Vector3d::UnitZ();
  for (const double side : {-1.0, 1.0}) {
    const int finger = side < 0 ? pinch.left : pinch.right;
    Vector3d point = beside(pinch, radius, side);
    if (!check.reaches(finger, point) || !check.reaches(finger, point + up)) return false;
    point = beside(pinch, radius + config.clearance, side);
    if (!check.reaches(finger, point)) return false;
    point.z() = config.approach_height;
    if (!check.reaches(finger, point)) return false;
  }
  constexpr int kAngles = 4;
  for (int i = 0; i <= kAngles; ++i) {
    const double angle = config.turn_angle * i / kAngles;
    if (!check.reaches(pinch.pusher,
                       pinch.centre + up + touch_of_pusher(pinch, config, radius, angle, kHover)))
      return false;
  }
  return check.reaches(pinch.pusher, waiting_place(pinch, config.approach_height));
}

}  // namespace

PinchedHandlingConfig read_pinched_handling(const config::Node& root, bool across_longest) {
  const Range length = above_zero("m", 0.3);
  const Range force = above_zero("N", 10);
  const Range time = above_zero("s", 600);
  const Range angle = above_zero("rad", 1.7);
  const Range stiffness = above_zero("N/m", 5000);
  const config::Node approach = root.section("approach");
  const config::Node pinch = root.section("pinch");
  const config::Node lift = root.section("lift");
  const config::Node turn = root.section("turn");
  return {.object = root.required<std::string>("object"),
          .look_time = read_time(root, "look_time", time),
          .max_duration = read_time(root, "max_duration", time),
          .attempts = root.required<int>("attempts", {.min = 1, .max = 100}),
          .end_tolerance = root.required<double>("end_tolerance", angle),
          .approach_speed = approach.required<double>("speed", above_zero("m/s", 1)),
          .approach_height = approach.required<double>("height", length),
          .clearance = approach.required<double>("clearance", length),
          .pinch_height = pinch.required<double>("height", length),
          .closing_force = pinch.required<double>("closing_force", force),
          .closing_speed = pinch.required<double>("closing_speed", above_zero("m/s", 1)),
          .pinch_force = pinch.required<double>("force", force),
          .loose_force = pinch.required<double>("loose_force", force),
          .tips = {.stiffness = pinch.required<double>("stiffness", stiffness),
                   .damping =
                       pinch.required<double>("damping", {.unit = "Ns/m", .min = 0, .max = 100})},
          .lift_height = lift.required<double>("height", length),
          .lift_time = read_time(lift, "time", time),
          .arm = turn.required<double>("arm", length),
          .turn_angle = turn.required<double>("angle", angle),
          .turn_time = read_time(turn, "time", time),
          .turn_stiffness = turn.required<double>("stiffness", stiffness),
          .turn_gain = turn.required<double>("gain", {.unit = "1/s", .min = 0, .max = 100}),
          .turn_tolerance = turn.required<double>("tolerance", angle),
          .across_longest = across_longest};
}

std::optional<Pinch> choose_pinch(const Kinematics& kinematics, const control::SafetyLimits& limits,
                                  const ObjectDescription& box, const Pose& pose,
                                  const PinchedHandlingConfig& config, double tip_radius,
                                  std::span<const int> tried) {
  const ReachCheck check(kinematics, limits);
  const Eigen::Matrix3d rotation = pose.orientation.toRotationMatrix();
  int upright = 0;
  rotation.row(2).cwiseAbs().maxCoeff(&upright);
  constexpr double kMinUprightCosine = 0.97;  // Cosine of the tilt of a box that rests on a face.
  if (std::abs(rotation(2, upright)) < kMinUprightCosine) return std::nullopt;
  const auto size = [&](int i) { return box.size[static_cast<std::size_t>(i)]; };
  const double longest = *std::ranges::max_element(box.size);

  std::optional<Pinch> best;
  double best_score = 0.0;
  for (const int across : {(upright + 1) % 3, (upright + 2) % 3}) {
    const int along = 3 - upright - across;
    if (config.across_longest && size(along) < longest) continue;
    for (int pusher = 0; pusher < control::kContacts; ++pusher) {
      if (std::ranges::find(tried, pusher) != tried.end()) continue;
      const auto side_of = [&](int finger) {
        const double azimuth = kinematics.finger_azimuth(finger);
        return Vector3d(std::cos(azimuth), std::sin(azimuth), 0.0);
      };
      Pinch pinch;
      pinch.pusher = pusher;
      pinch.forward = flat(rotation.col(along));
      if (pinch.forward.dot(side_of(pusher)) < 0) pinch.forward = -pinch.forward;
      pinch.axis = pinch.forward.cross(Vector3d::UnitZ());
      pinch.left = (pusher + 1) % control::kContacts;
      pinch.right = (pusher + 2) % control::kContacts;
      if (side_of(pinch.left).dot(pinch.axis) > side_of(pinch.right).dot(pinch.axis))
        std::swap(pinch.left, pinch.right);
      pinch.centre = pose.position;
      pinch.centre.z() = config.pinch_height;
      pinch.width = size(across);
      pinch.length = size(along);
      pinch.above = size(upright) - config.pinch_height;
      const double score = pinch.forward.dot(side_of(pusher));
      if (score > best_score && reaches_all(check, pinch, config, tip_radius)) {
        best = pinch;
        best_score = score;
      }
    }
  }
  return best;
}

PinchedHandling::PinchedHandling(const SkillContext& context, PinchedHandlingConfig config)
    : TipsSkill(context),
      config_(std::move(config)),
      box_(object_of(context.description, config_.object, ObjectShape::kBox)),
      limits_(context.limits),
      planning_(context.description),
      closing_(config_.closing_speed, config_.closing_force, config_.tips) {}

constinit const std::array<PinchedHandling::Row, 14> PinchedHandling::kPhases{{
    // name, when it is stopped, done, next, entry, during
    {"look", &S::fail, nullptr, kPlan, nullptr, &S::look},
    {"plan", &S::fail},
    {"approach", &S::open, &S::are_tips_there, kPinch, &S::begin_pinch},
    {"pinch", &S::open, &S::is_pressed, kLift, &S::begin_lift, &S::pinch},
    {"lift", &S::put_down, &S::is_middle_there, kReach, &S::begin_reach, &S::watch},
    {"reach", &S::put_down, &S::is_pusher_there, kTurn, &S::begin_turn, &S::watch},
    {"turn", &S::put_down, nullptr, kWithdraw, nullptr, &S::turn},
    {"withdraw", &S::note_failure, &S::is_pusher_there, kLower, &S::begin_lower, &S::watch},
    {"lower", &S::note_failure, &S::is_middle_there, kLoosen, nullptr, &S::watch},
    {"loosen", &S::note_failure, &S::has_loosened, kRelease, &S::open_fingers, &S::loosen},
    {"release", &S::note_failure, &S::has_let_go, kCheck, nullptr, &S::release},
    {"check", &S::fail, nullptr, kDone, nullptr, &S::check},
    {"done"},
    {"failed"},
}};

void PinchedHandling::see(TimeIndex captured, const Pose& pose) noexcept {
  if (!estimator_.update(clock_.time_of(captured), pose)) return;
  average_.add(captured, pose);
}

// The third tip goes away from the box.
void PinchedHandling::withdraw_pusher() noexcept {
  const auto k = static_cast<std::size_t>(pinch_.pusher);
  const Vector3d tip = servo_.tip(pinch_.pusher);
  const Vector3d outward = turn_by(pinch_, turned_) * Vector3d::UnitZ();
  trajectories_[k].rest_at(tip);
  trajectories_[k].begin(
      {tip + (kHover + 0.01) * outward, waiting_place(pinch_, config_.approach_height)},
      config_.approach_speed);
}

// Opens the fingers, then fails.
void PinchedHandling::open(std::string_view failure) noexcept {
  note_failure(failure);
  open_fingers();
  enter(Phase::kRelease);
}

void PinchedHandling::open_fingers() noexcept {
  if (phase_ == Phase::kReach || phase_ == Phase::kTurn) withdraw_pusher();
  for (const auto& [finger, side] : {std::pair{pinch_.left, -1.0}, std::pair{pinch_.right, 1.0}}) {
    TipTrajectory& trajectory = trajectories_[static_cast<std::size_t>(finger)];
    const Vector3d back = servo_.tip(finger) + side * config_.clearance * pinch_.axis;
    Vector3d up = back;
    up.z() = std::max(back.z(), config_.approach_height);
    trajectory.rest_at(servo_.tip(finger));
    constexpr double kOpeningSpeed = 0.06;
    trajectory.begin({back, up}, kOpeningSpeed);
  }
}

// Puts the box down where it is, then fails if there is a failure.
void PinchedHandling::put_down(std::string_view failure) noexcept {
  note_failure(failure);
  middle_trajectory_.rest_at(middle_);
  // The poses from now on tell how far it is to the table.
  average_.restart(clock_.step());
  withdraw_pusher();
  enter(Phase::kWithdraw);
}

void PinchedHandling::plan() {
  planned_ = plan_untried(tried_, [this] {
    return choose_pinch(planning_, limits_, box_, rest_, config_, servo_.tip_radius(), tried_);
  });
  if (planned_) tried_.push_back(planned_->pusher);
}

void PinchedHandling::begin() noexcept {
  if (phase_ != Phase::kPlan) return;  // It was stopped meanwhile.
  if (!planned_) {
    fail("the fingers cannot pinch and turn it where it lies");
    return;
  }
  pinch_ = *planned_;
  goal_ = Pose{.position = rest_.position,
               .orientation = turn_by(pinch_, config_.turn_angle) * rest_.orientation};
  for (const double side : {-1.0, 1.0}) {
    const int finger = side < 0 ? pinch_.left : pinch_.right;
    const Vector3d end = beside(pinch_, servo_.tip_radius() + config_.clearance, side);
    Vector3d above = end;
    above.z() = config_.approach_height;
    Vector3d up = servo_.tip(finger);
    up.z() = std::max(up.z(), config_.approach_height);
    trajectories_[static_cast<std::size_t>(finger)].begin({up, above, end}, config_.approach_speed);
  }
  Vector3d up = servo_.tip(pinch_.pusher);
  up.z() = std::max(up.z(), config_.approach_height);
  trajectories_[static_cast<std::size_t>(pinch_.pusher)].begin(
      {up, waiting_place(pinch_, config_.approach_height)}, config_.approach_speed);
  enter(Phase::kApproach);
}

Vector3d PinchedHandling::contact_at(double angle, double distance) const noexcept {
  return middle_ + touch_of_pusher(pinch_, config_, servo_.tip_radius(), angle, distance);
}

// The angle by which the box is turned if the third tip touches it.
double PinchedHandling::tip_angle() const noexcept {
  const Vector3d arm = servo_.tip(pinch_.pusher) - middle_;
  const double begin = std::atan2(pinch_.above + servo_.tip_radius(), config_.arm + rolled_);
  return begin - std::atan2(arm.z(), arm.dot(pinch_.forward));
}

// The third tip rolls along the face, because it turns less than the box.
void PinchedHandling::follow_roll(Seconds elapsed) noexcept {
  const double before = std::exchange(turned_, std::clamp(tip_angle(), 0.0, config_.turn_angle));
  const double rate =
      servo_.angular_velocity(pinch_.pusher).dot(Vector3d::UnitZ().cross(pinch_.forward));
  rolled_ += servo_.tip_radius() * (rate * elapsed.count() - (turned_ - before));
}

double PinchedHandling::seen_angle(const Pose& pose) const noexcept {
  const Vector3d turn = control::rotation_error(pose.orientation, rest_.orientation);
  return turn.dot(Vector3d::UnitZ().cross(pinch_.forward));
}

// The distance of the box from the table.
double PinchedHandling::gap() const noexcept {
  if (average_.count() > 0) {
    const Pose seen = average_.mean();
    return seen.position.z() - half_height(box_, seen.orientation);
  }
  // Nobody sees it: as it must be between the tips.
  const double below = config_.pinch_height;
  double lowest = std::numeric_limits<double>::infinity();
  for (const double forward : {-pinch_.length / 2, pinch_.length / 2}) {
    for (const double up : {-below, pinch_.above}) {
      const Vector3d corner = forward * pinch_.forward + up * Vector3d::UnitZ();
      lowest = std::min(lowest, (turn_by(pinch_, turned_) * corner).z());
    }
  }
  return middle_.z() + lowest;
}

bool PinchedHandling::is_pinched() const noexcept {
  return std::abs(distance_ - pinch_.width - 2 * servo_.tip_radius()) < kPinchFit;
}

void PinchedHandling::sense_object(const control::JointState& /*joints*/,
                                   Seconds /*elapsed*/) noexcept {
  const Vector3d& left = servo_.tip(pinch_.left);
  const Vector3d& right = servo_.tip(pinch_.right);
  middle_ = (left + right) / 2;
  distance_ = (right - left).dot(pinch_.axis);
}

void PinchedHandling::look(Seconds /*elapsed*/) noexcept {
  if (average_.count() > 0 && clock_.in_phase() >= config_.look_time) {
    rest_ = average_.mean();
    if (!first_) first_ = rest_;
    if (goal_ && error_of(rest_, *goal_) <= config_.end_tolerance) {
      enter(Phase::kDone);  // It fell as it should lie.
    } else if (!may_begin_again(*first_, rest_)) {
      fail(wrong_end());
    } else {
      enter(Phase::kPlan);
    }
  } else if (clock_.in_phase() >= kLongestLook) {
    fail("the object was not seen");
  }
}

void PinchedHandling::finish_check() noexcept {
  if (average_.count() == 0) {
    fail("the object was not seen at the end");
  } else if (error_of(average_.mean(), *goal_) > config_.end_tolerance) {
    try_again_or_fail(wrong_end());
  } else {
    enter(Phase::kDone);
  }
}

void PinchedHandling::try_again_or_fail(std::string_view failure) noexcept {
  if (is_stopped_ || attempt_ >= config_.attempts) {
    fail(failure);
    return;
  }
  ++attempt_;
  next_failure_ = {};
  average_.restart(clock_.step());
  enter(Phase::kLook);
}

// Notices a box that is no longer between the tips.
void PinchedHandling::watch(Seconds elapsed) noexcept {
  numb_ = is_pinched() ? Seconds(0) : numb_ + elapsed;
  if (numb_ > kPinchNumbTime) open("the object slipped away");
}

void PinchedHandling::begin_pinch() noexcept {
  middle_trajectory_.rest_at(pinch_.centre);
  squeeze_ = 0.0;
  carried_ = 0.0;
  numb_ = Seconds(0);
  closing_.begin(distance_);
  corrections_ = 0;
  turned_ = 0.0;
}

void PinchedHandling::pinch(Seconds elapsed) noexcept {
  closing_.follow(distance_, is_pinched(), elapsed);
  if (!is_pressed() && clock_.in_phase() > kLongestPinch)
    open("the object was not between the tips");
}

void PinchedHandling::begin_lift() noexcept {
  middle_trajectory_.rest_at(middle_);
  Vector3d up = middle_;
  up.z() = config_.lift_height;
  middle_trajectory_.begin({up}, (up - middle_).norm() / config_.lift_time.count());
}

void PinchedHandling::begin_reach() noexcept {
  trajectories_[static_cast<std::size_t>(pinch_.pusher)].begin(
      {contact_at(0.0, kHover), contact_at(0.0, 0.0)}, config_.approach_speed / 2);
}

void PinchedHandling::begin_turn() noexcept {
  turn_from_ = 0.0;
  turn_to_ = config_.turn_angle;
  turn_sum_ = 0.0;
  rolled_ = 0.0;
}

void PinchedHandling::turn(Seconds elapsed) noexcept {
  constexpr Seconds kSettle{0.15};
  const Seconds duration = corrections_ == 0 ? config_.turn_time : kCorrectionTime;
  follow_roll(elapsed);
  if (clock_.in_phase() < duration + kSettle) {
    average_.restart(clock_.step());
  } else if (average_.count() >= kPosesForAngle ||
             clock_.in_phase() > duration + kSettle + Seconds(0.5)) {
    const double left =
        average_.count() > 0 ? config_.turn_angle - seen_angle(average_.mean()) : 0.0;
    if (left > config_.turn_tolerance && corrections_ < kMaxCorrections) {
      ++corrections_;
      turn_from_ = turn_to_;
      turn_to_ += std::min(left, 0.5);
      enter(Phase::kTurn);
    } else {
      put_down({});
    }
  }
  watch(elapsed);
}

void PinchedHandling::begin_lower() noexcept {
  Vector3d down = middle_;
  down.z() -= std::clamp(gap(), 0.0, config_.lift_height) + kPress;
  middle_trajectory_.rest_at(middle_);
  middle_trajectory_.begin({down}, kLowerSpeed);
}

void PinchedHandling::loosen(Seconds /*elapsed*/) noexcept {
  if (clock_.in_phase() > Seconds(0.8)) middle_trajectory_.rest_at(middle_);
}

void PinchedHandling::release(Seconds /*elapsed*/) noexcept {
  if (!next_failure_.empty() && are_tips_there()) try_again_or_fail(next_failure_);
}

void PinchedHandling::check(Seconds /*elapsed*/) noexcept {
  if (clock_.in_phase() < kPinchCheckTime / 2) {
    average_.restart(clock_.step());
  } else if (clock_.in_phase() >= kPinchCheckTime) {
    finish_check();
  }
}

void PinchedHandling::press(TipsCommand& command, Seconds elapsed) noexcept {
  TipVectors& forces = command.forces;
  TipVectors& velocities = command.velocities;
  TipVectors& accelerations = command.accelerations;
  command.are_free = phase_ == Phase::kApproach;
  const control::TipGains& gains = config_.tips;
  for (int finger = 0; finger < control::kContacts; ++finger) {
    const auto k = static_cast<std::size_t>(finger);
    PointMotion motion = trajectories_[k].advance(elapsed);
    forces[k] = control::tip_impedance(motion, servo_.tip(finger), servo_.velocity(finger), gains);
    velocities[k] = motion.velocity;
    accelerations[k] = motion.acceleration;
  }
  if (!holds()) return;

  if (phase_ == Phase::kPinch && !closing_.has_closed()) {
    squeeze_ = closing_.pull();
  } else {
    const double squeeze = phase_ == Phase::kLoosen ? config_.loose_force : config_.pinch_force;
    squeeze_ = towards(squeeze_, squeeze, kPinchRate * elapsed.count());
  }
  const double weight = phase_ > Phase::kPinch && phase_ < Phase::kLoosen ? 1.0 : 0.0;
  carried_ = towards(carried_, weight, kCarryRate * elapsed.count());

  const PointMotion middle = middle_trajectory_.advance(elapsed);
  const double closing =
      (servo_.velocity(pinch_.right) - servo_.velocity(pinch_.left)).dot(pinch_.axis);
  const double along = squeeze_ + config_.tips.damping * closing / 2;
  for (const double side : {-1.0, 1.0}) {
    const int finger = side < 0 ? pinch_.left : pinch_.right;
    const auto k = static_cast<std::size_t>(finger);
    const PointMotion motion{.position = middle.position + side * distance_ / 2 * pinch_.axis,
                             .velocity = middle.velocity + side * closing / 2 * pinch_.axis,
                             .acceleration = middle.acceleration};
    forces[k] = control::tip_impedance(motion, servo_.tip(finger), servo_.velocity(finger), gains) -
                side * along * pinch_.axis - carried_ * box_.mass / 2 * control::gravity();
    velocities[k] = middle.velocity;
    if (phase_ == Phase::kPinch) velocities[k] -= side * closing_.speed() * pinch_.axis;
    accelerations[k] = motion.acceleration;
  }

  if (phase_ != Phase::kTurn) return;
  const Seconds duration = corrections_ == 0 ? config_.turn_time : kCorrectionTime;
  const control::Progress progress = control::minimum_jerk(clock_.in_phase(), duration);
  const double wanted = turn_from_ + progress.value * (turn_to_ - turn_from_);
  turn_sum_ = std::clamp(turn_sum_ + config_.turn_gain * (wanted - tip_angle()) * elapsed.count(),
                         0.0, kMaxIntegral);
  const auto k = static_cast<std::size_t>(pinch_.pusher);
  const double rate = progress.rate * (turn_to_ - turn_from_);
  const Vector3d arm = contact_at(wanted + turn_sum_, 0.0) - middle_;
  const PointMotion motion{.position = middle_ + arm,
                           .velocity = rate * Vector3d::UnitZ().cross(pinch_.forward).cross(arm),
                           .acceleration = Vector3d::Zero()};
  forces[k] =
      control::tip_impedance(motion, servo_.tip(pinch_.pusher), servo_.velocity(pinch_.pusher),
                             {.stiffness = config_.turn_stiffness, .damping = gains.damping});
  forces[k] = within_friction(forces[k], turn_by(pinch_, turned_) * -Vector3d::UnitZ());
  velocities[k] = motion.velocity;
  accelerations[k].setZero();
}

std::vector<Figure> PinchedHandling::figures(const SkillTrace& trace,
                                             std::span<const SeenPose> poses) const {
  const double time =
      trace.steps.empty() ? 0.0 : trace.period.count() * static_cast<double>(trace.steps.size());
  std::vector<Figure> all{
      {.name = "time", .value = time, .unit = "s", .meaning = "from the first step to the end"},
      torque_share_figure(trace),
      {.name = "attempts",
       .value = static_cast<double>(attempt_),
       .unit = "",
       .meaning = "how often it was pinched"},
      {.name = "corrections",
       .value = static_cast<double>(corrections_),
       .unit = "",
       .meaning = "turns that were added because the poses showed less than was wanted"}};
  if (goal_ && !poses.empty()) {
    PoseAverage end;
    constexpr std::size_t kLast = 30;
    for (const SeenPose& seen : poses.last(std::min(kLast, poses.size()))) end.add(seen.pose);
    all.push_back({.name = "turned",
                   .value = seen_angle(end.mean()),
                   .unit = "rad",
                   .meaning = "about the line between the tips, at the end"});
    all.push_back({.name = "orientation_error",
                   .value = error_of(end.mean(), *goal_),
                   .unit = "rad",
                   .meaning = "of the box at the end"});
  }
  return all;
}

}  // namespace trifinger::manipulation
