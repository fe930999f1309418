// SPDX-License-Identifier: BSD-3-Clause
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <filesystem>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <thread>
#include <vector>

#include "camera/cameras_of_tests.hpp"
#include "camera/image_file.hpp"
#include "camera/source_contract.hpp"
#include "log/copy.hpp"
#include "log/image_source.hpp"
#include "log/logged_images.hpp"
#include "log/recordings.hpp"
#include "log/repair.hpp"
#include "log/replay.hpp"
#include "log/seeing_robot.hpp"
#include "support/folder.hpp"
#include "support/message_of.hpp"
#include "trifinger/camera/pixels.hpp"
#include "trifinger/log/log.hpp"
#include "trifinger/mcap/reader.hpp"

// The images of a session on their way into a log and out of it.

namespace trifinger::test {
namespace {

using namespace std::chrono_literals;
using camera::CameraLost;
using camera::Frame;
using log::ImageStorage;
using log::Log;
using log::LoggedCameras;
using log::LoggedImages;
using ::testing::HasSubstr;

std::filesystem::path only_file(const Folder& folder) {
  std::filesystem::path found;
  for (const auto& entry : std::filesystem::directory_iterator(folder.path())) {
    if (entry.path().extension() == ".mcap") found = entry.path();
  }
  return found;
}

// A smooth picture, which JPEG keeps.
void fill_smooth(std::span<std::byte> pixels, std::size_t camera, std::int64_t number) {
  for (std::size_t i = 0; i < pixels.size(); ++i) {
    const std::size_t row = i / 32;
    const std::size_t column = i % 32;
    pixels[i] = static_cast<std::byte>(40 + 2 * row + 3 * column + 10 * camera +
                                       static_cast<std::size_t>(number % 5) * 4);
  }
}

// All images are good, but for one of image `lost`.
ImageStates all_but_one(std::int64_t number, std::int64_t lost, std::size_t camera) {
  ImageStates states{Frame::State::kGood, Frame::State::kGood, Frame::State::kGood};
  if (number == lost) states[camera] = Frame::State::kLost;
  return states;
}

// What a log must say of the images that a session of `images` images had.
void expect_patterns(const LoggedCameras& cameras, std::int64_t images) {
  ASSERT_EQ(cameras.range(), std::pair(TimeIndex{0}, TimeIndex{images}));
  for (TimeIndex i = 0; i < images; ++i) {
    const LoggedImages found = cameras.at(i);
    EXPECT_EQ(found.index(), i);
    for (std::size_t camera = 0; camera < 3; ++camera) {
      EXPECT_EQ(found.infos()[camera].number, i);
      ASSERT_TRUE(has_pattern(found.pixels(camera), camera, i)) << i << " " << camera;
    }
  }
}

TEST(ImagesInLogs, AreThoseOfTheCamerasBitForBitIfTheyAreRaw) {
  const Folder folder;
  RecordedSight sight(folder.path(), ImageStorage::kRaw, {});
  sight.run(1000);
  sight.stop();
  const Log log(only_file(folder));
  const log::LoggedSession robot = log.session();
  const LoggedCameras cameras(robot);
  expect_patterns(cameras, 101);
  EXPECT_EQ(sight.recorder()->state().images, 303);
  EXPECT_EQ(sight.recorder()->state().left_out_images, 0);
  EXPECT_EQ(cameras.calibration().text(),
            (camera::Calibration{.date = {}, .residual = 0, .cameras = three_cameras()}.text()));
  for (const TimeIndex t : {0, 9, 10, 555, 1000}) {
    const std::optional<LoggedImages> images = cameras.get_latest_at(t);
    ASSERT_TRUE(images);
    EXPECT_EQ(images->index(), t / 10);
    // The times are those of the log's clock: the session's beginning and 1 ms per step.
    for (std::size_t camera = 0; camera < 3; ++camera) {
      EXPECT_EQ(images->times()[camera] - images->times()[0], static_cast<int>(camera) * 7000);
    }
    EXPECT_EQ(images->times()[1], robot.header().time_offset + t / 10 * 10'000'000);
    EXPECT_EQ(cameras.find(images->times()[1])->index(), t / 10);
  }
}

TEST(ImagesInLogs, AreNearlyThoseOfTheCamerasIfTheyAreJpeg) {
  const Folder folder;
  RecordedSight sight(folder.path(), ImageStorage::kJpeg, {.draw = fill_smooth});
  sight.run(200);
  sight.stop();
  const LoggedCameras cameras(Log(only_file(folder)).session());
  const camera::ImageFormat format = three_cameras()[0].format;
  for (TimeIndex i = 0; i < 20; ++i) {
    const LoggedImages images = cameras.at(i);
    for (std::size_t camera = 0; camera < 3; ++camera) {
      std::vector<std::byte> mosaic(format.size());
      fill_smooth(mosaic, camera, i);
      std::vector<std::byte> rgb(3 * format.size());
      camera::to_rgb(format, mosaic, rgb);
      EXPECT_EQ(images.recorded(camera).encoding, "jpeg");
      const camera::Picture picture = camera::decode_image(images.recorded(camera).bytes);
      ASSERT_EQ(picture.pixels.size(), rgb.size());
      double sum = 0;
      for (std::size_t k = 0; k < rgb.size(); ++k) {
        sum += std::abs(static_cast<double>(picture.pixels[k]) - static_cast<double>(rgb[k]));
      }
      EXPECT_LT(sum / static_cast<double>(rgb.size()), 2.5);
      EXPECT_EQ(images.pixels(camera).size(), format.size());
    }
  }
}

TEST(ImagesInLogs, SayWhyAnImageIsMissing) {
  const Folder folder;
  Seen seen;
  seen.states = [](std::int64_t number) {
    ImageStates states{Frame::State::kGood, Frame::State::kGood, Frame::State::kGood};
    if (number % 3 == 0) states[0] = Frame::State::kDamaged;
    if (number % 3 == 1) states[1] = Frame::State::kLost;
    return states;
  };
  RecordedSight sight(folder.path(), ImageStorage::kRaw, seen);
  sight.run(100);
  sight.stop();
  const LoggedCameras cameras(Log(only_file(folder)).session());
  for (TimeIndex i = 0; i <= 10; ++i) {
    const LoggedImages images = cameras.at(i);
    for (std::size_t camera = 0; camera < 3; ++camera) {
      const Frame::State state = seen.states(i)[camera];
      EXPECT_EQ(images.infos()[camera].frame().state, state);
      EXPECT_EQ(images.has(camera), state == Frame::State::kGood);
      // Who looks for times finds the missing one beside the others.
      EXPECT_LT(std::abs(images.times()[camera] - images.times()[2]), 100'000);
      if (state == Frame::State::kGood) {
        EXPECT_TRUE(has_pattern(images.pixels(camera), camera, i));
      } else {
        EXPECT_THROW(static_cast<void>(images.pixels(camera)), CameraLost);
      }
    }
  }
}

TEST(ImagesInLogs, AreNotThereIfNobodyWantsThem) {
  const Folder folder;
  RecordedSight sight(folder.path(), ImageStorage::kNone, {});
  sight.run(100);
  sight.stop();
  const LoggedCameras cameras(Log(only_file(folder)).session());
  EXPECT_EQ(cameras.at(3).infos()[0].number, 3);
  EXPECT_FALSE(cameras.at(3).has(0));
  EXPECT_EQ(message_of<log::NotInLog>([&] { return cameras.at(3).pixels(0); }),
            "the log of 'robot' lacks the image of camera60 of element 3");
  const mcap::Reader reader(only_file(folder));
  for (const auto& [id, channel] : reader.contents().channels) {
    EXPECT_THAT(channel.topic, ::testing::Not(HasSubstr("image")));
  }
}

TEST(ImagesInLogs, OfSeveralSessionsAreNotMixed) {
  const Folder folder;
  RecordedSight sight(folder.path(), ImageStorage::kRaw, {});
  for (int i = 0; i < 3; ++i) sight.run(50 + 10 * i);
  sight.stop();
  const Log log(only_file(folder));
  const std::vector<log::LoggedSession> sessions = log.sessions();
  ASSERT_EQ(sessions.size(), 3U);
  for (std::size_t i = 0; i < 3; ++i) {
    expect_patterns(LoggedCameras(sessions[i]), 6 + static_cast<int>(i));
  }
}

TEST(ImagesInLogs, StandInEachFileOfARecording) {
  const Folder folder;
  log::RecorderOptions options;
  options.rotate_size = 300'000;
  RecordedSight sight(folder.path(), ImageStorage::kRaw, {}, options);
  sight.run(3000);
  sight.stop();
  const Log log(folder.path());
  EXPECT_GT(log.files().size(), 2U);
  expect_patterns(LoggedCameras(log.session()), 301);
  EXPECT_TRUE(log.damage().empty());
  for (const std::filesystem::path& file : log.files()) {
    const mcap::Reader reader(file);
    int infos = 0;
    bool has_images = false;
    for (const auto& [id, channel] : reader.contents().channels) {
      const auto count = reader.contents().channel_message_counts.find(id);
      if (channel.topic.ends_with("/camera_info")) {
        EXPECT_EQ(count->second, 1U);
        ++infos;
      }
      has_images = has_images || channel.topic.ends_with("/image");
    }
    // The last file may have the end alone.
    EXPECT_EQ(infos, has_images ? 3 : 0);
  }
}

TEST(ImagesInLogs, AreInChunksOfTheirOwnThatNobodyElseReads) {
  const Folder folder;
  {
    RecordedSight sight(folder.path(), ImageStorage::kRaw, {});
    sight.run(1000);
    sight.stop();
  }
  const std::filesystem::path file = only_file(folder);
  Bytes bytes = read_file(file);
  const mcap::Reader reader(file);
  const mcap::Contents& contents = reader.contents();
  int chunks = 0;
  for (const mcap::ChunkPlace& chunk : contents.chunks) {
    bool has_images = false;
    bool has_others = false;
    for (const auto& [id, offset] : chunk.indexes) {
      const bool is_image = contents.channels.at(id).topic.ends_with("/image");
      has_images = has_images || is_image;
      has_others = has_others || !is_image;
    }
    EXPECT_FALSE(has_images && has_others);
    if (!has_images) continue;
    ++chunks;
    EXPECT_EQ(chunk.compression, mcap::Compression::kNone);
    bytes[chunk.offset + chunk.length / 2] = flipped(bytes[chunk.offset + chunk.length / 2], 3);
  }
  EXPECT_GT(chunks, 0);
  write_file(file, bytes);
  // All images are damaged. The steps are read as before, and the damage is named.
  const Log log(file);
  log::LoggedSession session = log.session();
  std::vector<FakeObservation> observations(1001);
  session.get(Series::kObservation, 0, observations.size(), observations.data());
  EXPECT_EQ(observations.back().applied_actions, 1000);
  EXPECT_TRUE(session.gaps().empty());
  EXPECT_EQ(log.damage().size(), static_cast<std::size_t>(chunks));
  EXPECT_FALSE(LoggedCameras(session).at(5).has(0));
}

TEST(ImagesInLogs, AreInWhatIsCutOutOfALog) {
  const Folder folder;
  const Folder target;
  for (const ImageStorage storage : {ImageStorage::kRaw, ImageStorage::kJpeg}) {
    RecordedSight sight(folder.path(), storage, {});
    sight.run(400);
    sight.stop();
    const Log log(folder.path());
    const std::filesystem::path cut = target.path() / (storage == ImageStorage::kRaw ? "r" : "j");
    log::copy(log, cut, {.session = "robot", .first = 100, .last = 200});
    const LoggedCameras before(log.session());
    const LoggedCameras after(Log(cut).session());
    EXPECT_LE(after.range().first, 10);
    EXPECT_GE(after.range().second, 20);
    for (TimeIndex i = 10; i < 20; ++i) {
      const LoggedImages expected = before.at(i);
      const LoggedImages found = after.at(i);
      EXPECT_EQ(found.times(), expected.times());
      for (std::size_t camera = 0; camera < 3; ++camera) {
        EXPECT_EQ(found.recorded(camera).encoding, expected.recorded(camera).encoding);
        EXPECT_EQ(found.recorded(camera).bytes, expected.recorded(camera).bytes);
      }
    }
    std::filesystem::remove(log.files().front());
  }
}

TEST(ImagesInLogs, OfAFileThatWasCutOffAreReadAndRecovered) {
  const Folder folder;
  {
    RecordedSight sight(folder.path(), ImageStorage::kRaw, {});
    sight.run(1000);
    sight.stop();
  }
  const std::filesystem::path file = only_file(folder);
  Bytes bytes = read_file(file);
  bytes.resize(bytes.size() * 2 / 3);
  write_file(file, bytes);
  const std::filesystem::path whole = folder / "whole.mcap";
  static_cast<void>(log::recover(file, whole));
  EXPECT_TRUE(log::check(whole).is_whole());
  for (const std::filesystem::path& path : {file, whole}) {
    const LoggedCameras cameras(Log(path).session());
    const auto [first, end] = cameras.range();
    int images = 0;
    for (TimeIndex i = first; i < end; ++i) {
      const LoggedImages found = cameras.at(i);
      for (std::size_t camera = 0; camera < 3; ++camera) {
        if (!found.has(camera)) continue;
        ++images;
        EXPECT_TRUE(has_pattern(found.pixels(camera), camera, i));
      }
    }
    EXPECT_GT(images, 100);
  }
}

// Counts the images in a log, and checks that they are those of the cameras.
std::int64_t count_images(const LoggedCameras& cameras) {
  std::int64_t images = 0;
  const auto [first, end] = cameras.range();
  for (TimeIndex i = first; i < end; ++i) {
    try {
      const LoggedImages found = cameras.at(i);
      for (std::size_t camera = 0; camera < 3; ++camera) {
        if (!found.has(camera)) continue;
        ++images;
        EXPECT_TRUE(has_pattern(found.pixels(camera), camera, found.infos()[camera].number));
      }
    } catch (const log::NotInLog&) {  // NOLINT(bugprone-empty-catch): busy machines lose elements
    }
  }
  return images;
}

log::RecorderOptions raw_follower(const Folder& folder) {
  log::RecorderOptions options;
  options.folder = folder.path();
  options.keep_free = 0;
  options.is_follower = true;
  options.images = ImageStorage::kRaw;
  return options;
}

TEST(ImagesInLogs, ThatComeTooFastInRealTimeAreLeftOutAndCounted) {
#ifdef __SANITIZE_THREAD__
  GTEST_SKIP()
      << "ThreadSanitizer takes pixels that are overwritten while they are read for a race";
#endif
  const Folder folder;
  SeeingDriver driver({.period = 1});
  SessionHost host =
      SessionHost::anonymous({.documents = RecordedSight::documents(three_cameras())}, "robot");
  RecorderUnderTest recorder({"robot"}, raw_follower(folder));
  {
    // In the 5 ms between two looks come 25 images; at most 16 of them are still there.
    Backend backend(driver, host, kRealTime);
    backend.follow(*recorder);
    const BackendThread thread(backend, {.demand = Demand::kOff});
    Frontend<FakeRobot> robot(host);
    robot.append_desired_action({});
    robot.wait_until_time_index(3000);
    robot.finish();
    recorder.wait_for_event("robot: the controller finished");
  }
  recorder.stop();
  const log::RecorderState state = recorder->state();
  EXPECT_GT(state.images, 0);
  EXPECT_GT(state.left_out_images, 0);
  EXPECT_GT(recorder.count_events("images of robot are not in the log"), 0U);
  const Log log(folder.path());
  EXPECT_EQ(count_images(LoggedCameras(log.session())), state.images);
  EXPECT_TRUE(log.damage().empty());
}

TEST(ImagesInLogs, FromBeforeTheRecorderAreNotLeftOut) {
  const Folder folder;
  SeeingDriver driver({.period = 1});
  SessionHost host =
      SessionHost::anonymous({.documents = RecordedSight::documents(three_cameras())}, "robot");
  Backend backend(driver, host, kPatient);
  Frontend<FakeRobot> robot(backend);
  const Session session = robot.session();
  const std::vector<Session> companions{session.companion("cameras")};
  for (int i = 0; i < 100; ++i) {
    static_cast<void>(robot.get_status(robot.append_desired_action({})));
  }
  robot.finish();
  RecorderUnderTest recorder({"robot"}, raw_follower(folder));
  recorder->begin_session(session, companions);
  recorder.stop();
  EXPECT_GE(recorder->state().images, 3 * 10);
  EXPECT_LE(recorder->state().left_out_images, 3);
  const LoggedCameras cameras(Log(folder.path()).session());
  EXPECT_EQ(cameras.range().second, 101);
  EXPECT_EQ(count_images(cameras), recorder->state().images);
}

TEST(ImagesInLogs, WaitForADiskThatIsFull) {
  const Folder folder;
  Disk disk;
  log::RecorderOptions options;
  options.open_file = disk.opener();
  RecordedSight sight(folder.path(), ImageStorage::kRaw, {}, options);
  for (int i = 0; i < 3; ++i) {
    disk.set_error(i % 2 == 1 ? ENOSPC : 0);
    sight.run(30);
  }
  disk.set_error(0);
  sight.stop();
  const Log log(only_file(folder));
  ASSERT_EQ(log.sessions().size(), 3U);
  for (const log::LoggedSession& session : log.sessions()) {
    expect_patterns(LoggedCameras(session), 4);
  }
  EXPECT_TRUE(log.damage().empty());
}

// ---- the source ----

SourceUnderTest make_logged_source() {
  auto folder = std::make_shared<Folder>();
  RecordedSight sight(folder->path(), ImageStorage::kRaw, {});
  sight.run(100);
  sight.stop();
  auto source = std::make_unique<log::ImageSource>(Log(folder->path()).session());
  return {.world = std::move(folder), .source = std::move(source)};
}

INSTANTIATE_TEST_SUITE_P(Logged, SourceContract, testing::Values(&make_logged_source));

TEST(ImageSource, ShowsWhatWasRecordedAtItsDistancesInTime) {
  const Folder folder;
  Seen seen;
  seen.states = [](std::int64_t number) { return all_but_one(number, 4, 1); };
  RecordedSight sight(folder.path(), ImageStorage::kRaw, seen);
  sight.run(100);
  sight.stop();
  log::ImageSource source(Log(folder.path()).session(), {.repeats = false});
  Grabbed grabbed(source);
  Instant last{};
  for (std::int64_t i = 0; i <= 10; ++i) {
    ASSERT_TRUE(source.grab(grabbed.images, grabbed.frames, kForever));
    for (std::size_t c = 0; c < 3; ++c) {
      EXPECT_EQ(grabbed.frames[c].state, seen.states(i)[c]);
      if (seen.states(i)[c] != Frame::State::kGood) continue;
      EXPECT_EQ(grabbed.frames[c].number, i);
      EXPECT_EQ(grabbed.frames[c].exposure, 1500us);
      EXPECT_TRUE(has_pattern(grabbed.images[c], c, i));
    }
    EXPECT_EQ(grabbed.frames[2].time - grabbed.frames[0].time, 14us);
    if (i > 0) {
      EXPECT_EQ(grabbed.frames[0].time - last, 10ms);
    }
    last = grabbed.frames[0].time;
  }
  EXPECT_TRUE(source.has_ended());
  EXPECT_FALSE(source.grab(grabbed.images, grabbed.frames, kForever));
}

TEST(ImageSource, LeavesOutWhatIsOverAfterAPause) {
  const Folder folder;
  RecordedSight sight(folder.path(), ImageStorage::kRaw, {});
  sight.run(100);
  sight.stop();
  log::ImageSource source(Log(folder.path()).session());
  Grabbed grabbed(source);
  ASSERT_TRUE(source.grab(grabbed.images, grabbed.frames, kForever));
  const Instant first = grabbed.frames[0].time;
  // This time has to pass: it is what is tested.
  std::this_thread::sleep_until(first + 345ms);
  const Instant before = std::chrono::steady_clock::now();
  ASSERT_TRUE(source.grab(grabbed.images, grabbed.frames, kForever));
  EXPECT_GT(grabbed.frames[0].time, before - 10ms - 14us);
  EXPECT_GE(grabbed.frames[0].number, 34);
}

TEST(ImagesInLogs, AreSeenAgainByWhoRunsAgainstTheLog) {
  const Folder folder;
  Seen seen;
  seen.states = [](std::int64_t number) { return all_but_one(number, 12, 2); };
  RecordedSight sight(folder.path(), ImageStorage::kRaw, seen);
  sight.run(400);
  sight.stop();
  const log::Replay replay(Log(folder.path()).session(), {.first = 100, .last = 300});
  for (int session = 0; session < 2; ++session) {
    auto robot = replay.connect<FakeRobot>();
    const camera::CameraReader cameras(robot);
    for (TimeIndex t = 0; t < 200; ++t) {
      static_cast<void>(robot.get_status(robot.append_desired_action({})));
      const std::optional<camera::Images> images = cameras.get_latest_at(t);
      ASSERT_TRUE(images);
      const std::int64_t number = 10 + t / 10;
      for (std::size_t camera = 0; camera < 3; ++camera) {
        if (seen.states(number)[camera] == Frame::State::kGood) {
          ASSERT_EQ(images->infos()[camera].number, number);
          ASSERT_TRUE(has_pattern(images->pixels(camera), camera, number)) << t;
        } else {
          EXPECT_THROW(static_cast<void>(images->pixels(camera)), CameraLost);
        }
      }
      EXPECT_TRUE(images->is_valid());
    }
    robot.finish();
  }
}

TEST(ImageSource, RefusesALogWithoutImages) {
  const Folder folder;
  RecordedSight sight(folder.path(), ImageStorage::kNone, {});
  sight.run(20);
  sight.stop();
  EXPECT_EQ(message_of<InvalidArgument>(
                [&] { return log::ImageSource(Log(folder.path()).session()).names(); }),
            "the log of 'robot' has no images: they were not recorded");
}

}  // namespace
}  // namespace trifinger::test
