// SPDX-License-Identifier: BSD-3-Clause
#include <fmt/format.h>

#include <cmath>
#include <cstdlib>
#include <fstream>
#include <sstream>
#include <thread>

#include "harness.hpp"
#include "trifinger/core/backend.hpp"
#include "trifinger/core/fake_robot.hpp"
#include "trifinger/core/frontend.hpp"

namespace trifinger::benchmarks {
namespace {

constexpr Nanoseconds kPeriod = std::chrono::milliseconds(1);
const RealtimeOptions kRealtime{.demand = Demand::kTry, .priority = 80, .cpu = 1};

// What the machine's host has taken from all processors so far [s].
double steal_time() {
  std::ifstream file("/proc/stat");
  std::string word;
  file >> word;
  double value = 0.0;
  for (int i = 0; i < 8; ++i) file >> value;
  constexpr double kTicksPerSecond = 100.0;
  return value / kTicksPerSecond;
}

// Lateness [us] of a loop that does nothing but sleep until absolute deadlines.
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
      // Late by whole periods: as the back-end does.
      while (deadline + kPeriod <= now) deadline += kPeriod;
    }
  }).join();
  return samples;
}

struct Window {
  Samples lateness;   // [us]
  double drift{0.0};  // [ns]
};

// The same of the back-end, as its status series tells it.
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
  // In pieces: the window may be longer than the history.
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

}  // namespace

std::vector<Row> realtime_rows(const Effort& effort) {
  Samples ours_p99;
  Samples bare_p99;
  Samples ratio;
  double ours_max = 0.0;
  double bare_max = 0.0;
  double drift = 0.0;
  const double steal_before = steal_time();
  for (int i = 0; i < effort.windows; ++i) {
    const Window ours = backend_window(effort.window_time);
    const Samples bare = bare_window(effort.window_time);
    ours_p99.add(ours.lateness.quantile(0.99));
    bare_p99.add(bare.quantile(0.99));
    ratio.add(ours.lateness.quantile(0.99) / bare.quantile(0.99));
    ours_max = std::max(ours_max, ours.lateness.quantile(1.0));
    bare_max = std::max(bare_max, bare.quantile(1.0));
    drift = std::max(drift, ours.drift);
  }
  const double steal = steal_time() - steal_before;

  const Row drift_row{.measure = "1 kHz: drift",
                      .value = drift,
                      .low = drift,
                      .high = drift,
                      .unit = "ns",
                      .reference = {},
                      .ratio = {},
                      .reach = "0",
                      .holds = drift == 0.0,
                      .remark = {}};

  Row lateness;
  lateness.measure = "1 kHz: lateness, median of the windows' p99";
  lateness.value = ours_p99.median();
  lateness.low = ours_p99.quantile(0.0);
  lateness.high = ours_p99.quantile(1.0);
  lateness.unit = "us";
  lateness.reference = fmt::format("bare clock_nanosleep loop ({:.4g} us)", bare_p99.median());
  lateness.ratio = ours_p99.median() / bare_p99.median();
  lateness.reach = "<= 1.2x";
  lateness.holds = *lateness.ratio <= 1.2;
  lateness.remark = fmt::format(
      "{} pairs of windows of {:g} s; maxima {:.0f} us and bare {:.0f} us; steal time {:.2f} s",
      effort.windows, effort.window_time, ours_max, bare_max, steal);
  return {drift_row, lateness};
}

}  // namespace trifinger::benchmarks
