// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <chrono>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <string_view>

namespace trifinger::test {

/// True in `./run soak`, where tests may take minutes.
[[nodiscard]] inline bool is_soak() {
  const char* const value = std::getenv("TRIFINGER_SOAK");
  return value != nullptr && std::string_view(value) == "1";
}

/// Returns how often a test repeats its attempt: `usual` times in `./run test`, `soak` times in
/// `./run soak`.
[[nodiscard]] inline std::int64_t repetitions(std::int64_t usual, std::int64_t soak) {
  return is_soak() ? soak : usual;
}

/// Shows the progress of a long test. In `./run soak` it prints a line at every hundredth, in
/// ninja's format, which `./run` shows. Otherwise it prints nothing.
class ProgressLine {
 public:
  explicit ProgressLine(std::int64_t total) : total_(total), next_(is_soak() ? 0 : total + 1) {}

  void update(std::int64_t done) {
    if (done < next_) return;
    // Written to the stream of the figures, so that it never splits one of their lines.
    std::printf("[%lld/%lld]\n", static_cast<long long>(done), static_cast<long long>(total_));
    std::fflush(stdout);
    next_ = done + (total_ + 99) / 100;
  }

 private:
  std::int64_t total_;
  std::int64_t next_;
};

/// The rounds of a test with random inputs: `usual` rounds in `./run test`, so that slow machines
/// do the same, and rounds for the time `soak` in `./run soak`.
///
///     for (Rounds rounds(100, std::chrono::minutes(10)); rounds.next();)
class Rounds {
 public:
  Rounds(std::int64_t usual, std::chrono::seconds soak)
      : usual_(usual), end_(Clock::now() + soak), soak_(soak), progress_(soak.count()) {}

  /// Starts the next round; false if there is none.
  [[nodiscard]] bool next() {
    ++done_;
    if (!is_soak()) return done_ <= usual_;
    const auto left = std::chrono::ceil<std::chrono::seconds>(end_ - Clock::now());
    progress_.update((soak_ - left).count());
    return left.count() > 0;
  }

  /// Index of the current round, from 0 on. After the last round: the number of rounds.
  [[nodiscard]] std::int64_t index() const noexcept { return done_ - 1; }

 private:
  using Clock = std::chrono::steady_clock;

  std::int64_t usual_;
  std::int64_t done_{0};
  Clock::time_point end_;
  std::chrono::seconds soak_;
  ProgressLine progress_;
};

}  // namespace trifinger::test
