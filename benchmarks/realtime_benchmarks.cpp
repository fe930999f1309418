// SPDX-License-Identifier: BSD-3-Clause
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <functional>
#include <memory>
#include <sstream>
#include <stop_token>
#include <thread>

#include "core/fake_robot.hpp"
#include "harness.hpp"
#include "trifinger/control/online_planner.hpp"
#include "trifinger/core/backend.hpp"
#include "trifinger/core/frontend.hpp"

namespace trifinger::benchmarks {
namespace {

const RealtimeOptions kRealtime{.demand = Demand::kTry, .priority = 80, .cpu = 1};

// Returns the time that the machine's host has taken from all processors so far [s].
double steal_time() {
  std::ifstream file("/proc/stat");
  std::string word;
  file >> word;
  double value = 0.0;
  for (int i = 0; i < 8; ++i) file >> value;
  constexpr double kTicksPerSecond = 100.0;
  return value / kTicksPerSecond;
}

// Returns the lateness [us] of a loop that only sleeps until absolute deadlines.
Samples bare_window(double window_time) {
  Samples samples;
  std::thread([&] {
    enter_realtime(kRealtime);
    MonotonicClock& clock = MonotonicClock::instance();
    Instant deadline = clock.now();
    const Instant end =
        deadline + std::chrono::round<Nanoseconds>(std::chrono::duration<double>(window_time));
    while (deadline < end) {
      deadline += kPeriod;
      clock.sleep_until(deadline);
      const Instant now = clock.now();
      samples.add(1e-3 * static_cast<double>((now - deadline).count()));
      // If it is late by whole periods, it skips them like the back-end does.
      while (deadline + kPeriod <= now) deadline += kPeriod;
    }
  }).join();
  return samples;
}

// Returns the lateness [us] measured by cyclictest, the usual program to judge real-time kernels.
// Empty if the program is missing or may not run in real time.
Samples cyclictest_window(double window_time) {
  const std::string command = fmt::format(
      "cyclictest --mlockall --quiet --threads=1 --policy=fifo --priority={} --affinity={} "
      "--interval={} --duration={} --histogram=100000 2>/dev/null",
      kRealtime.priority, *kRealtime.cpu, kPeriod / std::chrono::microseconds(1),
      std::max(1.0, std::round(window_time)));
  const std::unique_ptr<std::FILE, int (*)(std::FILE*)> output(
      // NOLINTNEXTLINE(bugprone-command-processor): all words of the command are ours.
      ::popen(command.c_str(), "r"), ::pclose);
  Samples samples;
  // A result has one line per microsecond, "000042 001234". All other lines begin with '#' or are
  // empty.
  std::array<char, 256> line{};
  while (output != nullptr && std::fgets(line.data(), line.size(), output.get()) != nullptr) {
    std::istringstream fields(line.data());
    int lateness = 0;
    int count = 0;
    if (!(fields >> lateness >> count)) continue;
    for (int i = 0; i < count; ++i) samples.add(lateness);
  }
  return samples;
}

struct Window {
  Samples lateness;   // [us]
  double drift{0.0};  // [ns]
};

// Returns the back-end's lateness and drift, read from its status series.
Window backend_window(double window_time) {
  FakeDriver driver;
  SessionHost host = SessionHost::anonymous();
  Backend backend(driver, host,
                  {.mode = BackendOptions::Mode::kRealTime,
                   .period = kPeriod,
                   .max_action_repeats = 1000000,
                   .max_skipped_ticks = 1000000});
  const BackendThread thread(backend, kRealtime);
  Frontend<FakeRobot> robot(host);
  robot.append_desired_action({});
  const auto steps =
      static_cast<TimeIndex>(window_time * 1e9 / static_cast<double>(kPeriod.count()));
  std::vector<Status> statuses;
  TimeIndex t = 0;
  std::vector<Status> part(100);
  // Reads in pieces, because the window may be longer than the history.
  while (t < steps) {
    robot.get_statuses(t, part);
    statuses.insert(statuses.end(), part.begin(), part.end());
    t += static_cast<TimeIndex>(part.size());
  }
  Window window;
  const auto deadline_of = [](const Status& status) { return status.time - status.lateness; };
  for (const Status& status : statuses) {
    window.lateness.add(1e-3 * static_cast<double>(status.lateness));
    const std::int64_t expected =
        deadline_of(statuses.front()) + (status.tick - statuses.front().tick) * kPeriod.count();
    window.drift =
        std::max(window.drift, std::abs(static_cast<double>(deadline_of(status) - expected)));
  }
  return window;
}

// Windows of the back-end and of a reference in turn. On a machine that stalls at random, 30 pairs
// say more than two long runs.
struct Pairs {
  Paired p99;              // [us]
  double ours_max{0.0};    // [us]
  double others_max{0.0};  // [us]
  double drift{0.0};       // [ns]
  double steal{0.0};       // [s]
};

Pairs measure_pairs(const Effort& effort, const std::function<Samples(double)>& reference) {
  Pairs pairs;
  const double steal_before = steal_time();
  for (int i = 0; i < effort.windows; ++i) {
    report_progress(i, effort.windows);
    const Window ours = backend_window(effort.window_time);
    const Samples others = reference(effort.window_time);
    pairs.p99.measure.add(ours.lateness.quantile(0.99));
    pairs.ours_max = std::max(pairs.ours_max, ours.lateness.quantile(1.0));
    pairs.drift = std::max(pairs.drift, ours.drift);
    if (others.empty()) continue;
    pairs.p99.reference.add(others.quantile(0.99));
    pairs.others_max = std::max(pairs.others_max, others.quantile(1.0));
  }
  pairs.steal = steal_time() - steal_before;
  return pairs;
}

Row lateness_row(const Effort& effort, const Pairs& pairs, std::string measure,
                 const std::string& reference) {
  Row row = make_row(std::move(measure), "us", pairs.p99.measure, "<= 1.2x", false);
  if (pairs.p99.reference.empty()) {
    row.reference = reference + ": missing, or refused";
    return row;
  }
  row.reference = reference;
  row.reference_value = pairs.p99.reference.median();
  row.ratio = row.value / *row.reference_value;
  row.holds = *row.ratio <= 1.2;
  row.remark = fmt::format(
      "{} pairs of windows of {:g} s; maxima {:.0f} us and, of the reference, {:.0f} us; steal "
      "time {:.2f} s",
      effort.windows, effort.window_time, pairs.ours_max, pairs.others_max, pairs.steal);
  return row;
}

// Keeps a processor busy for as long as this object lives.
class Hog {
 public:
  explicit Hog(int cpu)
      : child_([cpu] {
          pin(cpu);
          for (volatile std::uint64_t work = 0;;) work = work + 1;
        }) {}

