// SPDX-License-Identifier: BSD-3-Clause
#include "trifinger/camera/images.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "camera/cameras_of_tests.hpp"
#include "camera/feed.hpp"
#include "core/fake_robot.hpp"
#include "support/message_of.hpp"
#include "support/session_folder.hpp"
#include "trifinger/core/backend.hpp"
#include "trifinger/core/sensor.hpp"

// A robot with cameras in another process. Here both are in one.

namespace trifinger::test {
namespace {

using namespace std::chrono_literals;
using camera::Camera;
using camera::CameraLost;
using camera::Frame;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

// A robot with three cameras, whose clock only the test moves.
class Rig {
 public:
  Rig() = default;
  ~Rig() { robot.reset(); }
  Rig(const Rig&) = delete;
  Rig& operator=(const Rig&) = delete;

  static std::vector<Document> documents(const std::vector<Camera>& cameras) {
    const camera::Calibration calibration{.date = {}, .residual = 0, .cameras = cameras};
    return {{camera::kDocument, "application/yaml", calibration.text()}};
  }
  TimeIndex step() {
    clock.advance(1ms);
    const TimeIndex t = robot->append_desired_action({});
    robot->wait_until_time_index(t);
    return t;
  }

  SessionFolder folder;
  std::vector<Camera> cameras = three_cameras();
  ManualClock clock;
  DriverWithSensors driver{std::make_unique<FakeDriver>(FakeDriver::Options{}),
                           "robot",
                           {camera::camera_companion(cameras)}};
  SessionHost host{SessionHost::named("robot", {.documents = documents(cameras)})};
  Backend backend{driver, host, {.mode = BackendOptions::Mode::kNonRealTime}, clock};
  std::optional<Frontend<FakeRobot>> robot{backend};
};

Frame good(std::int64_t number, Instant time) {
  return {.state = Frame::State::kGood, .number = number, .time = time, .exposure = 1500us};
}

// Writes images of these states; those that are good have the pattern of `number`.
void write(camera::CameraSensor& sensor, std::int64_t number, Instant time,
           const std::array<Frame::State, 3>& states = {Frame::State::kGood, Frame::State::kGood,
                                                        Frame::State::kGood}) {
  const auto places = sensor.begin();
  std::array<Frame, 3> frames;
  for (std::size_t i = 0; i < 3; ++i) {
    if (states[i] == Frame::State::kGood) fill_pattern(places[i], i, number);
    frames[i] = good(number, time);
    frames[i].state = states[i];
    if (states[i] != Frame::State::kGood && states[i] != Frame::State::kDamaged) frames[i] = {};
    frames[i].state = states[i];
  }
  sensor.write(frames);
}

// Waits until the robot has found the cameras' process.
void await_cameras(DriverWithSensors& driver) {
  for (std::string text; text.find("delivers") == std::string::npos;) {
    for (const std::string& message : driver.take_messages()) text += message;
  }
}

TEST(Images, OfACameraAreWhereTheElementSays) {
  Rig rig;
  camera::CameraSensor sensor("robot", rig.cameras);
  await_cameras(rig.driver);
  const camera::CameraReader reader(*rig.robot);
  EXPECT_EQ(reader.calibration().cameras.size(), 3U);
  for (std::int64_t i = 0; i < 20; ++i) {
    const Instant captured = rig.clock.now() - 3ms;
    write(sensor, i, captured);
    const TimeIndex t = rig.step();
    const std::optional<camera::Images> images = reader.get_latest_at(t);
    ASSERT_TRUE(images);
    EXPECT_EQ(images->stamp().capture_time, captured.time_since_epoch().count());
    EXPECT_EQ(images->stamp().arrival_index, t);
    for (std::size_t c = 0; c < 3; ++c) {
      EXPECT_TRUE(has_pattern(images->pixels(c), c, i));
      EXPECT_TRUE(has_pattern(images->pixels(rig.cameras[c].name), c, i));
      EXPECT_EQ(images->infos()[c].number, i);
      EXPECT_EQ(images->infos()[c].exposure, 1'500'000);
      EXPECT_EQ(images->infos()[c].frame().state, Frame::State::kGood);
    }
    EXPECT_TRUE(images->is_valid());
    EXPECT_EQ(reader.latest()->infos()[0].number, i);
  }
  EXPECT_EQ(
      message_of<InvalidArgument>([&] { static_cast<void>(reader.latest()->pixels("camera6")); }),
      "there is no camera 'camera6'; there are camera60, camera180, camera300");
  // The element stays, the pixels do not.
  EXPECT_EQ(reader.get_latest_at(0)->infos()[0].number, 0);
  EXPECT_THROW(static_cast<void>(reader.get_latest_at(0)->pixels(0)), HistoryLost);
}

TEST(LiveCameras, SeeImagesWhileTheRobotHoldsItsPose) {
  Rig rig;
  camera::LiveCameras live("robot", rig.cameras);
  EXPECT_FALSE(live.next(0ms));
  for (int life = 0; life < 2; ++life) {
    camera::CameraSensor sensor("robot", rig.cameras);
    for (std::int64_t i = 0; i < 3; ++i) {
      write(sensor, i, rig.clock.now());
      const auto images = live.next(kForever);
      ASSERT_TRUE(images);
      EXPECT_TRUE(has_pattern(images->pixels("camera180"), 1, i));
      EXPECT_FALSE(live.next(1ms));  // it has seen these
    }
  }
}

TEST(Images, fault_51_ACameraThatIsUnpluggedHasNoImageInsteadOfAnOldOne) {
  using enum Frame::State;
  Rig rig;
  camera::CameraSensor sensor("robot", rig.cameras);
  await_cameras(rig.driver);
  const camera::CameraReader reader(*rig.robot);
  write(sensor, 0, rig.clock.now());
  rig.step();
  write(sensor, 1, rig.clock.now(), {kGood, kLost, kGood});
  auto images = reader.get_latest_at(rig.step());
  EXPECT_TRUE(has_pattern(images->pixels("camera60"), 0, 1));
  EXPECT_TRUE(has_pattern(images->pixels("camera300"), 2, 1));
  EXPECT_EQ(message_of<CameraLost>([&] { static_cast<void>(images->pixels("camera180")); }),
            "camera180 is not there: unplugged, or without power");
  // All of them: there is an element that says so, and no pixels at all.
  write(sensor, 2, rig.clock.now(), {kLost, kLost, kLost});
  images = reader.get_latest_at(rig.step());
  for (const Camera& camera : rig.cameras) {
    EXPECT_THROW(static_cast<void>(images->pixels(camera.name)), CameraLost);
  }
  EXPECT_EQ(images->infos()[1].number, 0);  // the last one that came
}

TEST(Images, fault_52_ImagesThatWereDroppedAreCounted) {
  Rig rig;
  camera::CameraSensor sensor("robot", rig.cameras);
  await_cameras(rig.driver);
  const camera::CameraReader reader(*rig.robot);
  for (const std::int64_t number : {0, 1, 4, 5, 9}) write(sensor, number, rig.clock.now());
  auto images = reader.get_latest_at(rig.step());
  EXPECT_EQ(images->infos()[0].missed, 5U);
  write(sensor, 10, rig.clock.now(),
        {Frame::State::kNone, Frame::State::kGood, Frame::State::kGood});
  images = reader.get_latest_at(rig.step());
  EXPECT_EQ(message_of<CameraLost>([&] { static_cast<void>(images->pixels(0)); }),
            "no image of camera60 has come: it is late or was lost");
  write(sensor, 11, rig.clock.now());
  images = reader.get_latest_at(rig.step());
  EXPECT_EQ(images->infos()[0].missed, 6U);  // known by the gap
  EXPECT_EQ(images->infos()[1].missed, 5U);
}

TEST(Images, fault_52_TimesOfElementsNeverGoBack) {
  using enum Frame::State;
  Rig rig;
  camera::CameraSensor sensor("robot", rig.cameras);
  await_cameras(rig.driver);
  const camera::CameraReader reader(*rig.robot);
  const Instant begin = rig.clock.now();
  const auto captured = [&] {
    return Instant(Nanoseconds(reader.get_latest_at(rig.step())->stamp().capture_time));
  };
  write(sensor, 0, begin);
  EXPECT_EQ(captured(), begin);
  // Nothing newer is known while there are no images, and none is from before the last one.
  write(sensor, 1, begin, {kLost, kLost, kLost});
  EXPECT_EQ(captured(), begin);
  write(sensor, 2, begin + 2ms);
  EXPECT_EQ(captured(), begin + 2ms);
  write(sensor, 3, begin + 1ms);
  EXPECT_EQ(captured(), begin + 2ms);
}

TEST(Images, fault_51_OfAProcessThatHasEndedAreNotValid) {
  Rig rig;
  std::optional<camera::CameraSensor> sensor(std::in_place, "robot", rig.cameras);
  await_cameras(rig.driver);
  const camera::CameraReader reader(*rig.robot);
  write(*sensor, 0, rig.clock.now());
  const TimeIndex t = rig.step();
  sensor.reset();
  const std::optional<camera::Images> images = reader.get_latest_at(t);
  EXPECT_EQ(images->infos()[0].frame().state, Frame::State::kGood);
  EXPECT_FALSE(images->is_valid());
  EXPECT_THROW(images->require_valid(), HistoryLost);
  EXPECT_THAT(message_of<HistoryLost>([&] { static_cast<void>(images->pixels(0)); }),
              HasSubstr("the pixels of camera60 have been overwritten by newer images, or their "
                        "process has ended"));
}

TEST(Images, fault_53_ADamagedImageIsNotShown) {
  Rig rig;
  camera::CameraSensor sensor("robot", rig.cameras);
  await_cameras(rig.driver);
  const camera::CameraReader reader(*rig.robot);
  write(sensor, 0, rig.clock.now(),
        {Frame::State::kGood, Frame::State::kGood, Frame::State::kDamaged});
  const auto images = reader.get_latest_at(rig.step());
  EXPECT_EQ(message_of<CameraLost>([&] { static_cast<void>(images->pixels("camera300")); }),
            "the image of camera300 is damaged");
  EXPECT_EQ(images->infos()[2].missed, 1U);
  EXPECT_TRUE(has_pattern(images->pixels("camera60"), 0, 0));
}

TEST(Images, OfOtherSizesAreRefusedByTheRobot) {
  const SessionFolder folder;
  const camera::CameraSensor sensor("robot", three_cameras(camera::PixelFormat::kBayerRg8, 16));
  DriverWithSensors driver(std::make_unique<FakeDriver>(FakeDriver::Options{}), "robot",
                           {camera::camera_companion(three_cameras())});
  std::vector<std::string> messages;
  while (messages.empty()) messages = driver.take_messages();
  EXPECT_THAT(messages.front(), ::testing::AllOf(HasSubstr("sensor 'cameras' is refused"),
                                                 HasSubstr("camera60 uint8[16,16]"),
                                                 HasSubstr("camera60 uint8[32,32]")));
}

TEST(Images, AreDescribedByTheNamesOfTheirCameras) {
  const std::vector<Camera> cameras = three_cameras(camera::PixelFormat::kRgb8);
  const ElementDescription element = camera::image_elements(cameras);
  EXPECT_EQ(element.size(), sizeof(camera::CameraImages<3>));
  ASSERT_NE(element.find("camera180.state"), nullptr);
  EXPECT_EQ(element.find("camera180.number")->offset,
            offsetof(camera::CameraImages<3>, images) + sizeof(camera::ImageInfo));
  EXPECT_THAT(camera::image_payload(cameras).text(), HasSubstr("camera300 uint8[32,32,3] rgb8\n"));
  auto wrong = cameras;
  wrong[0].name = "camera.60";
  EXPECT_THROW(static_cast<void>(camera::image_elements(wrong)), InvalidArgument);
  wrong[0].name = "camera180";
  EXPECT_THROW(static_cast<void>(camera::image_elements(wrong)), InvalidArgument);
}

TEST(Images, OfARobotWithoutCamerasAreAnError) {
  const SessionFolder folder;
  FakeDriver driver{FakeDriver::Options{}};
  SessionHost host = SessionHost::named("robot");
  Backend backend(driver, host, {.mode = BackendOptions::Mode::kNonRealTime});
  const Frontend<FakeRobot> robot(backend);
  EXPECT_EQ(message_of<InvalidArgument>(
                [&] { static_cast<void>(camera::calibration_of(robot.session())); }),
            "robot 'robot' has no cameras; its configuration needs a section 'cameras'");
}

// ---- the process of the cameras ----

// Delivers what a script says.
class ScriptedSource final : public camera::Source {
 public:
  using Shot = std::array<Frame, 3>;

