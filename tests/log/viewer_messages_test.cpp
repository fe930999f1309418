// SPDX-License-Identifier: BSD-3-Clause
// What 3D viewers find in a log. No description of a robot can prevent recording.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <map>
#include <random>
#include <span>
#include <string>
#include <tuple>
#include <vector>

#include "core/odd_robot.hpp"
#include "log/format/cdr.hpp"
#include "log/log_writer.hpp"
#include "trifinger/core/driver.hpp"
#include "trifinger/mcap/reader.hpp"

namespace trifinger::test {
namespace {

using log::LogWriter;
using log::SessionHeader;
using ::testing::HasSubstr;

struct ArmObservation {
  std::array<double, 2> angle{};

  static constexpr auto fields() { return std::tuple{field("angle", &ArmObservation::angle)}; }
};

struct PuckObservation {
  Stamp stamp;
  std::array<double, 3> position{};
  std::array<double, 4> orientation{1, 0, 0, 0};

  static constexpr auto fields() {
    return std::tuple{field("stamp", &PuckObservation::stamp),
                      field("position", &PuckObservation::position),
                      field("orientation", &PuckObservation::orientation)};
  }
};

constexpr const char* kFrames =
    "# of an arm\n"
    "fixed world base 0 0 1 1 0 0 0\n"
    "turning base upper 0 0 0.5 1 0 0 0 0 0 1 shoulder angle[0]\n"
    "turning upper lower 0.25 0 0 0.7071067811865476 0.7071067811865476 0 0 1 0 0 elbow angle[1]\n"
    "free base puck sight position orientation\n";
constexpr const char* kUrdf =
    "<robot name=\"arm\"><link name=\"base\"/><link name=\"upper\"/>"
    "<joint name=\"shoulder\"><parent link=\"base\"/><child link=\"upper\"/></joint></robot>";

class ArmSink final : public mcap::Sink {
 public:
  void append(std::span<const std::byte> more) override {
    bytes.insert(bytes.end(), more.begin(), more.end());
  }
  void sync() override {}
  [[nodiscard]] std::uint64_t size() const noexcept override { return bytes.size(); }

