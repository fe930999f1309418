// SPDX-License-Identifier: BSD-3-Clause
#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <numbers>
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
#include "manipulation/parts/tips_drive.hpp"
#include "manipulation/skills/makers.hpp"
#include "trifinger/base/error.hpp"
#include "trifinger/control/trajectories.hpp"

namespace trifinger::manipulation {
namespace {

using config::Node;
using config::Range;
using Eigen::Vector2d;
using Eigen::Vector3d;

struct CatchConfig {
  std::string object;
  Seconds wait_time;
  double approach_speed;  // [m/s]
  double height;          // Of the tips' centres [m].
  double open_radius;     // [m]
  double closed_radius;   // [m]
  double reach;           // [m]
  Seconds closing_time;
  Seconds closing_lead;
  double follow_rate;  // [1/s]
  double yield;        // [1]
  Seconds yield_time;
  double hold_force;  // [N]
  Seconds hold_time;
  double lost_distance;  // [m]
  control::TipGains tips;
};

CatchConfig read_catch(const Node& root) {
  const Range time = above_zero("s", 60);
  const Range length = above_zero("m", 1);
  CatchConfig config{
      .object = root.required<std::string>("object"),
      .wait_time = read_time(root, "wait_time", time),
      .approach_speed = root.required<double>("approach_speed", above_zero("m/s", 1)),
      .height = root.required<double>("height", length),
      .open_radius = root.required<double>("open_radius", length),
      .closed_radius = root.required<double>("closed_radius", length),
      .reach = root.required<double>("reach", length),
      .closing_time = read_time(root, "closing_time", time),
      .closing_lead = read_time(root, "closing_lead", time),
      .follow_rate = root.required<double>("follow_rate", above_zero("1/s", 200)),
      .yield = root.required<double>("yield", {.min = 0, .max = 1}),
      .yield_time = read_time(root, "yield_time", time),
      .hold_force = root.required<double>("hold_force", {.unit = "N", .min = 0, .max = 5}),
      .hold_time = read_time(root, "hold_time", time),
      .lost_distance = root.required<double>("lost_distance", length),
      .tips = {
          .stiffness = root.required<double>("tip_stiffness", above_zero("N/m", 5000)),
          .damping = root.required<double>("tip_damping", {.unit = "Ns/m", .min = 0, .max = 100})}};
  if (!(config.closed_radius < config.open_radius))
    throw InvalidArgument("closed_radius is not below open_radius");
  return config;
}

enum class CatchPhase : std::uint8_t { kApproach, kWait, kClose, kHold, kDone, kFailed };

// Catches a ball that falls or flies towards the fingers of a flipped robot.
class Catch final : public Phased<Catch, CatchPhase> {
 public:
  Catch(const SkillContext& context, CatchConfig config)
      : Phased(context.period),
        config_(std::move(config)),
        drive_(context.description, context.limits, config_.tips),
        ball_(object_of(context.description, config_.object, ObjectShape::kBall)) {
    if (!context.description.flipped)
      throw InvalidArgument("to catch, the fingers must point up: 'platform: flipped'");
    const double reach = ball_.size[0] / 2 + trifinger::figures(context.description).tip_radius;
    if (!(config_.closed_radius < reach))
      throw InvalidArgument("closed_radius lets the ball fall between the tips");
    rest_height_ =
        config_.height + std::sqrt(reach * reach - config_.closed_radius * config_.closed_radius);
    for (std::size_t i = 0; i < outward_.size(); ++i) {
      const double azimuth = drive_.kinematics().finger_azimuth(static_cast<int>(i));
      outward_[i] = {std::cos(azimuth), std::sin(azimuth), 0.0};
    }
    radius_ = config_.open_radius;
    phase_ = Phase::kWait;
    note();
  }

  [[nodiscard]] std::string_view object() const noexcept override { return config_.object; }
  [[nodiscard]] Seconds max_duration() const noexcept override {
    return kMaxApproach + config_.wait_time + config_.hold_time + Seconds(3);
  }