 private:
  Child child_;
};

// Plans without a pause for as long as this object lives, on one thread.
class Planning {
 public:
  Planning()
      : planner_(control::PlanningModel(description()), {}, {.num_threads = 1}, {.period = {}}),
        feeder_([this](const std::stop_token& stop) {
          control::PlanningState state = planner_.model().initial_state();
          while (!stop.stop_requested()) {
            state.time += kPeriod;
            planner_.set_state(state);
            std::this_thread::sleep_for(kPeriod);
          }
        }) {}

 private:
  static RobotDescription description() { return {.finger_height = 0.3}; }

  control::OnlinePlanner planner_;
  std::jthread feeder_;
};

}  // namespace

std::vector<Row> lateness(const Effort& effort) {
  const Pairs pairs = measure_pairs(effort, bare_window);
  Samples drift;
  drift.add(pairs.drift);
  return {make_row("1 kHz: drift", "ns", drift, "0", pairs.drift == 0.0),
          lateness_row(effort, pairs, "1 kHz: lateness, median of the windows' p99",
                       "bare clock_nanosleep loop, same priority")};
}

std::vector<Row> lateness_beside_hogs(const Effort& effort) {
  const Hog first(0);
  const Hog second(1);
  return {lateness_row(effort, measure_pairs(effort, cyclictest_window),
                       "1 kHz beside two CPU hogs: lateness, likewise",
                       "cyclictest, same priority")};
}

std::vector<Row> lateness_beside_planner(const Effort& effort) {
  const auto beside = [&] {
    const Planning planning;
    return backend_window(effort.window_time).lateness.quantile(0.99);
  };
  const auto alone = [&] { return backend_window(effort.window_time).lateness.quantile(0.99); };
  const Paired paired = alternate(effort.windows, beside, alone);
  const double ratio = paired.measure.median() / paired.reference.median();
  Row row = make_row("1 kHz beside a planner: lateness, median of the windows' p99", "us", paired,
                     "without the planner", "<= 1.2x", ratio <= 1.2);
  row.ratio = ratio;
  return {row};
}

}  // namespace trifinger::benchmarks
