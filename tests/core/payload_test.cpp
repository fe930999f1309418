// SPDX-License-Identifier: BSD-3-Clause
#include "trifinger/core/payload.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "core/fake_robot.hpp"
#include "support/allocation_counter.hpp"
#include "support/child_process.hpp"
#include "support/message_of.hpp"
#include "support/session_folder.hpp"
#include "support/soak.hpp"
#include "trifinger/core/backend.hpp"
#include "trifinger/core/frontend.hpp"
#include "trifinger/core/sensor.hpp"

// Large data of sensors: written by one process, looked at in place by others.

namespace trifinger::test {
namespace {

using namespace std::chrono_literals;
using ::testing::HasSubstr;

constexpr std::size_t kWords = 4096;

ElementDescription words() {
  return ElementDescription(
      {{.name = "words", .type = ScalarType::kUint64, .shape = {kWords}, .unit = {}}});
}

struct Sight {
  Stamp stamp{};
  PayloadReference payload{};

  static constexpr auto fields() {
    return std::tuple{field("stamp", &Sight::stamp), field("payload", &Sight::payload)};
  }
};

// Payload i consists of words i.
PayloadReference write(PayloadWriter& writer, std::uint64_t number) {
  const std::span<std::byte> place = writer.begin();
  auto* const words = reinterpret_cast<std::uint64_t*>(place.data());
  std::fill_n(words, place.size() / 8, number);
  return writer.commit();
}

// All words of a payload that are different.
std::set<std::uint64_t> different_words(std::span<const std::byte> bytes) {
  std::vector<std::uint64_t> words(bytes.size() / 8);
  std::memcpy(words.data(), bytes.data(), bytes.size());
  return {words.begin(), words.end()};
}

TEST(Payload, IsReadInPlaceAndStaysWholeForAHistory) {
  PayloadWriter writer = PayloadWriter::anonymous(words(), 4);
  const PayloadReader reader("anonymous", "eye", words());
  std::vector<PayloadView> views;
  for (std::uint64_t i = 0; i < 4; ++i) {
    const PayloadReference reference = write(writer, i);
    EXPECT_EQ(reference.number, static_cast<std::int64_t>(i));
    views.push_back(reader.view(reference));
    EXPECT_EQ(views.back().bytes().size(), 8 * kWords);
  }
  for (std::uint64_t i = 0; i < 4; ++i) {
    EXPECT_EQ(different_words(views[i].bytes()), std::set{i});
    EXPECT_TRUE(views[i].is_valid());
  }
  static_cast<void>(writer.begin());  // not yet committed, but its place was that of payload 0
  EXPECT_FALSE(views[0].is_valid());
  EXPECT_TRUE(views[1].is_valid());
}

TEST(Payload, ThatWasOverwrittenIsHistoryLost) {
  PayloadWriter writer = PayloadWriter::anonymous(words(), 2);
  const PayloadReader reader("anonymous", "eye", words());
  const PayloadReference first = write(writer, 0);
  const PayloadView view = reader.view(first);
  write(writer, 1);
  write(writer, 2);
  std::array<std::uint64_t, kWords> copy{};
  EXPECT_EQ(
      message_of<HistoryLost>([&] { view.copy_to(copy.data()); }),
      "payload 0 was overwritten while it was read or before; the oldest one still kept is 1");
  EXPECT_EQ(
      message_of<HistoryLost>([&] { static_cast<void>(reader.view(first)); }),
      "payload 0 was overwritten while it was read or before; the oldest one still kept is 1");
  // One that was not yet written cannot be read either.
  EXPECT_THROW(static_cast<void>(reader.view({.memory = first.memory, .number = 7})), HistoryLost);
  EXPECT_EQ(message_of<InvalidArgument>([&] { static_cast<void>(reader.view({})); }),
            "an element of sensor 'eye' has no payload");
}

TEST(Payload, StaysReadableWhenItsWriterHasEnded) {
  const SessionFolder folder;
  std::optional<PayloadWriter> writer(std::in_place, "robot", "eye", words());
  const PayloadReader reader("robot", "eye", words());
  const PayloadReference reference = write(*writer, 42);
  const PayloadView view = reader.view(reference);
  writer.reset();
  EXPECT_EQ(different_words(view.bytes()), std::set<std::uint64_t>{42});
  EXPECT_TRUE(view.is_valid());
  EXPECT_TRUE(reader.view(reference).is_valid());  // this reader has kept the memory
}

TEST(Payload, OfAnEarlierProcessIsLostWithoutMappingTheNewFile) {
  const SessionFolder folder;
  PayloadReference earlier;
  {
    PayloadWriter writer("robot", "eye", words());
    earlier = write(writer, 1);
  }
  const PayloadReader reader("robot", "eye", words());
  const PayloadWriter later("robot", "eye", words());
  // Whoever maps this file is told that it is too short.
  std::filesystem::resize_file(session_folder() / "trifinger-payload.robot.eye", 64);
  EXPECT_THAT(message_of<HistoryLost>([&] { static_cast<void>(reader.view(earlier)); }),
              HasSubstr("are gone: its process was started again"));
}

// A process that writes payloads without a pause, payload i of words i.
ChildProcess busy_writer(std::size_t history) {
  return ChildProcess([history] {
    PayloadWriter payloads("robot", "eye", words(), history);
    SensorWriter<Sight> sensor("robot", "eye");
    for (std::uint64_t i = 0;; ++i) {
      Sight sight;
      sight.payload = write(payloads, i);
      sensor.write(std::chrono::steady_clock::now(), sight);
    }
    return 0;
  });
}

std::unique_ptr<DriverWithSensors> make_driver(ElementDescription payload) {
  return std::make_unique<DriverWithSensors>(
      std::make_unique<FakeDriver>(FakeDriver::Options{}), "robot",
      std::vector{CompanionDescription{.name = "eye",
                                       .type = "sight",
                                       .element = describe<Sight>(),
                                       .payload = std::move(payload)}});
}

TEST(Payload, OfAnotherProcessIsNeverTornWithoutBeingToldSo) {
  const SessionFolder folder;
  // The child's elements have no description of a payload: this is about the memory alone.
  const ChildProcess child = busy_writer(2);
  const auto driver = make_driver({});
  ASSERT_EQ(driver->prepare(0).state, DriverReport::State::kReady);
  const PayloadReader reader("robot", "eye", words());
  const std::int64_t wanted = repetitions(200, 1'000'000);
  std::int64_t whole = 0;
  std::int64_t lost = 0;
  std::vector<std::uint64_t> copy(kWords);
  for (TimeIndex t = 0; whole < wanted || lost < wanted; ++t) {
    Sight sight;
    while (driver->get_companion_element(0, t, &sight)) {
      try {
        const PayloadView view = reader.view(sight.payload);
        view.copy_to(copy.data());
        ++whole;
        ASSERT_EQ(copy.front(), static_cast<std::uint64_t>(sight.payload.number));
        ASSERT_EQ(std::ranges::count(copy, copy.front()), kWords);
      } catch (const HistoryLost&) {
        ++lost;
      }
    }
  }
}

TEST(Payload, OfAProcessThatWasKilledIsWholeOrGone) {
  const SessionFolder folder;
  for (int life = 0; life < repetitions(5, 1000); ++life) {
    ChildProcess child = busy_writer(4);
    const auto driver = make_driver({});
    const PayloadReader reader("robot", "eye", words());
    ASSERT_EQ(driver->prepare(0).state, DriverReport::State::kReady);
    Sight newest;
    // The first elements may be those of the life before.
    for (TimeIndex t = 0; newest.payload.number < 20; ++t) {
      while (driver->get_companion_element(0, t, &newest)) {
      }
    }
    try {
      static_cast<void>(reader.view(newest.payload));  // maps the memory
    } catch (const HistoryLost&) {
    }
    // It is stopped where it will be killed: the driver forgets a process that has ended as soon as
    // it notices that, and with it the newest element.
    child.stop();
    for (TimeIndex t = 1'000'000; driver->get_companion_element(0, t, &newest);) {
    }
    child.kill();
    int whole = 0;
    for (std::int64_t i = newest.payload.number + 4; i > newest.payload.number - 4; --i) {
      try {
        const PayloadView view = reader.view({.memory = newest.payload.memory, .number = i});
        EXPECT_EQ(different_words(view.bytes()), std::set{static_cast<std::uint64_t>(i)});
        EXPECT_TRUE(view.is_valid());
        ++whole;
      } catch (const HistoryLost&) {
      }
    }
    EXPECT_GE(whole, 1);
    // The dead one does not stand in the way of the next.
    PayloadWriter next("robot", "eye", words(), 4);
    const PayloadReader other("robot", "eye", words());
    EXPECT_THAT(message_of<HistoryLost>([&] { static_cast<void>(other.view(newest.payload)); }),
                HasSubstr("are gone: its process was started again"));
    EXPECT_EQ(different_words(reader.view(write(next, 7)).bytes()), std::set<std::uint64_t>{7});
  }
}

TEST(Payload, HasOneWriter) {
  const SessionFolder folder;
  const PayloadWriter writer("robot", "eye", words());
  EXPECT_THAT(message_of<Error>([] { PayloadWriter("robot", "eye", words()); }),
              HasSubstr("is already the writer of the payloads of sensor 'eye' of robot 'robot'"));
  EXPECT_THROW(PayloadWriter("ro/bot", "eye", words()), InvalidArgument);
  EXPECT_THROW(PayloadWriter("another", "eye", words(), 0), InvalidArgument);
  EXPECT_THROW(PayloadWriter("another", "eye", ElementDescription{}), InvalidArgument);
}

TEST(Payload, BelongsToTheElementsOfASession) {
  const SessionFolder folder;
  PayloadWriter payloads("robot", "eye", words());
  UntypedSensorWriter sensor("robot", "eye", describe<Sight>(), 64, words());
  const auto driver = make_driver(words());
  SessionHost host = SessionHost::named("robot");
  Backend backend(*driver, host, {.mode = BackendOptions::Mode::kNonRealTime});
  Frontend<FakeRobot> robot(backend);
  const Companion<Sight> eye(robot.companion("eye"));
  EXPECT_EQ(robot.companion("eye").session().payload(), words());
  EXPECT_EQ(robot.session().payload().size(), 0U);
  for (std::uint64_t i = 0; i < 20; ++i) {
    Sight sight;
    sight.payload = write(payloads, i);
    sensor.write(std::chrono::steady_clock::now(), &sight);
    const TimeIndex t = robot.append_desired_action({});
    const auto seen = eye.get_latest_at(t);
    ASSERT_TRUE(seen);
    EXPECT_EQ(different_words(eye.payload(*seen).bytes()), std::set{i});
  }
  // Another program, which knows only the name, finds them through the files.
  ChildProcess other([] {
    const UntypedFrontend frontend("robot.eye", {.control = false});
    Sight sight;
    if (!frontend.get_latest_at(19, &sight, 10s)) return 2;
    const PayloadReader reader("robot", "eye", frontend.session().payload());
    return different_words(reader.view(sight.payload).bytes()) == std::set<std::uint64_t>{19} ? 0
                                                                                              : 3;
  });
  EXPECT_EQ(other.wait(), 0);
  EXPECT_EQ(message_of<InvalidArgument>([&] {
              FakeObservation observation;
              UntypedFrontend untyped(host, {.control = false});
              static_cast<void>(untyped.payload(&observation));
            }),
            "the elements of 'robot' have no payloads");
}

TEST(Payload, OfOtherFieldsIsRefusedByRobotAndReader) {
  const SessionFolder folder;
  const ElementDescription other(
      {{.name = "words", .type = ScalarType::kUint64, .shape = {kWords / 2}, .unit = {}}});
  PayloadWriter payloads("robot", "eye", other);
  const UntypedSensorWriter sensor("robot", "eye", describe<Sight>(), 64, other);
  const auto driver = make_driver(words());
  std::vector<std::string> messages;
  while (messages.empty()) messages = driver->take_messages();
  EXPECT_THAT(messages.front(),
              ::testing::AllOf(HasSubstr("sensor 'eye' is refused: its elements have the fields"),
                               HasSubstr("words uint64[2048]"), HasSubstr("words uint64[4096]")));
  const PayloadReference reference = write(payloads, 1);
  EXPECT_THAT(message_of<IncompatibleSession>([reference] {
                static_cast<void>(PayloadReader("robot", "eye", words()).view(reference));
              }),
              HasSubstr("writes payloads with the fields\nwords uint64[2048]"));
  // An element without a reference cannot have a payload.
  EXPECT_THAT(message_of<InvalidArgument>([] {
                UntypedSensorWriter("robot", "ear", describe<FakeSensorReading>(), 64, words());
              }),
              HasSubstr("must begin with a Stamp 'stamp' and a PayloadReference 'payload'"));
}

TEST(Payload, HostileBytesInItsFileHarmNobody) {
  const SessionFolder folder;
  ChildProcess child = busy_writer(4);
  const auto driver = make_driver({});
  static_cast<void>(driver->prepare(0));
  Sight sight;
  for (TimeIndex t = 0; sight.payload.memory == 0; ++t) {
    static_cast<void>(driver->get_companion_element(0, t, &sight));
  }
  child.kill();
  const auto path = session_folder() / "trifinger-payload.robot.eye";
  const PayloadReader mapped("robot", "eye", words());
  const auto look = [&sight](const PayloadReader& reader) {
    for (std::int64_t i = sight.payload.number; i < sight.payload.number + 8; ++i) {
      try {
        std::vector<std::uint64_t> copy(kWords);
        reader.view({.memory = sight.payload.memory, .number = i}).copy_to(copy.data());
      } catch (const Error&) {
      }
    }
  };
  look(mapped);
  for (std::streamoff place = 0; place < 1024; place += 8) {
    std::fstream file(path, std::ios::in | std::ios::out | std::ios::binary);
    file.seekp(place);
    file.write("\xff\xff\xff\xff\xff\xff\xff\x7f", 8);
    file.close();
    look(mapped);
    look(PayloadReader("robot", "eye", words()));
  }
  std::filesystem::resize_file(path, 8);
  look(mapped);
  look(PayloadReader("robot", "eye", words()));
}

TEST(Payload, IsWrittenAndSeenWithoutAllocating) {
  PayloadWriter writer = PayloadWriter::anonymous(words());
  const PayloadReader reader("anonymous", "eye", words());
  static_cast<void>(reader.view(write(writer, 0)));
  const AllocationCounter counter;
  for (std::uint64_t i = 1; i < 100; ++i) {
    EXPECT_TRUE(reader.view(write(writer, i)).is_valid());
  }
  EXPECT_EQ(counter.count(), 0U);
}

}  // namespace
}  // namespace trifinger::test
