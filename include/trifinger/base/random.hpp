// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <cstdint>

namespace trifinger {

/// Philox4x32-10: four random numbers that are a function of their place, `counter`, and of `key`.
/// J. K. Salmon, M. A. Moraes, R. O. Dror, D. E. Shaw: Parallel random numbers: as easy as 1, 2, 3.
/// SC 2011. Different counters never give the same four numbers under one key.
[[nodiscard]] std::array<std::uint32_t, 4> philox4x32_10(std::array<std::uint32_t, 4> counter,
                                                         std::array<std::uint32_t, 2> key) noexcept;

/// The random numbers of one episode, by Philox4x32-10 with `seed` as its key and `count` and
/// `episode` as its counter.
///
/// Nothing but these three numbers decides what comes next: a copy goes on as the original does,
/// and episodes need not be run in their order. The same numbers, bit for bit, on every machine.
struct Random {
  std::uint64_t seed{0};
  std::uint64_t episode{0};
  std::uint64_t count{0};  ///< How many blocks of four numbers have been taken.

  /// At least `low` and below `high`; their difference must be finite. `low` if they are equal.
  [[nodiscard]] double uniform(double low, double high) noexcept;

  /// Normally distributed, with mean 0 and standard deviation 1.
  [[nodiscard]] double normal() noexcept;

  /// At least `low` and below `high`, each with exactly the same probability. `low` if there is no
  /// number between them.
  [[nodiscard]] std::int64_t integer(std::int64_t low, std::int64_t high) noexcept;

  friend bool operator==(const Random&, const Random&) = default;
};

}  // namespace trifinger
