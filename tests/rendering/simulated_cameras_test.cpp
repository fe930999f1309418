// SPDX-License-Identifier: BSD-3-Clause
#include "rendering/simulated_cameras.hpp"

#include <gtest/gtest.h>

#include <atomic>
#include <chrono>
#include <cstring>
#include <memory>
#include <string>
#include <thread>
#include <vector>

#include "camera/source_contract.hpp"
#include "rendering/scenes.hpp"
#include "sim/scene_observation.hpp"
#include "sim/simulated_plant.hpp"
#include "support/session_folder.hpp"
#include "trifinger/core/backend.hpp"
#include "trifinger/core/frontend.hpp"
#include "trifinger/joint/types.hpp"
#include "trifinger/sim/simulated_robot.hpp"

namespace trifinger::rendering {
namespace {

using namespace std::chrono_literals;
using camera::Frame;
using test::SourceContract;

constexpr TimeIndex kScenePeriod = 10;

std::vector<camera::Camera> small_cameras() { return cameras(RobotDescription{}, 6); }

// An element of the companion "scene".
struct SceneElement {
  Stamp stamp;
  std::vector<double> configuration;
};

std::vector<SceneElement> scenes_of(const UntypedFrontend& scenes) {
  std::vector<SceneElement> all;
  const auto [first, end] = scenes.range(Series::kObservation);
  std::vector<std::byte> element(scenes.session().element(Series::kObservation).size());
  for (TimeIndex i = first; i < end; ++i) {
    scenes.get(Series::kObservation, i, element.data(), Nanoseconds::zero());
    SceneElement found{.stamp = {},
                       .configuration = std::vector<double>(configuration_size(RobotModel()))};
    std::memcpy(&found.stamp, element.data(), sizeof(Stamp));
    std::memcpy(found.configuration.data(), element.data() + sizeof(Stamp),
                std::span(found.configuration).size_bytes());
    all.push_back(std::move(found));
  }
  return all;
}

// Takes control as soon as the back-end has begun a session.
std::unique_ptr<Frontend<TriFinger>> connect_soon() {
  while (true) {
    try {
      return std::make_unique<Frontend<TriFinger>>("robot", FrontendOptions{});
    } catch (const SessionNotFound&) {
      std::this_thread::yield();
    }
  }
}

// A simulated robot in a thread, as another process has it. The test gives its actions.
class Rig {
 public:
  void act(int steps) const {
    TriFinger::Action action;
    action.torque.fill(0.02);
    TimeIndex t = -1;
    for (int i = 0; i < steps; ++i) t = robot->append_desired_action(action);
    robot->wait_until_time_index(t + 1);  // what follows the last action
  }

