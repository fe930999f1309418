// SPDX-License-Identifier: BSD-3-Clause
#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <filesystem>
#include <map>
#include <memory>
#include <random>
#include <thread>

#include "core/fake_robot.hpp"
#include "harness.hpp"
#include "log/recorder.hpp"
#include "support/folder.hpp"
#include "trifinger/base/error.hpp"
#include "trifinger/core/backend.hpp"
#include "trifinger/core/frontend.hpp"
#include "trifinger/log/log.hpp"

namespace trifinger::benchmarks {
namespace {

constexpr Nanoseconds kSearch = std::chrono::seconds(20);  // wait of a process that starts
// A process that makes no progress for so long has hung.
constexpr Nanoseconds kHang = std::chrono::seconds(20);

Instant now() { return MonotonicClock::instance().now(); }

double milliseconds(Nanoseconds time) { return 1e-6 * static_cast<double>(time.count()); }

// Runs the back-end of a process until the process is killed.
void run_backend(const std::string& name, const BackendOptions& options) {
  FakeDriver driver;
  SessionHost host = SessionHost::named(name);
  Backend backend(driver, host, options);
  enter_realtime({.demand = Demand::kTry});
  backend.run();
}

BackendOptions at_one_kilohertz(std::uint32_t max_action_repeats) {
  return {.mode = BackendOptions::Mode::kRealTime,
          .period = kPeriod,
          .max_action_repeats = max_action_repeats,
          .max_skipped_ticks = 1'000'000};
}

// Returns an observer of a running session of this back-end. Waits as long as a start may take.
Frontend<FakeRobot> find(const std::string& name, const Child& backend) {
  const Deadline deadline(kSearch);
  while (true) {
    try {
      auto robot = observe<FakeRobot>(name);
      // Skip the remains of a dead back-end, which can be read, too.
      if (robot.session().info().backend.pid == backend.pid() && !robot.fault()) return robot;
    } catch (const SessionNotFound&) {
    } catch (const RobotStopped&) {
    }
    if (deadline.passed()) throw TimedOut(fmt::format("robot '{}' does not begin", name));
    std::this_thread::yield();
  }
}

// Controls robot `name` in one session after the other. Each action follows the observation before
// it.
void run_controller(const std::string& name, std::atomic<std::int64_t>* appended = nullptr) {
  while (true) {
    try {
      auto robot = connect<FakeRobot>(name, {.timeout = kSearch});
      TimeIndex t = robot.append_desired_action({});
      while (true) {
        if (appended != nullptr) ++*appended;
        static_cast<void>(robot.get_observation(t));
        t = robot.append_desired_action({.setpoint = static_cast<double>(t)});
      }
    } catch (const RobotStopped&) {
      // Continue with the next session.
    } catch (const SessionNotFound&) {
      std::this_thread::yield();
    } catch (const HistoryLost&) {
    }
  }
}

class Dice {
 public:
  [[nodiscard]] int below(int end) {
    return std::uniform_int_distribution<int>(0, end - 1)(generator_);
  }
  // Waits for a random time of up to `longest`, so that kills may hit any instant between the
  // steps.
  void dawdle(Nanoseconds longest) {
    const Instant end = now() + Nanoseconds(std::uniform_int_distribution<std::int64_t>(
                                    0, longest.count())(generator_));
    while (now() < end) std::this_thread::yield();
  }

