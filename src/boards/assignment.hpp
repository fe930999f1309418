// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <limits>
#include <vector>

namespace trifinger::boards {

/// Gives each row of a square matrix of costs a column of its own, so that their sum is as small as
/// possible: the Hungarian method with shortest augmenting paths (Jonker and Volgenant, Computing
/// 38, 1987). It allocates only in its constructor.
class Assignment {
 public:
  explicit Assignment(std::size_t size)
      : size_(size),
        row_of_(size + 1, kNone),
        column_of_(size),
        row_price_(size),
        column_price_(size + 1),
        distance_(size),
        before_(size),
        is_settled_(size + 1) {}

  /// `cost(row, column)` returns a finite cost.
  template <class Cost>
  void solve(const Cost& cost) noexcept {
    row_of_.assign(size_ + 1, kNone);
    row_price_.assign(size_, 0.0);
    column_price_.assign(size_ + 1, 0.0);
    for (std::size_t row = 0; row < size_; ++row) add(row, cost);
    for (std::size_t column = 0; column < size_; ++column) column_of_[row_of_[column]] = column;
  }

  [[nodiscard]] std::size_t column_of(std::size_t row) const noexcept { return column_of_[row]; }

 private:
  static constexpr std::size_t kNone = std::numeric_limits<std::size_t>::max();

  // Finds the cheapest way to give `row` a column, where other rows may take other columns. The
  // search begins at a column beside all others, which has the row.
  template <class Cost>
  void add(std::size_t row, const Cost& cost) noexcept {
    std::size_t column = size_;
    row_of_[column] = row;
    distance_.assign(size_, std::numeric_limits<double>::infinity());
    is_settled_.assign(size_ + 1, false);
    while (row_of_[column] != kNone) {
      is_settled_[column] = true;
      const std::size_t taker = row_of_[column];
      std::size_t nearest = size_;
      double step = std::numeric_limits<double>::infinity();
      for (std::size_t k = 0; k < size_; ++k) {
        if (is_settled_[k]) continue;
        const double reduced = cost(taker, k) - row_price_[taker] - column_price_[k];
        if (reduced < distance_[k]) {
          distance_[k] = reduced;
          before_[k] = column;
        }
        if (distance_[k] < step) {
          step = distance_[k];
          nearest = k;
        }
      }
      for (std::size_t k = 0; k <= size_; ++k) {
        if (is_settled_[k]) {
          row_price_[row_of_[k]] += step;
          column_price_[k] -= step;
        } else if (k < size_) {
          distance_[k] -= step;
        }
      }
      column = nearest;
    }
    while (column != size_) {
      row_of_[column] = row_of_[before_[column]];
      column = before_[column];
    }
  }

  std::size_t size_;
  std::vector<std::size_t> row_of_;  // of each column
  std::vector<std::size_t> column_of_;
  std::vector<double> row_price_;
  std::vector<double> column_price_;
  std::vector<double> distance_;
  std::vector<std::size_t> before_;
  std::vector<bool> is_settled_;
};

}  // namespace trifinger::boards
