// SPDX-License-Identifier: BSD-3-Clause
#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "control/ballistics.hpp"
#include "manipulation/parts/object_of.hpp"
#include "manipulation/parts/phased.hpp"
#include "manipulation/parts/settings.hpp"
#include "manipulation/skills/makers.hpp"
#include "manipulation/skills/throw/stroke.hpp"
#include "trifinger/base/error.hpp"
#include "trifinger/control/impedance.hpp"
#include "trifinger/control/trajectories.hpp"
#include "trifinger/model/kinematics.hpp"

namespace trifinger::manipulation {
namespace {

using config::Node;
using config::Range;

struct ThrowConfig {
  std::string object;
  Seconds wait_time;
  Seconds centre_time;
  Seconds watch_time;
  double approach_speed;   // [rad/s]
  double cradle_distance;  // [m]
  double centre_distance;  // [m]
  double rest_speed;       // [m/s]
  double feedback;         // [1/s]
  double least_distance;   // [m]
  double distance;         // How far the ball should land after practice [m].
  int practice;            // Throws before the one that counts.
  Stroke stroke;
  Eigen::Vector3d ball;  // Where the ball lies when the stroke begins [m].
};

ThrowConfig read_throw(const Node& root, const control::SafetyLimits& limits) {
  const Range time = above_zero("s", 60);
  const Range length = above_zero("m", 1);
  ThrowConfig config{
      .object = root.required<std::string>("object"),
      .wait_time = read_time(root, "wait_time", time),
      .centre_time = read_time(root, "centre_time", time),
      .watch_time = read_time(root, "watch_time", time),
      .approach_speed = root.required<double>("approach_speed", above_zero("rad/s", 5)),
      .cradle_distance = root.required<double>("cradle_distance", length),
      .centre_distance = root.required<double>("centre_distance", length),
      .rest_speed = root.required<double>("rest_speed", above_zero("m/s", 1)),
      .feedback = root.required<double>("feedback", {.unit = "1/s", .min = 0, .max = 20}),
      .least_distance = root.required<double>("least_distance", {.unit = "m", .min = 0, .max = 10}),
      .distance = root.required<double>("distance", above_zero("m", 10)),
      .practice = root.required<int>("practice", {.min = 0, .max = 10}),
      .stroke = {},
      .ball = {}};
  if (config.distance < config.least_distance) {
    throw config::ConfigError(root.at("distance").location(),
                              "distance must be at least least_distance");
  }
  // All strokes are read, so that a mistake in any of them is found.
  const auto name = root.required<std::string>("stroke");
  std::string names;
  bool is_found = false;
  for (const std::string_view known : {"usual", "far"}) {
    const Node section = root.section("strokes").section(known);
    Stroke stroke{
        .spacing = read_time(section, "spacing", time),
        .targets = {},
        .stiffness = section.required<double>("stiffness", above_zero("Nm/rad", 50)),
        .damping = section.required<double>("damping", {.unit = "Nms/rad", .min = 0, .max = 0.5})};
    for (const Node& target : section.at("targets", "rad").items()) {
      const auto joints =
          target.as<std::array<double, kMaxJoints>>({.unit = "rad", .min = -7, .max = 7});
      stroke.targets.push_back(joint_values(joints));
    }
    const auto ball =
        section.required<std::array<double, 3>>("ball", {.unit = "m", .min = -1, .max = 1});
    const auto most =
        section.required<double>("safety_kd", {.unit = "Nms/rad", .min = 0, .max = 1});
    names += (names.empty() ? "'" : "' and '") + std::string(known);
    if (known != name) continue;
    is_found = true;
    if (*std::ranges::max_element(limits.safety_kd) > most) {
      throw InvalidArgument("the stroke '" + name +
                            "' is for a robot with less safety_kd: 'trifinger run throw_far'");
    }
    validate(stroke, limits);
    config.stroke = std::move(stroke);
    config.ball = Eigen::Vector3d::Map(ball.data());
  }
  if (!is_found) {
    throw config::ConfigError(root.at("stroke").location(),
                              "stroke is '" + name + "', must be one of " + names + "'");
  }
  return config;
}

enum class ThrowPhase : std::uint8_t { kApproach, kWait, kCentre, kThrow, kWatch, kDone, kFailed };

// Throws a ball that lies on the tips.
class Throw final : public Phased<Throw, ThrowPhase> {
 public:
  Throw(const SkillContext& context, ThrowConfig config)
      : Phased(context.period),
        config_(std::move(config)),
        limits_(context.limits),
        kinematics_(context.description),
        ball_(object_of(context.description, config_.object, ObjectShape::kBall)),
        still_(config_.stroke),
        correction_(Eigen::Vector3d::Zero()),
        last_targets_(config_.stroke.targets.front()),
        begin_(last_targets_) {
    still_.damping = std::max(still_.damping, kStillDamping);
    if (!context.description.flipped)
      throw InvalidArgument("to throw, the fingers must point up: 'platform: flipped'");
    kinematics_.update(last_targets_);
    // Each tip carries a third of the ball.
    const Eigen::Vector3d weight = ball_.mass / 3.0 * control::gravity();
    const TipPositions forces = weight.replicate<3, 1>();
    weight_ = -kinematics_.tip_jacobians().transpose() * forces;
    jacobians_ = kinematics_.tip_jacobians();
    phase_ = Phase::kWait;
    set_state();
  }

