// SPDX-License-Identifier: BSD-3-Clause
#include "trifinger/core/sensor.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <chrono>
#include <csignal>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <memory>
#include <numeric>
#include <optional>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "core/fake_robot.hpp"
#include "support/allocation_counter.hpp"
#include "support/child_process.hpp"
#include "support/message_of.hpp"
#include "support/session_folder.hpp"
#include "trifinger/core/backend.hpp"
#include "trifinger/core/frontend.hpp"

// A sensor in another process than its robot. Where the process does not matter, both are here.

namespace trifinger::test {
namespace {

using namespace std::chrono_literals;
using ::testing::HasSubstr;

struct Sight {
  Stamp stamp{};
  std::int64_t number{0};

  static constexpr auto fields() {
    return std::tuple{field("stamp", &Sight::stamp), field("number", &Sight::number)};
  }
};

std::unique_ptr<DriverWithSensors> make_driver(const FakeDriver::Options& options = {},
                                               bool is_record = false) {
  return std::make_unique<DriverWithSensors>(
      std::make_unique<FakeDriver>(options), "robot",
      std::vector{CompanionDescription{
          .name = "eye", .type = "sight", .element = describe<Sight>(), .is_record = is_record}});
}

// Waits for what happens next to the sensors.
std::string next_message(DriverWithSensors& driver) {
  for (;;) {
    const std::vector<std::string> messages = driver.take_messages();
    if (!messages.empty()) return messages.front();
    std::this_thread::sleep_for(1ms);
  }
}

// A robot whose steps take 1 ms of a clock that only the test moves.
class Rig {
 public:
  Rig() : driver(make_driver()) { begin(); }
  ~Rig() { robot.reset(); }
  Rig(const Rig&) = delete;
  Rig& operator=(const Rig&) = delete;

  void begin() {
    if (robot) robot->finish();
    robot.reset();
    robot.emplace(backend);
    eye.emplace(robot->companion("eye"));
  }
  TimeIndex step() {
    clock.advance(1ms);
    const TimeIndex t = robot->append_desired_action({});
    robot->wait_until_time_index(t);
    return t;
  }

