// SPDX-License-Identifier: BSD-3-Clause
#include <Eigen/Geometry>
#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <optional>
#include <string>
#include <utility>

#include "manipulation/parts/object_of.hpp"
#include "manipulation/parts/phase_clock.hpp"
#include "manipulation/parts/settings.hpp"
#include "manipulation/parts/tip_servo.hpp"
#include "manipulation/parts/tip_trajectory.hpp"
#include "manipulation/parts/torque_action.hpp"
#include "manipulation/skills/balance/tilt_observer.hpp"
#include "manipulation/skills/makers.hpp"
#include "model/rotation_between.hpp"
#include "trifinger/control/impedance.hpp"

namespace trifinger::manipulation {
namespace {

using config::Range;
using Eigen::Vector2d;
using Eigen::Vector3d;

// config/skills/balance.yml explains every key.
struct BalanceConfig {
  std::string object;
  Seconds duration;
  double largest_tilt;
  double farthest;
  Seconds longest_blind;
  double tilt_weight;
  double place_weight;
  double speed_weight;
  double speed_gain;
  double height_stiffness;
  double height_damping;
  TiltObserverConfig observer;
};

BalanceConfig read_balance(const config::Node& root) {
  const Range time = above_zero("s", 86400);
  const Range weight{.min = 0, .max = 1e6};
  const config::Node control = root.section("control");
  const config::Node observer = root.section("observer");
  return {
      .object = root.required<std::string>("object"),
      .duration = read_time(root, "duration", time),
      .largest_tilt = root.required<double>("largest_tilt", above_zero("rad", 1)),
      .farthest = root.required<double>("farthest", above_zero("m", 0.3)),
      .longest_blind = read_time(root, "longest_blind", time),
      .tilt_weight = control.required<double>("tilt_weight", weight),
      .place_weight = control.required<double>("place_weight", above_zero("", 1e6)),
      .speed_weight = control.required<double>("speed_weight", weight),
      .speed_gain = control.required<double>("speed_gain", {.unit = "1/s", .min = 0, .max = 1e3}),
      .height_stiffness =
          control.required<double>("height_stiffness", {.unit = "1/s^2", .min = 0, .max = 1e5}),
      .height_damping =
          control.required<double>("height_damping", {.unit = "1/s", .min = 0, .max = 1e3}),
      .observer = {
          .position_noise = observer.required<double>("position_noise", above_zero("m", 0.1)),
          .tilt_noise = observer.required<double>("tilt_noise", above_zero("rad", 1)),
          .disturbance =
              observer.required<double>("disturbance", {.unit = "rad/s", .min = 0, .max = 100}),
          .drift = observer.required<double>("drift", {.unit = "m", .min = 0, .max = 1})}};
}

// The gains of the acceleration of the tip on tilt, its rate, place and speed that minimise the
// integral of weights times squares, with 1 for the acceleration: the discrete Riccati equation,
// iterated.
Eigen::RowVector4d regulator(const TippingBox& box, const BalanceConfig& config, Seconds period) {
  const double dt = period.count();
  Eigen::Matrix4d a = Eigen::Matrix4d::Identity();
  a(0, 1) = dt;
  a(1, 0) = dt * box.fall();
  a(2, 3) = dt;
  const Eigen::Vector4d b(-dt * dt / 2 * box.lever(), -dt * box.lever(), dt * dt / 2, dt);
  const Eigen::Matrix4d weights =
      Eigen::Vector4d(config.tilt_weight, 0.0, config.place_weight, config.speed_weight)
          .asDiagonal();
  // Any positive beginning leads to the gains that keep it upright; without a cost of tilts at the
  // end, doing nothing would be a solution, too.
  Eigen::Matrix4d cost = weights + Eigen::Matrix4d::Identity();
  Eigen::RowVector4d gain = Eigen::RowVector4d::Zero();
  constexpr int kMaxIterations = 200000;
  for (int i = 0; i < kMaxIterations; ++i) {
    gain = b.transpose() * cost * a / (1.0 + b.dot(cost * b));
    const Eigen::Matrix4d next = weights + a.transpose() * cost * (a - b * gain);
    const double change = (next - cost).cwiseAbs().maxCoeff() / next.cwiseAbs().maxCoeff();
    cost = (next + next.transpose()) / 2;
    if (change < 1e-9) break;
  }
  return gain;
}

// Keeps a box upright on one tip.
class Balance final : public Skill {
 public:
  Balance(const SkillContext& context, BalanceConfig config)
      : config_(std::move(config)),
        object_(object_of(context.description, config_.object, ObjectShape::kBox)),
        clock_(context.period),
        servo_(context.description, context.limits),
        damping_(JointValues::Map(context.limits.safety_kd.data(), kMaxJoints)),
        limits_(JointValues::Map(context.limits.max_torque.data(), kMaxJoints)),
        box_(tipping_box(object_, servo_.tip_radius())),
        gain_(regulator(box_, config_, context.period)),
        observer_(box_, config_.observer, context.period),
        longest_(static_cast<int>(std::ranges::max_element(object_.size) - object_.size.begin())) {
    enter(Phase::kLook);
  }

