// SPDX-License-Identifier: BSD-3-Clause
#include "trifinger/camera/rendering_options.hpp"

#include <cmath>
#include <type_traits>

#include "base/text_of.hpp"
#include "trifinger/base/error.hpp"

namespace trifinger::camera {
namespace {

using trifinger::detail::require;
using trifinger::detail::text_of;

template <class T>
void check(const RenderingField<T>& row, const RenderingOptions& options) {
  const T& value = options.*row.value;
  const auto check_number = [&row](double number) {
    require(number >= row.low && number <= row.high,
            text_of(row.name, " is ", number, ", must be from ", row.low, " to ", row.high));
  };
  if (row.low == row.high) return;
  if constexpr (std::is_same_v<T, Nanoseconds>) {
    check_number(std::chrono::duration<double>(value).count());
  } else if constexpr (std::is_same_v<T, std::array<double, 3>>) {
    for (const double number : value) check_number(number);
  } else {
    check_number(static_cast<double>(value));
  }
}

}  // namespace

void RenderingOptions::validate() const {
  std::apply([this](const auto&... row) { (check(row, *this), ...); }, fields());
  require(multisampling == 0 || multisampling == 2 || multisampling == 4 || multisampling == 8,
          text_of("multisampling is ", multisampling, ", must be 0, 2, 4 or 8"));
  const double length = std::hypot(lamp[0], lamp[1], lamp[2]);
  require(std::isfinite(length) && length > 1e-6,
          text_of("lamp is ", lamp[0], ' ', lamp[1], ' ', lamp[2], ", must be a direction"));
}

}  // namespace trifinger::camera
