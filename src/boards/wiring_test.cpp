// SPDX-License-Identifier: BSD-3-Clause
#include "boards/wiring_test.hpp"

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <numeric>
#include <utility>

namespace trifinger::boards {
namespace {

// A push goes forth for a quarter of its time, back for two, and forth again.
constexpr double kQuarter = 0.025;  // [s]
// The first push of a joint has this part of its largest torque; each further one has twice as much
// until something moves by 2 degrees.
constexpr double kFirst = 0.0625;
constexpr double kMaxPush = 0.5;
constexpr double kEnough = 0.025;  // [rad]; the next push would move it by more than 2 degrees
constexpr double kLeast = 0.001;   // [rad]; less is no movement
constexpr int kPause = 2;          // quarters between two pushes
// Two opposite pushes agree if their displacements differ by less than this part of the largest.
constexpr double kDifference = 0.35;
// Torque beside the push in each attempt, in parts of the push: at an end stop one way is free.
constexpr std::array kBeside{0.0, 0.5, -0.5, 2.0, -2.0};
// After these attempts comes a torque that grows until something has moved.
constexpr std::size_t kRamp = kBeside.size();
constexpr double kRampTime = 0.6;            // [s]
constexpr double kRampPause = 0.2;           // [s]
constexpr double kRampDisplacement = 0.035;  // [rad]: 2 degrees
// Ways of opposite ramps must differ by this part of the longer one.
constexpr double kRampDifference = 0.6;
// A joint that moves itself by this part of the largest displacement is held while others are
// tested.
constexpr double kOwnWay = 0.5;
constexpr int kRounds = 3;

// Subtracts from `values` what `basis` explains of them. The functions of the basis are orthogonal.
void subtract(std::vector<double>& values, const std::vector<double>& basis) {
  const double norm = std::inner_product(basis.begin(), basis.end(), basis.begin(), 0.0);
  if (norm == 0.0) return;
  const double part = std::inner_product(values.begin(), values.end(), basis.begin(), 0.0) / norm;
  for (std::size_t i = 0; i < values.size(); ++i) values[i] -= part * basis[i];
}

double largest(const std::vector<double>& values) noexcept {
  double most = 0.0;
  for (const double value : values) most = std::max(most, std::abs(value));
  return most;
}

// The displacement of a joint that a push accelerates by 1 rad/s^2, before each step of the push
// [rad].
std::vector<double> displacement_of_push(std::size_t quarter, double period) {
  std::vector<double> displacement(4 * quarter + 1);
  double velocity = 0.0;
  for (std::size_t i = 0; i + 1 < displacement.size(); ++i) {
    const bool is_forth = i < quarter || i >= 3 * quarter;
    const double change = (is_forth ? 1.0 : -1.0) * period;
    displacement[i + 1] = displacement[i] + (velocity + 0.5 * change) * period;
    velocity += change;
  }
  return displacement;
}

}  // namespace

WiringTest::WiringTest(std::span<const double> max_torques, Nanoseconds period)
    : max_torques_(max_torques.begin(), max_torques.end()),
      displacements_(max_torques.size()),
      start_(max_torques.size()),
      first_(max_torques.size()),
      responses_(max_torques.size() * max_torques.size()),
      findings_(max_torques.size()),
      assignment_(max_torques.size()) {
  std::ranges::transform(max_torques_, max_torques_.begin(), [](double x) { return std::abs(x); });
  const double seconds = std::chrono::duration<double>(period).count();
  quarter_ = std::max<std::size_t>(1, static_cast<std::size_t>(std::lround(kQuarter / seconds)));
  const std::vector<double> displacement = displacement_of_push(quarter_, seconds);
  // The weights find the displacement of a push in angles that have a start, a velocity and an
  // acceleration of their own: polynomials, made orthogonal one after the other.
  std::vector<std::vector<double>> polynomials;
  for (int power = 0; power <= 2; ++power) {
    std::vector<double> polynomial(displacement.size());
    for (std::size_t i = 0; i < displacement.size(); ++i) {
      polynomial[i] = std::pow(static_cast<double>(i) - 2.0 * static_cast<double>(quarter_), power);
    }
    for (const std::vector<double>& lower : polynomials) subtract(polynomial, lower);
    polynomials.push_back(std::move(polynomial));
  }
  weights_ = displacement;
  for (const std::vector<double>& polynomial : polynomials) subtract(weights_, polynomial);
  const double norm =
      std::inner_product(weights_.begin(), weights_.end(), displacement.begin(), 0.0);
  for (double& weight : weights_) weight *= std::ranges::max(displacement) / norm;
  ramp_ = static_cast<std::size_t>(std::lround(kRampTime / seconds));
  ramp_pause_ = static_cast<std::size_t>(std::lround(kRampPause / seconds));
  joint_ = max_torques_.size();
}

void WiringTest::begin() noexcept {
  round_ = 0;
  joint_ = 0;
  std::ranges::fill(findings_, WiringFinding());
  begin_joint();
}

void WiringTest::begin_joint() noexcept {
  torque_ = kFirst * max_torques_[joint_];
  attempt_ = 0;
  begin_half(Half::kFirst);
}

void WiringTest::begin_half(Half half) noexcept {
  half_ = half;
  step_ = 0;
  std::ranges::fill(displacements_, 0.0);
}

void WiringTest::next(std::span<const double> angles, std::span<double> torques) noexcept {
  std::ranges::fill(torques, 0.0);
  if (is_done()) return;
  const double sign = half_ == Half::kFirst ? 1.0 : -1.0;
  if (attempt_ == kRamp) {
    torques[joint_] = sign * next_of_ramp(angles);
    if (++step_ == ramp_ + ramp_pause_) end_half();
  } else {
    torques[joint_] = next_of_push(angles, sign);
    if (++step_ == (4 + kPause) * quarter_) end_half();
  }
}

double WiringTest::next_of_push(std::span<const double> angles, double sign) noexcept {
  if (step_ < weights_.size()) {
    for (std::size_t i = 0; i < angles.size(); ++i)
      displacements_[i] += weights_[step_] * angles[i];
  }
  if (step_ >= 4 * quarter_) return 0.0;
  const bool is_forth = step_ < quarter_ || step_ >= 3 * quarter_;
  const double most_beside = (1.0 - kMaxPush) * max_torques_[joint_];
  return (is_forth ? sign : -sign) * torque_ +
         std::clamp(kBeside[attempt_] * torque_, -most_beside, most_beside);
}

double WiringTest::next_of_ramp(std::span<const double> angles) noexcept {
  if (step_ == 0) std::ranges::copy(angles, start_.begin());
  if (step_ >= ramp_) return 0.0;
  for (std::size_t i = 0; i < angles.size(); ++i) displacements_[i] = angles[i] - start_[i];
  if (largest(displacements_) >= kRampDisplacement) step_ = ramp_;
  torque_ = max_torques_[joint_] * static_cast<double>(step_) / static_cast<double>(ramp_);
  return step_ < ramp_ ? torque_ : 0.0;
}

void WiringTest::end_half() noexcept {
  const bool is_ramp = attempt_ == kRamp;
  if (half_ == Half::kFirst) {
    const double most_torque = kMaxPush * max_torques_[joint_];
    if (!is_ramp && largest(displacements_) < kEnough && torque_ < most_torque) {
      torque_ = std::min(2.0 * torque_, most_torque);
      begin_half(Half::kFirst);
    } else {
      first_ = displacements_;
      begin_half(Half::kOpposite);
    }
    return;
  }
  const double longest = std::max(largest(displacements_), largest(first_));
  double sum = 0.0;
  double difference = 0.0;
  for (std::size_t i = 0; i < displacements_.size(); ++i) {
    sum = std::max(sum, std::abs(first_[i] + displacements_[i]));
    difference = std::max(difference, std::abs(first_[i] - displacements_[i]));
  }
  const bool agrees =
      is_ramp ? difference >= kRampDifference * longest : sum <= kDifference * longest;
  if (!is_ramp && (!agrees || longest < kLeast)) {
    attempt_ = longest < kLeast ? kRamp : attempt_ + 1;
    begin_half(Half::kFirst);
    return;
  }
  findings_[joint_] = {
      .moves = longest >= kLeast, .joint = joint_, .is_reversed = false, .is_hindered = !agrees};
  for (std::size_t i = 0; i < displacements_.size(); ++i) {
    response(i, joint_) = findings_[joint_].moves ? first_[i] - displacements_[i] : 0.0;
  }
  // So that the joint can be held from now on.
  findings_[joint_].is_reversed = response(joint_, joint_) < kOwnWay * difference;
  next_joint();
}

// Goes on to the next joint that is not good. After the last one, those that are still not good get
// another round, in which all others are held.
void WiringTest::next_joint() noexcept {
  joint_ = first_bad(joint_ + 1);
  if (joint_ == findings_.size()) {
    judge();
    if (++round_ == kRounds) return;
    joint_ = first_bad(0);
  }
  if (!is_done()) begin_joint();
}

std::size_t WiringTest::first_bad(std::size_t begin) const noexcept {
  while (begin < findings_.size() && findings_[begin].is_good(begin)) ++begin;
  return begin;
}

void WiringTest::judge() noexcept {
  assignment_.solve([this](std::size_t driven, std::size_t moved) {
    // A joint that does not move at all must not make every order equally good.
    constexpr double kFloor = 1e-9;  // [rad]
    return -std::log(std::max(std::abs(response(moved, driven)), kFloor));
  });
  for (std::size_t i = 0; i < findings_.size(); ++i) {
    if (!findings_[i].moves) continue;
    findings_[i].joint = assignment_.column_of(i);
    findings_[i].is_reversed = response(findings_[i].joint, i) < 0.0;
  }
}

}  // namespace trifinger::boards