  explicit ScriptedSource(const std::vector<Camera>& cameras) {
    for (const Camera& camera : cameras) {
      names_.push_back(camera.name);
      formats_.push_back(camera.format);
    }
  }
  [[nodiscard]] const std::vector<std::string>& names() const noexcept override { return names_; }
  [[nodiscard]] const std::vector<camera::ImageFormat>& formats() const noexcept override {
    return formats_;
  }
  [[nodiscard]] bool grab(std::span<const std::span<std::byte>> images, std::span<Frame> frames,
                          Timeout timeout) override {
    longest_timeout = std::max(longest_timeout, timeout);
    if (next_ == shots.size()) return false;
    if (!shots[next_]) {
      ++next_;
      std::this_thread::sleep_for(timeout);
      for (const std::size_t camera : lost_in_silence) frames[camera].state = Frame::State::kLost;
      return false;
    }
    for (std::size_t i = 0; i < 3; ++i) {
      frames[i] = (*shots[next_])[i];
      fill_pattern(images[i], i, frames[i].number);
    }
    ++next_;
    return true;
  }
  [[nodiscard]] bool has_ended() const noexcept override { return next_ == shots.size(); }

  // Nothing: no image comes as long as the caller waits.
  std::vector<std::optional<Shot>> shots;
  std::vector<std::size_t> lost_in_silence;
  Timeout longest_timeout{0};