  void see(TimeIndex captured, const Pose& pose) noexcept override {
    const Seconds time = clock_.time_of(captured);
    is_seen_ = true;
    last_seen_ = time;
    place_ += 0.4 * (pose.position - place_);
    if (phase_ != Phase::kHold) place_ = pose.position;
    orientation_ = pose.orientation;
    // What the tips have touched no longer flies.
    if (phase_ == Phase::kApproach || phase_ == Phase::kWait || time < contact_)
      flight_.add(time, pose.position);
  }

  [[nodiscard]] const TriFinger::Action& update(
      TimeIndex step, const control::JointState& joints) noexcept override {
    const Seconds elapsed = clock_.advance(step);
    drive_.sense(joints);
    if (!has_begun_) plan_approach();
    follow_phases(elapsed);
    move(elapsed);
    note();
    return action_;
  }

  void stop() noexcept override {
    // A ball that is in the air is caught, one that is held stays held.
    is_stopped_ = true;
    stop_phase("it was stopped");
    note();
  }

  [[nodiscard]] const SkillState& state() const noexcept override { return state_; }

  [[nodiscard]] std::vector<Figure> figures(const SkillTrace& trace,
                                            std::span<const SeenPose> poses) const override {
    std::vector<Figure> figures;
    const auto hold = std::ranges::find(trace.steps, row_of(Phase::kHold).name, &SkillStep::phase);
    if (hold == trace.steps.end()) return figures;
    // The flight until the ball met the tips.
    const TimeIndex met = hold->step - static_cast<TimeIndex>(kUntilHold / trace.period) -
                          static_cast<TimeIndex>(kBeforeContact / trace.period);
    control::BallisticEstimator flight(kFlightTolerance);
    for (const SeenPose& seen : poses)
      if (seen.step <= met)
        flight.add(trace.period * static_cast<double>(seen.step), seen.pose.position);
    if (flight.count() >= 3) {
      const auto through = flight.falls_through(rest_height_);
      if (through) {
        const control::PointMotion arrival = flight.at(*through);
        figures.push_back({"offset", arrival.position.head<2>().norm(), "m",
                           "from the axis to where it came down"});
        figures.push_back({"speed", arrival.velocity.norm(), "m/s", "with which it came down"});
      }
    }
    // Its motion in the last second.
    double most = 0.0;
    const auto tail = static_cast<TimeIndex>(Seconds(1) / trace.period);
    const SeenPose* last = poses.empty() ? nullptr : &poses.back();
    for (const SeenPose& seen : poses)
      if (last != nullptr && seen.step > last->step - tail)
        most = std::max(most, (seen.pose.position - last->pose.position).norm());
    figures.push_back({"motion", most, "m", "of the held ball in the last second"});
    return figures;
  }

 private:
  using Phase = CatchPhase;
  using enum CatchPhase;
  friend Phased;
  static const std::array<Row, 6> kPhases;

  static constexpr Seconds kNever{std::numeric_limits<double>::infinity()};
  static constexpr Seconds kMaxApproach{10};
  static constexpr Seconds kUntilHold{0.08};         // From the contact to the hold.
  static constexpr Seconds kBeforeContact{0.01};     // Poses seen later may be of a touched ball.
  static constexpr Seconds kForceTime{0.1};          // In which the holding force grows.
  static constexpr Seconds kLostTime{0.2};           // So long may a held ball be elsewhere.
  static constexpr double kFlightTolerance = 0.004;  // [m]
  static constexpr double kAtStart = 0.01;           // Tips so near need no approach [m].
  static constexpr std::size_t kEnough = 4;          // Poses that make a flight.

  void end(std::string_view failure) noexcept {
    failure_ = failure;
    enter(failure.empty() ? Phase::kDone : Phase::kFailed);
  }

  void plan_approach() noexcept {
    has_begun_ = true;
    begin_ = drive_.tips();
    double distance = 0.0;
    for (std::size_t i = 0; i < begin_.size(); ++i)
      distance = std::max(distance, (begin_[i] - on_circle(i)).norm());
    approach_time_ = std::min(Seconds(distance / config_.approach_speed), kMaxApproach);
    enter(distance > kAtStart ? Phase::kApproach : Phase::kWait);
  }

  // Where and when the ball comes down to where it will rest on the closed tips.
  struct Arrival {
    Seconds time;
    Vector2d place;
    Vector3d velocity;
  };
  [[nodiscard]] std::optional<Arrival> arrival() const noexcept {
    if (flight_.count() == 0) return std::nullopt;
    const auto time = flight_.falls_through(rest_height_);
    if (!time) return std::nullopt;
    const control::PointMotion there = flight_.at(*time);
    return Arrival{*time, there.position.head<2>(), there.velocity};
  }

