// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <unistd.h>

#include <chrono>
#include <csignal>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "trifinger/base/time.hpp"

namespace trifinger::benchmarks {

using Clock = std::chrono::steady_clock;

/// Period of the loops at 1 kHz.
inline constexpr Nanoseconds kPeriod = std::chrono::milliseconds(1);

[[nodiscard]] inline double microseconds(Clock::duration time) {
  return std::chrono::duration<double, std::micro>(time).count();
}
[[nodiscard]] inline double seconds_since(Clock::time_point begin) {
  return std::chrono::duration<double>(Clock::now() - begin).count();
}

/// Samples of one figure.
class Samples {
 public:
  void add(double value) { values_.push_back(value); }
  [[nodiscard]] bool empty() const noexcept { return values_.empty(); }
  /// Returns the value below which the fraction `p` of the samples lies.
  [[nodiscard]] double quantile(double p) const;
  [[nodiscard]] double median() const { return quantile(0.5); }

 private:
  std::vector<double> values_;
};

/// One row of the table.
struct Row {
  std::string measure;
  double value{0.0};  ///< Median.
  double low{0.0};    ///< Smallest and largest value of the rounds.
  double high{0.0};
  std::string unit;
  std::string reference;                  ///< What was measured for comparison; empty for nothing.
  std::optional<double> reference_value;  ///< Median, in the same unit.
  std::optional<double> ratio;  ///< Measure divided by its reference, median of the rounds.
  std::string reach;            ///< In words, as in "<= 80 ns"; empty for none.
  bool holds{true};
  std::string remark;
};

/// Tells `./run bench` the progress of the measure, at most twice a second because showing it takes
/// a processor.
void report_progress(std::int64_t done, std::int64_t total);

/// Measures both sides in turn, so that both see the same conditions. Returns the samples of each
/// side and of their ratio.
struct Paired {
  Samples measure;
  Samples reference;
  Samples ratio;
};
[[nodiscard]] Paired alternate(int rounds, const std::function<double()>& measure,
                               const std::function<double()>& reference);

/// Returns a row without a reference.
[[nodiscard]] Row make_row(std::string measure, std::string unit, const Samples& samples,
                           std::string reach, bool holds, std::string remark = {});
[[nodiscard]] Row make_row(std::string measure, std::string unit, const Paired& paired,
                           std::string reference, std::string reach, bool holds);

/// Reports a result to `./run bench`.
void report_row(const Row& row);

/// Reports to `./run bench` what this process may use of the machine.
void report_process();

/// Keeps the calling thread on one processor. Returns false if there is no such processor.
bool pin(int cpu);

/// A child process that runs `body` and exits. The destructor sends it a signal and waits for its
/// end. If this thread ends without that, the child is killed.
class Child {
 public:
  explicit Child(const std::function<void()>& body, int end_signal = SIGKILL);
  Child(const Child&) = delete;
  Child& operator=(const Child&) = delete;
  ~Child();

  [[nodiscard]] int pid() const noexcept { return pid_; }
  [[nodiscard]] bool has_ended() const noexcept;

 private:
  int parent_{::getpid()};  // initialised before the fork
  int pid_;
  int end_signal_;
};

/// Memory that is shared with children forked later.
template <class T>
class Shared;
void* make_shared_memory(std::size_t size);
template <class T>
class Shared {
 public:
  Shared() : value_(new (make_shared_memory(sizeof(T))) T{}) {}
  T& operator*() const noexcept { return *value_; }
  T* operator->() const noexcept { return value_; }

 private:
  T* value_;  // the memory is released when the process ends
};

struct Effort {
  int rounds;          ///< Rounds of each paired measure.
  int windows;         ///< Pairs of windows in which the lateness is measured.
  double window_time;  ///< [s]
  int kills;           ///< Kills of processes at random instants.
  double hold_time;    ///< Time for which the lifted cube is held [s].
  double share{1.0};   ///< Share of the episodes and pictures of each round that is measured.
};

/// A measure runs in a process of its own. It may pin itself, become real-time and lock its memory:
/// all that ends with the process.
using Measure = std::vector<Row>(const Effort& effort);

Measure lateness, lateness_beside_hogs, lateness_beside_planner, lift;
Measure append, wake, loop, inline_loop;
Measure emulator;
Measure motor_bus;
Measure emulated_robot;
Measure can_frames;
Measure safety_chain, simulation, cameras, control_cycle, planner;
Measure policy, single_precision_policy;
Measure vector_environment_1_thread, vector_environment_2_threads, environment;
Measure any_robot;
Measure log_files, recorded_simulation, recorded_images;
Measure images;
Measure dead_user, dead_user_with_repeats, dead_backend, kills;

}  // namespace trifinger::benchmarks
