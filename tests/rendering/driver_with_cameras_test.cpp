// SPDX-License-Identifier: BSD-3-Clause
#include "trifinger/rendering/driver_with_cameras.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <memory>
#include <optional>
#include <utility>
#include <vector>

#include "rendering/scenes.hpp"
#include "support/message_of.hpp"
#include "trifinger/base/error.hpp"
#include "trifinger/joint/types.hpp"
#include "trifinger/rendering/options.hpp"
#include "trifinger/rendering/simulation_with_cameras.hpp"

namespace trifinger::rendering {
namespace {

using camera::CameraReader;
using ::testing::HasSubstr;

constexpr CaptureOptions kCapture{.period = 10, .delay = 4};

camera::Calibration small_cameras(const RobotDescription& description = {}) {
  camera::Calibration calibration = calibration_of_figures(description);
  for (camera::Camera& camera : calibration.cameras) camera = camera.reduced(6);
  return calibration;
}

using Robot = Frontend<TriFinger>;
using Cameras = SimulationWithCameras;

// The fingers move.
TimeIndex step(Robot& robot) {
  TriFinger::Action action;
  action.torque.fill(0.02);
  const TimeIndex t = robot.append_desired_action(action);
  robot.wait_until_time_index(t);
  return t;
}

Images copy(const camera::Images& images) {
  Images copied;
  for (std::size_t i = 0; i < images.cameras().size(); ++i) {
    const auto pixels = images.pixels(i);
    copied.bytes.emplace_back(pixels.begin(), pixels.end());
  }
  images.require_valid();
  return copied;
}

TEST(DriverWithCameras, ImagesShowTheSceneOfTheirCaptureAndArriveAfterTheDelay) {
  const camera::Calibration calibration = small_cameras();
  const RenderingOptions options{.seed = 7};
  const Cameras simulation({}, calibration, kCapture, options);
  CameraRenderer renderer({}, calibration.cameras, options);
  Robot robot = simulation.connect();
  const CameraReader cameras(robot);
  simulation.robot().push_object("cube", {0.5, 0, 0});

  // Image 0 is that before step 0; then there is one of every tenth step.
  std::vector<std::vector<double>> scenes{simulation.robot().configuration()};
  for (TimeIndex t = 0; t < 55; ++t) {
    // Captures of step t happen before y_t, so before the action of step t acts.
    if (t % kCapture.period == 0) scenes.push_back(simulation.robot().configuration());
    ASSERT_EQ(step(robot), t);
    const auto images = cameras.get_latest_at(t);
    ASSERT_TRUE(images.has_value());
    const TimeIndex arrived = t < kCapture.delay ? -1 : (t - kCapture.delay) / 10 * 10;
    EXPECT_EQ(images->stamp().capture_index, arrived);
    EXPECT_EQ(images->stamp().arrival_index, arrived < 0 ? -1 : arrived + kCapture.delay);
    const std::int64_t number = arrived < 0 ? 0 : 1 + arrived / 10;
    ASSERT_EQ(images->infos()[0].number, number);
    const Images expected = render(renderer, scenes[static_cast<std::size_t>(number)],
                                   static_cast<std::uint64_t>(number));
    ASSERT_EQ(copy(*images), expected) << "at step " << t;
  }
  EXPECT_NE(scenes.front(), scenes.back());
}

// All images and poses of a session.
std::vector<std::pair<TimeIndex, Images>> run_session(const Cameras& simulation, int steps) {
  std::vector<std::pair<TimeIndex, Images>> all;
  Robot robot = simulation.connect();
  const CameraReader cameras(robot);
  for (int i = 0; i < steps; ++i) {
    const TimeIndex t = step(robot);
    const auto images = cameras.get_latest_at(t);
    if (images && (all.empty() || all.back().first != images->stamp().capture_index)) {
      all.emplace_back(images->stamp().capture_index, copy(*images));
    }
  }
  return all;
}

TEST(DriverWithCameras, TheSameSeedAndActionsGiveTheSameSeriesInEverySession) {
  const RenderingOptions options{.read_noise = 3, .seed = 5};
  const Cameras one({}, small_cameras(), kCapture, options);
  const Cameras other({}, small_cameras(), kCapture, options);
  const auto first = run_session(one, 40);
  EXPECT_EQ(first.size(), 5U);
  EXPECT_EQ(first, run_session(other, 40));
  EXPECT_EQ(first, run_session(one, 40)) << "the next session begins in the same state";
  one.renderer().set_options({.read_noise = 3, .seed = 6});
  EXPECT_NE(first, run_session(one, 40));
}

TEST(DriverWithCameras, AfterResetAndRestoreImagesShowTheNewScene) {
  const Cameras simulation({}, small_cameras(), kCapture);
  const auto before = run_session(simulation, 20);
  simulation.robot().place_object("cube", {.position = {0.06, 0.02, 0.0325}});
  const SimulationState placed = simulation.robot().save();
  const auto moved = run_session(simulation, 20);
  EXPECT_NE(before, moved);
  simulation.robot().reset();
  EXPECT_EQ(before, run_session(simulation, 20));
  simulation.robot().restore(placed);
  EXPECT_EQ(moved, run_session(simulation, 20));
}

TEST(DriverWithCameras, EachEpisodeHasNoiseOfItsOwn) {
  const Cameras simulation({}, small_cameras(), kCapture);
  const auto session = [&](std::uint64_t seed, std::uint64_t episode) {
    simulation.robot().reset(simulation.robot().initial_position(),
                             Random{.seed = seed, .episode = episode});
    return run_session(simulation, 5);
  };
  const auto first = session(1, 2);
  EXPECT_NE(first, session(1, 3));
  EXPECT_NE(first, session(2, 2));
  EXPECT_EQ(first, session(1, 2));
}

TEST(CaptureQueue, IsOfTheNewestImagesThatHaveArrived) {
  const RobotDescription description;
  const std::vector<camera::Camera> cameras = small_cameras().cameras;
  const std::vector<double> scene = configuration(description, {0, 0, 0.0325});
  VisionPipeline pipeline({.description = description}, cameras, {}, nullptr);
  CaptureQueue captures({.period = 2, .delay = 1}, 1);
  captures.begin({});
  EXPECT_TRUE(captures.is_due(-1));
  captures.capture(-1, scene);
  EXPECT_FALSE(captures.is_due(-1));
  for (TimeIndex t = 0; t < 6; ++t) {
    EXPECT_EQ(captures.is_due(t), t % 2 == 0);
    if (captures.is_due(t)) captures.capture(t, scene);
  }
  EXPECT_TRUE(captures.look(4, pipeline));
  EXPECT_EQ(captures.images().capture_index, 2) << "that of step 4 arrives at step 5";
  EXPECT_EQ(captures.images().number, 2);
  EXPECT_FALSE(captures.look(4, pipeline));
  EXPECT_TRUE(captures.look(5, pipeline));
  EXPECT_EQ(captures.images().capture_index, 4);
  EXPECT_FALSE(captures.take_poses(5));
}

// Fails once, then finds the object.
class Forgetful final : public ObjectFinder {
 public:
  void find(std::span<const std::span<const std::byte>>,
            std::span<std::optional<ObjectPose>> poses) override {
    if (!std::exchange(has_failed_, true)) throw Error("the lens cap is on");
    poses[0].emplace();
  }