  [[nodiscard]] bool is_at_start() const noexcept { return clock_.in_phase() >= approach_time_; }

  void wait(Seconds /*elapsed*/) noexcept {
    const auto coming = arrival();
    if (coming && flight_.count() >= kEnough) {
      aim(*coming);
      if (is_coming(*coming) && clock_.now() >= coming->time - config_.closing_lead) {
        contact_ = coming->time;
        close_begin_ = clock_.now();
        enter(Phase::kClose);
        return;
      }
    }
    if (clock_.in_phase() >= config_.wait_time)
      end(is_seen_ ? "no ball came down to the fingers" : "nobody has said where the ball is");
  }

  void close(Seconds /*elapsed*/) noexcept {
    const auto coming = arrival();
    if (!coming || clock_.now() >= contact_ - kBeforeContact) return;
    contact_ = coming->time;
    aim(*coming);
  }
  [[nodiscard]] bool has_met() const noexcept { return clock_.now() >= contact_ + kUntilHold; }

  void begin_hold() noexcept {
    place_ = expected();
    last_good_ = hold_begin_ = clock_.now();
  }

  void hold(Seconds /*elapsed*/) noexcept {
    const bool is_there = (place_ - expected()).norm() < config_.lost_distance;
    if (is_there && clock_.now() - last_seen_ < kLostTime) last_good_ = clock_.now();
    if (clock_.now() - last_good_ > kLostTime) {
      end(is_there ? "the ball went out of sight" : "the ball fell out of the fingers");
    } else if (clock_.in_phase() >= config_.hold_time) {
      end(is_stopped_ ? "it was stopped" : "");
    }
  }

  // A ball that comes down within reach, or nearly so, and not long ago.
  [[nodiscard]] bool is_coming(const Arrival& coming) const noexcept {
    return coming.time > clock_.now() - config_.closing_time &&
           coming.place.norm() < config_.reach + config_.open_radius;
  }

  void aim(const Arrival& coming) noexcept {
    const double distance = coming.place.norm();
    goal_ =
        distance > config_.reach ? Vector2d(config_.reach / distance * coming.place) : coming.place;
    fall_ = coming.velocity;
  }

  // Where a ball in the closed tips lies.
  [[nodiscard]] Vector3d expected() const noexcept {
    return {centre_.x(), centre_.y(), rest_height_ + sink_.position};
  }

  [[nodiscard]] Vector3d on_circle(std::size_t tip) const noexcept {
    return Vector3d(centre_.x(), centre_.y(), config_.height) + radius_ * outward_[tip];
  }

  void move(Seconds elapsed) noexcept {
    follow_goal(elapsed);
    const double depth = config_.open_radius - config_.closed_radius;
    // Fingers that have begun to close or to press go on, whatever becomes of the ball.
    const control::Progress closing =
        control::minimum_jerk(clock_.now() - close_begin_, config_.closing_time);
    const double press = control::minimum_jerk(clock_.now() - hold_begin_, kForceTime).value;
    radius_ = config_.open_radius - closing.value * depth;
    sink(clock_.now());

    TipsDrive::Motions motions;
    TipVectors forces;
    for (std::size_t i = 0; i < motions.size(); ++i) {
      control::PointMotion& motion = motions[i];
      motion.position = on_circle(i);
      motion.position.z() += sink_.position;
      motion.velocity = -closing.rate * depth * outward_[i];
      motion.acceleration = -closing.acceleration * depth * outward_[i];
      motion.velocity.head<2>() += centre_velocity_;
      motion.velocity.z() += sink_.velocity;
      motion.acceleration.z() += sink_.acceleration;
      forces[i] = -press * config_.hold_force * outward_[i];
      if (phase_ == Phase::kApproach) {
        const control::Progress progress = control::minimum_jerk(clock_.in_phase(), approach_time_);
        const Vector3d from = begin_[i];
        motion = {.position = from + progress.value * (on_circle(i) - from),
                  .velocity = progress.rate * (on_circle(i) - from),
                  .acceleration = progress.acceleration * (on_circle(i) - from)};
      }
    }
    const JointValues& torques =
        drive_.torques(motions, forces, phase_ == Phase::kApproach, elapsed);
    JointValues::Map(action_.torque.data(), torques.size()) = torques;
  }

