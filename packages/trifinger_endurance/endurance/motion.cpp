// SPDX-License-Identifier: BSD-3-Clause
#include "endurance/motion.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <string>
#include <utility>

#include "trifinger/base/error.hpp"
#include "trifinger/joint/orderly_stop.hpp"

namespace trifinger::apps {
namespace {

// A movement of least jerk is faster in its middle than on average, by this factor.
constexpr double kPeak = 1.875;
// A joint without a greatest speed crosses its range in this time [s].
constexpr double kCrossing = 0.5;
// This share of the range stays free at each soft limit.
constexpr double kMargin = 0.03;
// How far a joint without soft limits may go [rad].
constexpr double kFar = 1.0;
// How far caught joints go to find a way [rad].
constexpr double kAside = 0.3;
// The places of the path back are so far apart [rad], and this near to home a joint is at home.
constexpr double kApart = 0.08;
constexpr double kAtHome = 0.25;
// This share of the reaches goes home, so that the path back stays short.
constexpr double kHomecomings = 0.05;
// Rests within a slow pass [s], until nothing swings any more.
constexpr double kSettling = 0.3;

double lower(const JointLimit& limit) noexcept {
  return limit.soft_lower + kMargin * (limit.soft_upper - limit.soft_lower);
}
double upper(const JointLimit& limit) noexcept {
  return limit.soft_upper - kMargin * (limit.soft_upper - limit.soft_lower);
}

bool is_within(std::span<const double> one, std::span<const double> other, double distance) {
  return std::ranges::equal(one, other, [distance](double left, double right) {
    return std::abs(left - right) < distance;
  });
}

// Soft limits may be absent: then the motion has bounds of its own, so that it has a range.
std::vector<JointLimit> with_range(std::vector<JointLimit> limits) {
  for (JointLimit& limit : limits) {
    if (!std::isfinite(limit.soft_lower)) limit.soft_lower = -kFar;
    if (!std::isfinite(limit.soft_upper)) limit.soft_upper = kFar;
    detail::require(limit.soft_lower < limit.soft_upper,
                    "the soft limits of a joint leave it no room to move");
    detail::require(limit.default_kp > 0.0,
                    "a joint has no default stiffness (safety.default_kp), so that no position can "
                    "be asked of it");
  }
  return limits;
}

}  // namespace

std::string_view name_of(Move move) noexcept {
  switch (move) {
    case Move::kReach:
      return "reach";
    case Move::kShake:
      return "shake";
    case Move::kPush:
      return "push";
    case Move::kRest:
      return "rest";
    case Move::kRetreat:
      return "retreat";
    case Move::kPass:
      break;
  }
  return "pass";
}

RandomMotion::RandomMotion(std::vector<JointLimit> limits, const MotionOptions& options)
    : limits_(with_range(std::move(limits))), options_(options) {
  detail::require(!limits_.empty(), "the robot has no joints");
  detail::require(options_.speed > 0.0 && options_.speed <= 1.0,
                  "speed is " + std::to_string(options_.speed) + ", must be above 0, at most 1");
  detail::require_positive("period", options_.period.count());
  detail::require_positive("pass_every", options_.pass_every.count());
  detail::require_positive("pass_speed", options_.pass_speed);
  detail::require_positive("pass_amplitude", options_.pass_amplitude);
  const std::size_t joints = limits_.size();
  for (const JointLimit& limit : limits_) {
    const double range = limit.soft_upper - limit.soft_lower;
    most_speed_.push_back(std::min(limit.max_velocity, range / kCrossing));
    amplitude_.push_back(std::min(options_.pass_amplitude, range / 5));
  }
  for (std::vector<double>* values : {&home_, &centre_, &position_, &torque_, &start_, &target_,
                                      &before_, &measured_, &frequency_}) {
    values->assign(joints, 0.0);
  }
  path_.assign(kMaxPlaces * joints, 0.0);
}

void RandomMotion::begin(std::span<const double> position, std::span<const double> home,
                         std::uint64_t session, Seconds free_time) noexcept {
  random_ = {.seed = options_.seed, .episode = session};
  for (std::size_t i = 0; i < joints(); ++i) {
    position_[i] = std::clamp(position[i], limits_[i].soft_lower, limits_[i].soft_upper);
    centre_[i] =
        std::clamp(home[i], lower(limits_[i]) + amplitude_[i], upper(limits_[i]) - amplitude_[i]);
    home_[i] = std::clamp(home[i], limits_[i].soft_lower, limits_[i].soft_upper);
    torque_[i] = 0.0;
  }
  step_ = 0;
  steps_ = 0;
  gives_way_ = false;
  retreats_ = 0;
  is_pass_due_ = free_time <= Seconds(0);
  if (is_within(position, home_, kAtHome)) num_places_ = 0;
  returns_ = !is_pass_due_;
  since_pass_ = steps_in((options_.pass_every - free_time).count());
}

void RandomMotion::give_way(std::span<const double> measured) noexcept {
  if (move_ == Move::kPass) return;
  gives_way_ = true;
  std::ranges::copy(measured, measured_.begin());
}

std::span<double> RandomMotion::place(std::size_t number) noexcept {
  const std::size_t index = (oldest_place_ + number) % kMaxPlaces;
  return std::span(path_).subspan(index * joints(), joints());
}

void RandomMotion::remember(std::span<const double> measured) noexcept {
  if (is_within(measured, home_, kAtHome)) num_places_ = 0;
  if (returns_) return;  // Each place was forgotten when the joints set out for it.
  if (num_places_ > 0 && is_within(measured, place(num_places_ - 1), kApart)) return;
  if (num_places_ == kMaxPlaces) {
    oldest_place_ = (oldest_place_ + 1) % kMaxPlaces;
    --num_places_;
  }
  std::ranges::copy(measured, place(num_places_).begin());
  ++num_places_;
}

MotionStep RandomMotion::next() noexcept {
  if (step_ == steps_ || gives_way_) {
    begin_move();
    step_ = 0;
  }
  ++since_pass_;
  if (since_pass_ >= steps_in(options_.pass_every.count())) is_pass_due_ = true;
  const double done = static_cast<double>(step_ + 1) / static_cast<double>(steps_);
  PassPart part = PassPart::kNone;
  switch (move_) {
    case Move::kReach:
    case Move::kRetreat:
      for (std::size_t i = 0; i < joints(); ++i) {
        position_[i] = start_[i] + detail::smooth(done) * (target_[i] - start_[i]);
      }
      break;
    case Move::kShake: {
      // It swells and fades, so that position and speed begin and end without a jump.
      const double window = std::sin(std::numbers::pi * done);
      const double time = static_cast<double>(step_ + 1) * options_.period.count();
      for (std::size_t i = 0; i < joints(); ++i) {
        const double swing = std::sin(2 * std::numbers::pi * frequency_[i] * time);
        position_[i] = start_[i] + window * window * target_[i] * swing;
      }
      break;
    }
    case Move::kPush: {
      const double window = std::sin(std::numbers::pi * done);
      for (std::size_t i = 0; i < joints(); ++i) torque_[i] = window * window * target_[i];
      break;
    }
    case Move::kRest:
      break;
    case Move::kPass:
      part = make_pass();
      break;
  }
  ++step_;
  return {.move = move_, .part = part, .begins = step_ == 1, .ends = step_ == steps_};
}

void RandomMotion::begin_move() noexcept {
  std::ranges::copy(start_, before_.begin());
  std::ranges::copy(position_, start_.begin());
  std::ranges::fill(torque_, 0.0);
  if (std::exchange(gives_way_, false)) {
    begin_retreat();
    return;
  }
  if (move_ != Move::kRetreat) retreats_ = 0;
  if (returns_ && num_places_ > 0) {
    begin_return();
    return;
  }
  returns_ = false;
  if (is_pass_due_) {
    begin_pass();
    return;
  }
  const double choice = random_.uniform(0.0, 1.0);
  if (choice < 0.75) {
    begin_reach();
  } else if (choice < 0.85) {
    begin_shake();
  } else if (choice < 0.95) {
    begin_push();
  } else {
    move_ = Move::kRest;
    steps_ = steps_in(random_.uniform(0.2, 1.0));
  }
}

void RandomMotion::begin_reach() noexcept {
  move_ = Move::kReach;
  // Some moves use all of the range, most stay nearer to where the robot begins. There it comes
  // free of what it was caught in.
  const bool goes_home = random_.uniform(0.0, 1.0) < kHomecomings;
  const double share = goes_home ? 0.0 : random_.uniform(0.2, 1.0);
  for (std::size_t i = 0; i < joints(); ++i) {
    const double place = random_.uniform(lower(limits_[i]), upper(limits_[i]));
    target_[i] = goes_home || random_.uniform(0.0, 1.0) < 0.7
                     ? home_[i] + share * (place - home_[i])
                     : start_[i];
  }
  steps_ = steps_in(std::max(0.15, move_time(random_.uniform(0.3, 1.0))));
}

void RandomMotion::begin_shake() noexcept {
  move_ = Move::kShake;
  for (std::size_t i = 0; i < joints(); ++i) {
    frequency_[i] = random_.uniform(1.0, 4.0);
    const double room =
        std::min(start_[i] - limits_[i].soft_lower, limits_[i].soft_upper - start_[i]);
    const double fastest = options_.speed * most_speed_[i] / (2 * std::numbers::pi * frequency_[i]);
    target_[i] = random_.uniform(0.0, 1.0) < 0.5
                     ? random_.uniform(0.0, std::max(0.0, std::min(room, fastest)))
                     : 0.0;
  }
  steps_ = steps_in(random_.uniform(0.5, 2.0));
}

void RandomMotion::begin_push() noexcept {
  move_ = Move::kPush;
  for (std::size_t i = 0; i < joints(); ++i) {
    const double most = 0.5 * limits_[i].max_torque;
    target_[i] = random_.uniform(-most, most);
  }
  steps_ = steps_in(random_.uniform(0.2, 0.6));
}

void RandomMotion::begin_retreat() noexcept {
  move_ = Move::kRetreat;
  ++retreats_;
  // Where the move began was free. Joints that are caught all the same stop pressing, and a random
  // half of them goes home: fingers that hook into each other come apart when they do not pull at
  // once, and when they try another way each time.
  const bool is_caught = retreats_ > 2;
  for (std::size_t i = 0; i < joints(); ++i) {
    const double choice = random_.uniform(0.0, 1.0);
    const double aside = measured_[i] + random_.uniform(-kAside, kAside);
    const double target = !is_caught ? before_[i] : choice < 0.5 ? home_[i] : aside;
    target_[i] = std::clamp(target, limits_[i].soft_lower, limits_[i].soft_upper);
  }
  steps_ = steps_in(std::max(0.15, move_time(0.6)));
}

// A finger that is caught behind something got there on a way that was free. Straight home it may
// find no way.
void RandomMotion::begin_return() noexcept {
  move_ = Move::kRetreat;
  --num_places_;
  const std::span<const double> there = place(num_places_);
  for (std::size_t i = 0; i < joints(); ++i) {
    target_[i] = std::clamp(there[i], limits_[i].soft_lower, limits_[i].soft_upper);
  }
  steps_ = steps_in(std::max(0.05, move_time(0.6)));
}

// Goes to the lower end of the pass, rests, goes forth at constant speed, rests, goes back at
// constant speed, rests.
void RandomMotion::begin_pass() noexcept {
  move_ = Move::kPass;
  is_pass_due_ = false;
  since_pass_ = 0;
  for (std::size_t i = 0; i < joints(); ++i) target_[i] = centre_[i] - amplitude_[i];
  double longest = 0.0;
  for (const double amplitude : amplitude_) {
    longest = std::max(longest, 2 * amplitude / options_.pass_speed);
  }
  const TimeIndex settling = steps_in(kSettling);
  const TimeIndex pass = steps_in(longest);
  // It also waits before it begins: something may swing still.
  pass_ends_ = {steps_in(std::max(1.0, move_time(0.5))), settling, pass, settling, pass, settling};
  for (std::size_t part = 1; part < pass_ends_.size(); ++part) {
    pass_ends_[part] += pass_ends_[part - 1];
  }
  steps_ = pass_ends_.back();
}

PassPart RandomMotion::make_pass() noexcept {
  std::size_t part = 0;
  while (step_ >= pass_ends_[part]) ++part;
  const TimeIndex before = part == 0 ? 0 : pass_ends_[part - 1];
  const double done =
      static_cast<double>(step_ - before + 1) / static_cast<double>(pass_ends_[part] - before);
  if (part == 0) {
    for (std::size_t i = 0; i < joints(); ++i) {
      position_[i] = start_[i] + detail::smooth(done) * (target_[i] - start_[i]);
    }
    return PassPart::kOnTheWay;
  }
  if (part % 2 == 1) return PassPart::kOnTheWay;
  const bool is_forth = part == 2;
  const double place = is_forth ? done : 1.0 - done;
  for (std::size_t i = 0; i < joints(); ++i) {
    position_[i] = target_[i] + 2 * amplitude_[i] * place;
  }
  // Both ends are left out: there, speed and friction are changing. What counts is symmetric, so
  // that both directions measure the same places.
  constexpr double kEnds = 0.3;
  const bool counts = place >= kEnds && place <= 1.0 - kEnds;
  if (!counts) return PassPart::kOnTheWay;
  return is_forth ? PassPart::kForth : PassPart::kBack;
}

double RandomMotion::pass_speed(std::size_t joint) const noexcept {
  return options_.pass_speed * amplitude_[joint] / *std::ranges::max_element(amplitude_);
}

double RandomMotion::move_time(double share) const noexcept {
  double longest = 0.0;
  for (std::size_t i = 0; i < joints(); ++i) {
    const double speed = share * options_.speed * most_speed_[i];
    longest = std::max(longest, kPeak * std::abs(target_[i] - start_[i]) / speed);
  }
  return longest;
}

TimeIndex RandomMotion::steps_in(double time) const noexcept {
  return std::max<TimeIndex>(1, std::llround(time / options_.period.count()));
}

}  // namespace trifinger::apps