  [[nodiscard]] std::string_view object() const noexcept override { return config_.object; }
  [[nodiscard]] Seconds max_duration() const noexcept override {
    return config_.duration + kLongestLook + Seconds(1.0);
  }
  void see(TimeIndex captured, const Pose& pose) noexcept override;
  [[nodiscard]] const TriFinger::Action& update(
      TimeIndex step, const control::JointState& joints) noexcept override;
  void stop() noexcept override {
    if (!state_.has_ended) fail("it was stopped");
  }
  [[nodiscard]] const SkillState& state() const noexcept override { return state_; }
  [[nodiscard]] std::vector<Figure> figures(const SkillTrace& trace,
                                            std::span<const SeenPose> poses) const override;

 private:
  enum class Phase : std::uint8_t { kLook, kBalance, kDone, kFailed };

  static TippingBox tipping_box(const ObjectDescription& object, double tip_radius) {
    auto size = object.size;
    std::ranges::sort(size);
    const double width = (size[0] + size[1]) / 2;
    return {.half_height = size[2] / 2,
            .gyration = std::sqrt((size[2] * size[2] + width * width) / 12),
            .tip_radius = tip_radius};
  }

  void enter(Phase phase) noexcept {
    constexpr std::array<std::string_view, 4> kNames{"look", "balance", "done", "failed"};
    phase_ = phase;
    clock_.begin_phase();
    state_.phase = kNames[static_cast<std::size_t>(phase)];
    state_.has_ended = phase == Phase::kDone || phase == Phase::kFailed;
  }
  void fail(std::string_view failure) noexcept {
    state_.failure = failure;
    enter(Phase::kFailed);
  }
  // The direction of the long edge that points up.
  [[nodiscard]] Vector3d edge_of(const Pose& pose) const noexcept {
    const Vector3d edge = pose.orientation * Vector3d::Unit(longest_);
    return edge.z() < 0 ? Vector3d(-edge) : edge;
  }
  void take_pose() noexcept;
  void find_finger() noexcept;
  void follow_phases() noexcept;
  void sense(Seconds elapsed) noexcept;
  void balance() noexcept;

  BalanceConfig config_;
  ObjectDescription object_;
  PhaseClock clock_;
  TipServo servo_;
  JointValues damping_;
  JointValues limits_;
  TippingBox box_;
  Eigen::RowVector4d gain_;
  TiltObserver observer_;
  int longest_;  // Index of the longest edge.

  Phase phase_{Phase::kLook};
  SkillState state_;
  TriFinger::Action action_;
  std::array<TipTrajectory, control::kContacts> trajectories_;
  bool has_sensed_{false};
  control::JointState joints_;
  std::optional<SeenPose> first_;
  std::optional<SeenPose> new_pose_;
  TimeIndex last_seen_{-1};
  int finger_{0};

