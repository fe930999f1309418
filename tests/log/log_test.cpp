// SPDX-License-Identifier: BSD-3-Clause
#include "trifinger/log/log.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <array>
#include <chrono>
#include <filesystem>
#include <fstream>
#include <limits>
#include <map>
#include <random>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "core/fake_robot.hpp"
#include "log/recordings.hpp"
#include "support/message_of.hpp"
#include "trifinger/core/errors.hpp"
#include "trifinger/mcap/writer.hpp"

// What is read equals what was written, however it is asked for.

namespace trifinger::log {
namespace {

using test::Folder;
using test::message_of;
using test::OddLampReading;
using test::OddObservation;
using test::OddRobot;
using test::OddSession;
using test::random_session;
using test::same_bytes;
using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

void expect_same(const LoggedSession& found, const OddSession& written) {
  EXPECT_EQ(found.header().realtime_warnings, written.header.realtime_warnings);
  const test::FoundSteps steps = test::read_steps(found);
  EXPECT_EQ(steps.indices.size(), written.desired_actions.size());
  EXPECT_TRUE(test::is_true(steps, written));

  const LoggedRobot<OddRobot> robot(found);
  std::vector<OddObservation> observations(written.observations.size());
  robot.get_observations(0, observations);  // including the one at the end
  for (std::size_t t = 0; t < observations.size(); ++t) {
    ASSERT_TRUE(same_bytes(observations[t], written.observations[t])) << t;
  }
  EXPECT_TRUE(same_bytes(robot.get_status(written.steps()), written.statuses.back()));

  const LoggedSession lamp = found.companion("lamp");
  std::vector<OddLampReading> readings(written.lamp.size());
  EXPECT_EQ(lamp.range(Series::kObservation).second, static_cast<TimeIndex>(readings.size()));
  LoggedCompanion<OddLampReading>(lamp).get_observations(0, readings);
  for (std::size_t i = 0; i < readings.size(); ++i) {
    ASSERT_TRUE(same_bytes(readings[i], written.lamp[i])) << i;
  }
}

TEST(Log, ReadsWhatWasWrittenWhateverTheSizesAndTheMode) {
  for (unsigned seed = 0; seed < 40; ++seed) {
    std::mt19937 random(seed);
    const Folder folder;
    const auto steps = static_cast<TimeIndex>(random() % 300);
    const auto block = static_cast<TimeIndex>(1 + random() % 50);
    LogOptions options;
    options.compression = static_cast<mcap::Compression>(random() % 3);
    std::vector<OddSession> sessions;
    for (unsigned i = 0; i <= random() % 3; ++i) {
      sessions.push_back(random_session(10 * seed + i, steps, random() % 2 == 0));
    }
    sessions.push_back(random_session(10 * seed + 9, steps, true, "other"));
    test::write_log(folder / "a.mcap", sessions, options, block);

    const Log log(folder / "a.mcap");
    EXPECT_TRUE(log.is_finished());
    EXPECT_THAT(log.damage(), IsEmpty());
    EXPECT_EQ(log.lost_bytes(), 0U);
    ASSERT_EQ(log.sessions().size(), sessions.size());
    for (std::size_t i = 0; i < sessions.size(); ++i) {
      SCOPED_TRACE(testing::Message() << "seed " << seed << ", session " << i);
      expect_same(log.sessions()[i], sessions[i]);
      EXPECT_THAT(log.sessions()[i].gaps(), IsEmpty());
    }
  }
}

TEST(Log, TellsWhatTheSessionWas) {
  const Folder folder;
  const OddSession written = random_session(1, 30);
  test::write_log(folder / "a.mcap", {written});
  const LoggedSession session = Log(folder / "a.mcap").session();
  EXPECT_EQ(session.name(), "odd");
  EXPECT_EQ(session.type(), "odd");
  EXPECT_EQ(session.header().session_id, written.header.session_id);
  EXPECT_TRUE(session.header().is_real_time);
  EXPECT_EQ(session.header().period, written.header.period);
  EXPECT_EQ(session.header().created, written.header.created);
  EXPECT_EQ(session.header().host, "host");
  EXPECT_EQ(session.header().backend_pid, 4711);
  EXPECT_EQ(session.header().documents, written.header.documents);
  EXPECT_EQ(session.steps(), 30);
  EXPECT_EQ(session.fault(), (Fault{.code = Fault::Code::kFinished, .time_index = 30}));
  EXPECT_EQ(session.fault_text(), "the controller has finished");
  EXPECT_EQ(session.companion("odd.lamp").type(), "odd_lamp");
  EXPECT_EQ(session.range(Series::kAppliedAction), std::pair(TimeIndex{0}, TimeIndex{30}));
  EXPECT_EQ(session.range(Series::kObservation), std::pair(TimeIndex{0}, TimeIndex{31}));
}

TEST(Log, GivesEachSessionTheDocumentsOfItsTime) {
  const Folder folder;
  OddSession later = random_session(2, 5);
  later.header.documents.pop_back();  // the model is missing, so the earlier one still applies
  test::write_log(folder / "a.mcap", {random_session(1, 5), later});
  const Log log(folder / "a.mcap");
  EXPECT_EQ(log.sessions()[0].header().documents[0].text, "seed: 1\n");
  EXPECT_EQ(log.sessions()[1].header().documents[0].text, "seed: 2\n");
}

TEST(Log, ReadsAnyRangeWithoutReadingAllTheRest) {
  const Folder folder;
  const OddSession written = random_session(3, 500);
  const OddSession other = random_session(2, 200);
  test::write_log(folder / "a.mcap", {other, written, random_session(5, 200)});
  std::mt19937 random(1);
  for (int i = 0; i < 200; ++i) {
    // A new log each time, so that nothing about the file is known.
    const Log log(folder / "a.mcap");
    const auto first = static_cast<TimeIndex>(random() % 500);
    const auto last = first + static_cast<TimeIndex>(random() % static_cast<unsigned>(501 - first));
    const test::FoundSteps found =
        test::read_steps(log.sessions()[1], first, last, 1 + random() % 100);
    ASSERT_EQ(found.indices.size(), static_cast<std::size_t>(last - first));
    ASSERT_TRUE(test::is_true(found, written));
    if (first < last) {
      ASSERT_EQ(found.indices.front(), first);
    }
  }
}

TEST(Log, fault_82_HasNothingAtTheEndsOfTheIndices) {
  const Folder folder;
  test::write_log(folder / "a.mcap", {random_session(3, 50)});
  const Log log(folder / "a.mcap");
  const LoggedRobot<OddRobot> robot(log.sessions().front());
  constexpr TimeIndex kLargest = std::numeric_limits<TimeIndex>::max();
  std::vector<OddObservation> two(2);
  for (const TimeIndex t : {std::numeric_limits<TimeIndex>::min(), TimeIndex{-1}, kLargest - 2,
                            kLargest - 1, kLargest}) {
    EXPECT_THROW(static_cast<void>(robot.get_observation(t)), NotInLog) << t;
    EXPECT_THROW(robot.get_observations(t, two), NotInLog) << t;
  }
  SeriesReader moved = robot.session().read({{.series = Series::kStatus, .fields = {}}}, 0, 5);
  const SeriesReader reader(std::move(moved));
  // NOLINTNEXTLINE(bugprone-use-after-move): this is what the test is about
  EXPECT_THROW(static_cast<void>(moved.read(1, {})), InvalidArgument);
}

TEST(Log, fault_82_SaysThatItWasMovedAwayAndSoDoItsSessions) {
  const Folder folder;
  test::write_log(folder / "a.mcap", {random_session(3, 50)});
  Log log(folder / "a.mcap");
  LoggedSession session = log.session("odd");
  const Log other(std::move(log));
  const LoggedSession another(std::move(session));
  EXPECT_EQ(other.sessions().front().name(), another.name());
  constexpr const char* kSentence = "after it had been moved";
  std::vector<OddObservation> two(2);
  // NOLINTBEGIN(bugprone-use-after-move): this is what the test is about
  EXPECT_THROW(static_cast<void>(log.sessions()), InvalidArgument);
  EXPECT_THROW(static_cast<void>(log.session("odd")), InvalidArgument);
  EXPECT_THROW(static_cast<void>(log.events()), InvalidArgument);
  EXPECT_THROW(static_cast<void>(log.damage()), InvalidArgument);
  EXPECT_THROW(static_cast<void>(log.lost_bytes()), InvalidArgument);
  EXPECT_THROW(static_cast<void>(session.element(Series::kStatus)), InvalidArgument);
  EXPECT_THROW(static_cast<void>(session.range(Series::kStatus)), InvalidArgument);
  EXPECT_THROW(static_cast<void>(session.gaps()), InvalidArgument);
  EXPECT_THROW(session.get(Series::kObservation, 0, 2, two.data()), InvalidArgument);
  EXPECT_THROW(
      session.get(Series::kObservation, std::numeric_limits<TimeIndex>::max(), 2, two.data()),
      InvalidArgument);
  EXPECT_THROW(static_cast<void>(session.read({}, 0, 5)), InvalidArgument);
  EXPECT_THROW(static_cast<void>(session.find(0)), InvalidArgument);
  EXPECT_THROW(static_cast<void>(session.between(Nanoseconds(0), Nanoseconds(1))), InvalidArgument);
  EXPECT_THROW(static_cast<void>(session.companions()), InvalidArgument);
  EXPECT_DEATH(static_cast<void>(log.size()), kSentence);
  EXPECT_DEATH(static_cast<void>(session.name()), kSentence);
  EXPECT_DEATH(static_cast<void>(session.get_latest_at(0, two.data(), nullptr)), kSentence);
  // NOLINTEND(bugprone-use-after-move)
}

TEST(Log, ReadsSomeFieldsOnly) {
  const Folder folder;
  const OddSession written = random_session(3, 50);
  test::write_log(folder / "a.mcap", {written});
  const LoggedSession session = Log(folder / "a.mcap").session("odd");
  const Column column{Series::kObservation, {"gears", "left.speed"}};
  const ElementDescription element = select(session.element(Series::kObservation), column.fields);
  EXPECT_EQ(element.text(), "left.speed float32 rad/s\ngears int8[2,2]\n");
  std::vector<std::byte> bytes(30 * element.size());
  session.get(column, 10, 30, bytes.data());
  for (std::size_t i = 0; i < 30; ++i) {
    const OddObservation& expected = written.observations[10 + i];
    const std::byte* const found = &bytes[i * element.size()];
    EXPECT_EQ(std::memcmp(found, &expected.left.speed, 4), 0);
    EXPECT_EQ(std::memcmp(found + 4, &expected.gears, 4), 0);
  }
  EXPECT_EQ(select(element, {"left"}).text(), "left.speed float32 rad/s\n");
  EXPECT_THAT(message_of<InvalidArgument>([&] { (void)select(element, {"middle"}); }),
              AllOf(HasSubstr("'middle'"), HasSubstr("'left.speed' and 'gears'")));
}

TEST(Log, FindsStepsByTime) {
  const Folder folder;
  for (const bool is_real_time : {true, false}) {
    const OddSession written = random_session(3, 300, is_real_time);
    const auto path = folder / (is_real_time ? "a.mcap" : "b.mcap");
    test::write_log(path, {random_session(2, 100), written});
    const LoggedSession session = Log(path).session();
    const test::FoundSteps steps = test::read_steps(session);
    for (std::size_t t = 0; t < 300; t += 7) {
      EXPECT_EQ(session.find(steps.times[t]), static_cast<TimeIndex>(t));
      EXPECT_EQ(session.find(steps.times[t] + 1), static_cast<TimeIndex>(t + 1));
    }
    EXPECT_EQ(session.between(std::chrono::milliseconds(1000), Nanoseconds::max()),
              std::pair(TimeIndex{300}, TimeIndex{300}));
    EXPECT_EQ(session.between(Nanoseconds(steps.times[50] - steps.times[0]),
                              Nanoseconds(steps.times[70] - steps.times[0])),
              std::pair(TimeIndex{50}, TimeIndex{70}));
    EXPECT_EQ(session.between(Nanoseconds::min(), Nanoseconds(1)),
              std::pair(TimeIndex{0}, TimeIndex{1}));
    EXPECT_EQ(session.find(0), 0);
    EXPECT_EQ(session.find(steps.times.back() + 1), 300);
  }
}

TEST(Log, KnowsTheLatestReadingAtEveryStep) {
  const Folder folder;
  const OddSession written = random_session(3, 100);
  test::write_log(folder / "a.mcap", {written}, {}, 7);
  const LoggedCompanion<OddLampReading> lamp(Log(folder / "a.mcap").session("odd.lamp"));
  for (TimeIndex t = 0; t <= 100; ++t) {
    const OddLampReading* expected = nullptr;
    for (const OddLampReading& reading : written.lamp) {
      if (reading.stamp.arrival_index <= t) expected = &reading;
    }
    const std::optional<OddLampReading> found = lamp.get_latest_at(t);
    ASSERT_EQ(found.has_value(), expected != nullptr) << t;
    ASSERT_TRUE(!found || same_bytes(*found, *expected)) << t;
  }
  EXPECT_THROW((void)lamp.get_latest_at(101), NotInLog);  // not known yet when the session ended
}

TEST(Log, NamesWhatIsMissing) {
  const Folder folder;
  const OddSession written = random_session(3, 100);
  test::write_log_with_gap(folder / "a.mcap", written, 30, 39);
  const LoggedSession session = Log(folder / "a.mcap").session();
  EXPECT_THAT(session.gaps(), ElementsAre(Gap{30, 39, "the disk was full"}));
  const test::FoundSteps found = test::read_steps(session);
  EXPECT_EQ(found.indices.size(), 90U);
  EXPECT_TRUE(test::is_true(found, written));
  EXPECT_EQ(session.read({}).max_rows(), 90U);

  const LoggedRobot<OddRobot> robot(session);
  EXPECT_THAT(message_of<NotInLog>([&] { (void)robot.get_observation(35); }),
              AllOf(HasSubstr("steps 30 to 39"), HasSubstr("the disk was full")));
  EXPECT_THAT(message_of<NotInLog>([&] { (void)robot.get_desired_action(100); }),
              AllOf(HasSubstr("step 100"), HasSubstr("steps 0 to 99")));
  EXPECT_THROW((void)robot.get_observation(-1), NotInLog);
  EXPECT_TRUE(same_bytes(robot.get_observation(100), written.observations[100]));
}

TEST(Log, GivesNoIndexTwiceWhateverAFileSays) {
  const Folder folder;
  const OddSession written = random_session(3, 100);
  const auto write = [&](const std::string& name, const std::vector<TimeIndex>& firsts,
                         bool is_one_chunk) {
    mcap::FileSink sink = mcap::FileSink::create(folder / name);
    LogWriter writer(sink, {});
    const std::size_t number = writer.begin_session(written.header);
    for (const TimeIndex first : firsts) {
      const auto t = static_cast<std::size_t>(first);
      writer.write_steps(number,
                         {first, 30, &written.desired_actions[t], &written.applied_actions[t],
                          &written.observations[t], &written.statuses[t]});
      if (!is_one_chunk) writer.flush();
    }
    writer.finish();
    return Log(folder / name).session();
  };
  for (const bool is_one_chunk : {true, false}) {
    const LoggedSession session =
        write(is_one_chunk ? "a.mcap" : "b.mcap", {0, 10, 5, 50}, is_one_chunk);
    const test::FoundSteps found = test::read_steps(session);
    EXPECT_TRUE(test::is_true(found, written));  // this also checks that the indices rise
    EXPECT_EQ(found.indices.size(), 70U);
    ASSERT_THAT(session.gaps(), testing::SizeIs(1));
    EXPECT_EQ(session.gaps()[0].first, 40);
    EXPECT_EQ(session.gaps()[0].last, 49);
  }
  const LoggedSession session = write("c.mcap", {0, 50, 10}, true);
  EXPECT_EQ(session.range(Series::kAppliedAction).second, 80);
  EXPECT_EQ(test::read_steps(session).indices.size(), 60U);
}

TEST(Log, ReadsASessionThatWentOnWhenTheRecordingEnded) {
  const Folder folder;
  const OddSession written = random_session(3, 100);
  {
    mcap::FileSink sink = mcap::FileSink::create(folder / "a.mcap");
    LogWriter writer(sink, {});
    test::write_steps(writer, writer.begin_session(written.header), written, 0, 60);
  }  // killed: no summary
  const Log log(folder / "a.mcap");
  EXPECT_FALSE(log.is_finished());
  EXPECT_EQ(log.lost_bytes(), 0U);
  const LoggedSession session = log.session("odd");
  EXPECT_EQ(session.steps(), std::nullopt);
  EXPECT_FALSE(session.fault());
  EXPECT_EQ(session.range(Series::kObservation), std::pair(TimeIndex{0}, TimeIndex{60}));
  EXPECT_EQ(test::read_steps(session).indices.size(), 60U);
  EXPECT_THAT(session.gaps(), IsEmpty());
}

TEST(Log, PutsThePartsOfARecordingTogetherInAnyOrder) {
  const Folder folder;
  const OddSession written = random_session(3, 100);
  const OddSession second = random_session(4, 20);
  for (int part = 0; part < 3; ++part) {
    // The names sort in the reverse order.
    mcap::FileSink sink = mcap::FileSink::create(folder / (std::to_string(9 - part) + ".mcap"));
    LogOptions options;
    options.recording = "r";
    options.part = part;
    LogWriter writer(sink, options);
    SessionHeader header = written.header;
    header.first_index = 40 * part;
    const std::size_t number = writer.begin_session(header);
    test::write_steps(writer, number, written, 40 * part, std::min<TimeIndex>(40 * part + 40, 100));
    if (part == 2) {
      test::write_end(writer, number, written);
      const std::size_t next = writer.begin_session(second.header);
      test::write_steps(writer, next, second, 0, 20);
      test::write_end(writer, next, second);
    }
    writer.finish();
  }
  const Log log(folder.path());
  EXPECT_EQ(log.files().front().filename(), "9.mcap");
  ASSERT_EQ(log.sessions().size(), 2U);
  expect_same(log.sessions()[0], written);
  expect_same(log.sessions()[1], second);
  EXPECT_THAT(log.sessions()[0].gaps(), IsEmpty());

  // A single part is a log, too.
  const Log middle(folder / "8.mcap");
  EXPECT_EQ(middle.session().range(Series::kObservation), std::pair(TimeIndex{40}, TimeIndex{80}));
  EXPECT_THAT(middle.session().gaps(), IsEmpty());

  std::filesystem::remove(folder / "8.mcap");
  const Log rest(folder.path());
  EXPECT_THAT(rest.damage(), testing::SizeIs(1));
  ASSERT_THAT(rest.sessions()[0].gaps(), testing::SizeIs(1));
  EXPECT_EQ(rest.sessions()[0].gaps()[0].first, 40);
  EXPECT_EQ(rest.sessions()[0].gaps()[0].last, 79);
}

TEST(Log, RefusesWhatBelongsToSeveralRecordings) {
  const Folder folder;
  test::write_log(folder / "a.mcap", {random_session(1, 5)});
  test::write_log(folder / "b.mcap", {random_session(2, 5)});
  EXPECT_THAT(message_of<InvalidArgument>(
                  [&] { (void)Log(std::vector{folder / "a.mcap", folder / "b.mcap"}); }),
              AllOf(HasSubstr("a.mcap"), HasSubstr("b.mcap"), HasSubstr("two recordings")));
}

TEST(Log, TakesTheNewestRecordingOfAFolder) {
  const Folder folder;
  const auto write = [&](const std::string& name, TimeIndex steps) {
    test::write_log(folder / name, {random_session(1, steps)});
  };
  write("sim_2026-11-20_09-05-12_000.mcap", 5);
  write("sim_2026-11-20_09-05-13_000.mcap", 7);
  // One recorder of each kind was killed before the first record.
  std::ofstream(folder / "sim_2026-11-20_09-05-12_001.mcap") << '?';
  std::ofstream(folder / "sim_2026-11-20_09-05-13_001.mcap") << '?';

  const Log log(folder.path());
  EXPECT_THAT(log.files(), testing::ElementsAre(folder / "sim_2026-11-20_09-05-13_000.mcap"));
  ASSERT_THAT(log.damage(), testing::SizeIs(1));
  EXPECT_EQ(log.damage()[0].file, folder / "sim_2026-11-20_09-05-13_001.mcap");
}

TEST(Log, NamesWhatIsNotThere) {
  const Folder folder;
  const Folder empty;
  EXPECT_THAT(message_of<InvalidArgument>([&] { (void)Log(empty.path()); }),
              HasSubstr("no .mcap files"));
  EXPECT_THROW((void)Log(folder / "c.mcap"), SystemError);
}

TEST(Log, NamesTheRobotsThereAre) {
  const Folder folder;
  test::write_log(folder / "a.mcap", {random_session(1, 5), random_session(2, 5, true, "other")});
  const Log log(folder / "a.mcap");
  EXPECT_THAT(message_of<InvalidArgument>([&] { (void)log.session("sim"); }),
              AllOf(HasSubstr("'sim'"), HasSubstr("'odd' and 'other'")));
  EXPECT_THAT(message_of<InvalidArgument>([&] { (void)log.session(); }),
              HasSubstr("'odd' and 'other'"));
  EXPECT_THAT(message_of<InvalidArgument>([&] { (void)log.session("odd").companion("camera"); }),
              AllOf(HasSubstr("'camera'"), HasSubstr("'lamp'")));
  EXPECT_THAT(
      message_of<InvalidArgument>([&] { (void)log.session("odd").element(Series::kHolding); }),
      HasSubstr("holding"));
  EXPECT_THROW((void)LoggedRobot<FakeRobot>(log, "odd"), IncompatibleSession);
}

TEST(Log, fault_27_SaysWhichVersionIsNeededForALaterFormat) {
  const Folder folder;
  mcap::FileSink sink = mcap::FileSink::create(folder / "a.mcap");
  mcap::Writer writer(sink, {.profile = "ros2", .library = "trifinger 9.0.0"});
  writer.write(
      mcap::Metadata{"trifinger.log", {{"format_version", "2"}, {"trifinger_version", "9.0.0"}}});
  writer.finish();
  EXPECT_THAT(message_of<mcap::FormatError>([&] { (void)Log(folder / "a.mcap"); }),
              AllOf(HasSubstr("a.mcap"), HasSubstr("needs trifinger >= 9.0.0")));
}

// memory_damaged was once called queue_damaged.
TEST(Log, fault_27_KnowsAFaultByItsCodeWhateverItsNameWasThen) {
  const Folder folder;
  mcap::FileSink sink = mcap::FileSink::create(folder / "a.mcap");
  mcap::Writer writer(sink, {.profile = "ros2", .library = "trifinger 0.1.0"});
  writer.write(
      mcap::Metadata{"trifinger.log", {{"format_version", "1"}, {"trifinger_version", "0.1.0"}}});
  writer.write(mcap::Metadata{"trifinger.session",
                              {{"name", "odd"},
                               {"type", "odd"},
                               {"session_id", "7"},
                               {"is_real_time", "1"},
                               {"period", "1000000"},
                               {"created", "0"},
                               {"host", "host"},
                               {"backend_pid", "1"},
                               {"time_offset", "0"},
                               {"companions", ""},
                               {"companion_first_indices", ""},
                               {"first_index", "0"}}});
  writer.write(mcap::Metadata{"trifinger.end",
                              {{"name", "odd"},
                               {"session_id", "7"},
                               {"steps", "5"},
                               {"observations", "6"},
                               {"fault_code", "20"},
                               {"fault", "queue_damaged"},
                               {"fault_detail", "0"},
                               {"fault_time_index", "5"},
                               {"fault_text", "the queue of actions was damaged"}}});
  writer.finish();
  const Log log(folder / "a.mcap");
  EXPECT_THAT(log.damage(), IsEmpty());
  EXPECT_EQ(name_of(log.session().fault().code), "memory_damaged");
  EXPECT_EQ(log.session().fault_text(), "the queue of actions was damaged");
}

TEST(Log, TellsAnotherMcapFileFromALog) {
  const Folder folder;
  mcap::FileSink sink = mcap::FileSink::create(folder / "a.mcap");
  mcap::Writer writer(sink, {.profile = "ros2", .library = "rosbag2"});
  writer.finish();
  EXPECT_THAT(message_of<mcap::FormatError>([&] { (void)Log(folder / "a.mcap"); }),
              HasSubstr("no log of robots"));
}

TEST(Log, TellsTheEventsInTheirOrder) {
  const Folder folder;
  test::write_log(folder / "a.mcap", {random_session(1, 50), random_session(2, 5, true, "other")});
  const std::vector<Event> events = Log(folder / "a.mcap").events();
  ASSERT_EQ(events.size(), 2U);
  EXPECT_EQ(events[0].source, "odd");
  EXPECT_EQ(events[1].source, "other");
  EXPECT_EQ(events[1].text, "begins");
  EXPECT_EQ(events[1].level, Level::kInfo);
}

TEST(Log, IsReadByManyThreads) {
  const Folder folder;
  const OddSession written = random_session(3, 200);
  test::write_log(folder / "a.mcap", {written});
  const Log log(folder / "a.mcap");
  std::vector<std::thread> threads;
  threads.reserve(4);
  for (int i = 0; i < 4; ++i) {
    threads.emplace_back([&log, &written] {
      const test::FoundSteps found = test::read_steps(log.session(), 0, 200, 10);
      EXPECT_EQ(found.indices.size(), 200U);
      EXPECT_TRUE(test::is_true(found, written));
    });
  }
  for (std::thread& thread : threads) thread.join();
}

TEST(Log, ReadsChunksThatClosedThemselves) {
  const Folder folder;
  const OddSession written = random_session(3, 40'000);
  test::write_log(folder / "a.mcap", {written}, {}, 40'000);
  const test::FoundSteps found = test::read_steps(Log(folder / "a.mcap").session());
  EXPECT_EQ(found.indices.size(), 40'000U);
  EXPECT_TRUE(test::is_true(found, written));
}

}  // namespace
}  // namespace trifinger::log