  test::SessionFolder folder;
  SimulatedRobot driver{{.scene_period = kScenePeriod}};
  SessionHost host{SessionHost::named("robot")};
  Backend backend{driver, host};
  BackendThread thread{backend};
  std::unique_ptr<Frontend<TriFinger>> robot{connect_soon()};
};

struct Grabbed {
  bool is_new{false};
  Images images;
  std::vector<Frame> frames;
};

Grabbed grab(SimulatedCameras& source, Timeout timeout = kForever) {
  Grabbed grabbed;
  std::vector<std::span<std::byte>> places;
  places.reserve(source.formats().size());
  for (const camera::ImageFormat& format : source.formats()) {
    grabbed.images.bytes.emplace_back(format.size());
  }
  for (auto& bytes : grabbed.images.bytes) places.emplace_back(bytes);
  grabbed.frames.resize(places.size());
  grabbed.is_new = source.grab(places, grabbed.frames, timeout);
  return grabbed;
}

test::SourceUnderTest make_simulated_cameras() {
  return {.world = std::make_shared<Rig>(),
          .source = std::make_unique<SimulatedCameras>("robot", SimulationOptions{},
                                                       small_cameras(), 5ms, plain())};
}

// While the robot holds its pose. A program that moves it is in the tests below.
INSTANTIATE_TEST_SUITE_P(Simulated, SourceContract, ::testing::Values(&make_simulated_cameras));

TEST(SimulatedCameras, ShowTheSceneOfTheRobotsStepAndHaveItsTime) {
  Rig rig;
  const RenderingOptions options{.seed = 3};
  SimulatedCameras source("robot", {}, small_cameras(), 1ms, options);
  CameraRenderer renderer({}, small_cameras(), options);
  EXPECT_EQ(source.names(), (std::vector<std::string>{"camera60", "camera180", "camera300"}));
  const UntypedFrontend scenes = UntypedFrontend("robot", {.control = false}).companion("scene");
  Frame last{};
  for (int round = 0; round < 5; ++round) {
    rig.act(2 * kScenePeriod);  // so a scene is new
    const Grabbed grabbed = grab(source);
    ASSERT_TRUE(grabbed.is_new);
    const SceneElement newest = scenes_of(scenes).back();
    EXPECT_EQ(newest.stamp.capture_index % kScenePeriod, 0);
    for (const Frame& frame : grabbed.frames) {
      EXPECT_EQ(frame.state, Frame::State::kGood);
      EXPECT_EQ(frame.time.time_since_epoch().count(), newest.stamp.capture_time);
      EXPECT_EQ(frame.exposure, options.exposure);
      EXPECT_GT(frame.number, last.number);
      EXPECT_GT(frame.time, last.time);
    }
    last = grabbed.frames[0];
    EXPECT_EQ(grabbed.images,
              render(renderer, newest.configuration, static_cast<std::uint64_t>(last.number)));
  }
}

TEST(SimulatedCameras, ScenesThatCameWhileDrawingAreLeftOutAndCounted) {
  Rig rig;
  SimulatedCameras source("robot", {}, small_cameras(), 10ms);
  rig.act(1);
  const Grabbed first = grab(source);
  // The time of a scene is that of the monotonic clock, so this time passes in any case.
  const Instant until = first.frames[0].time + 35ms;
  while (Instant(std::chrono::steady_clock::now()) < until) std::this_thread::yield();
  rig.act(2 * kScenePeriod);
  const Grabbed second = grab(source);
  const auto passed = second.frames[0].time - first.frames[0].time;
  const std::int64_t steps = second.frames[0].number - first.frames[0].number;
  EXPECT_NEAR(std::chrono::duration<double>(passed) / 10ms, static_cast<double>(steps), 0.51);
  EXPECT_GE(steps, 3);
  EXPECT_EQ(source.num_dropped(), steps - 1);
}

TEST(SimulatedCameras, GoOnWhileTheRobotHoldsItsPose) {
  Rig rig;
  SimulatedCameras source("robot", {}, small_cameras(), 1ms, plain());
  const Grabbed first = grab(source);
  const Grabbed second = grab(source);
  const Grabbed third = grab(source);
  EXPECT_TRUE(third.is_new);
  EXPECT_LT(first.frames[0].time, second.frames[0].time);
  EXPECT_LT(second.frames[0].number, third.frames[0].number);
  EXPECT_EQ(first.images, third.images) << "nothing moves";
}

TEST(SimulatedCameras, WaitForARobotAndForItsNextSession) {
  const test::SessionFolder folder;
  SimulatedCameras source("robot", {}, small_cameras(), 1ms);
  EXPECT_FALSE(grab(source, Nanoseconds::zero()).is_new) << "there is no robot";
  EXPECT_FALSE(grab(source, 30ms).is_new);

  SimulatedRobot driver({.scene_period = kScenePeriod});
  SessionHost host = SessionHost::named("robot");
  Backend backend(driver, host);
  const BackendThread thread(backend);
  std::int64_t last = -1;
  for (int session = 0; session < 3; ++session) {
    // Each front-end has a session of its own.
    const auto robot = connect_soon();
    robot->wait_until_time_index(robot->append_desired_action({}));
    const Grabbed grabbed = grab(source);
    ASSERT_TRUE(grabbed.is_new);
    EXPECT_GT(grabbed.frames[0].number, last);
    last = grabbed.frames[0].number;
    robot->finish();
  }
  EXPECT_FALSE(source.has_ended());
}

TEST(SimulatedCameras, SeeWhatAnEmulatorSaysAboutItsPlant) {
  const test::SessionFolder folder;
  SimulatedPlant plant({});
  SimulatedScene scene("robot", plant, 10ms);
  DriverWithSensors driver(std::make_unique<SimulatedRobot>(), "robot",
                           {scene_companion(plant.model())});
  SessionHost host = SessionHost::named("robot");
  Backend backend(driver, host);
  const BackendThread thread(backend);
  const auto robot = connect_soon();
  SimulatedCameras source("robot", {}, small_cameras(), 1ms, plain());
  CameraRenderer renderer({}, small_cameras(), plain());
  JointVector<9> torque{};
  torque.fill(0.05);
  std::atomic<bool> is_seen{false};
  // The emulator writes, the robot's loop polls, the cameras draw what arrives.
  std::thread emulator([&] {
    while (!is_seen) {
      plant.step(torque);
      scene.tick(std::chrono::steady_clock::now());
      robot->wait_until_time_index(robot->append_desired_action({}));
    }
  });
  Grabbed first = grab(source);
  Grabbed second = grab(source);
  while (second.images == first.images) second = grab(source);
  is_seen = true;
  emulator.join();
  EXPECT_GT(second.frames[0].time, first.frames[0].time);
}

}  // namespace
}  // namespace trifinger::rendering