 private:
  std::mt19937 generator_{1};
};

// A session whose controller at 1 kHz was killed.
struct KilledController {
  Instant time;  // time of the kill
  Fault fault;   // fault that ended the session
  Status last;   // status of the last step with an action
  Status end;
};

KilledController kill_controller(const std::string& name, const Child& backend, Dice& random) {
  const Frontend<FakeRobot> robot = find(name, backend);
  auto controller = std::make_unique<Child>([&] { run_controller(name); });
  KilledController result{};
  try {
    robot.wait_until_time_index(20, kSearch);
    random.dawdle(25 * kPeriod);
    result.time = now();
    controller.reset();
    static_cast<void>(robot.get_status(1LL << 40U, kHang));
  } catch (const RobotStopped& stopped) {
    result.fault = stopped.fault();
    result.last = robot.get_status(result.fault.time_index - 1);
    result.end = robot.get_status(result.fault.time_index);
  }
  return result;
}

Instant time_of(const Status& status) { return Instant(Nanoseconds(status.time)); }
Instant deadline_of(const Status& status) { return time_of(status) - Nanoseconds(status.lateness); }

// Returns the number of deaths of one kind, since each takes a while.
int deaths(const Effort& effort) { return std::max(4, effort.kills / 5); }

// --- Kills of any process ---

// What the four processes report about their work.
struct Work {
  std::atomic<std::int64_t> appended{0};
  std::atomic<std::int64_t> observed{0};
  std::atomic<std::uint64_t> recorded_session{0};
  std::atomic<std::int64_t> recorded_step{0};
};

void run_observer(const std::string& name, std::atomic<std::int64_t>& observed) {
  while (true) {
    try {
      const auto robot = observe<FakeRobot>(name);
      for (TimeIndex t = robot.current_time_index() + 1;; ++t) {
        static_cast<void>(robot.get_observation(t));
        ++observed;
      }
    } catch (const RobotStopped&) {
      // Continue with the next session.
    } catch (const SessionNotFound&) {
      std::this_thread::yield();
    } catch (const HistoryLost&) {
    }
  }
}

void run_recorder(const std::string& name, const std::filesystem::path& folder, Work& work) {
  log::Recorder recorder({name}, {.folder = folder, .rotate_size = 1'000'000, .keep_free = 0});
  std::thread([&] {
    while (true) {
      const log::RecorderState::Robot state = recorder.state().robots[0];
      work.recorded_step = state.next_step;
      work.recorded_session = state.session_id;
      std::this_thread::sleep_for(std::chrono::milliseconds(1));
    }
  }).detach();
  recorder.run();
}

// Robot, controller, observer and recorder, each in a process. They are killed one after the other.
class FourProcesses {
 public:
  void start() {
    for (std::size_t i = 0; i < kProcesses; ++i) start(i);
  }

  // Kills one of them at any instant and starts it again. Throws TimedOut if another one hangs.
  void kill_one() {
    const auto victim = static_cast<std::size_t>(random_.below(kProcesses));
    const Frontend<FakeRobot> robot = wait_until_all_work();
    random_.dawdle(5 * kPeriod);
    processes_[victim].reset();
    if (victim == kBackend || victim == kController) wait_for_end(robot);
    start(victim);
    // A process may be killed right after its start, too. But if a recorder has not found its robot
    // yet, the robot must live, because nobody would record it.
    if (victim != kBackend && random_.below(4) == 0) {
      random_.dawdle(5 * kPeriod);
      processes_[victim].reset();
      start(victim);
      ++kills_;
    }
    ++kills_;
  }

  // Ends all processes. The log of the last session is then complete.
  void end() {
    const Frontend<FakeRobot> robot = wait_until_all_work();
    processes_[kController].reset();
    wait_for_end(robot);
    const std::uint64_t session = robot.session().info().session_id;
    // When the recorder has found the next session, it has finished this one.
    wait_for("recorder", [&] { return work_->recorded_session != session; });
    for (auto& process : processes_) process.reset();
  }

  [[nodiscard]] int kills() const noexcept { return kills_; }
  [[nodiscard]] std::size_t sessions() const noexcept { return steps_.size(); }
  [[nodiscard]] std::int64_t steps() const noexcept {
    std::int64_t sum = 0;
    for (const auto& [session, steps] : steps_) sum += steps;
    return sum;
  }
  // Returns the number of committed elements that are in neither the memory nor the log.
  [[nodiscard]] std::int64_t lost() const {
    std::map<std::uint64_t, std::int64_t> logged;
    for (const log::LoggedSession& session : log::Log(logs_.path()).sessions()) {
      const auto [first, end] = session.range(Series::kAppliedAction);
      logged[session.header().session_id] += end - first;
      for (const log::Gap& gap : session.gaps()) {
        logged[session.header().session_id] -= gap.last + 1 - gap.first;
      }
    }
    std::int64_t sum = lost_in_memory_;
    for (const auto& [session, steps] : steps_)
      sum += std::max<std::int64_t>(0, steps - logged[session]);
    return sum;
  }