  [[nodiscard]] std::string_view object() const noexcept override { return config_.object; }
  [[nodiscard]] Seconds max_duration() const noexcept override {
    const Seconds one = kMaxApproach + 2 * config_.wait_time + config_.centre_time +
                        config_.stroke.duration() + config_.watch_time + Seconds(1);
    return (1 + config_.practice) * one;
  }

  void see(TimeIndex captured, const Pose& pose) noexcept override {
    if (is_seen_ && captured <= last_seen_) return;
    flight_.add(clock_.time_of(captured), pose.position);
    measured_ = pose;
    if (!is_seen_) {
      place_ = pose.position;
      last_seen_ = captured;
      is_seen_ = true;
      return;
    }
    // Noise is averaged away: a ball on the fingers hardly moves.
    const Eigen::Vector3d step = kSmoothing * (pose.position - place_);
    const Seconds elapsed = clock_.time_of(captured - last_seen_);
    place_ += step;
    velocity_ += kSmoothing * (step / elapsed.count() - velocity_);
    last_seen_ = captured;
  }

  [[nodiscard]] const TriFinger::Action& update(
      TimeIndex step, const control::JointState& joints) noexcept override {
    const Seconds elapsed = clock_.advance(step);
    if (!has_begun_) begin_at(joints);
    follow_phases(elapsed);
    act(elapsed, joints);
    set_state();
    return action_;
  }

  void stop() noexcept override {
    // A stroke takes less time than to stop the ball safely.
    is_stopped_ = true;
    stop_phase("it was stopped");
    set_state();
  }

  [[nodiscard]] const SkillState& state() const noexcept override { return state_; }

  [[nodiscard]] std::vector<Figure> figures(const SkillTrace& trace,
                                            std::span<const SeenPose> poses) const override {
    // The last throw.
    const auto is_watch = [](const SkillStep& step) {
      return step.phase == row_of(Phase::kWatch).name;
    };
    auto watch = std::ranges::find_if(trace.steps, is_watch);
    for (auto step = watch; step != trace.steps.end(); ++step)
      if (is_watch(*step) && step != watch && !is_watch(*std::prev(step))) watch = step;
    control::BallisticEstimator flight(kFlightTolerance);
    if (watch != trace.steps.end()) {
      const TimeIndex first = watch->step + static_cast<TimeIndex>(kReleaseTime / trace.period);
      for (const SeenPose& seen : poses)
        if (seen.step >= first && seen.pose.position.z() > kLowest)
          flight.add(trace.period * static_cast<double>(seen.step), seen.pose.position);
    }
    std::vector<Figure> figures;
    if (const auto distance = distance_of(flight)) {
      const control::PointMotion release =
          flight.at(trace.period * static_cast<double>(watch->step));
      figures.push_back({"distance", *distance, "m",
                         "from the axis to where it lands, 1 m below the platform's feet"});
      figures.push_back(
          {"speed", release.velocity.norm(), "m/s", "of the ball at the stroke's end"});
      figures.push_back({"elevation", std::asin(release.velocity.normalized().z()), "rad",
                         "of its way at the stroke's end"});
      figures.push_back({"azimuth", std::atan2(release.velocity.y(), release.velocity.x()), "rad",
                         "of its way, from x towards y"});
    }
    if (announced_) {
      figures.push_back({"announced", *announced_, "m",
                         "where it should land, as the throw before told for this robot"});
    }
    figures.push_back({"num_poses", static_cast<double>(flight.count()), "", "seen in its flight"});
    return figures;
  }

