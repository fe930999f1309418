// SPDX-License-Identifier: BSD-3-Clause
#include "trifinger/core/follower.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <array>
#include <atomic>
#include <chrono>
#include <cstring>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <random>
#include <span>
#include <thread>
#include <utility>
#include <vector>

#include "core/drivers_of_tests.hpp"
#include "core/fake_robot.hpp"
#include "core/transports.hpp"
#include "trifinger/core/backend.hpp"
#include "trifinger/core/errors.hpp"
#include "trifinger/core/frontend.hpp"

// Outside real-time mode, nothing is overwritten that a follower still has to read. No follower can
// stop a robot for good.

namespace trifinger {
namespace {

constexpr TimeIndex kHistory = 64;

// Reports the position that the test sets, and remembers the calls.
class PuppetFollower : public Follower {
 public:
  explicit PuppetFollower(TimeIndex first = 0) : first_(first) {}

  void begin_session(const Session& robot,
                     const std::vector<Session>& companions_of_it) noexcept override {
    sessions.push_back(robot);
    companions = companions_of_it;
    next = first_;
  }
  [[nodiscard]] TimeIndex next_step() const noexcept override {
    ++asked;
    return next.load();
  }

  std::vector<Session> sessions;
  std::vector<Session> companions;
  std::atomic<TimeIndex> next{0};
  mutable std::atomic<int> asked{0};

 private:
  TimeIndex first_;
};

constexpr TimeIndex kFarAhead = TimeIndex{1} << 62U;

// A back-end in this thread.
struct Bench {
  explicit Bench(const BackendOptions& options = {}, const FakeDriver::Options& driver_options = {},
                 std::vector<PuppetFollower*> followers_of_it = {})
      : followers(std::move(followers_of_it)),
        driver(driver_options),
        backend(driver, host, options) {
    for (PuppetFollower* const follower : followers) backend.follow(*follower);
    backend.begin_session();
    robot.emplace(backend);
  }

  Bench(const Bench&) = delete;
  Bench& operator=(const Bench&) = delete;
  // The follower has read everything here: otherwise the end would wait for it.
  ~Bench() {
    for (PuppetFollower* const follower : followers) follower->next = kFarAhead;
  }

  // Appends actions for the steps [first, last] and runs until the back-end cannot continue.
  Progress run_steps(TimeIndex first, TimeIndex last) {
    for (TimeIndex t = first; t <= last; ++t) robot->append_desired_action({});
    return run();
  }
  Progress run() {
    auto progress = Progress::kStepped;
    while (progress == Progress::kStepped) progress = backend.advance();
    return progress;
  }
  [[nodiscard]] TimeIndex steps() const { return robot->session().info().steps; }

