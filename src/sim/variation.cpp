// SPDX-License-Identifier: BSD-3-Clause
#include "trifinger/sim/variation.hpp"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <string>
#include <string_view>

#include "base/text_of.hpp"
#include "trifinger/base/error.hpp"

namespace trifinger {
namespace {

using detail::text_of;

void check(std::string_view name, double value, bool may_be_zero, double limit) {
  const bool is_enough = value > 0.0 || (may_be_zero && value == 0.0);
  if (std::isfinite(value) && is_enough && value < limit) return;
  const std::string most = std::isfinite(limit) ? text_of(" and below ", limit) : "";
  throw InvalidArgument(text_of(name, " is ", value, ", must be ",
                                may_be_zero ? "at least" : "more than", " 0", most));
}

void check(std::string_view /*name*/, std::uint64_t /*seed*/, bool /*zero*/, double /*limit*/) {}

void check(std::string_view name, TimeIndex steps, bool /*zero*/, double /*limit*/) {
  if (steps >= 0 && steps <= Variation::kMaxDelay) return;
  throw InvalidArgument(
      text_of(name, " is ", steps, " steps, must be 0 to ", Variation::kMaxDelay));
}

void check(std::string_view name, const OfSurfacePairs<double>& factors, bool may_be_zero,
           double limit) {
  for (const SurfacePair pair : all_surface_pairs()) {
    check(text_of(name, " of ", name_of(pair)), factors[pair], may_be_zero, limit);
  }
}

}  // namespace

void Variation::validate() const {
  std::apply(
      [this](const auto&... row) {
        (check(row.name, this->*row.value, row.may_be_zero, row.limit), ...);
      },
      fields());
}

bool Variation::varies_same_pairs_as(const Variation& other) const noexcept {
  return std::ranges::all_of(all_surface_pairs(),
                             [&](SurfacePair pair) { return varies(pair) == other.varies(pair); });
}

}  // namespace trifinger
