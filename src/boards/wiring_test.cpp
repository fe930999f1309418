// SPDX-License-Identifier: BSD-3-Clause
#include "trifinger/boards/wiring_test.hpp"

#include <algorithm>
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
constexpr double kFirst = 0.125;
constexpr double kEnough = 0.025;  // [rad]; the next push would move it by more than 2 degrees
constexpr double kLeast = 0.001;   // [rad]; less is no movement
constexpr int kPause = 2;          // quarters between two pushes

// Subtracts from `values` what `basis` explains of them. The functions of the basis are orthogonal.
void subtract(std::vector<double>& values, const std::vector<double>& basis) {
  const double norm = std::inner_product(basis.begin(), basis.end(), basis.begin(), 0.0);
  if (norm == 0.0) return;
  const double part = std::inner_product(values.begin(), values.end(), basis.begin(), 0.0) / norm;
  for (std::size_t i = 0; i < values.size(); ++i) values[i] -= part * basis[i];
}

// The way of a joint that a push accelerates by 1 rad/s^2, before each step of the push [rad].
std::vector<double> way_of_push(std::size_t quarter, double period) {
  std::vector<double> way(4 * quarter + 1);
  double velocity = 0.0;
  for (std::size_t i = 0; i + 1 < way.size(); ++i) {
    const bool is_forth = i < quarter || i >= 3 * quarter;
    const double change = (is_forth ? 1.0 : -1.0) * period;
    way[i + 1] = way[i] + (velocity + 0.5 * change) * period;
    velocity += change;
  }
  return way;
}

}  // namespace

WiringTest::WiringTest(std::span<const double> max_torques, Nanoseconds period)
    : max_torques_(max_torques.begin(), max_torques.end()),
      accelerations_(max_torques.size()),
      responses_(max_torques.size() * max_torques.size()),
      findings_(max_torques.size()),
      assignment_(max_torques.size()) {
  std::ranges::transform(max_torques_, max_torques_.begin(), [](double x) { return std::abs(x); });
  const double seconds = std::chrono::duration<double>(period).count();
  quarter_ = std::max<std::size_t>(1, static_cast<std::size_t>(std::lround(kQuarter / seconds)));
  const std::vector<double> way = way_of_push(quarter_, seconds);
  way_ = std::ranges::max(way);
  // The weights find the way of a push in angles that have a start, a velocity and an acceleration
  // of their own: polynomials, made orthogonal one after the other.
  std::vector<std::vector<double>> polynomials;
  for (int power = 0; power <= 2; ++power) {
    std::vector<double> polynomial(way.size());
    for (std::size_t i = 0; i < way.size(); ++i) {
      polynomial[i] = std::pow(static_cast<double>(i) - 2.0 * static_cast<double>(quarter_), power);
    }
    for (const std::vector<double>& lower : polynomials) subtract(polynomial, lower);
    polynomials.push_back(std::move(polynomial));
  }
  weights_ = way;
  for (const std::vector<double>& polynomial : polynomials) subtract(weights_, polynomial);
  const double norm = std::inner_product(weights_.begin(), weights_.end(), way.begin(), 0.0);
  for (double& weight : weights_) weight /= norm;
  joint_ = max_torques_.size();
}

void WiringTest::begin() noexcept {
  joint_ = 0;
  begin_push(kFirst * max_torques_[0]);
}

void WiringTest::begin_push(double torque) noexcept {
  step_ = 0;
  torque_ = torque;
  std::ranges::fill(accelerations_, 0.0);
}

void WiringTest::next(std::span<const double> angles, std::span<double> torques) noexcept {
  std::ranges::fill(torques, 0.0);
  if (is_done()) return;
  if (step_ < weights_.size()) {
    for (std::size_t i = 0; i < angles.size(); ++i) {
      accelerations_[i] += weights_[step_] * angles[i];
    }
  }
  if (step_ < 4 * quarter_) {
    const bool is_forth = step_ < quarter_ || step_ >= 3 * quarter_;
    torques[joint_] = is_forth ? torque_ : -torque_;
  }
  if (++step_ == (4 + kPause) * quarter_) end_push();
}

void WiringTest::end_push() noexcept {
  const auto size = [](double x, double y) { return std::abs(x) < std::abs(y); };
  const double most = std::abs(*std::ranges::max_element(accelerations_, size));
  const bool is_enough = most * way_ >= kEnough;
  if (!is_enough && torque_ < max_torques_[joint_]) {
    begin_push(std::min(2.0 * torque_, max_torques_[joint_]));
    return;
  }
  findings_[joint_] = {.moves = most * way_ >= kLeast, .joint = joint_, .is_reversed = false};
  for (std::size_t i = 0; i < accelerations_.size(); ++i) {
    response(i, joint_) = findings_[joint_].moves ? accelerations_[i] / torque_ : 0.0;
  }
  if (++joint_ < max_torques_.size()) {
    begin_push(kFirst * max_torques_[joint_]);
  } else {
    judge();
  }
}

void WiringTest::judge() noexcept {
  assignment_.solve([this](std::size_t driven, std::size_t moved) {
    // A joint that does not move at all must not make every order equally good.
    constexpr double kFloor = 1e-6;
    return -std::log(std::max(std::abs(response(moved, driven)), kFloor));
  });
  for (std::size_t i = 0; i < findings_.size(); ++i) {
    if (!findings_[i].moves) continue;
    findings_[i].joint = assignment_.column_of(i);
    findings_[i].is_reversed = response(findings_[i].joint, i) < 0.0;
  }
}

}  // namespace trifinger::boards