  std::vector<std::byte> bytes;
};

SessionHeader arm_header(const std::string& frames, const std::string& urdf = kUrdf,
                         std::uint64_t id = 7) {
  SessionHeader header;
  header.name = "arm";
  header.session_id = id;
  header.period = std::chrono::milliseconds(10);
  header.time_offset = 1'000'000'000;
  header.types = describe_robot<OddRobot>();
  header.types.observation = describe<ArmObservation>();
  header.companions = {
      {.name = "arm.sight", .type = "sight", .element = describe<PuckObservation>()}};
  header.documents = {{"robot.urdf", "application/xml", urdf},
                      {"frames.txt", "text/plain", frames}};
  return header;
}

constexpr std::size_t kSteps = 40;  // 0.4 s

// The angles of step t are t / 100 and 1, or what `observe` returns.
template <class Observe>
void write_arm_session(LogWriter& writer, const SessionHeader& header, const Observe& observe) {
  std::vector<OddAction> actions(kSteps);
  std::vector<OddAppliedAction> applied(kSteps);
  std::vector<ArmObservation> observations(kSteps);
  std::vector<Status> statuses(kSteps);
  for (std::size_t t = 0; t < kSteps; ++t) observations[t] = observe(t);
  const std::size_t session = writer.begin_session(header);
  std::vector<PuckObservation> seen(kSteps / 4);
  for (std::size_t i = 0; i < seen.size(); ++i) {
    const auto t = static_cast<TimeIndex>(4 * i);
    seen[i].stamp = {.arrival_index = t, .capture_index = t - 2};
    seen[i].position = {0, 0, 0.25 * static_cast<double>(i)};
  }
  writer.write_companion(session, 0, 0, seen.size(), seen.data());
  for (std::size_t t = 0; t < kSteps; t += 8) {
    writer.write_steps(session, {.first = static_cast<TimeIndex>(t),
                                 .count = 8,
                                 .desired_actions = &actions[t],
                                 .applied_actions = &applied[t],
                                 .observations = &observations[t],
                                 .statuses = &statuses[t]});
    writer.flush();
  }
  writer.end_session(session, kSteps, {.code = Fault::Code::kStopped}, "stopped");
}

void write_arm_session(LogWriter& writer, const SessionHeader& header) {
  write_arm_session(writer, header, [](std::size_t t) {
    return ArmObservation{{static_cast<double>(t) / 100, 1.0}};
  });
}

struct Found {
  std::int64_t time;
  std::vector<std::byte> data;
};

// Returns the messages of each topic.
std::map<std::string, std::vector<Found>> messages_of(const ArmSink& sink) {
  mcap::Reader reader(mcap::open_memory(sink.bytes));
  std::map<std::string, std::vector<Found>> found;
  for (std::size_t i = 0; i < reader.contents().chunks.size(); ++i) {
    const auto messages = reader.read_chunk(i);
    for (const mcap::Message& message : messages.value()) {
      found[reader.contents().channels.at(message.channel_id).topic].push_back(
          {static_cast<std::int64_t>(message.log_time),
           {message.data.begin(), message.data.end()}});
    }
  }
  EXPECT_TRUE(reader.contents().damage.empty());
  return found;
}

struct Transform {
  std::string parent, child;
  std::int64_t stamp{0};
  std::array<double, 7> numbers{};  // x y z, then x y z w
};

std::map<std::string, Transform> transforms_of(const Found& message) {
  log::detail::CdrReader reader(message.data);
  std::map<std::string, Transform> found;
  for (auto left = reader.number<std::uint32_t>(); left > 0; --left) {
    Transform one;
    one.stamp = std::int64_t{reader.number<std::int32_t>()} * 1'000'000'000;
    one.stamp += reader.number<std::uint32_t>();
    one.parent = reader.text();
    one.child = reader.text();
    for (double& number : one.numbers) number = reader.number<double>();
    found[one.child] = one;
  }
  EXPECT_TRUE(reader.is_whole());
  return found;
}

TEST(ViewerMessages, SayAtTheirRateWhereAllLinksAre) {
  ArmSink sink;
  LogWriter writer(sink, {.recording = "r", .viewer_rate = 10});
  write_arm_session(writer, arm_header(kFrames));
  writer.finish();
  const auto found = messages_of(sink);
  ASSERT_EQ(found.at("/arm/tf_static").size(), 1U);
  const auto still = transforms_of(found.at("/arm/tf_static")[0]);
  EXPECT_EQ(still.at("arm/base").parent, "world");
  EXPECT_EQ(still.at("arm/base").numbers[2], 1);

  const std::vector<Found>& moving = found.at("/arm/tf");
  ASSERT_EQ(moving.size(), 4U);
  for (std::size_t i = 0; i < moving.size(); ++i) {
    EXPECT_EQ(moving[i].time, 1'000'000'000 + static_cast<std::int64_t>(i) * 100'000'000);
    const auto links = transforms_of(moving[i]);
    const Transform& upper = links.at("arm/upper");
    EXPECT_EQ(upper.parent, "arm/base");
    EXPECT_EQ(upper.stamp, moving[i].time);
    EXPECT_EQ(upper.numbers[2], 0.5);
    EXPECT_NEAR(upper.numbers[5], std::sin(0.05 * static_cast<double>(i)), 1e-4);
    EXPECT_NEAR(upper.numbers[6], std::cos(0.05 * static_cast<double>(i)), 1e-4);
    // A quarter turn about x, plus 1 rad.
    const Transform& lower = links.at("arm/lower");
    EXPECT_NEAR(lower.numbers[3], std::sin((std::acos(0.0) + 1) / 2), 1e-4);
    EXPECT_NEAR(lower.numbers[4], 0, 1e-4);
    // The puck is seen in every fourth step, two steps late. Viewers get steps 0, 10, 20 and 30.
    const Transform& puck = links.at("arm/puck");
    const std::array<TimeIndex, 4> arrival{0, 8, 20, 28};
    EXPECT_EQ(puck.stamp, 1'000'000'000 + (arrival[i] - 2) * 10'000'000) << i;
    const TimeIndex sight = arrival[i] / 4;
    EXPECT_EQ(puck.numbers[2], 0.25 * static_cast<double>(sight));
    EXPECT_EQ(puck.numbers[6], 1);
  }

  log::detail::CdrReader joints(found.at("/arm/joint_states").at(3).data);
  static_cast<void>(joints.number<std::uint64_t>());  // stamp
  EXPECT_EQ(joints.text(), "");
  EXPECT_EQ(joints.number<std::uint32_t>(), 2U);
  EXPECT_EQ(joints.text(), "shoulder");
  EXPECT_EQ(joints.text(), "elbow");
  EXPECT_EQ(joints.number<std::uint32_t>(), 2U);
  EXPECT_NEAR(joints.number<double>(), 0.3, 1e-4);
  EXPECT_EQ(joints.number<double>(), 1);

  log::detail::CdrReader description(found.at("/arm/robot_description").at(0).data);
  EXPECT_EQ(description.text(),
            "<robot name=\"arm arm\"><link name=\"arm/base\"/><link name=\"arm/upper\"/>"
            "<joint name=\"shoulder\"><parent link=\"arm/base\"/><child link=\"arm/upper\"/>"
            "</joint></robot>");
}

TEST(ViewerMessages, DescribeARobotOnceInAFileAsLongAsItIsTheSame) {
  ArmSink sink;
  LogWriter writer(sink, {.recording = "r", .viewer_rate = 10});
  for (std::uint64_t id = 1; id <= 4; ++id) {
    write_arm_session(writer, arm_header(kFrames, id < 4 ? kUrdf : "<robot name=\"other\"/>", id));
  }
  writer.finish();
  const auto found = messages_of(sink);
  EXPECT_EQ(found.at("/arm/robot_description").size(), 2U);
  EXPECT_EQ(found.at("/arm/tf_static").size(), 2U);
  EXPECT_EQ(found.at("/arm/tf").size(), 16U);
}

TEST(ViewerMessages, AreNotThereWithoutARateOrDocuments) {
  for (const bool has_documents : {false, true}) {
    ArmSink sink;
    log::LogOptions options{.recording = "r", .viewer_rate = 10};
    if (has_documents) options.viewer_rate = 0;
    LogWriter writer(sink, options);
    SessionHeader header = arm_header(kFrames);
    if (!has_documents) header.documents.clear();
    write_arm_session(writer, header);
    writer.finish();
    const mcap::Reader reader(mcap::open_memory(sink.bytes));
    for (const auto& [id, channel] : reader.contents().channels) {
      EXPECT_NE(channel.metadata.count("session") + channel.metadata.count("role"), 1U)
          << channel.topic;
    }
    EXPECT_FALSE(messages_of(sink).contains("/arm/tf"));
  }
}

TEST(ViewerMessages, LeaveOutNumbersThatAreNone) {
  ArmSink sink;
  LogWriter writer(sink, {.recording = "r", .viewer_rate = 10});
  write_arm_session(writer, arm_header(kFrames), [](std::size_t t) {
    return ArmObservation{{t < 20 ? std::numeric_limits<double>::quiet_NaN() : 0.5, 1.0}};
  });
  writer.finish();
  const auto found = messages_of(sink);
  EXPECT_FALSE(transforms_of(found.at("/arm/tf").at(0)).contains("arm/upper"));
  EXPECT_TRUE(transforms_of(found.at("/arm/tf").at(0)).contains("arm/lower"));
  EXPECT_TRUE(transforms_of(found.at("/arm/tf").at(2)).contains("arm/upper"));
}

// Each case has one strange line.
TEST(ViewerMessages, NoDescriptionHindersRecording) {
  for (const std::string line :
       {"turning base upper", "turning base upper 0 0 0 1 0 0 0 1 0 0 joint angle[2]",
        "turning base upper 0 0 0 1 0 0 0 1 0 0 joint angle[-1]",
        "turning base upper 0 0 0 1 0 0 0 1 0 0 joint angle[0",
        "turning base upper 0 0 0 1 0 0 0 1 0 0 joint nothing", "fixed a b 0 0 0 1 0 0 x",
        "fixed a b 0 0 0 nan 0 0 0", "free base puck sight position position",
        "free base puck sight", "sliding a b 0 0 0 1 0 0 0", "\xff\xfe\x01", " "}) {
    ArmSink sink;
    LogWriter writer(sink, {.recording = "r", .viewer_rate = 10});
    write_arm_session(writer, arm_header("fixed world base 0 0 0 1 0 0 0\n" + line + "\n"));
    writer.finish();
    const auto found = messages_of(sink);
    EXPECT_EQ(found.at("/arm/step").size(), kSteps) << line;
    ASSERT_EQ(found.at("/events").size(), 1U) << line;
    log::detail::CdrReader event(found.at("/events")[0].data);
    static_cast<void>(event.number<std::uint64_t>());  // stamp
    static_cast<void>(event.number<std::uint8_t>());
    EXPECT_EQ(event.text(), "arm");
    EXPECT_THAT(event.text(), HasSubstr("Line 2 of frames.txt is not understood"));
  }
}

TEST(ViewerMessages, RandomBytesInDescriptionsDoNotHinderRecording) {
  std::mt19937 random(5);
  for (int attempt = 0; attempt < 300; ++attempt) {
    std::string frames = kFrames;
    std::string urdf = kUrdf;
    for (int i = 0; i < 1 + attempt % 20; ++i) {
      frames[random() % frames.size()] = static_cast<char>(random());
      urdf[random() % urdf.size()] = static_cast<char>(random());
    }
    ArmSink sink;
    LogWriter writer(sink, {.recording = "r", .viewer_rate = 10});
    write_arm_session(writer, arm_header(frames, urdf));
    writer.finish();
    EXPECT_EQ(messages_of(sink).at("/arm/step").size(), kSteps);
  }
}

}  // namespace
}  // namespace trifinger::test
