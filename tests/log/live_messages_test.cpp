// SPDX-License-Identifier: BSD-3-Clause
#include "log/live_messages.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <limits>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "core/named_robot.hpp"
#include "log/format/cdr.hpp"
#include "log/recorder_under_test.hpp"
#include "log/recordings.hpp"
#include "log/seeing_robot.hpp"
#include "support/folder.hpp"
#include "support/session_folder.hpp"
#include "trifinger/log/log.hpp"
#include "trifinger/mcap/reader.hpp"

// What is shown live is what a log has.

namespace trifinger::test {
namespace {

using log::LiveBatch;
using log::LiveMessage;
using log::LiveMessages;
using log::LiveOptions;
using ::testing::Contains;
using ::testing::HasSubstr;

// A message of a topic: its type, definition, time and bytes.
struct Told {
  std::string type;
  std::string definition;
  std::uint64_t time{0};
  std::vector<std::byte> data;

  friend auto operator<=>(const Told&, const Told&) = default;
};
using ByTopic = std::map<std::string, std::vector<Told>>;

ByTopic messages_of_log(const std::filesystem::path& folder) {
  ByTopic found;
  for (const auto& file : std::filesystem::directory_iterator(folder)) {
    if (file.path().extension() != ".mcap") continue;
    mcap::Reader reader(file.path());
    const mcap::Contents& contents = reader.contents();
    for (std::size_t i = 0; i < contents.chunks.size(); ++i) {
      const auto messages = reader.read_chunk(i);
      for (const mcap::Message& message : messages.value()) {
        const mcap::Channel& channel = contents.channels.at(message.channel_id);
        const mcap::Schema& schema = contents.schemas.at(channel.schema_id);
        found[channel.topic].push_back({schema.name,
                                        schema.data,
                                        message.log_time,
                                        {message.data.begin(), message.data.end()}});
      }
    }
  }
  return found;
}

// Takes messages and keeps them by topic.
class Viewer {
 public:
  explicit Viewer(const LiveOptions& options = {.rate = 0, .viewer_rate = 8})
      : live_("robot", options) {}

  // Returns the number of messages that are not events.
  std::size_t look() {
    const LiveBatch batch = live_.take();
    lost_ += batch.lost;
    std::size_t count = 0;
    for (const LiveMessage& message : batch.messages) {
      const log::LiveChannel& channel = live_.channels().at(message.channel);
      told_[channel.topic].push_back(
          {channel.type, channel.definition, message.log_time, message.data});
      if (channel.topic != "/events") ++count;
    }
    for (const log::Event& event : batch.events) texts_.push_back(event.text);
    return count;
  }
  void look_until_told(const std::string& topic, std::size_t count = 1) {
    while (told_[topic].size() < count) {
      look();
      std::this_thread::yield();
    }
  }
  void look_until_end() {
    while (live_.is_running()) {
      look();
      std::this_thread::yield();
    }
  }
  // Waits until it has found a session.
  void find() {
    while (!live_.is_running()) {
      look();
      std::this_thread::yield();
    }
  }

  [[nodiscard]] LiveMessages& live() noexcept { return live_; }
  [[nodiscard]] const ByTopic& told() const noexcept { return told_; }
  [[nodiscard]] const std::vector<std::string>& texts() const noexcept { return texts_; }
  [[nodiscard]] std::int64_t lost() const noexcept { return lost_; }

 private:
  LiveMessages live_;
  ByTopic told_;
  std::vector<std::string> texts_;
  std::int64_t lost_{0};
};

TimeIndex index_of(const Told& message) {
  log::detail::CdrReader reader(message.data);
  static_cast<void>(reader.number<std::uint64_t>());
  return reader.number<std::int64_t>();
}

void step(Frontend<FakeRobot>& robot, TimeIndex count) {
  for (TimeIndex i = 0; i < count; ++i) {
    const double setpoint = 0.01 * static_cast<double>(robot.current_time_index() % 100);
    static_cast<void>(robot.get_status(robot.append_desired_action({.setpoint = setpoint})));
  }
}

std::vector<Document> documents() {
  return {{"robot.urdf", "application/xml", R"(<robot name="arm"><link name="base"/></robot>)"},
          {"frames.txt", "text/plain",
           "fixed world base 0 0 1 1 0 0 0\n"
           "turning base upper 0 0 0.5 1 0 0 0 0 0 1 shoulder setpoint\n"}};
}

class LiveMessagesTest : public ::testing::Test {
 protected:
  [[nodiscard]] log::RecorderOptions options() const {
    log::RecorderOptions options;
    options.folder = logs_.path();
    options.keep_free = 0;
    options.is_follower = true;
    return options;
  }

