// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <optional>

#include "can/motor_board.hpp"

namespace trifinger::can {

/// Makes positions continuous that roll over at ±100 revolutions.
///
/// Between two positions the motor must turn by less than 100 revolutions; a fast motor needs a
/// second for that. A wrong position between two right ones changes nothing that follows.
class PositionUnwrapper {
 public:
  /// Continues from the position before. The first one is returned as it is. [revolutions]
  constexpr double unwrap(double revolutions) noexcept {
    if (last_.has_value()) {
      const double step = revolutions - *last_;
      if (step < -kRolloverRevolutions) ++turns_;
      if (step > kRolloverRevolutions) --turns_;
    }
    last_ = revolutions;
    // The count is an integer, so errors do not add up however long the motor turns.
    return revolutions + 2.0 * kRolloverRevolutions * static_cast<double>(turns_);
  }

  /// Begins anew, as is needed after the board was switched on.
  constexpr void reset() noexcept { *this = {}; }

 private:
  std::optional<double> last_;  // [revolutions]
  std::int64_t turns_{0};
};

}  // namespace trifinger::can