  std::vector<PuppetFollower*> followers;
  FakeDriver driver;
  SessionHost host{SessionHost::anonymous({.history = kHistory, .queue = 4096})};
  Backend backend;
  std::optional<Frontend<FakeRobot>> robot;
};

constexpr BackendOptions kPatient{.max_follower_wait = kForever};

TEST(Followers, SeeEverySessionWithItsCompanionsBeforeItsFirstStep) {
  PuppetFollower follower(kFarAhead);
  Bench bench(kPatient, {.sensor_period = 4}, {&follower});
  ASSERT_EQ(follower.sessions.size(), 1U);
  EXPECT_EQ(follower.sessions[0].info().steps, 0);
  EXPECT_EQ(follower.sessions[0].info().session_id, bench.robot->session().info().session_id);
  ASSERT_EQ(follower.companions.size(), 1U);
  EXPECT_EQ(follower.companions[0].info().name, "anonymous.sensor");
  bench.run_steps(0, 9);
  bench.robot->finish();
  bench.robot.reset();
  bench.robot.emplace(bench.backend);
  ASSERT_EQ(follower.sessions.size(), 2U);
  EXPECT_EQ(follower.sessions[1].info().session_id, bench.robot->session().info().session_id);
  // The first session is readable as long as its handle is kept.
  EXPECT_EQ(Frontend<FakeRobot>(follower.sessions[0]).get_observation(10).applied_actions, 10);
}

TEST(Followers, WhoComeLaterSeeTheNextSession) {
  PuppetFollower follower;
  Bench bench(kPatient);
  bench.backend.follow(follower);
  bench.followers.push_back(&follower);
  EXPECT_EQ(bench.run_steps(0, 3 * kHistory), Progress::kWaiting) << "held up by one who is not in";
  EXPECT_TRUE(follower.sessions.empty());
  bench.robot->finish();
  bench.robot.reset();
  bench.robot.emplace(bench.backend);
  EXPECT_EQ(follower.sessions.size(), 1U);
  EXPECT_EQ(bench.run_steps(0, 3 * kHistory), Progress::kHeldUp);
}

TEST(Followers, LoseNothingHoweverFarTheyAreBehind) {
  PuppetFollower follower;
  Bench bench(kPatient, {}, {&follower});
  std::mt19937 random(1);
  constexpr TimeIndex kLast = 10 * kHistory;
  for (auto progress = bench.run_steps(0, kLast); progress == Progress::kHeldUp;
       progress = bench.run()) {
    // Everything that the follower has not read is still there.
    const Frontend<FakeRobot> reader(follower.sessions.back());
    for (TimeIndex t = follower.next; t < bench.steps(); ++t) {
      ASSERT_EQ(reader.get_observation(t).applied_actions, t);
      static_cast<void>(reader.get_status(t));
    }
    const auto count = 1 + static_cast<TimeIndex>(random() % kHistory);
    follower.next = std::min(follower.next + count, bench.steps());
  }
  EXPECT_EQ(bench.steps(), kLast + 1);
}

TEST(Followers, OfWhomTheSlowestDecides) {
  PuppetFollower fast(kFarAhead), slow;
  Bench bench(kPatient, {}, {&fast, &slow});
  EXPECT_EQ(bench.run_steps(0, 2 * kHistory), Progress::kHeldUp);
  EXPECT_EQ(bench.steps(), kHistory);
  slow.next = 7;
  EXPECT_EQ(bench.run(), Progress::kHeldUp);
  EXPECT_EQ(bench.steps(), kHistory + 7);
}

TEST(Followers, AreNotAskedInEveryStep) {
  PuppetFollower follower;
  Bench bench(kPatient, {}, {&follower});
  bench.run_steps(0, kHistory - 2);
  EXPECT_EQ(follower.asked, 0);
}

TEST(Followers, DoNotLoseTheEndEither) {
  PuppetFollower follower;
  Bench bench(kPatient, {}, {&follower});
  bench.run_steps(0, kHistory - 1);
  // The last status, of step kHistory, would overwrite the first one.
  EXPECT_THROW(bench.robot->finish(std::chrono::milliseconds(1)), TimedOut);
  follower.next = 1;
  bench.robot->finish();
  const Frontend<FakeRobot> reader(follower.sessions.back());
  static_cast<void>(reader.get_status(1));
  EXPECT_NE(reader.get_status(kHistory).flags & Status::kEnd, 0U);
}

// A sensor with a short history that sometimes delivers many elements at once.
class BurstDriver final : public Driver<FakeRobot> {
 public:
  static constexpr TimeIndex kSensorHistory = 16;

  using Driver::apply_action;
  using Driver::get_latest_observation;
  using Driver::hold;

  [[nodiscard]] DriverReport prepare(TimeIndex) noexcept override {
    written_ = 0;
    return DriverReport::ready();
  }
  [[nodiscard]] DriverReport get_latest_observation(FakeObservation&) noexcept override {
    return DriverReport::ready();
  }
  [[nodiscard]] DriverReport apply_action(const FakeAction&, FakeAction&) noexcept override {
    return DriverReport::ready();
  }
  [[nodiscard]] DriverReport hold(const FakeObservation&, FakeAction&) noexcept override {
    return DriverReport::ready();
  }
  [[nodiscard]] std::span<const CompanionDescription> companions() const noexcept override {
    return companions_;
  }
  [[nodiscard]] bool get_companion_element(std::size_t, TimeIndex t,
                                           void* element) noexcept override {
    if (t != t_) left_ = t % 5 == 0 ? kSensorHistory / 2 : 1;
    t_ = t;
    if (left_ == 0) return false;
    --left_;
    FakeSensorReading reading;
    reading.stamp.arrival_index = reading.stamp.capture_index = t;
    reading.applied_actions = written_++;
    std::memcpy(element, &reading, sizeof(reading));
    return true;
  }