 private:
  using Phase = ThrowPhase;
  using enum ThrowPhase;
  friend Phased;
  static const std::array<Row, 7> kPhases;

  static constexpr Seconds kMaxApproach{10};
  static constexpr Seconds kMaxLate{2};
  static constexpr Seconds kRestTime{0.3};           // In which the ball must lie still.
  static constexpr Seconds kOldPose{0.2};            // An older pose says nothing.
  static constexpr double kSmoothing = 0.15;         // Share of a new pose in the ball's place.
  static constexpr double kFlightTolerance = 0.004;  // [m]
  static constexpr double kLowest = 0.06;            // Below it the ball meets the table [m].
  static constexpr double kFloorDepth = 1.0;         // Below the feet of the platform [m].
  static constexpr double kAtStart = 0.03;           // Joints so near need no approach [rad].
  static constexpr double kStillDamping = 0.1;       // [Nms/rad]
  static constexpr double kMaxCorrection = 0.01;     // [m]
  static constexpr int kBisections = 20;

  void end(std::string_view failure) noexcept {
    failure_ = failure;
    enter(failure.empty() ? Phase::kDone : Phase::kFailed);
  }

  void begin_at(const control::JointState& joints) noexcept {
    has_begun_ = true;
    is_seen_ = has_left_ = is_down_ = is_braking_ = false;
    flight_.reset();
    distance_.reset();
    velocity_.setZero();
    correction_.setZero();
    begin_ = joints.position;
    const double displacement = (begin_ - config_.stroke.targets.front()).cwiseAbs().maxCoeff();
    approach_time_ = std::min(Seconds(displacement / config_.approach_speed), kMaxApproach);
    enter(displacement > kAtStart ? Phase::kApproach : Phase::kWait);
    if (displacement <= kAtStart) approach_time_ = Seconds(0);
  }

  [[nodiscard]] bool is_ball_in_cradle() const noexcept {
    return is_seen_ && clock_.now() - clock_.time_of(last_seen_) < kOldPose &&
           (place_ - config_.ball).norm() < config_.cradle_distance;
  }

  // Links that have swung out come late.
  [[nodiscard]] bool is_at_start() const noexcept {
    const Seconds late = clock_.in_phase() - approach_time_;
    return late >= Seconds(0) && (lag_ < kAtStart || late > kMaxLate);
  }
  [[nodiscard]] bool has_thrown() const noexcept {
    return clock_.in_phase() >= config_.stroke.duration();
  }

  void wait(Seconds /*elapsed*/) noexcept {
    if (is_ball_in_cradle() && velocity_.norm() < 3 * config_.rest_speed) {
      enter(Phase::kCentre);
    } else if (clock_.in_phase() >= config_.wait_time) {
      end(is_seen_ ? "no ball lies on the fingers" : "nobody has said where the ball is");
    }
  }

  void watch(Seconds /*elapsed*/) noexcept {
    if (clock_.in_phase() >= kReleaseTime && !std::exchange(has_left_, true)) flight_.reset();
    if (has_left_) note_flight();
    if (clock_.in_phase() >= config_.watch_time) finish();
  }