 private:
  enum : std::size_t { kBackend, kController, kObserver, kRecorder, kProcesses };

  void start(std::size_t process) {
    // What the last recorder has said is nothing that the next one has found.
    if (process == kRecorder) work_->recorded_session = 0;
    processes_[process] = std::make_unique<Child>([this, process] {
      if (process == kBackend) run_backend(name_, at_one_kilohertz(1'000'000));
      if (process == kController) run_controller(name_, &work_->appended);
      if (process == kObserver) run_observer(name_, work_->observed);
      if (process == kRecorder) run_recorder(name_, logs_.path(), *work_);
    });
  }

  template <class Ready>
  void wait_for(const char* who, const Ready& ready) const {
    const Deadline deadline(kHang);
    while (!ready()) {
      if (deadline.passed()) throw TimedOut(fmt::format("the {} hangs", who));
      std::this_thread::yield();
    }
  }

  // Waits for a session in which all processes work, and returns it.
  [[nodiscard]] Frontend<FakeRobot> wait_until_all_work() {
    const Deadline deadline(kHang);
    while (true) {
      auto robot = find(name_, *processes_[kBackend]);
      try {
        robot.wait_until_time_index(5, kHang);
        const std::int64_t appended = work_->appended;
        const std::int64_t observed = work_->observed;
        wait_for("controller", [&] { return work_->appended > appended || robot.fault(); });
        wait_for("observer", [&] { return work_->observed > observed || robot.fault(); });
        const std::uint64_t session = robot.session().info().session_id;
        wait_for("recorder", [&] {
          return (work_->recorded_session == session && work_->recorded_step > 0) || robot.fault();
        });
        if (!robot.fault()) return robot;
      } catch (const RobotStopped&) {
        // This session belongs to a process that was killed before.
      }
      if (deadline.passed()) throw TimedOut("no session goes on");
    }
  }

