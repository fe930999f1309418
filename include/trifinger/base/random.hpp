// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <cstdint>

namespace trifinger {

/// Philox4x32-10: four random numbers that depend only on `counter`, their place in the series, and
/// on `key`. Under one key, different counters never give the same four numbers.
/// J. K. Salmon, M. A. Moraes, R. O. Dror, D. E. Shaw: Parallel random numbers: as easy as 1, 2, 3.
/// SC 2011.
[[nodiscard]] std::array<std::uint32_t, 4> philox4x32_10(std::array<std::uint32_t, 4> counter,
                                                         std::array<std::uint32_t, 2> key) noexcept;

/// The random numbers of one episode: Philox4x32-10 with `seed` as its key, and with `count` and
/// `episode` as its counter.
///
/// Only these three numbers decide which number comes next. A copy therefore continues exactly like
/// the original, and episodes may run in any order. The numbers are the same on every machine, bit
/// for bit.
struct Random {
  std::uint64_t seed{0};
  std::uint64_t episode{0};
  std::uint64_t count{0};  ///< Number of blocks of four numbers taken so far.

  /// A number from `low` up to but not including `high`. Their difference must be finite. Returns
  /// `low` if they are equal.
  [[nodiscard]] double uniform(double low, double high) noexcept;

  /// A normally distributed number with mean 0 and standard deviation 1.
  [[nodiscard]] double normal() noexcept;

  /// An integer from `low` up to but not including `high`, each with exactly the same probability.
  /// Returns `low` if there is no integer between them.
  [[nodiscard]] std::int64_t integer(std::int64_t low, std::int64_t high) noexcept;

  friend bool operator==(const Random&, const Random&) = default;
};

}  // namespace trifinger