  // The centre of the circle goes to its goal like a critically damped spring.
  void follow_goal(Seconds elapsed) noexcept {
    const double dt = std::min(elapsed.count(), 0.01);
    const double rate = config_.follow_rate;
    const Vector2d acceleration = rate * rate * (goal_ - centre_) - 2 * rate * centre_velocity_;
    centre_velocity_ += dt * acceleration;
    centre_ += dt * centre_velocity_;
  }

  // The tips sink with the ball from when it meets them, and so take its speed bit by bit.
  void sink(Seconds now) noexcept {
    sink_ = {};
    if (!std::isfinite(close_begin_.count())) return;
    const double duration = config_.yield_time.count();
    const double speed = config_.yield * std::max(-fall_.z(), 0.0);
    const double lead = 0.3 * duration;
    const double t = std::clamp((now - contact_).count() + lead, 0.0, duration);
    // A velocity like half a period of a sine, squared: it begins and ends smoothly.
    const double w = std::numbers::pi / duration;
    sink_.velocity = -speed * std::sin(w * t) * std::sin(w * t);
    sink_.position = -speed * (0.5 * t - 0.25 / w * std::sin(2 * w * t));
    sink_.acceleration = t > 0.0 && t < duration ? -speed * w * std::sin(2 * w * t) : 0.0;
  }

  void note() noexcept {
    state_.phase = row_of(phase_).name;
    state_.has_ended = phase_ == Phase::kDone || phase_ == Phase::kFailed;
    state_.failure = failure_;
    state_.desired = {.pose = {.position = expected()}};
    state_.object.pose = {.position = place_, .orientation = orientation_};
    const bool is_flying = phase_ == Phase::kWait || phase_ == Phase::kClose;
    if (is_flying && flight_.count() > 0) {
      const control::PointMotion now = flight_.at(clock_.now());
      state_.object.pose.position = now.position;
      state_.object.twist.linear = now.velocity;
    }
    state_.torque_share = drive_.torque_share();
  }

  CatchConfig config_;
  TipsDrive drive_;
  ObjectDescription ball_;
  double rest_height_{0.0};  // Of a ball on the closed tips [m].
  TipVectors outward_{};

  std::string_view failure_;
  bool has_begun_{false};
  bool is_stopped_{false};
  Seconds close_begin_{kNever};
  Seconds hold_begin_{kNever};
  Seconds approach_time_{0};
  TipVectors begin_{};

  // What is known of the ball.
  bool is_seen_{false};
  Seconds last_seen_{0};
  Seconds last_good_{0};
  Vector3d place_{Vector3d::Zero()};
  Eigen::Quaterniond orientation_{Eigen::Quaterniond::Identity()};
  control::BallisticEstimator flight_{kFlightTolerance};
  Seconds contact_{kNever};
  Vector3d fall_{Vector3d::Zero()};

  // The circle of the tips.
  Vector2d goal_{Vector2d::Zero()};
  Vector2d centre_{Vector2d::Zero()};
  Vector2d centre_velocity_{Vector2d::Zero()};
  double radius_{0.0};
  struct {
    double position{0.0};
    double velocity{0.0};
    double acceleration{0.0};
  } sink_;

  TriFinger::Action action_;
  SkillState state_;
};

constinit const std::array<Catch::Row, 6> Catch::kPhases{{
    // name, when it is stopped, done, next, entry, during
    {"approach", &Catch::end, &Catch::is_at_start, kWait},
    {"wait", &Catch::end, nullptr, kClose, nullptr, &Catch::wait},
    {"close", nullptr, &Catch::has_met, kHold, &Catch::begin_hold, &Catch::close},
    {"hold", &Catch::end, nullptr, kDone, nullptr, &Catch::hold},
    {"done"},
    {"failed"},
}};

}  // namespace

std::unique_ptr<Skill> make_catch(const SkillContext& context, const config::Node& root) {
  return std::make_unique<Catch>(context, read_catch(root));
}

}  // namespace trifinger::manipulation