  void centre(Seconds /*elapsed*/) noexcept {
    const Seconds elapsed = clock_.in_phase();
    if (!is_ball_in_cradle()) {
      end("the ball has left the fingers");
      return;
    }
    const double error = (place_ - config_.ball).norm();
    if (error > config_.centre_distance || velocity_.norm() > config_.rest_speed)
      rest_begin_ = elapsed;
    if (elapsed - rest_begin_ >= kRestTime) {
      enter(Phase::kThrow);
    } else if (elapsed >= config_.centre_time) {
      end("the ball does not come to rest in the middle");
    }
  }

  // The flight as long as the ball has not met the table.
  void note_flight() noexcept {
    if (flight_.count() == 0) return;
    is_down_ = is_down_ || measured_.position.z() < kLowest;
    if (is_down_) return;
    distance_ = distance_of(flight_);
    release_ = flight_.at(clock_.now() - clock_.in_phase());
  }

  void finish() noexcept {
    if (is_stopped_) {
      end("it was stopped");
    } else if (!distance_) {
      end("the ball was not seen in its flight");
    } else if (*distance_ < config_.least_distance) {
      end("the ball was not thrown");
    } else if (practised_ < config_.practice) {
      ++practised_;
      announce(*distance_);
      has_begun_ = false;
    } else {
      end({});
    }
  }

  // This robot has thrown the ball so far. One that throws farther than it should throws slower.
  void announce(double thrown) noexcept {
    announced_ = std::min(thrown, config_.distance);
    double low = 0.0;
    double high = 1.0;
    for (int i = 0; i < kBisections; ++i) {
      const double share = (low + high) / 2;
      (landing_of(share) < *announced_ ? low : high) = share;
    }
    config_.stroke.spacing /= high;
  }

  // Where the ball would have landed with this share of its velocity [m].
  [[nodiscard]] double landing_of(double share) const noexcept {
    const Eigen::Vector3d velocity = share * release_.velocity;
    const double g = -control::gravity().z();
    const double drop = release_.position.z() - ball_.size[0] / 2 + kFloorDepth;
    const double time =
        (velocity.z() + std::sqrt(std::max(velocity.z() * velocity.z() + 2 * g * drop, 0.0))) / g;
    return (release_.position + time * velocity).head<2>().norm();
  }

  // Where a ball lands that is seen in its flight.
  [[nodiscard]] std::optional<double> distance_of(
      const control::BallisticEstimator& flight) const noexcept {
    if (flight.count() < 4) return std::nullopt;
    const auto time = flight.falls_through(ball_.size[0] / 2 - kFloorDepth);
    if (!time) return std::nullopt;
    return flight.at(*time).position.head<2>().norm();
  }

  void act(Seconds elapsed, const control::JointState& joints) noexcept {
    if (has_left_) {
      if (!std::exchange(is_braking_, true)) last_targets_ = joints.position;
      kinematics_.update(joints.position);
      brake(last_targets_, limits_, kinematics_.gravity_torques(), action_);
      torque_share_ = 0.0;
      return;
    }
    StrokeTargets targets = targets_at(config_.stroke, Seconds(-1));
    kinematics_.update(joints.position);
    JointValues torque = kinematics_.gravity_torques();
    switch (phase_) {
      case Phase::kApproach: {
        const control::Progress progress = control::minimum_jerk(clock_.in_phase(), approach_time_);
        const JointValues displacement = targets.position - begin_;
        targets = {begin_ + progress.value * displacement, progress.rate * displacement};
        break;
      }
      case Phase::kWait:
        torque += weight_;
        break;
      case Phase::kCentre: {
        // The cradle moves against the ball's error.
        correction_ += elapsed.count() * config_.feedback * (config_.ball - place_);
        const double length = correction_.norm();
        if (length > kMaxCorrection) correction_ *= kMaxCorrection / length;
        targets.position += shift_of(correction_);
        torque += weight_;
        break;
      }
      case Phase::kThrow:
      case Phase::kWatch: {
        const Seconds time =
            phase_ == Phase::kThrow ? clock_.in_phase() : config_.stroke.duration();
        targets = targets_at(config_.stroke, time);
        // What brought the ball to the middle fades out.
        const double rest = std::max(1.0 - time / config_.stroke.duration(), 0.0);
        targets.position += rest * shift_of(correction_);
        torque += rest * weight_;
        break;
      }
      case Phase::kDone:
      case Phase::kFailed:
        targets = {last_targets_, JointValues::Zero(kMaxJoints)};
        break;
    }
    last_targets_ = targets.position;
    lag_ = (targets.position - joints.position).cwiseAbs().maxCoeff();
    // With the damping of a stroke alone, late torques make fingers tremble that hold a ball.
    const bool moves_fast = phase_ == Phase::kThrow || phase_ == Phase::kWatch;
    const Stroke& stroke = moves_fast ? config_.stroke : still_;
    follow(stroke, targets, limits_, torque, action_);
    double share = 0.0;
    for (std::size_t i = 0; i < TriFinger::kJoints; ++i) {
      const auto k = static_cast<Eigen::Index>(i);
      const double asked = action_.torque[i] +
                           stroke.stiffness * (targets.position[k] - joints.position[k]) -
                           (stroke.damping + limits_.safety_kd[i]) * joints.velocity[k];
      share = std::max(share, std::abs(asked) / limits_.max_torque[i]);
    }
    torque_share_ = std::min(share, 1.0);
  }