 private:
  std::array<CompanionDescription, 1> companions_{
      CompanionDescription{.name = "sensor",
                           .type = "fake_sensor",
                           .element = describe<FakeSensorReading>(),
                           .history = kSensorHistory}};
  TimeIndex t_{-2};
  TimeIndex left_{0};
  std::int64_t written_{0};
};

TEST(Followers, LoseNoElementOfACompanionWithAShortHistory) {
  BurstDriver driver;
  SessionHost host = SessionHost::anonymous({.history = 4096, .queue = 4096});
  PuppetFollower follower;
  Backend backend(driver, host, kPatient);
  backend.follow(follower);
  Frontend<FakeRobot> robot(backend);
  constexpr TimeIndex kSteps = 50;
  for (TimeIndex t = 0; t < kSteps; ++t) robot.append_desired_action({});

  const UntypedFrontend sensor(follower.companions.at(0));
  std::int64_t read = 0;
  int held_up = 0;
  while (true) {
    const Progress progress = backend.advance();
    if (progress == Progress::kWaiting) break;
    if (progress == Progress::kStepped) continue;
    ++held_up;
    // Reads the elements of one step, which must all be there.
    const TimeIndex t = follower.next;
    FakeSensorReading reading;
    while (sensor.try_get(Series::kObservation, read, &reading)) {
      ASSERT_EQ(reading.applied_actions, read);
      if (reading.stamp.arrival_index > t) break;
      ++read;
    }
    follower.next = t + 1;
  }
  follower.next = kFarAhead;  // so that the end does not wait
  EXPECT_GT(held_up, 10);
  EXPECT_GT(read, 80);
}

TEST(Followers, WhoDoNotMoveAreGivenUp) {
  PuppetFollower follower;
  Bench bench({.max_follower_wait = std::chrono::milliseconds(1)}, {}, {&follower});
  EXPECT_EQ(bench.run_steps(0, kHistory), Progress::kHeldUp);
  while (bench.backend.advance() == Progress::kHeldUp) {
  }
  // From now on the back-end does not wait,
  EXPECT_EQ(bench.run_steps(kHistory + 1, 10 * kHistory), Progress::kWaiting);
  EXPECT_EQ(bench.steps(), 10 * kHistory + 1);
  // until the follower has caught up.
  follower.next = bench.steps() - kHistory / 2;
  EXPECT_EQ(bench.run_steps(10 * kHistory + 1, 11 * kHistory), Progress::kHeldUp);
  EXPECT_EQ(bench.steps(), follower.next + kHistory);
}

TEST(Followers, WhoMoveSlowlyAreNotGivenUp) {
  PuppetFollower follower;
  Bench bench({.max_follower_wait = std::chrono::milliseconds(500)}, {}, {&follower});
  bench.run_steps(0, 2 * kHistory);
  // The waits together take longer than half a second, but the follower moves in between.
  const Deadline deadline(std::chrono::milliseconds(700));
  while (!deadline.passed() && follower.next < kHistory / 2) {
    follower.next = follower.next + 1;
    static_cast<void>(bench.run());
    EXPECT_LE(bench.steps(), follower.next + kHistory);
  }
}

TEST(Followers, WhoAreGivenUpDoNotTakeTheOthersAlong) {
  PuppetFollower dead, alive;
  Bench bench({.max_follower_wait = std::chrono::milliseconds(1)}, {}, {&dead, &alive});
  alive.next = kHistory;
  bench.run_steps(0, 3 * kHistory);
  while (bench.steps() < kHistory + 1) static_cast<void>(bench.backend.advance());
  // One follower is lost. The back-end still waits for the other one, which moves at every wait.
  while (bench.steps() < 3 * kHistory) {
    EXPECT_LE(bench.steps(), alive.next + kHistory);
    if (bench.backend.advance() == Progress::kHeldUp) alive.next = bench.steps() - 1;
  }
}

TEST(Followers, AreNeverWaitedForInRealTimeMode) {
  ManualClock clock;
  FakeDriver driver;
  SessionHost host = SessionHost::anonymous({.history = kHistory, .queue = 1024});
  PuppetFollower follower;
  Backend backend(driver, host,
                  {.mode = BackendOptions::Mode::kRealTime,
                   .period = test::kPeriod,
                   .max_follower_wait = kForever},
                  clock);
  backend.follow(follower);
  {
    const BackendThread thread(backend);
    Frontend<FakeRobot> robot(host);
    for (TimeIndex t = 0; t < 4 * kHistory; ++t) robot.append_desired_action({});
    clock.tick(test::kPeriod, 4 * kHistory);
    robot.wait_until_time_index(4 * kHistory - 1);
    clock.run_free();
    // No session follows this end. Releasing the robot earlier would start one.
    EXPECT_THROW(static_cast<void>(robot.get_status(4 * kHistory + 1)), RobotStopped);
  }
  EXPECT_EQ(follower.sessions.size(), 1U);
  EXPECT_EQ(follower.asked, 0);
}

// A thread that reads every step of every session, slower than the robot runs.
class ReadingFollower final : public Follower {
 public:
  ReadingFollower() : thread_([this] { read_all(); }) {}
  ~ReadingFollower() override { finish(); }