 private:
  bool has_failed_{false};
};

TEST(CaptureQueue, ImagesAtWhichNobodyCouldLookDidNotArrive) {
  const RobotDescription description;
  VisionPipeline pipeline({.description = description}, small_cameras().cameras, {},
                          std::make_unique<Forgetful>());
  CaptureQueue captures({.period = 2, .delay = 0}, 1);
  captures.begin({});
  captures.capture(0, configuration(description, {0, 0, 0.0325}));
  EXPECT_THROW((void)captures.look(0, pipeline), Error);
  EXPECT_EQ(captures.images().number, -1);
  EXPECT_FALSE(captures.take_poses(0));
  EXPECT_TRUE(captures.look(0, pipeline));
  EXPECT_EQ(captures.images().number, 0);
  EXPECT_TRUE(captures.take_poses(0));
}

TEST(ObjectFinder, RefusesObjectsWhoseOrientationNoImageShows) {
  RobotDescription description;
  EXPECT_NE(make_object_finder(description.objects, small_cameras().cameras), nullptr);
  description.objects[0].colours.fill("red");
  EXPECT_THAT(test::message_of<InvalidArgument>(
                  [&] { (void)make_object_finder(description.objects, small_cameras().cameras); }),
              HasSubstr("cube looks the same after 23 different turns"));
}

TEST(Varied, StaysInTheRangesThatAreAllowed) {
  RenderingOptions nominal = rendering_options({.gain = 48});
  nominal.lamp_power = nominal.ambient_power = 9;
  nominal.light_colour = {10, 10, 10};
  nominal.read_noise = nominal.shot_noise = 90;
  EXPECT_NO_THROW(nominal.validate()) << "48 dB are a gain that a camera may have";
  nominal.gain = 999;
  Random random{.seed = 1};
  for (int i = 0; i < 100; ++i) {
    ASSERT_NO_THROW(varied(nominal, random).validate());
    ASSERT_NO_THROW(RenderingVariation{}.draw(nominal, random).validate());
  }
}

TEST(Varied, DustAndColoursDifferWhereCamerasStay) {
  const RenderingOptions nominal{.calibration_error = 2, .calibration_seed = 5};
  Random random{.seed = 1};
  const RenderingOptions first = varied(nominal, random);
  const RenderingOptions second = varied(nominal, random);
  EXPECT_NE(first.seed, second.seed);
  CameraRenderer renderer({}, small_cameras().cameras, first);
  const Eigen::Vector3d place = renderer.true_cameras()[0].pose.translation();
  EXPECT_NE(place, renderer.cameras()[0].pose.translation());
  renderer.set_options(second);
  EXPECT_EQ(place, renderer.true_cameras()[0].pose.translation());
  renderer.set_options({.calibration_error = 2, .calibration_seed = 6});
  EXPECT_NE(place, renderer.true_cameras()[0].pose.translation());
}

// Finds the object where a test says it is; it counts what it was shown.
class Finder final : public ObjectFinder {
 public:
  struct Answers {
    int shown{0};
    int first_sights{0};  // in which no earlier pose was known
    int fails_at{-1};
    std::size_t bytes{0};
  };
  explicit Finder(std::shared_ptr<Answers> answers) : answers_(std::move(answers)) {}

