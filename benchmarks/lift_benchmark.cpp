// SPDX-License-Identifier: BSD-3-Clause
// Runs the paper's experiment the way its users start it: `trifinger run sim` on one processor,
// `trifinger manipulate lift` on another.
#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <bit>
#include <cerrno>
#include <chrono>
#include <cmath>
#include <csignal>
#include <cstdio>
#include <optional>
#include <span>
#include <string>
#include <thread>
#include <vector>

#include "harness.hpp"
#include "support/folder.hpp"
#include "trifinger/core/frontend.hpp"
#include "trifinger/core/session.hpp"
#include "trifinger/core/timing.hpp"
#include "trifinger/realtime/clock.hpp"
#include "trifinger/realtime/thread.hpp"
#include "trifinger/sim/simulated_robot.hpp"

namespace trifinger::benchmarks {
namespace {

constexpr int kBackendCpu = 0;
constexpr int kControllerCpu = 1;
// Time that an action needs between two ticks: the controller's wake-up, its cycle, and whatever
// the reference loops do not see.
constexpr Nanoseconds kEnough = std::chrono::microseconds(250);

// A real-time loop that only wakes up. It runs above the robot's program on the same processor, and
// remembers when it was delayed.
class BareLoop {
 public:
  static constexpr Nanoseconds kInterval = std::chrono::microseconds(100);

  BareLoop(int cpu, int priority)
      : thread_([this, cpu, priority](const std::stop_token& stop) { run(stop, cpu, priority); }) {}

  void stop() {
    thread_.request_stop();
    thread_.join();
  }

  // Returns how long it was kept from running between two instants.
  [[nodiscard]] Nanoseconds held_up(std::int64_t from, std::int64_t to) const {
    std::int64_t sum = 0;
    for (const Delay& delay : delays_) {
      sum += std::max<std::int64_t>(0, std::min(to, delay.end) - std::max(from, delay.begin));
    }
    return Nanoseconds(sum);
  }
  [[nodiscard]] Nanoseconds longest() const {
    Nanoseconds longest{0};
    for (const Delay& delay : delays_) {
      longest = std::max(longest, Nanoseconds(delay.end - delay.begin));
    }
    return longest;
  }

 private:
  // The time from the planned to the actual wake-up [ns].
  struct Delay {
    std::int64_t begin;
    std::int64_t end;
  };

  void run(const std::stop_token& stop, int cpu, int priority) {
    enter_realtime({.demand = Demand::kTry, .priority = priority, .cpu = cpu});
    delays_.reserve(std::size_t{1} << 20U);
    MonotonicClock& clock = MonotonicClock::instance();
    Instant deadline = clock.now();
    while (!stop.stop_requested()) {
      deadline += kInterval;
      clock.sleep_until(deadline);
      const Instant now = clock.now();
      if (now - deadline > kInterval && delays_.size() < delays_.capacity()) {
        delays_.push_back({deadline.time_since_epoch().count(), now.time_since_epoch().count()});
      }
      while (deadline + kInterval <= now) deadline += kInterval;
    }
  }