 private:
  std::vector<std::string> names_;
  std::vector<camera::ImageFormat> formats_;
  std::size_t next_{0};
};

// Shots at 100 Hz, with changes.
ScriptedSource::Shot shot(std::int64_t number, Nanoseconds second_is_later = 0ns) {
  const Instant time = Instant(1s) + number * 10ms;
  return {good(number, time), good(number, time + second_is_later), good(number, time)};
}

std::vector<std::string> messages_of(const std::vector<std::optional<ScriptedSource::Shot>>& shots,
                                     camera::FeedStatistics* statistics = nullptr,
                                     const std::vector<std::size_t>& lost_in_silence = {}) {
  const SessionFolder folder;
  const std::vector<Camera> cameras = three_cameras();
  ScriptedSource source(cameras);
  source.shots = shots;
  source.lost_in_silence = lost_in_silence;
  camera::CameraFeed feed(source, "robot", cameras, 10ms);
  std::vector<std::string> messages;
  for (bool goes_on = true; goes_on;) {
    goes_on = feed.step();
    for (const std::string& sentence : feed.take_messages()) messages.push_back(sentence);
  }
  if (statistics != nullptr) *statistics = feed.statistics();
  return messages;
}

TEST(CameraFeed, IsSilentWhileAllIsWell) {
  camera::FeedStatistics statistics;
  EXPECT_THAT(messages_of({shot(0), shot(1), shot(2, 100us), shot(3)}, &statistics), IsEmpty());
  EXPECT_EQ(statistics.elements, 4);
  EXPECT_EQ(statistics.cameras[1].good, 4);
  EXPECT_EQ(statistics.largest_skew, 100us);
  EXPECT_EQ(statistics.duration, 30ms);
}

TEST(CameraFeed, fault_51_SaysThatACameraIsLostAndThatItIsBack) {
  auto first = shot(1);
  auto second = shot(2);
  first[2] = second[2] = {.state = Frame::State::kLost};
  EXPECT_THAT(messages_of({shot(0), first, second, shot(3)}),
              ElementsAre("camera300 is lost; the others go on", "camera300 delivers again",
                          "2 images of camera300 were lost or damaged"));
}

TEST(CameraFeed, fault_51_SaysThatACameraIsBackThatDeliversALittleLater) {
  auto lost = shot(1);
  auto silent = shot(2);
  lost[2] = {.state = Frame::State::kLost};
  silent[2] = {};
  EXPECT_THAT(messages_of({shot(0), lost, silent, shot(3)}),
              ElementsAre("camera300 is lost; the others go on", "camera300 delivers again",
                          "2 images of camera300 were lost or damaged"));
}

TEST(CameraFeed, fault_51_DoesNotCallALostCameraLate) {
  const auto first_messages = [](const std::vector<std::size_t>& lost) {
    auto messages = messages_of({shot(0), std::nullopt, shot(1)}, nullptr, lost);
    messages.resize(3);
    return messages;
  };
  EXPECT_THAT(first_messages({0, 1, 2}),
              ElementsAre("camera60 is lost", "camera180 is lost", "camera300 is lost"));
  EXPECT_THAT(first_messages({1}),
              ElementsAre(HasSubstr("no images of camera60 come"), "camera180 is lost",
                          HasSubstr("no images of camera300 come")));
}

TEST(CameraFeed, fault_52_WaitsForImagesAsTheirRateSaysAndLetsOthersWorkMeanwhile) {
  const SessionFolder folder;
  const std::vector<Camera> cameras = three_cameras();
  ScriptedSource source(cameras);
  source.shots = {shot(0), std::nullopt, std::nullopt, std::nullopt, shot(1)};
  camera::CameraFeed feed(source, "robot", cameras, 10s);
  while (feed.step()) {
  }
  EXPECT_THAT(feed.take_messages(), IsEmpty());
  EXPECT_EQ(feed.statistics().elements, 2);
  EXPECT_LE(source.longest_timeout, 100ms);
}

TEST(CameraFeed, fault_52_SaysThatNoImagesCome) {
  camera::FeedStatistics statistics;
  EXPECT_THAT(
      messages_of({shot(0), std::nullopt, std::nullopt, shot(1)}, &statistics),
      ElementsAre(HasSubstr("no images of camera60 come"), HasSubstr("no images of camera180 come"),
                  HasSubstr("no images of camera300 come"), "camera60 delivers again",
                  "camera180 delivers again", "camera300 delivers again"));
  EXPECT_EQ(statistics.cameras[0].missing, 2);
}

TEST(CameraFeed, fault_52_NamesACameraThatIsLateForLongAndCountsSingleImages) {
  std::vector<std::optional<ScriptedSource::Shot>> shots;
  for (std::int64_t i = 0; i < 40; ++i) {
    auto images = shot(i);
    // One drops every tenth image, the other one twenty in a row.
    if (i % 10 == 5) images[0] = {};
    if (i >= 10 && i < 30) images[1] = {};
    shots.emplace_back(images);
  }
  EXPECT_THAT(messages_of(shots),
              ElementsAre("no images of camera180 come: it is late or loses them",
                          "camera180 delivers again", "4 images of camera60 were lost or damaged",
                          "20 images of camera180 were lost or damaged"));
}

TEST(CameraFeed, fault_54_TellsHowFarApartImagesWere) {
  camera::FeedStatistics statistics;
  EXPECT_THAT(messages_of({shot(0, 100us), shot(1, -2ms), shot(2)}, &statistics), IsEmpty());
  EXPECT_EQ(statistics.largest_skew, 2ms);
}

TEST(CameraFeed, fault_54_NamesACameraThatIsOutOfStep) {
  EXPECT_THAT(messages_of({shot(0), shot(1, 4ms), shot(2, 4ms), shot(3)}),
              ElementsAre("camera180 is out of step: its image is 4 ms later than those of the "
                          "others",
                          "camera180 is in step again"));
  EXPECT_THAT(messages_of({shot(0, -4ms)}),
              ElementsAre(HasSubstr("camera180 is out of step: its image "
                                    "is 4 ms earlier")));
}

TEST(CameraFeed, fault_54_RefusesASourceWithCamerasInAnotherOrder) {
  const SessionFolder folder;
  std::vector<Camera> cameras = three_cameras();
  ScriptedSource source(cameras);
  std::swap(cameras[0], cameras[1]);
  EXPECT_EQ(
      message_of<InvalidArgument>([&] { camera::CameraFeed(source, "robot", cameras, 10ms); }),
      "the source has the cameras camera60, camera180, camera300, the robot has camera180, "
      "camera60, camera300");
  EXPECT_THAT(message_of<InvalidArgument>([&] {
                camera::CameraFeed(source, "robot", three_cameras(camera::PixelFormat::kRgb8),
                                   10ms);
              }),
              HasSubstr("images of camera60 have 32 x 32 pixels in bayer_rggb8, the robot expects "
                        "32 x 32 in rgb8"));
}

}  // namespace
}  // namespace trifinger::test