  // Waits for the end of the session and checks that everything committed is there.
  void wait_for_end(const Frontend<FakeRobot>& robot) {
    try {
      static_cast<void>(robot.get_status(1LL << 40U, kHang));
    } catch (const RobotStopped&) {
    }
    const SessionInfo info = robot.session().info();
    steps_[info.session_id] = info.steps;
    const TimeIndex first = std::max<TimeIndex>(0, info.steps - 10'000);
    for (TimeIndex t = first; t < info.steps; ++t) {
      try {
        const FakeObservation observation = robot.get_observation(t);
        const double applied = robot.get_applied_action(t).setpoint;
        const double desired = robot.get_desired_action(t).setpoint;
        const bool follows =
            t == first ||
            (observation.applied_actions == robot.get_observation(t - 1).applied_actions + 1 &&
             observation.setpoint == robot.get_applied_action(t - 1).setpoint);
        if (!follows || applied != desired) ++lost_in_memory_;
      } catch (const HistoryLost&) {
        ++lost_in_memory_;
      }
    }
  }

  std::string name_{"benchmark-kills"};
  test::Folder logs_;
  Shared<Work> work_;
  Dice random_;
  std::array<std::unique_ptr<Child>, kProcesses> processes_;
  std::map<std::uint64_t, std::int64_t> steps_;  // steps of finished sessions
  std::int64_t lost_in_memory_{0};
  int kills_{0};
};

}  // namespace

// The robot continues with the actions that the controller had appended. So the death can be
// noticed at the tick of the first missing action, and no earlier.
std::vector<Row> dead_user(const Effort& effort) {
  const int kills = deaths(effort);
  const std::string name = "benchmark-detection";
  const Child backend([&] { run_backend(name, at_one_kilohertz(0)); });
  Dice random;
  Samples from_last_action;  // [periods]
  Samples from_kill;         // [ms]
  bool holds = true;
  for (int counted = 0; counted < kills;) {
    report_progress(counted, kills);
    const KilledController killed = kill_controller(name, backend, random);
    // On a busy machine a controller may be late by itself. Such a session does not count.
    if (killed.time != Instant{} && time_of(killed.end) >= killed.time) {
      const Nanoseconds time = time_of(killed.end) - std::max(killed.time, time_of(killed.last));
      ++counted;
      from_last_action.add(milliseconds(time) / milliseconds(kPeriod));
      from_kill.add(milliseconds(time_of(killed.end) - killed.time));
      // The lateness of ticks is measured separately, so it is subtracted here.
      const Instant since = std::max(killed.time, deadline_of(killed.last));
      holds = holds && deadline_of(killed.end) - since <= kPeriod * (1 + killed.end.skipped_ticks);
    }
    recover(name);
  }
  return {
      make_row("dead user: from the kill, or its last action, to the tick that stops the robot",
               "periods", from_last_action, "<= 1 period + the tick's lateness", holds,
               fmt::format("{} kills; from the kill, with an action that was still queued: median "
                           "{:.3g} ms, 95 % {:.3g} ms",
                           kills, from_kill.median(), from_kill.quantile(0.95)))};
}

// Measures the time until a dead user is noticed while missing actions may be repeated: a watchdog
// finds the controller's lock free.
std::vector<Row> dead_user_with_repeats(const Effort& effort) {
  const int kills = deaths(effort);
  const std::string name = "benchmark-detection";
  const Child backend([&] { run_backend(name, at_one_kilohertz(1'000'000)); });
  Dice random;
  Samples samples;  // [ms]
  for (int counted = 0; counted < kills;) {
    report_progress(counted, kills);
    const KilledController killed = kill_controller(name, backend, random);
    if (killed.time == Instant{}) continue;  // the session ended before the kill
    ++counted;
    samples.add(milliseconds(time_of(killed.end) - killed.time));
  }
  return {make_row("dead user whose actions may be repeated: kill to the end of the session", "ms",
                   samples, "95 % <= 25 ms", samples.quantile(0.95) <= 25.0,
                   fmt::format("{} kills; the watchdog looks every 20 ms; 95 % {:.3g} ms", kills,
                               samples.quantile(0.95)))};
}

std::vector<Row> dead_backend(const Effort& effort) {
  const int kills = deaths(effort);
  const std::string name = "benchmark-detection";
  Dice random;
  Samples samples;  // [ms]
  for (int i = 0; i < kills; ++i) {
    report_progress(i, kills);
    auto backend = std::make_unique<Child>([&] { run_backend(name, at_one_kilohertz(0)); });
    const Frontend<FakeRobot> robot = find(name, *backend);
    static_cast<void>(robot.latest_observation(kSearch));
    Instant killed{};
    std::thread killer([&] {
      random.dawdle(std::chrono::milliseconds(150));
      killed = now();
      backend.reset();
    });
    Instant noticed{};
    try {
      static_cast<void>(robot.get_observation(0, kHang));
    } catch (const RobotStopped&) {
      noticed = now();
    }
    killer.join();
    samples.add(milliseconds(noticed - killed));
  }
  return {make_row("dead back-end: kill to the error of a user who waits", "ms", samples,
                   "<= 200 ms", samples.quantile(1.0) <= 200.0, fmt::format("{} kills", kills))};
}

std::vector<Row> kills(const Effort& effort) {
  FourProcesses robot;
  int hangs = 0;
  std::string remark;
  try {
    robot.start();
    while (robot.kills() < effort.kills) {
      report_progress(robot.kills(), effort.kills);
      robot.kill_one();
    }
    robot.end();
  } catch (const TimedOut& error) {
    ++hangs;
    remark = fmt::format("; {}", error.what());
  }
  const auto count = [&](std::string measure, std::int64_t value, std::string reference) {
    const auto number = static_cast<double>(value);
    return Row{.measure = std::move(measure),
               .value = number,
               .low = number,
               .high = number,
               .unit = {},
               .reference = std::move(reference),
               .reference_value = {},
               .ratio = {},
               .reach = "0",
               .holds = value == 0,
               .remark = fmt::format("{} kills of a back-end, controller, observer or recorder at "
                                     "any instant, 1 kHz, {} sessions, {} steps{}",
                                     robot.kills(), robot.sessions(), robot.steps(), remark)};
  };
  return {count("random kills: processes that hang", hangs,
                "the original stack hangs in 20 of 20 kills of a user"),
          count("random kills: committed steps that are lost", robot.lost(), {})};
}

}  // namespace trifinger::benchmarks