  std::vector<Delay> delays_;
  std::jthread thread_;
};

// Starts a `trifinger` command on one processor. Its output is not part of the table.
Child start(int cpu, const std::vector<std::string>& words) {
  const auto body = [&] {
    pin(cpu);
    std::vector<char*> arguments;
    arguments.reserve(words.size() + 1);
    for (const std::string& word : words) arguments.push_back(const_cast<char*>(word.c_str()));
    arguments.push_back(nullptr);
    if (std::freopen("/dev/null", "w", stdout) != nullptr) {
      ::execvp(arguments.front(), arguments.data());
    }
    throw SystemError("start " + words.front() + ", which ./run bench builds", errno);
  };
  return Child(body, SIGTERM);
}

// Lists shares of the times, in powers of two: "50 % < 4 us, 99 % < 8 us".
std::string text_of(const LatenessHistogram& times) {
  std::string text;
  for (std::uint64_t below = 0, bin = 0; bin < LatenessHistogram::kNumBins; ++bin) {
    below += times.count_in(bin);
    const Nanoseconds end = LatenessHistogram::end_of(bin);
    const bool is_edge = std::has_single_bit(static_cast<std::uint64_t>(end.count()));
    if (!is_edge || 2 * below < times.count()) continue;
    text += fmt::format("{}{:.5g} % < {:.4g} us", text.empty() ? "" : ", ",
                        100.0 * static_cast<double>(below) / static_cast<double>(times.count()),
                        1e-3 * static_cast<double>(end.count()));
    if (below == times.count()) break;
  }
  return text;
}

// Returns all statuses of a session, from its first step to its end.
std::vector<Status> statuses_of(const Frontend<TriFinger>& robot, double hold_time) {
  std::vector<Status> statuses;
  for (bool has_ended = false; !has_ended;) {
    constexpr TimeIndex kAtOnce = 100;  // so many steps at once, to be woken rarely
    constexpr double kWayTime = 10.0;   // there and back [s]
    report_progress(std::ssize(statuses) / 1000, std::llround(hold_time + kWayTime));
    const auto next = static_cast<TimeIndex>(statuses.size());
    try {
      robot.wait_until_time_index(next + kAtOnce);
    } catch (const RobotStopped&) {
      has_ended = true;
    }
    statuses.resize(static_cast<std::size_t>(robot.current_time_index() + 1));
    robot.get_statuses(next, std::span(statuses).subspan(static_cast<std::size_t>(next)));
  }
  return statuses;
}

}  // namespace

std::vector<Row> lift(const Effort& effort) {
  const std::string name = fmt::format("benchmark-{}", ::getpid());
  const test::Folder folder;

  const Child backend = start(
      kBackendCpu, {"trifinger", "run", "sim", "--name", name, "--set", "fingers.height=0.3"});
  std::optional<Frontend<TriFinger>> robot;
  for (int tries = 0; !robot; ++tries) {
    try {
      robot = observe<TriFinger>(name);
    } catch (const SessionNotFound&) {
      if (tries > 1000 || backend.has_ended()) throw;
      std::this_thread::sleep_for(std::chrono::milliseconds(10));
    }
  }
  BareLoop beside_backend(kBackendCpu, 81);
  BareLoop beside_controller(kControllerCpu, 71);
  // Together with the way there and back, the lift takes a minute.
  const std::string hold_time = fmt::format("lift.hold_time={}", effort.hold_time);
  const Child controller =
      start(kControllerCpu, {"trifinger", "manipulate", "lift", "--robot", name, "--output",
                             folder.path(), "--set", hold_time});
  const std::vector<Status> statuses = statuses_of(*robot, effort.hold_time);
  beside_backend.stop();
  beside_controller.stop();

  int late = 0;
  int blamed = 0;
  for (std::size_t t = 1; t < statuses.size(); ++t) {
    if (late_cause(statuses[t]) != LateCause::kUser) continue;
    ++late;
    const std::int64_t from = statuses[t - 1].time;
    const std::int64_t to = statuses[t].time;
    const Nanoseconds left = Nanoseconds(to - from) - beside_backend.held_up(from, to) -
                             beside_controller.held_up(from, to);
    if (left > kEnough) ++blamed;
  }
  const SessionInfo end = robot->session().info();
  const bool is_done = end.fault.code == Fault::Code::kFinished;
  const double duration = 1e-9 * static_cast<double>(statuses.back().time - statuses.front().time);
  const std::optional<TimingRecord> timing = robot->session().timing();

  Samples samples;
  samples.add(blamed);
  Row row = make_row("lift in real time, two processes: late actions where bare loops were in time",
                     "", samples, "0", is_done && blamed == 0);
  row.reference = fmt::format(
      "bare FIFO loops on both processors, held up for at most {:.3g} ms",
      1e-6 * static_cast<double>(
                 std::max(beside_backend.longest(), beside_controller.longest()).count()));
  row.remark =
      fmt::format("{:.1f} s{}, {:.2f} steps/s; {} late actions in all; the back-end's lateness: {}",
                  duration, is_done ? "" : ", ended as " + end.fault_text,
                  static_cast<double>(statuses.size() - 1) / duration, late,
                  timing ? text_of(timing->lateness()) : "unknown");
  return {row};
}

}  // namespace trifinger::benchmarks