  SessionFolder sessions_;
  Folder logs_;
};

// All topics but "/events", whose sentences are those of a recorder or of a viewer.
TEST_F(LiveMessagesTest, AreThoseOfALogByteForByte) {
  RecorderUnderTest recorder({"robot"}, options());
  Viewer viewer;
  for (int session = 0; session < 3; ++session) {
    const NamedRobot backend("robot", {.history = 4096, .queue = 64, .documents = documents()},
                             kPatient, &*recorder);
    auto robot = connect<FakeRobot>("robot");
    viewer.look_until_end();
    viewer.find();
    for (int i = 0; i < 40; ++i) {
      step(robot, 25);
      viewer.look();
    }
    robot.finish();
    viewer.look_until_end();
    // The recorder sees the next session, too. Times depend on the sessions before.
    viewer.find();
  }
  viewer.look_until_end();
  recorder.stop();
  EXPECT_EQ(viewer.lost(), 0);

  ByTopic logged = messages_of_log(logs_.path());
  logged.erase("/events");
  ByTopic told = viewer.told();
  told.erase("/events");
  // Before the first step a viewer also gets where the robot is. A log has no such message.
  for (const char* const topic : {"/robot/tf", "/robot/joint_states"}) {
    const std::set<Told> shown(told.at(topic).begin(), told.at(topic).end());
    for (const Told& message : logged.at(topic)) EXPECT_TRUE(shown.contains(message)) << topic;
    told.erase(topic);
    logged.erase(topic);
  }
  ASSERT_EQ(told.size(), logged.size());
  for (const auto& [topic, messages] : logged) {
    // A viewer keeps what stays the same, so it comes once. A log has it once in each file.
    EXPECT_TRUE(told.at(topic) == messages) << topic;
  }
  EXPECT_EQ(told.at("/robot/step").size(), 3000U);
  EXPECT_EQ(told.at("/robot/end").size(), 3U);
  EXPECT_GT(told.at("/robot/sensor").size(), 700U);
  EXPECT_EQ(told.at("/robot/robot_description").size(), 1U);
}

TEST_F(LiveMessagesTest, ComeAtTheirRate) {
  // A period is 1 ms.
  for (const auto& [rate, stride] : std::map<double, TimeIndex>{{100, 10}, {250, 4}, {5000, 1}}) {
    const NamedRobot backend("robot", {.history = 4096}, kPatient);
    Viewer viewer({.rate = rate});
    viewer.find();
    auto robot = connect<FakeRobot>("robot");
    step(robot, 1);
    viewer.look();
    step(robot, 999);
    viewer.look();
    const std::vector<Told>& steps = viewer.told().at("/robot/step");
    ASSERT_EQ(steps.size(), static_cast<std::size_t>(1000 / stride));
    for (std::size_t i = 0; i < steps.size(); ++i) {
      EXPECT_EQ(index_of(steps[i]), static_cast<TimeIndex>(i) * stride);
    }
    EXPECT_EQ(viewer.lost(), 0);
  }
}

TEST_F(LiveMessagesTest, GoOnWithTheNewestForAReaderWhoIsLate) {
  const NamedRobot backend("robot", {.history = 64, .queue = 64}, kPatient);
  Viewer viewer;
  viewer.find();
  auto robot = connect<FakeRobot>("robot");
  step(robot, 10);
  viewer.look();
  step(robot, 500);
  viewer.look();
  const std::vector<Told>& steps = viewer.told().at("/robot/step");
  EXPECT_EQ(index_of(steps.back()), 509);
  const TimeIndex missing = 510 - static_cast<TimeIndex>(steps.size());
  EXPECT_GT(missing, 0);
  EXPECT_GE(viewer.lost(), missing - 9);
  for (std::size_t i = 1; i < steps.size(); ++i) {
    EXPECT_LT(index_of(steps[i - 1]), index_of(steps[i]));
  }
}

TEST_F(LiveMessagesTest, AreAtMostASecondOfARobotAtOnce) {
  const NamedRobot backend("robot", {.history = 16384}, kPatient);
  Viewer viewer({.rate = 0, .viewer_rate = 0});
  viewer.find();
  auto robot = connect<FakeRobot>("robot");
  step(robot, 1);
  viewer.look();
  step(robot, 9000);
  EXPECT_LE(viewer.look(), 2000U);
  EXPECT_EQ(index_of(viewer.told().at("/robot/step").back()), 9000);
  EXPECT_GE(viewer.lost(), 8000);
}

TEST_F(LiveMessagesTest, ShowWhereARobotIsBeforeItsFirstStep) {
  const NamedRobot backend("robot", {.history = 64, .queue = 64, .documents = documents()},
                           kPatient);
  Viewer viewer;
  viewer.look_until_told("/robot/joint_states");
  EXPECT_EQ(viewer.told().at("/robot/robot_description").size(), 1U);
  EXPECT_EQ(viewer.told().at("/robot/tf").size(), 1U);
  EXPECT_EQ(viewer.told().count("/robot/step"), 0U);
}

TEST_F(LiveMessagesTest, ShowTheNewestStepOfARobotThatStandsStill) {
  const NamedRobot backend("robot", {.history = 64, .queue = 64}, kPatient);
  auto robot = connect<FakeRobot>("robot");
  step(robot, 8);
  Viewer viewer({.rate = 100});
  viewer.look_until_told("/robot/step");
  EXPECT_EQ(index_of(viewer.told().at("/robot/step").front()), 7);
}

TEST_F(LiveMessagesTest, SayWhatBecomesOfTheRobot) {
  Viewer viewer;
  viewer.look();
  EXPECT_THAT(viewer.texts(), Contains(HasSubstr("is not running")));
  {
    const NamedRobot backend("robot");
    viewer.find();
    auto robot = connect<FakeRobot>("robot");
    step(robot, 3);
    robot.finish();
    viewer.look_until_end();
  }
  EXPECT_THAT(viewer.texts(), Contains(HasSubstr("is shown")));
  EXPECT_THAT(viewer.texts(), Contains(HasSubstr("the controller finished")));
  EXPECT_EQ(viewer.told().at("/events").size(), viewer.texts().size());
}

TEST_F(LiveMessagesTest, RefuseWhatIsNoRobotAndRatesThatAreNone) {
  EXPECT_THROW(LiveMessages("sim.object"), InvalidArgument);
  EXPECT_THROW(LiveMessages("sim", {.rate = -1}), InvalidArgument);
  EXPECT_THROW(LiveMessages("sim", {.rate = std::numeric_limits<double>::quiet_NaN()}),
               InvalidArgument);
  EXPECT_THROW(LiveMessages("sim", {.viewer_rate = -1}), InvalidArgument);
  EXPECT_THROW(LiveMessages("sim", {.jpeg_quality = 0}), InvalidArgument);
}

// A robot "robot" with three cameras, which others can find by its name.
class SeenRobot {
 public:
  explicit SeenRobot(Follower& follower)
      : driver_(Seen{}),
        host_(
            SessionHost::named("robot", {.documents = RecordedSight::documents(three_cameras())})),
        backend_(driver_, host_, kPatient) {
    backend_.follow(follower);
    thread_.emplace(backend_);
    const Frontend<FakeRobot> looker(host_, {.control = false});
    static_cast<void>(looker.latest_observation());
  }

