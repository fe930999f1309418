// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstddef>

#include "trifinger/base/time.hpp"
#include "trifinger/control/motion.hpp"

namespace trifinger::manipulation {

// A box that stands on a round tip, seen along one horizontal direction. Its flat end rolls on the
// tip without slipping. With the tilt a, the place w of the point of the tip's surface that was at
// the top, and the distance e between the place of the tip's centre and w, the equations are, for
// small tilts,
//
//     (k^2 + h^2) a'' = g ((h - r) a + e - s) - h w''        (moments about the contact)
//     c = w - d + h a - s                                    (place of the box's centre)
//
// h: half the height of the box; k: its radius of gyration; r: radius of the tip; s: how far the
// box stood off its middle at the beginning; d: how far joints that are homed badly put w from
// where it is. Neither mass nor friction count.
struct TippingBox {
  double half_height{0.04};   // h [m]
  double gyration{0.0238};    // k [m]
  double tip_radius{0.0095};  // r [m]

  [[nodiscard]] double inertia() const noexcept {  // k^2 + h^2
    return gyration * gyration + half_height * half_height;
  }
  [[nodiscard]] double fall() const noexcept {  // Of a'' by a [1/s^2].
    return kGravity * (half_height - tip_radius) / inertia();
  }
  [[nodiscard]] double lever() const noexcept { return half_height / inertia(); }  // -a'' by w''

  static constexpr double kGravity = 9.81;
};

// Where the tip is, in both horizontal directions.
struct TipInput {
  Eigen::Vector2d rate{Eigen::Vector2d::Zero()};   // w' [m/s]
  Eigen::Vector2d place{Eigen::Vector2d::Zero()};  // w [m]
  Eigen::Vector2d roll{Eigen::Vector2d::Zero()};   // e: w less the place of the tip's centre [m].
};

// How a box stands, in both horizontal directions.
struct TiltEstimate {
  Eigen::Vector2d tilt{Eigen::Vector2d::Zero()};     // a: positive if the top leans there [rad].
  Eigen::Vector2d rate{Eigen::Vector2d::Zero()};     // a' [rad/s]
  Eigen::Vector2d balance{Eigen::Vector2d::Zero()};  // Tilt at which it would not fall [rad].
};

struct TiltObserverConfig {
  double position_noise;  // Standard deviations of measured poses [m], [rad].
  double tilt_noise;
  double disturbance;  // Of the rate of the tilt, in a second [rad/s].
  double drift;        // By which s and d may change in a second [m].
};

// Estimates how the box stands from poses that are late: a Kalman filter at the time of the newest
// pose. From there the estimate is carried forward to the present with what the tip has truly done
// since, as its joints have measured it. Memory is in place; nothing throws.
class TiltObserver {
 public:
  TiltObserver(const TippingBox& box, const TiltObserverConfig& config, control::Seconds period);

  // Forgets everything. The box was last placed at `step`.
  void reset(TimeIndex step) noexcept;
  // The tip at `step`. Steps may be left out.
  void move(TimeIndex step, const TipInput& input) noexcept;
  // The box at `captured`: tilt, and place of its centre. Ignored if `move` does not know this
  // step, or if a newer one was seen.
  bool see(TimeIndex captured, const Eigen::Vector2d& tilt, const Eigen::Vector2d& centre) noexcept;

  // At the last step of `move`.
  [[nodiscard]] TiltEstimate estimate() const noexcept;
  [[nodiscard]] bool has_seen() const noexcept { return has_seen_; }

 private:
  // Rows: tilt; its rate plus lever w'; s; d. Columns: the two directions.
  using State = Eigen::Matrix<double, 4, 2>;
  static constexpr TimeIndex kMemory = 256;

  [[nodiscard]] const TipInput& input_at(TimeIndex step) const noexcept {
    return inputs_[static_cast<std::size_t>((step + kMemory) % kMemory)];
  }
  [[nodiscard]] State after(const State& state, const TipInput& input) const noexcept;

  TippingBox box_;
  TiltObserverConfig config_;
  double period_;
  Eigen::Matrix4d transition_;
  std::array<TipInput, static_cast<std::size_t>(kMemory)> inputs_{};
  TimeIndex first_{0};  // The oldest step in memory.
  TimeIndex newest_{-1};
  TimeIndex pose_step_{0};
  bool has_seen_{false};
  State at_pose_{State::Zero()};
  State now_{State::Zero()};
  Eigen::Matrix4d covariance_{Eigen::Matrix4d::Identity()};
};

}  // namespace trifinger::manipulation
