// SPDX-License-Identifier: BSD-3-Clause
#include "manipulation/taught_motion.hpp"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <fstream>
#include <span>
#include <string_view>
#include <system_error>
#include <utility>

#include "base/text_of.hpp"
#include "manipulation/parts/decimal.hpp"
#include "manipulation/parts/phase_clock.hpp"
#include "trifinger/base/error.hpp"
#include "trifinger/control/trajectories.hpp"

namespace trifinger::manipulation {
namespace {

constexpr Eigen::Index kJoints = kMaxJoints;
// A motion holds at most this many samples: ten minutes at 1 kHz.
constexpr std::size_t kMaxSamples = 600'000;

// The slope of a curve at a sample: a central difference, zero at the ends, where it rests.
JointValues slope_at(const TaughtMotion& motion, std::size_t i) noexcept {
  if (i == 0 || i + 1 >= motion.positions.size()) return JointValues::Zero(kJoints);
  return (motion.positions[i + 1] - motion.positions[i - 1]) / (2 * motion.interval.count());
}

std::vector<double> numbers_of(std::string_view line, const std::string& where) {
  std::vector<double> numbers;
  const char* at = line.data();
  const char* const end = at + line.size();
  while (at <= end) {
    double number = 0.0;
    const auto [next, error] = std::from_chars(at, end, number);
    if (error != std::errc() || !std::isfinite(number))
      throw InvalidArgument(where + " has something that is not a number");
    numbers.push_back(number);
    if (next == end) break;
    if (*next != ',') throw InvalidArgument(where + " has something other than a comma");
    at = next + 1;
  }
  return numbers;
}

// Plays a taught motion.
class TaughtSkill final : public Skill {
 public:
  TaughtSkill(std::unique_ptr<Skill> skill, const SkillContext& context, TaughtMotion motion)
      : skill_(std::move(skill)),
        motion_(std::move(motion)),
        limits_(context.limits),
        kinematics_(context.description),
        clock_(context.period) {
    if (kinematics_.num_joints() != kMaxJoints)
      throw InvalidArgument("the motion is for three fingers");
    for (const JointValues& position : motion_.positions) {
      for (std::size_t i = 0; i < kMaxJoints; ++i) {
        const double value = position[static_cast<Eigen::Index>(i)];
        // A hand, or the speed of a joint, may have brought it a little further.
        constexpr double kSlack = 0.2;
        if (value < limits_.soft_lower[i] - kSlack || value > limits_.soft_upper[i] + kSlack) {
          throw InvalidArgument(detail::text_of("the motion moves joint ", i, " to ", value,
                                                " rad, beyond its soft limits"));
        }
      }
    }
    state_.phase = "go";
  }

  [[nodiscard]] std::string_view object() const noexcept override { return skill_->object(); }
  [[nodiscard]] Seconds max_duration() const noexcept override {
    return kGoTime + motion_.duration() + kRest + Seconds(1.0);
  }
  void see(TimeIndex /*captured*/, const Pose& pose) noexcept override {
    // For the report alone.
    state_.object = {.pose = pose};
    state_.desired = state_.object;
  }

  [[nodiscard]] const TriFinger::Action& update(
      TimeIndex step, const control::JointState& joints) noexcept override {
    static_cast<void>(clock_.advance(step));
    if (begin_.size() == 0) begin_ = joints.position;
    follow_phases();
    apply(desired(), joints);
    return action_;
  }

  void stop() noexcept override {
    if (is_stopping_ || state_.has_ended) return;
    if (begin_.size() == 0) {
      end("it was stopped");
      return;
    }
    stopped_at_ = desired();
    is_stopping_ = true;
    enter("stop");
  }

  [[nodiscard]] const SkillState& state() const noexcept override { return state_; }

  [[nodiscard]] std::vector<Figure> figures(const SkillTrace& trace,
                                            std::span<const SeenPose> poses) const override {
    return skill_->figures(trace, poses);
  }
  [[nodiscard]] std::vector<ReportFile> report_files(
      const SkillTrace& trace, std::span<const SeenPose> poses) const override {
    return skill_->report_files(trace, poses);
  }

 private:
  static constexpr Seconds kGoTime{1.0};     // To where the motion begins.
  static constexpr Seconds kRest{0.5};       // At the end.
  static constexpr Seconds kBrakeTime{0.3};  // From full speed to rest, when it is stopped.

  void enter(std::string_view phase) noexcept {
    state_.phase = phase;
    clock_.begin_phase();
  }

  void end(std::string_view failure) noexcept {
    state_.has_ended = true;
    state_.failure = failure;
    enter(failure.empty() ? "done" : "failed");
  }

  void follow_phases() noexcept {
    if (state_.has_ended) return;
    const Seconds elapsed = clock_.in_phase();
    if (is_stopping_ && elapsed >= kBrakeTime) end("it was stopped");
    if (state_.phase == "go" && elapsed >= kGoTime) {
      enter("play");
    } else if (state_.phase == "play" && elapsed >= motion_.duration() + kRest) {
      end("");
    }
  }

  [[nodiscard]] TaughtMotion::Instant desired() const noexcept {
    const Seconds elapsed = clock_.in_phase();
    if (is_stopping_) {
      // Its speed falls evenly, so it goes half as far as it would have.
      TaughtMotion::Instant now = stopped_at_;
      const double share = state_.has_ended ? 1.0 : std::clamp(elapsed / kBrakeTime, 0.0, 1.0);
      now.position += stopped_at_.velocity * kBrakeTime.count() * (share - share * share / 2);
      now.velocity *= 1.0 - share;
      return now;
    }
    if (state_.phase == "go") {
      TaughtMotion::Instant now = motion_.at(Seconds(0));
      const control::Progress progress = control::minimum_jerk(clock_.in_phase(), kGoTime);
      const JointValues way = now.position - begin_;
      now.position = begin_ + progress.value * way;
      now.velocity = progress.rate * way;
      now.torque *= progress.value;
      return now;
    }
    return motion_.at(state_.has_ended ? motion_.duration() : elapsed);
  }