  Eigen::Matrix3d jacobian_{Eigen::Matrix3d::Identity()};  // Of the point w.
  Vector3d start_{Vector3d::Zero()};                       // Of the tip.
  TipInput input_;
  TiltEstimate estimate_;
  Vector2d speed_{Vector2d::Zero()};  // That the tip should have [m/s].
  double share_{0.0};
};

void Balance::see(TimeIndex captured, const Pose& pose) noexcept {
  if (!pose.position.allFinite() || !pose.orientation.coeffs().allFinite()) return;
  if (phase_ == Phase::kLook) {
    first_ = {captured, pose};
    return;
  }
  new_pose_ = {captured, pose};
}

void Balance::take_pose() noexcept {
  if (!new_pose_) return;
  const Vector3d edge = edge_of(new_pose_->pose);
  const Vector2d tilt(std::atan2(edge.x(), edge.z()), std::atan2(edge.y(), edge.z()));
  if (observer_.see(new_pose_->step, tilt, new_pose_->pose.position.head<2>()))
    last_seen_ = new_pose_->step;
  new_pose_.reset();
}

// The finger on whose tip the box stands.
void Balance::find_finger() noexcept {
  const Vector3d foot = first_->pose.position - box_.half_height * edge_of(first_->pose);
  double least = std::numeric_limits<double>::infinity();
  for (int i = 0; i < control::kContacts; ++i) {
    const double distance = (foot - servo_.tip(i) - box_.tip_radius * Vector3d::UnitZ()).norm();
    if (distance >= least) continue;
    least = distance;
    finger_ = i;
  }
  constexpr double kFarthest = 0.02;
  if (!(least < kFarthest)) {
    fail("the object does not stand on a tip");
    return;
  }
  start_ = servo_.tip(finger_);
  input_ = {};
  speed_.setZero();
  input_.place = start_.head<2>();
  // The tip has rested since the first pose was captured.
  observer_.reset(first_->step);
  observer_.move(clock_.step(), input_);
  new_pose_ = first_;
  take_pose();
  estimate_ = observer_.estimate();
  last_seen_ = clock_.step();
  enter(Phase::kBalance);
}

void Balance::follow_phases() noexcept {
  if (phase_ == Phase::kLook) {
    if (first_) {
      find_finger();
    } else if (clock_.in_phase() >= kLongestLook) {
      fail("the object was not seen");
    }
    return;
  }
  if (phase_ != Phase::kBalance) return;
  const Vector3d drift = servo_.tip(finger_) - start_;
  if (observer_.has_seen() && estimate_.tilt.norm() > config_.largest_tilt) {
    fail("the object fell");
  } else if (drift.norm() > config_.farthest) {
    fail("the tip went too far");
  } else if (clock_.now() - clock_.time_of(last_seen_) > config_.longest_blind) {
    fail("the object was out of sight");
  } else if (clock_.in_phase() >= config_.duration) {
    enter(Phase::kDone);
  }
}

// Computes how the point moves that was at the top of the tip: the tip turns, too.
void Balance::sense(Seconds elapsed) noexcept {
  const Kinematics& kinematics = servo_.kinematics();
  const int first = kJointsPerFinger * finger_;
  jacobian_ = kinematics.tip_jacobian(finger_).block<3, 3>(0, first);
  const Eigen::Matrix3d turning = kinematics.tip_rotation_jacobian(finger_).block<3, 3>(0, first);
  jacobian_.row(0) += box_.tip_radius * turning.row(1);
  jacobian_.row(1) -= box_.tip_radius * turning.row(0);
  input_.rate = (jacobian_ * joints_.velocity.segment<3>(first)).head<2>();
  const Vector2d rolling = input_.rate - servo_.velocity(finger_).head<2>();
  input_.roll += elapsed.count() * rolling;
  input_.place = servo_.tip(finger_).head<2>() + input_.roll;
}

void Balance::balance() noexcept {
  const int first = kJointsPerFinger * finger_;
  const Vector2d tilt = estimate_.tilt - estimate_.balance;
  const Vector2d place = input_.place - start_.head<2>();
  Vector2d wanted = Vector2d::Zero();
  if (observer_.has_seen()) {
    wanted =
        -(gain_[0] * tilt + gain_[1] * estimate_.rate + gain_[2] * place + gain_[3] * input_.rate);
  } else {
    wanted = -config_.height_stiffness * place - config_.height_damping * input_.rate;
  }
  // The friction of joints must not take away what is wanted.
  constexpr double kForget = 5.0;  // [1/s]
  speed_ += clock_.period().count() * (wanted - kForget * (speed_ - input_.rate));
  const Vector2d pushed = wanted + config_.speed_gain * (speed_ - input_.rate);
  const Vector3d& tip = servo_.tip(finger_);
  const Vector3d acceleration(pushed.x(), pushed.y(),
                              config_.height_stiffness * (start_.z() - tip.z()) -
                                  config_.height_damping * servo_.velocity(finger_).z());
  // The box presses on the tip: its weight, and what its centre's acceleration takes.
  const Vector2d falling = box_.fall() * tilt - box_.lever() * wanted;
  const Vector2d carried = object_.mass * (wanted + box_.half_height * falling);
  const Vector3d force(carried.x(), carried.y(), object_.mass * TippingBox::kGravity);

  const Kinematics& kinematics = servo_.kinematics();
  const Vector3d drift = kinematics.tip_accelerations(joints_.velocity).segment<3>(first);
  const Eigen::Matrix3d mass = kinematics.mass_matrix().block<3, 3>(first, first);
  const JointValues bias = kinematics.bias_torques(joints_.velocity);
  const Vector3d velocity = joints_.velocity.segment<3>(first);
  const Vector3d torque =
      jacobian_.transpose() * force + mass * (jacobian_.inverse() * (acceleration - drift)) +
      bias.segment<3>(first) + damping_.segment<3>(first).cwiseProduct(velocity);
  for (int j = 0; j < kJointsPerFinger; ++j) {
    const int joint = first + j;
    action_.torque[static_cast<std::size_t>(joint)] = torque[j];
  }
  share_ = torque.cwiseQuotient(limits_.segment<3>(first)).cwiseAbs().maxCoeff();
}

const TriFinger::Action& Balance::update(TimeIndex step,
                                         const control::JointState& joints) noexcept {
  const Seconds elapsed = clock_.advance(step);
  joints_ = joints;
  servo_.sense(joints);
  if (!std::exchange(has_sensed_, true)) {
    for (int i = 0; i < control::kContacts; ++i)
      trajectories_[static_cast<std::size_t>(i)].rest_at(servo_.tip(i));
    clock_.begin_phase();
  }
  if (phase_ == Phase::kLook) {
    follow_phases();
  } else {
    sense(elapsed);
    observer_.move(step, input_);
    take_pose();
    estimate_ = observer_.estimate();
    follow_phases();
  }

  TipsCommand command;
  for (int i = 0; i < control::kContacts; ++i) {
    const auto k = static_cast<std::size_t>(i);
    command.forces[k] =
        control::tip_impedance(trajectories_[k].advance(elapsed), servo_.tip(i), servo_.velocity(i),
                               {.stiffness = 300.0, .damping = 6.0});
  }
  set_torques(action_, servo_.torques(command, elapsed));
  share_ = servo_.torque_share();
  if (phase_ == Phase::kBalance) balance();

  state_.torque_share = share_;
  const Vector3d up(std::tan(estimate_.tilt.x()), std::tan(estimate_.tilt.y()), 1.0);
  state_.object.pose.orientation = rotation_between(Vector3d::UnitZ(), up);
  state_.object.pose.position =
      servo_.tip(finger_) + (box_.tip_radius + box_.half_height) * up.normalized();
  state_.desired.pose.position = start_ + (box_.tip_radius + box_.half_height) * Vector3d::UnitZ();
  return action_;
}

std::vector<Figure> Balance::figures(const SkillTrace& trace,
                                     std::span<const SeenPose> poses) const {
  TimeIndex begin = 0;
  TimeIndex end = 0;
  double share = 0.0;
  for (const SkillStep& step : trace.steps) {
    if (step.phase != "balance") continue;
    if (begin == 0) begin = step.step;
    end = step.step;
    share = std::max(share, step.torque_share);
  }
  double largest = 0.0;
  double squares = 0.0;
  int count = 0;
  for (const SeenPose& seen : poses) {
    if (seen.step < begin || seen.step > end) continue;
    const double tilt = std::acos(std::min(edge_of(seen.pose).z(), 1.0));
    largest = std::max(largest, tilt);
    squares += tilt * tilt;
    ++count;
  }
  return {{.name = "time",
           .value = trace.period.count() * static_cast<double>(end - begin),
           .unit = "s",
           .meaning = "for which it was balanced"},
          {.name = "tilt_rms",
           .value = count > 0 ? std::sqrt(squares / count) : 0.0,
           .unit = "rad",
           .meaning = "of the object"},
          {.name = "tilt_max", .value = largest, .unit = "rad", .meaning = "of the object"},
          {.name = "torque_share",
           .value = share,
           .unit = "1",
           .meaning = "largest requested torque, as a share of its limit"}};
}

}  // namespace

std::unique_ptr<Skill> make_balance(const SkillContext& context, const config::Node& root) {
  return std::make_unique<Balance>(context, read_balance(root));
}

}  // namespace trifinger::manipulation