  SessionFolder folder;
  ManualClock clock;
  SensorWriter<Sight> writer{"robot", "eye"};
  std::unique_ptr<DriverWithSensors> driver;
  SessionHost host{SessionHost::anonymous()};
  Backend backend{*driver, host, {.mode = BackendOptions::Mode::kNonRealTime}, clock};
  std::optional<Frontend<FakeRobot>> robot;
  std::optional<Companion<Sight>> eye;
};

TEST(Sensor, WhatItWritesIsThereAtTheNextStepWithTheStepOfItsCapture) {
  Rig rig;
  for (int i = 0; i < 20; ++i) rig.step();
  std::int64_t number = 0;
  for (const auto age : {0us, 400us, 1000us, 1600us, 7300us}) {
    const Instant captured = rig.clock.now() - age;
    rig.writer.write(captured, {.number = ++number});
    const TimeIndex t = rig.step();
    const auto seen = rig.eye->get_latest_at(t);
    ASSERT_TRUE(seen);
    EXPECT_EQ(seen->number, number);
    EXPECT_EQ(seen->stamp.arrival_index, t);
    EXPECT_EQ(seen->stamp.capture_time, captured.time_since_epoch().count());
    // The law: its step had begun when it was captured, and the next one had not.
    const TimeIndex step = seen->stamp.capture_index;
    EXPECT_LE(rig.robot->get_status(step).time, seen->stamp.capture_time);
    EXPECT_GT(rig.robot->get_status(step + 1).time, seen->stamp.capture_time);
    // What was known before does not change.
    const auto before = rig.eye->get_latest_at(t - 1);
    EXPECT_EQ(before ? before->number : 0, number - 1);
  }
}

TEST(Sensor, TheStepOfACaptureIsRightAfterTicksWereLeftOut) {
  Rig rig;
  rig.step();
  rig.step();
  const Instant captured = rig.clock.now();
  rig.clock.advance(40ms);
  rig.writer.write(captured + 30ms, {.number = 1});
  const TimeIndex t = rig.step();
  EXPECT_EQ(rig.eye->get_latest_at(t)->stamp.capture_index, t - 1);
}

TEST(Sensor, WhatWasCapturedBeforeTheSessionOrInTheFutureHasAStepAllTheSame) {
  Rig rig;
  rig.writer.write(rig.clock.now() - 1h, {.number = 1});
  EXPECT_EQ(rig.step(), 0);
  EXPECT_EQ(rig.eye->get_latest_at(0)->stamp.capture_index, -1);
  rig.writer.write(rig.clock.now() + 1h, {.number = 2});
  const TimeIndex t = rig.step();
  const Stamp stamp = rig.eye->get_latest_at(t)->stamp;
  EXPECT_EQ(stamp.capture_index, t);
  EXPECT_EQ(stamp.capture_time, stamp.arrival_time);
  for (int i = 0; i < 3000; ++i) rig.step();
  rig.writer.write(rig.clock.now() - 2500ms, {.number = 3});
  const TimeIndex late = rig.step();
  EXPECT_NEAR(static_cast<double>(rig.eye->get_latest_at(late)->stamp.capture_index),
              static_cast<double>(late - 2501), 1.0);
}

TEST(Sensor, ASessionBeginsWithTheNewestElementAndNothingOlder) {
  Rig rig;
  for (int i = 1; i <= 5; ++i) rig.writer.write(rig.clock.now(), {.number = i});
  rig.begin();
  EXPECT_EQ(rig.eye->get_latest_at(-1)->number, 5);
  // The robot holds its pose, and nobody reads.
  for (int i = 6; i <= 9; ++i) rig.writer.write(rig.clock.now(), {.number = i});
  rig.step();
  EXPECT_EQ(rig.eye->get_latest_at(-1)->number, 5);
  EXPECT_EQ(rig.eye->get_latest_at(0)->number, 9);
  EXPECT_EQ(rig.robot->companion("eye").range(Series::kObservation).second, 2);
  // From now on, all.
  for (int i = 10; i <= 13; ++i) rig.writer.write(rig.clock.now(), {.number = i});
  rig.step();
  EXPECT_EQ(rig.robot->companion("eye").range(Series::kObservation).second, 6);
}

TEST(Sensor, ASensorThatWritesTooFastLosesItsOlderElementsAndHoldsUpNobody) {
  Rig rig;
  rig.step();
  for (int i = 1; i <= 100'000; ++i) rig.writer.write(rig.clock.now(), {.number = i});
  const TimeIndex t = rig.step();
  EXPECT_EQ(rig.eye->get_latest_at(t)->number, 100'000);
  EXPECT_LE(rig.robot->companion("eye").range(Series::kObservation).second, 16);
}

TEST(Sensor, TheRobotsOwnCompanionsStayBeforeThoseOfSensors) {
  const SessionFolder folder;
  const auto driver = make_driver({.sensor_period = 4});
  ASSERT_EQ(driver->companions().size(), 2U);
  EXPECT_EQ(driver->companions()[0].name, "sensor");
  EXPECT_EQ(driver->companions()[1].name, "eye");
  SessionHost host = SessionHost::anonymous();
  Backend backend(*driver, host);
  Frontend<FakeRobot> robot(backend);
  for (int i = 0; i < 9; ++i) robot.append_desired_action({});
  const Companion<FakeSensorReading> own(robot.companion("sensor"));
  EXPECT_EQ(own.get_latest_at(8)->stamp.capture_index, 8);
  EXPECT_FALSE(Companion<Sight>(robot.companion("eye")).get_latest_at(8));
  EXPECT_EQ(message_of<InvalidArgument>([] {
              DriverWithSensors(
                  std::make_unique<FakeDriver>(FakeDriver::Options{.sensor_period = 1}), "robot",
                  {{.name = "sensor", .type = "sight", .element = describe<Sight>()}});
            }),
            "the robot has two companions 'sensor'");
}

TEST(Sensor, ItsProcessMayComeLaterAndComeAgain) {
  const SessionFolder folder;
  const auto driver = make_driver();
  Sight seen;
  ASSERT_EQ(driver->prepare(0).state, DriverReport::State::kReady);
  EXPECT_FALSE(driver->get_companion_element(0, 0, &seen));
  for (int life = 1; life <= 3; ++life) {
    std::optional<SensorWriter<Sight>> writer(std::in_place, "robot", "eye");
    EXPECT_EQ(next_message(*driver),
              "sensor 'eye': process " + std::to_string(::getpid()) + " delivers");
    writer->write(Instant(1s), {.number = life});
    ASSERT_TRUE(driver->get_companion_element(0, 2 * life, &seen));
    EXPECT_EQ(seen.number, life);
    EXPECT_FALSE(driver->get_companion_element(0, 2 * life, &seen));
    writer.reset();
    EXPECT_EQ(next_message(*driver),
              "sensor 'eye': its process has ended; the robot goes on without it");
    EXPECT_FALSE(driver->get_companion_element(0, 2 * life + 1, &seen));
  }
}

TEST(Sensor, AProcessThatIsKilledLeavesNothingThatASessionWouldBeginWith) {
  const SessionFolder folder;
  ChildProcess child([] {
    SensorWriter<Sight> writer("robot", "eye");
    for (;;) writer.write(std::chrono::steady_clock::now(), {.number = 1});
    return 0;
  });
  const auto driver = make_driver();
  while (next_message(*driver).find("delivers") == std::string::npos) {
  }
  child.kill();
  EXPECT_THAT(next_message(*driver), HasSubstr("has ended"));
  Sight seen;
  static_cast<void>(driver->prepare(0));
  EXPECT_FALSE(driver->get_companion_element(0, -1, &seen));
  // The next robot does not take it for a sensor either, and the next process is not refused.
  const auto next = make_driver();
  EXPECT_TRUE(next->take_messages().empty());
  const SensorWriter<Sight> writer("robot", "eye");
  EXPECT_THAT(next_message(*next), HasSubstr("delivers"));
}

TEST(Sensor, OnlyOneProcessIsASensor) {
  const SessionFolder folder;
  const SensorWriter<Sight> writer("robot", "eye");
  EXPECT_THAT(message_of<Error>([] { SensorWriter<Sight>("robot", "eye"); }),
              HasSubstr("is already sensor 'eye' of robot 'robot'; end it first"));
  const SensorWriter<Sight> other_robot("another", "eye");
}

TEST(Sensor, ElementsOfAnotherKindAreRefusedWithASentence) {
  const SessionFolder folder;
  const SensorWriter<FakeSensorReading> writer("robot", "eye");
  const auto driver = make_driver();
  EXPECT_THAT(next_message(*driver),
              ::testing::AllOf(HasSubstr("sensor 'eye' is refused: its elements have the fields"),
                               HasSubstr("applied_actions int64"), HasSubstr("number int64")));
  Sight seen;
  EXPECT_FALSE(driver->get_companion_element(0, 0, &seen));
  EXPECT_EQ(message_of<InvalidArgument>([] { SensorWriter<FakeObservation>("robot", "ear"); }),
            "the elements of sensor 'ear' do not begin with a stamp");
}

TEST(Sensor, HostileBytesInItsFileHarmNobody) {
  const SessionFolder folder;
  SensorWriter<Sight> writer("robot", "eye");
  const auto driver = make_driver();
  writer.write(Instant(1s), {.number = 1});
  Sight seen;
  ASSERT_TRUE(driver->get_companion_element(0, 0, &seen));
  EXPECT_FALSE(driver->get_companion_element(0, 0, &seen));
  const auto path = session_folder() / "trifinger-sensor.robot.eye";
  const auto size = std::filesystem::file_size(path);
  for (std::uintmax_t place = 0; place < size; place += 8) {
    std::fstream file(path, std::ios::in | std::ios::out | std::ios::binary);
    file.seekp(static_cast<std::streamoff>(place));
    file.write("\xff\xff\xff\xff\xff\xff\xff\x7f", 8);
    file.close();
    // No element, or any: but an end within the budget of a step.
    int count = 0;
    const auto step = static_cast<TimeIndex>(place + 8);
    while (driver->get_companion_element(0, step, &seen)) ++count;
    EXPECT_LE(count, 16);
    if (place % 256 == 0) static_cast<void>(make_driver());
  }
  std::filesystem::resize_file(path, 8);
  EXPECT_FALSE(driver->get_companion_element(0, 1 << 20, &seen));
}

TEST(Sensor, NothingAllocatesInTheLoopOrWhenItWrites) {
  Rig rig;
  rig.step();
  Sight seen;
  const AllocationCounter counter;
  for (TimeIndex t = 10; t < 200; ++t) {
    rig.writer.write(rig.clock.now(), {.number = t});
    while (rig.driver->get_companion_element(0, t, &seen)) {
    }
  }
  EXPECT_EQ(counter.count(), 0U);
  EXPECT_EQ(seen.number, 199);
}

// ---- a sensor that is a record ----

// The numbers of the elements that a driver has at this step.
std::vector<std::int64_t> numbers_at(DriverWithSensors& driver, TimeIndex step) {
  std::vector<std::int64_t> numbers;
  Sight seen;
  while (driver.get_companion_element(0, step, &seen)) numbers.push_back(seen.number);
  return numbers;
}

TEST(RecordingSensor, LosesNothingThatItsProcessesHaveWritten) {
  const SessionFolder folder;
  const auto driver = make_driver({}, true);
  std::vector<std::int64_t> seen;
  TimeIndex step = -1;
  std::int64_t written = 0;
  const auto take = [&] {
    const std::vector<std::int64_t> numbers = numbers_at(*driver, step++);
    EXPECT_LE(numbers.size(), 16U);
    seen.insert(seen.end(), numbers.begin(), numbers.end());
  };
  for (int life = 0; life < 4; ++life) {
    // A process writes before the robot knows it, between two sessions, and just before its end.
    std::optional<SensorWriter<Sight>> writer(std::in_place, "robot", "eye");
    const auto write = [&](int count) {
      for (int i = 0; i < count; ++i) writer->write(Instant(1s), {.number = written++});
    };
    write(40);
    if (life % 2 == 0) {
      static_cast<void>(driver->prepare(0));
      step = -1;
    }
    while (driver->take_messages().empty()) std::this_thread::sleep_for(1ms);
    take();
    write(20);
    take();
    write(3);
    writer.reset();
    // Time enough to look for the process several times: what it has left stays.
    std::this_thread::sleep_for(250ms);
    while (seen.size() < static_cast<std::size_t>(written)) take();
    EXPECT_THAT(next_message(*driver), HasSubstr("has ended"));
  }
  std::vector<std::int64_t> all(static_cast<std::size_t>(written));
  std::iota(all.begin(), all.end(), 0);
  EXPECT_EQ(seen, all);
}

TEST(RecordingSensor, KeepsWhatAKilledProcessHasLeft) {
  const SessionFolder folder;
  const auto driver = make_driver({}, true);
  ChildProcess child([] {
    SensorWriter<Sight> writer("robot", "eye");
    for (int i = 0; i < 30; ++i) writer.write(Instant(1s), {.number = i});
    std::ofstream(session_folder() / "done") << "done";
    for (;;) std::this_thread::sleep_for(1h);
    return 0;
  });
  EXPECT_THAT(next_message(*driver), HasSubstr("delivers"));
  while (!std::filesystem::exists(session_folder() / "done")) std::this_thread::sleep_for(1ms);
  std::vector<std::int64_t> seen = numbers_at(*driver, 0);
  EXPECT_EQ(seen.size(), 16U);
  child.kill();
  // Time enough to look for the process several times: what it has left stays.
  std::this_thread::sleep_for(250ms);
  std::vector<std::int64_t> all(30);
  std::iota(all.begin(), all.end(), 0);
  const std::vector<std::int64_t> more = numbers_at(*driver, 1);
  seen.insert(seen.end(), more.begin(), more.end());
  EXPECT_EQ(seen, all);
}

TEST(RecordingSensor, HostileBytesInItsFileHarmNobody) {
  const SessionFolder folder;
  SensorWriter<Sight> writer("robot", "eye");
  const auto driver = make_driver({}, true);
  writer.write(Instant(1s), {.number = 1});
  EXPECT_EQ(numbers_at(*driver, 0).size(), 1U);
  const auto path = session_folder() / "trifinger-sensor.robot.eye";
  const auto size = std::filesystem::file_size(path);
  for (std::uintmax_t place = 0; place < size; place += 8) {
    std::fstream file(path, std::ios::in | std::ios::out | std::ios::binary);
    file.seekp(static_cast<std::streamoff>(place));
    file.write("\xff\xff\xff\xff\xff\xff\xff\x7f", 8);
    file.close();
    EXPECT_LE(numbers_at(*driver, static_cast<TimeIndex>(place + 8)).size(), 16U);
  }
  std::filesystem::resize_file(path, 8);
  EXPECT_TRUE(numbers_at(*driver, 1 << 20).empty());
}

// ---- a sensor that a driver reads ----

// Waits for what happens next to the sensor.
std::string next_message(LoopSensorReader& reader) {
  for (;;) {
    const std::vector<std::string> messages = reader.take_messages();
    if (!messages.empty()) return messages.front();
    std::this_thread::sleep_for(1ms);
  }
}

TEST(LoopSensor, HasTheNewestElementAsOftenAsTheDriverLooks) {
  const SessionFolder folder;
  LoopSensorReader reader("robot", "eye", describe<Sight>());
  Sight seen;
  EXPECT_FALSE(reader.read_newest(&seen));
  for (int life = 1; life <= 3; ++life) {
    std::optional<SensorWriter<Sight>> writer(std::in_place, "robot", "eye");
    EXPECT_THAT(next_message(reader), HasSubstr("delivers"));
    EXPECT_FALSE(reader.read_newest(&seen));
    for (int number = 0; number < 200; ++number) {
      writer->write(Instant(1s), {.number = number});
      const AllocationCounter counter;
      for (int look = 0; look < 3; ++look) {
        ASSERT_TRUE(reader.read_newest(&seen));
        EXPECT_EQ(seen.number, number);
      }
      EXPECT_EQ(counter.count(), 0U);
    }
    writer.reset();
    EXPECT_THAT(next_message(reader), HasSubstr("has ended"));
    EXPECT_FALSE(reader.read_newest(&seen));
  }
}

TEST(LoopSensor, IsGoneWhileItsProcessLivesAndWritesNothing) {
  const SessionFolder folder;
  SensorWriter<Sight> writer("robot", "eye");
  LoopSensorReader patient("robot", "eye", describe<Sight>());
  LoopSensorReader reader("robot", "eye", describe<Sight>(), 50ms);
  EXPECT_THAT(next_message(reader), HasSubstr("delivers"));
  writer.write(Instant(1s), {.number = 1});
  Sight seen;
  while (next_message(reader).find("lives but writes nothing") == std::string::npos) {
  }
  EXPECT_FALSE(reader.read_newest(&seen));
  EXPECT_TRUE(patient.read_newest(&seen));
  writer.write(Instant(1s), {.number = 2});
  while (next_message(reader).find("delivers again") == std::string::npos) {
  }
  // A busy machine may find it silent once more.
  while (!reader.read_newest(&seen)) writer.write(Instant(1s), {.number = 2});
  EXPECT_EQ(seen.number, 2);
}

TEST(LoopSensor, IsNotHarmedByHostileBytes) {
  const SessionFolder folder;
  SensorWriter<Sight> writer("robot", "eye");
  LoopSensorReader reader("robot", "eye", describe<Sight>());
  writer.write(Instant(1s), {.number = 1});
  Sight seen;
  ASSERT_TRUE(reader.read_newest(&seen));
  const auto path = session_folder() / "trifinger-sensor.robot.eye";
  const auto size = std::filesystem::file_size(path);
  for (std::uintmax_t place = 0; place < size; place += 8) {
    std::fstream file(path, std::ios::in | std::ios::out | std::ios::binary);
    file.seekp(static_cast<std::streamoff>(place));
    file.write("\xff\xff\xff\xff\xff\xff\xff\x7f", 8);
    file.close();
    static_cast<void>(reader.read_newest(&seen));  // an element or none, but it returns
  }
  std::filesystem::resize_file(path, 8);
  EXPECT_FALSE(reader.read_newest(&seen));
}

}  // namespace
}  // namespace trifinger::test