  void apply(const TaughtMotion::Instant& desired, const control::JointState& joints) noexcept {
    kinematics_.update(desired.position);
    const JointValues bias = kinematics_.bias_torques(desired.velocity);
    state_.torque_share = 0.0;
    for (std::size_t i = 0; i < kMaxJoints; ++i) {
      const auto j = static_cast<Eigen::Index>(i);
      const double kp = figures_.kp[i % 3];
      const double kd = figures_.kd[i % 3];
      // What brakes a moving joint is added where the motion moves.
      action_.torque[i] =
          desired.torque[j] + bias[j] + (kd + limits_.safety_kd[i]) * desired.velocity[j];
      action_.position[i] =
          std::clamp(desired.position[j], limits_.soft_lower[i], limits_.soft_upper[i]);
      action_.position_kp[i] = kp;
      action_.position_kd[i] = kd;
      const double whole = action_.torque[i] + kp * (action_.position[i] - joints.position[j]) -
                           kd * joints.velocity[j];
      state_.torque_share = std::max(state_.torque_share, std::abs(whole) / limits_.max_torque[i]);
    }
  }

  std::unique_ptr<Skill> skill_;
  TaughtMotion motion_;
  control::SafetyLimits limits_;
  Kinematics kinematics_;
  PhaseClock clock_;
  VariantFigures figures_{variant_figures(kinematics_.description().variant)};
  JointValues begin_;  // Where the joints were at the first step; empty before.
  bool is_stopping_{false};
  TaughtMotion::Instant stopped_at_;
  TriFinger::Action action_;
  SkillState state_;
};

}  // namespace

TaughtMotion::Instant TaughtMotion::at(Seconds time) const noexcept {
  const double samples =
      std::clamp(time / interval, 0.0, static_cast<double>(positions.size() - 1));
  const std::size_t i = std::min(static_cast<std::size_t>(samples), positions.size() - 2);
  const double s = samples - static_cast<double>(i);
  const double length = interval.count();
  const JointValues& a = positions[i];
  const JointValues& b = positions[i + 1];
  const JointValues slope_a = length * slope_at(*this, i);
  const JointValues slope_b = length * slope_at(*this, i + 1);
  const JointValues way = b - a;
  Instant now;
  // The cubic with these ends and slopes, and its derivative.
  now.position = a + s * slope_a + s * s * (3 * way - 2 * slope_a - slope_b) +
                 s * s * s * (slope_a + slope_b - 2 * way);
  now.velocity = (slope_a + 2 * s * (3 * way - 2 * slope_a - slope_b) +
                  3 * s * s * (slope_a + slope_b - 2 * way)) /
                 length;
  now.torque = (1 - s) * torques[i] + s * torques[i + 1];
  if (time < Seconds(0) || time > duration()) now.velocity.setZero();
  return now;
}

TaughtMotion load_taught_motion(const std::filesystem::path& path) {
  std::ifstream file(path);
  if (!file) throw InvalidArgument("cannot read the motion '" + path.string() + "'");
  TaughtMotion motion;
  std::vector<double> times;
  std::string line;
  std::getline(file, line);  // The names.
  for (std::size_t row = 2; std::getline(file, line); ++row) {
    const std::string where = path.string() + ":" + std::to_string(row);
    const std::vector<double> numbers = numbers_of(line, where);
    constexpr std::size_t kColumns = 1 + 2 * static_cast<std::size_t>(kJoints);
    if (numbers.size() != kColumns)
      throw InvalidArgument(
          detail::text_of(where, " has ", numbers.size(), " numbers, must have ", kColumns));
    times.push_back(numbers[0]);
    motion.positions.emplace_back(JointValues::Map(numbers.data() + 1, kJoints));
    motion.torques.emplace_back(JointValues::Map(numbers.data() + 1 + kJoints, kJoints));
    if (times.size() > kMaxSamples) throw InvalidArgument(path.string() + " has too many rows");
  }
  if (times.size() < 2) throw InvalidArgument(path.string() + " has fewer than two rows");
  motion.interval = Seconds(times[1] - times[0]);
  for (std::size_t i = 0; i < times.size(); ++i) {
    const double expected = times[0] + static_cast<double>(i) * motion.interval.count();
    if (!(motion.interval > Seconds(0)) ||
        std::abs(times[i] - expected) > 0.01 * motion.interval.count()) {
      throw InvalidArgument(path.string() + ":" + std::to_string(i + 2) +
                            " is not at an even interval");
    }
  }
  return motion;
}

std::string text_of(const TaughtMotion& motion) {
  std::string text = "time";
  for (Eigen::Index i = 0; i < kJoints; ++i) text += ",position_" + std::to_string(i);
  for (Eigen::Index i = 0; i < kJoints; ++i) text += ",torque_" + std::to_string(i);
  text += '\n';
  for (std::size_t row = 0; row < motion.positions.size(); ++row) {
    text += decimal(static_cast<double>(row) * motion.interval.count(), 4);
    // A tenth of what encoders and motors resolve.
    for (const double value : motion.positions[row]) text += "," + decimal(value, 5);
    for (const double value : motion.torques[row]) text += "," + decimal(value, 4);
    text += '\n';
  }
  return text;
}

std::unique_ptr<Skill> play_instead(std::unique_ptr<Skill> skill, const SkillContext& context,
                                    TaughtMotion motion) {
  return std::make_unique<TaughtSkill>(std::move(skill), context, std::move(motion));
}

}  // namespace trifinger::manipulation