  // The joints' way for the same small shift of all tips.
  [[nodiscard]] JointValues shift_of(const Eigen::Vector3d& shift) const noexcept {
    JointValues displacement(kMaxJoints);
    for (Eigen::Index i = 0; i < kMaxJoints; i += 3)
      displacement.segment<3>(i) = jacobians_.block<3, 3>(i, i).inverse() * shift;
    return displacement;
  }

  void set_state() noexcept {
    state_.phase = row_of(phase_).name;
    state_.has_ended = phase_ == Phase::kDone || phase_ == Phase::kFailed;
    state_.failure = failure_;
    state_.desired = {.pose = {.position = config_.ball}};
    state_.object.pose = {.position = place_, .orientation = measured_.orientation};
    state_.torque_share = torque_share_;
  }

  ThrowConfig config_;
  control::SafetyLimits limits_;
  Kinematics kinematics_;
  ObjectDescription ball_;
  Stroke still_;  // The stroke as it holds the ball: with more damping.
  JointMatrix jacobians_;
  JointValues weight_;  // Torques that carry the ball in the cradle [Nm].

  std::string_view failure_;
  bool has_begun_{false};
  bool is_stopped_{false};
  int practised_{0};
  std::optional<double> announced_;  // [m]
  Seconds approach_time_{0};
  double lag_{0.0};  // Largest error of a joint [rad].
  Seconds rest_begin_{0};

  // What is known of the ball.
  bool is_seen_{false};
  bool has_left_{false};
  bool is_down_{false};
  bool is_braking_{false};
  TimeIndex last_seen_{-1};
  Pose measured_;
  Eigen::Vector3d place_{Eigen::Vector3d::Zero()};
  Eigen::Vector3d velocity_{Eigen::Vector3d::Zero()};
  control::BallisticEstimator flight_{kFlightTolerance};
  std::optional<double> distance_;
  control::PointMotion release_{};  // At the end of the stroke.

  Eigen::Vector3d correction_;
  JointValues last_targets_;
  JointValues begin_;
  double torque_share_{0.0};
  TriFinger::Action action_;
  SkillState state_;
};

constinit const std::array<Throw::Row, 7> Throw::kPhases{{
    // name, when it is stopped, done, next, entry, during
    {"approach", &Throw::end, &Throw::is_at_start, kWait},
    {"wait", &Throw::end, nullptr, kCentre, nullptr, &Throw::wait},
    {"centre", &Throw::end, nullptr, kThrow, nullptr, &Throw::centre},
    {"throw", nullptr, &Throw::has_thrown, kWatch},
    {"watch", nullptr, nullptr, kDone, nullptr, &Throw::watch},
    {"done"},
    {"failed"},
}};

}  // namespace

std::unique_ptr<Skill> make_throw(const SkillContext& context, const config::Node& root) {
  return std::make_unique<Throw>(context, read_throw(root, context.limits));
}

}  // namespace trifinger::manipulation
