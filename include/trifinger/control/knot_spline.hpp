// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "trifinger/control/motion.hpp"

namespace trifinger::control {

/// How values follow from knots.
enum class SplineKind : std::uint8_t {
  kConstant,  ///< A knot holds until the next one.
  kLinear,    ///< Straight lines between knots.
  /// Cubic polynomials whose rates at the knots are those of the parabolas through the neighbours
  /// (Catmull and Rom). Values and rates are continuous.
  kCubic,
};

/// Numbers as functions of time: `width` values given at knots of equal distance. Before the first
/// and after the last knot they rest.
///
/// After its construction, no function allocates memory.
class KnotSpline {
 public:
  /// A spline without values.
  KnotSpline() = default;
  /// Knots lie at `begin`, `begin + interval` and so on. All values are 0.
  /// @throws InvalidArgument if a number is below 1 or `interval` is not above zero.
  KnotSpline(SplineKind kind, int num_knots, int width, Seconds interval, Seconds begin = {});

  [[nodiscard]] SplineKind kind() const noexcept { return kind_; }
  [[nodiscard]] int num_knots() const noexcept { return num_knots_; }
  [[nodiscard]] int width() const noexcept { return width_; }
  [[nodiscard]] Seconds interval() const noexcept { return interval_; }
  /// Time of the first knot [s].
  [[nodiscard]] Seconds begin() const noexcept { return begin_; }
  /// Time of the last knot [s].
  [[nodiscard]] Seconds end() const noexcept { return begin_ + (num_knots_ - 1) * interval_; }
  /// Moves all knots, so that the first one lies at `begin`.
  void move_to(Seconds begin) noexcept { begin_ = begin; }

  /// The values of one knot.
  [[nodiscard]] std::span<double> knot(int index) noexcept {
    const auto width = static_cast<std::size_t>(width_);
    return values().subspan(static_cast<std::size_t>(index) * width, width);
  }
  [[nodiscard]] std::span<const double> knot(int index) const noexcept {
    const auto width = static_cast<std::size_t>(width_);
    return values().subspan(static_cast<std::size_t>(index) * width, width);
  }
  /// The values of all knots, one knot after the other.
  [[nodiscard]] std::span<double> values() noexcept { return values_; }
  [[nodiscard]] std::span<const double> values() const noexcept { return values_; }

  /// Computes the values at `time`, and their rates [1/s] unless `rate` is empty. Both spans have
  /// `width` numbers.
  void at(Seconds time, std::span<double> value, std::span<double> rate = {}) const noexcept {
    interpolate(time, values_, value, rate);
  }
  /// Does the same with `knots` as the values of all knots.
  void interpolate(Seconds time, std::span<const double> knots, std::span<double> value,
                   std::span<double> rate = {}) const noexcept;

 private:
  SplineKind kind_{SplineKind::kConstant};
  int num_knots_{0};
  int width_{0};
  Seconds interval_{1};
  Seconds begin_{0};
  std::vector<double> values_;
};

}  // namespace trifinger::control