 private:
  SeeingDriver driver_;
  SessionHost host_;
  Backend backend_;
  std::optional<BackendThread> thread_;
};

TEST_F(LiveMessagesTest, HaveTheImagesThatALogHasButOnlyWhileTheyAreWanted) {
  log::RecorderOptions with_images = options();
  with_images.images = log::ImageStorage::kJpeg;
  with_images.jpeg_quality = 77;
  RecorderUnderTest recorder({"robot"}, with_images);
  Viewer viewer({.rate = 0, .viewer_rate = 8, .jpeg_quality = 77});
  {
    const SeenRobot backend(*recorder);
    viewer.find();
    auto robot = connect<FakeRobot>("robot");
    step(robot, 200);
    viewer.look();
    EXPECT_EQ(viewer.told().count("/robot/camera60/image"), 0U);
    EXPECT_EQ(viewer.told().at("/robot/camera60/camera_info").size(), 1U);
    viewer.live().want_images(true);
    for (std::size_t i = 1; i <= 20; ++i) {
      step(robot, 10);
      viewer.look_until_told("/robot/camera300/image", i);
    }
    robot.finish();
    viewer.look_until_end();
  }
  recorder.stop();
  const ByTopic logged = messages_of_log(logs_.path());
  for (const char* const camera : {"camera60", "camera180", "camera300"}) {
    const std::string topic = "/robot/" + std::string(camera) + "/image";
    const std::set<Told> images(logged.at(topic).begin(), logged.at(topic).end());
    EXPECT_GE(viewer.told().at(topic).size(), 20U);
    for (const Told& image : viewer.told().at(topic)) EXPECT_TRUE(images.contains(image));
  }
}

TEST_F(LiveMessagesTest, NumbersOfChannelsStayWhenTheRobotChanges) {
  Viewer viewer;
  std::map<std::string, std::size_t> numbers;
  for (int session = 0; session < 2; ++session) {
    const NamedRobot backend("robot", {.history = 64, .queue = 64, .documents = documents()});
    viewer.find();
    const std::vector<log::LiveChannel>& channels = viewer.live().channels();
    for (std::size_t i = 0; i < channels.size(); ++i) {
      const auto [known, is_new] = numbers.emplace(channels[i].topic, i);
      EXPECT_EQ(known->second, i) << channels[i].topic;
    }
    auto robot = connect<FakeRobot>("robot");
    step(robot, 3);
    robot.finish();
    viewer.look_until_end();
  }
  EXPECT_TRUE(numbers.contains("/robot/sensor"));
  EXPECT_TRUE(viewer.live().channels()[numbers.at("/robot/tf_static")].is_latched);
  EXPECT_FALSE(viewer.live().channels()[numbers.at("/robot/tf")].is_latched);
}

}  // namespace
}  // namespace trifinger::test
