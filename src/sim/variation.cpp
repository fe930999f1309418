// SPDX-License-Identifier: BSD-3-Clause
#include "trifinger/sim/variation.hpp"

#include <algorithm>
#include <cmath>
#include <string_view>

#include "base/text_of.hpp"
#include "trifinger/base/error.hpp"

namespace trifinger {
namespace {

using detail::text_of;

void check(std::string_view name, double value, bool may_be_zero) {
  if (std::isfinite(value) && (value > 0.0 || (may_be_zero && value == 0.0))) return;
  throw InvalidArgument(
      text_of(name, " is ", value, ", must be ", may_be_zero ? "at least" : "more than", " 0"));
}

void check(std::string_view name, TimeIndex steps, bool /*may_be_zero*/) {
  if (steps >= 0 && steps <= Variation::kMaxTorqueDelay) return;
  throw InvalidArgument(
      text_of(name, " is ", steps, " steps, must be 0 to ", Variation::kMaxTorqueDelay));
}

void check(std::string_view name, const OfSurfacePairs<double>& factors, bool may_be_zero) {
  for (const SurfacePair pair : all_surface_pairs()) {
    check(text_of(name, " of ", name_of(pair)), factors[pair], may_be_zero);
  }
}

}  // namespace

void Variation::validate() const {
  std::apply(
      [this](const auto&... row) { (check(row.name, this->*row.value, row.may_be_zero), ...); },
      fields());
}

bool Variation::varies_same_pairs_as(const Variation& other) const noexcept {
  return std::ranges::all_of(all_surface_pairs(),
                             [&](SurfacePair pair) { return varies(pair) == other.varies(pair); });
}

}  // namespace trifinger