  // Reads what is left. Call this when the back-end has ended.
  void finish() {
    is_done_ = true;
    if (thread_.joinable()) thread_.join();
  }

  void begin_session(const Session& robot,
                     const std::vector<Session>& companions) noexcept override {
    const std::lock_guard lock(mutex_);
    waiting_.emplace_back(robot, companions.at(0));
    next_ = 0;
    newest_ = robot.info().session_id;
  }
  [[nodiscard]] TimeIndex next_step() const noexcept override { return next_.load(); }

  // Number of steps and elements read, in all sessions.
  std::atomic<std::int64_t> steps{0};
  std::atomic<std::int64_t> elements{0};

 private:
  void read_all() {
    while (true) {
      const bool is_last_look = is_done_;
      std::optional<std::pair<Session, Session>> session;
      {
        const std::lock_guard lock(mutex_);
        if (!waiting_.empty()) {
          session = waiting_.front();
          waiting_.erase(waiting_.begin());
        }
      }
      if (session) {
        read(session->first, session->second);
      } else if (is_last_look) {
        return;
      }
      std::this_thread::yield();
    }
  }

  void read(const Session& robot, const Session& sensor) {
    const Frontend<FakeRobot> observer(robot);
    const UntypedFrontend sensor_observer(sensor);
    std::int64_t element = 0;
    const auto read_elements = [&](TimeIndex through) {
      FakeSensorReading reading;
      while (sensor_observer.try_get(Series::kObservation, element, &reading)) {
        if (reading.stamp.arrival_index > through) return;
        ++element;
        ++elements;
      }
    };
    try {
      for (TimeIndex t = 0;; ++t) {
        EXPECT_EQ(observer.get_observation(t).applied_actions, t);
        read_elements(t);
        if ((observer.get_status(t).flags & Status::kEnd) != 0) break;
        EXPECT_EQ(observer.get_desired_action(t).setpoint, static_cast<double>(t));
        static_cast<void>(observer.get_applied_action(t));
        ++steps;
        const std::lock_guard lock(mutex_);
        if (newest_ == robot.info().session_id) next_ = t + 1;
      }
    } catch (const RobotStopped& stopped) {
      // Nobody has used the last session.
      EXPECT_EQ(stopped.fault().code, Fault::Code::kStopped);
      EXPECT_EQ(element, 0);
    } catch (const Error& error) {
      ADD_FAILURE() << error.what();
    }
  }

  std::mutex mutex_;
  std::vector<std::pair<Session, Session>> waiting_;
  std::uint64_t newest_{0};
  std::atomic<TimeIndex> next_{0};
  std::atomic<bool> is_done_{false};
  std::thread thread_;
};

constexpr TimeIndex kSessionSteps = 2000;
constexpr int kSessions = 3;

void run_sessions(const std::function<Frontend<FakeRobot>()>& connect) {
  for (int i = 0; i < kSessions; ++i) {
    auto robot = connect();
    for (TimeIndex t = 0; t < kSessionSteps; ++t) {
      robot.append_desired_action({.setpoint = static_cast<double>(t)});
    }
    robot.finish();
  }
}

TEST(Followers, InAnotherThreadReadEverythingThatAnInlineRobotDoes) {
  FakeDriver driver({.sensor_period = 2});
  SessionHost host = SessionHost::anonymous({.history = kHistory, .queue = 32});
  ReadingFollower follower;
  {
    Backend backend(driver, host, kPatient);
    backend.follow(follower);
    run_sessions([&] { return Frontend<FakeRobot>(backend); });
  }
  follower.finish();
  EXPECT_EQ(follower.steps, kSessions * kSessionSteps);
  EXPECT_EQ(follower.elements, kSessions * (kSessionSteps / 2 + 1));
}

TEST(Followers, InAnotherThreadReadEverythingThatABackendsThreadDoes) {
  FakeDriver driver({.sensor_period = 2});
  SessionHost host = SessionHost::anonymous({.history = kHistory, .queue = 32});
  ReadingFollower follower;
  {
    Backend backend(driver, host, kPatient);
    backend.follow(follower);
    const BackendThread thread(backend);
    run_sessions([&] { return Frontend<FakeRobot>(host, {.timeout = test::kLong}); });
  }
  follower.finish();
  EXPECT_EQ(follower.steps, kSessions * kSessionSteps);
  EXPECT_EQ(follower.elements, kSessions * (kSessionSteps / 2 + 1));
}

}  // namespace
}  // namespace trifinger
