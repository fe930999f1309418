// SPDX-License-Identifier: BSD-3-Clause
#include "trifinger/control/knot_spline.hpp"

#include <algorithm>
#include <string>

#include "trifinger/base/error.hpp"

namespace trifinger::control {

KnotSpline::KnotSpline(SplineKind kind, int num_knots, int width, Seconds interval, Seconds begin)
    : kind_(kind), num_knots_(num_knots), width_(width), interval_(interval), begin_(begin) {
  detail::require(num_knots >= 1,
                  "the number of knots is " + std::to_string(num_knots) + ", must be at least 1");
  detail::require(width >= 1, "the number of values per knot is " + std::to_string(width) +
                                  ", must be at least 1");
  detail::require_positive("the interval of the knots", interval.count());
  values_.resize(static_cast<std::size_t>(num_knots) * static_cast<std::size_t>(width));
}

void KnotSpline::interpolate(Seconds time, std::span<const double> knots, std::span<double> value,
                             std::span<double> rate) const noexcept {
  const auto width = static_cast<std::size_t>(width_);
  const int last = num_knots_ - 1;
  const double where = (time - begin_) / interval_;
  const double* const first = knots.data();
  // Written so that NaN rests at the first knot.
  if (!(where > 0.0) || where >= last) {
    std::copy_n(first + (where > 0.0 ? last : 0) * width_, width, value.begin());
    if (!rate.empty()) std::ranges::fill(rate, 0.0);
    return;
  }
  const int index = static_cast<int>(where);
  const double s = where - index;
  const double per_second = 1.0 / interval_.count();
  const double* const here = first + index * width_;
  const double* const next = here + width_;
  switch (kind_) {
    case SplineKind::kConstant:
      std::copy_n(here, width, value.begin());
      if (!rate.empty()) std::ranges::fill(rate, 0.0);
      return;
    case SplineKind::kLinear:
      for (std::size_t i = 0; i < width; ++i) value[i] = here[i] + s * (next[i] - here[i]);
      if (rate.empty()) return;
      for (std::size_t i = 0; i < width; ++i) rate[i] = per_second * (next[i] - here[i]);
      return;
    case SplineKind::kCubic:
      break;
  }
  // Hermite's polynomials. At the ends the rate is that of the line to the only neighbour.
  const double* const before = index > 0 ? here - width_ : nullptr;
  const double* const after = index + 2 <= last ? next + width_ : nullptr;
  for (std::size_t i = 0; i < width; ++i) {
    const double difference = next[i] - here[i];
    const double rate_here = before != nullptr ? 0.5 * (next[i] - before[i]) : difference;
    const double rate_next = after != nullptr ? 0.5 * (after[i] - here[i]) : difference;
    const double third = rate_here + rate_next - 2.0 * difference;
    const double second = 3.0 * difference - 2.0 * rate_here - rate_next;
    value[i] = here[i] + s * (rate_here + s * (second + s * third));
    if (!rate.empty()) rate[i] = per_second * (rate_here + s * (2.0 * second + 3.0 * s * third));
  }
}

}  // namespace trifinger::control