  void find(std::span<const std::span<const std::byte>> images,
            std::span<std::optional<ObjectPose>> poses) override {
    answers_->bytes = images[0].size();
    if (!poses[0]) ++answers_->first_sights;
    poses[0] = ObjectPose{.position = {0.001 * answers_->shown, 0, 0}};
    if (answers_->shown++ == answers_->fails_at) poses[0].reset();
  }

 private:
  std::shared_ptr<Answers> answers_;
};

TEST(DriverWithCameras, PosesAreThoseThatTheFinderFoundInImagesOfThatTime) {
  const auto answers = std::make_shared<Finder::Answers>();
  answers->fails_at = 3;
  const Cameras simulation({}, small_cameras(), {.period = 10, .delay = 4, .pose_delay = 17}, {},
                           std::make_unique<Finder>(answers));
  Robot robot = simulation.connect();
  const Companion<CubeObservation> objects(robot.companion(kObjectCompanion));
  for (TimeIndex t = 0; t < 100; ++t) {
    step(robot);
    const std::optional<CubeObservation> object = objects.get_latest_at(t);
    ASSERT_TRUE(object.has_value());
    TimeIndex captured = t < 17 ? -1 : (t - 17) / 10 * 10;
    // Image 3, that of step 20, shows no object: the pose before it is the newest one.
    if (captured == 20) captured = 10;
    EXPECT_EQ(object->stamp.capture_index, captured);
    EXPECT_EQ(object->stamp.arrival_index, captured < 0 ? -1 : captured + 17);
    const TimeIndex number = captured < 0 ? 0 : 1 + captured / 10;
    EXPECT_NEAR(object->cube.position[0], 0.001 * static_cast<double>(number), 1e-12);
  }
  EXPECT_EQ(answers->bytes, small_cameras().cameras[0].format.size());
  EXPECT_EQ(answers->first_sights, 2) << "at the beginning, and after image 3";
}

class Failing final : public ObjectFinder {
 public:
  void find(std::span<const std::span<const std::byte>>,
            std::span<std::optional<ObjectPose>> poses) override {
    if (++count_ > 2) throw Error("the lens cap is on");
    poses[0].emplace();
  }

 private:
  int count_{0};
};

TEST(DriverWithCameras, AnExceptionOfTheFinderEndsTheSessionWithAFault) {
  const Cameras simulation({}, small_cameras(), kCapture, {}, std::make_unique<Failing>());
  Robot robot = simulation.connect();
  const std::string text = test::message_of<RobotStopped>([&] {
    for (int i = 0; i < 50; ++i) step(robot);
  });
  EXPECT_THAT(text,
              HasSubstr("drawing or reading an image threw an exception: the lens cap is on"));
}

TEST(DriverWithCameras, RefusesWhatMakesNoSense) {
  const auto message = [](const CaptureOptions& capture) {
    return test::message_of<InvalidArgument>([&] { Cameras({}, small_cameras(), capture); });
  };
  EXPECT_THAT(message({.period = 0}), HasSubstr("period is 0 steps, must be 1 to 100000"));
  EXPECT_THAT(message({.delay = -1}), HasSubstr("delay is -1 steps, must be 0 to"));
  EXPECT_THAT(message({.delay = 5, .pose_delay = 4}),
              HasSubstr("pose_delay is 4 steps, must be 5, that is delay, to"));
}

}  // namespace
}  // namespace trifinger::rendering
