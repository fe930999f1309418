// SPDX-License-Identifier: BSD-3-Clause
#include "camera/device.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <array>
#include <atomic>
#include <chrono>
#include <condition_variable>
#include <deque>
#include <memory>
#include <mutex>
#include <string>
#include <utility>
#include <vector>

#include "camera/cameras_of_tests.hpp"
#include "camera/error_throttle.hpp"
#include "camera/grabbed.hpp"
#include "support/child_process.hpp"
#include "trifinger/base/error.hpp"
#include "trifinger/base/random.hpp"
#include "trifinger/core/errors.hpp"

// Single cameras become a source: those that belong together are found by their times.

namespace trifinger::test {
namespace {

using namespace std::chrono_literals;

using camera::Frame;

// A camera that delivers what the test says, when it says so.
class ScriptedDevice final : public camera::Device {
 public:
  // What the test holds in its hands.
  struct Script {
    std::mutex mutex;
    std::condition_variable changed;
    std::deque<Frame> frames;
    bool has_frame{false};  // the device, until it is asked for the next one
    bool is_there{true};
    std::atomic<bool> fails{false};
    std::atomic<int> failures{0};

    // Returns when the caller of the device has the image.
    void deliver(Frame frame) {
      std::unique_lock lock(mutex);
      frames.push_back(frame);
      changed.notify_all();
      changed.wait(lock, [this] { return frames.empty() && !has_frame; });
    }
    void fail(bool does) {
      const std::lock_guard lock(mutex);
      fails = does;
      changed.notify_all();
    }
    void plug(bool in) {
      const std::lock_guard lock(mutex);
      is_there = in;
      changed.notify_all();
    }
  };

  ScriptedDevice(std::shared_ptr<Script> script, std::size_t camera)
      : script_(std::move(script)), camera_(camera) {}

  [[nodiscard]] bool grab(std::span<std::byte> pixels, Frame& frame, Timeout timeout) override {
    std::unique_lock lock(script_->mutex);
    script_->has_frame = false;
    script_->changed.notify_all();
    script_->changed.wait_for(lock, timeout, [this] {
      return !script_->frames.empty() || was_ != is_there_now() || script_->fails;
    });
    if (script_->fails) {
      ++script_->failures;
      throw Error("broken");
    }
    was_ = is_there_now();
    if (script_->frames.empty()) return false;
    frame = script_->frames.front();
    script_->frames.pop_front();
    script_->has_frame = true;
    fill_pattern(pixels, camera_, frame.number);
    return true;
  }
  [[nodiscard]] bool is_there() const noexcept override { return was_; }
  [[nodiscard]] std::vector<std::string> take_messages() override { return {}; }

 private:
  [[nodiscard]] bool is_there_now() const noexcept { return script_->is_there; }

  std::shared_ptr<Script> script_;
  std::size_t camera_;
  bool was_{true};
};

class Group {
 public:
  Group() {
    std::vector<std::unique_ptr<camera::Device>> devices;
    for (std::size_t i = 0; i < 3; ++i) {
      scripts.push_back(std::make_shared<ScriptedDevice::Script>());
      devices.push_back(std::make_unique<ScriptedDevice>(scripts.back(), i));
    }
    group.emplace(three_cameras(), std::move(devices), 10ms);
    grabbed.emplace(*group);
  }
  // Delivers image `number` of a camera, taken `later` than planned. The group has it when this
  // returns, so it does not take a camera for late whose thread is.
  void deliver(std::size_t camera, std::int64_t number, Nanoseconds later = 0ns,
               Frame::State state = Frame::State::kGood) {
    scripts[camera]->deliver(
        {.state = state, .number = number, .time = begin + number * 10ms + later, .exposure = 1ms});
  }
  std::array<std::int64_t, 3> next() {
    EXPECT_TRUE(group->grab(grabbed->images, grabbed->frames, kForever));
    std::array<std::int64_t, 3> numbers{};
    for (std::size_t i = 0; i < 3; ++i) {
      const Frame& frame = grabbed->frames[i];
      const bool is_good = frame.state == Frame::State::kGood;
      numbers[i] = is_good ? frame.number : -static_cast<std::int64_t>(frame.state) - 1;
      if (is_good) {
        EXPECT_TRUE(has_pattern(grabbed->images[i], i, frame.number));
      }
    }
    return numbers;
  }

  const Instant begin = std::chrono::steady_clock::now();
  std::vector<std::shared_ptr<ScriptedDevice::Script>> scripts;
  std::optional<camera::CameraGroup> group;
  std::optional<Grabbed> grabbed;
};

constexpr std::int64_t kNone = -1;
constexpr std::int64_t kDamaged = -3;
constexpr std::int64_t kLost = -4;

using Numbers = std::array<std::int64_t, 3>;

TEST(CameraGroup, fault_64_StaysInTheParentOfAForkedChild) {
  Group group;
  ChildProcess child([&] {
    try {
      (void)group.group->grab(group.grabbed->images, group.grabbed->frames, kForever);
      return 2;
    } catch (const InheritedHandle&) {
    }
    if (!group.group->take_messages().empty()) return 3;
    group.group.reset();  // waits for no thread
    return 0;
  });
  EXPECT_EQ(child.wait(), 0);
  for (std::size_t c = 0; c < 3; ++c) group.deliver(c, 0);
  EXPECT_EQ(group.next(), (Numbers{0, 0, 0}));
}

TEST(CameraGroup, PutsTogetherWhatWasTakenAtOneTime) {
  Group group;
  Random random{.seed = 3};
  for (std::int64_t i = 0; i < 100; ++i) {
    for (std::size_t c = 0; c < 3; ++c) {
      group.deliver(c, i, Nanoseconds(random.integer(-2'400'000, 2'400'000)));
    }
    EXPECT_EQ(group.next(), (Numbers{i, i, i}));
  }
}

TEST(CameraGroup, fault_52_AnImageThatWasDroppedLeavesTheOthersTogether) {
  Group group;
  for (std::size_t c = 0; c < 3; ++c) {
    for (std::int64_t i = 0; i < 4; ++i) {
      if (c != 1 || i != 1) group.deliver(c, i);
    }
  }
  EXPECT_EQ(group.next(), (Numbers{0, 0, 0}));
  EXPECT_EQ(group.next(), (Numbers{1, kNone, 1}));
  EXPECT_EQ(group.next(), (Numbers{2, 2, 2}));
  EXPECT_EQ(group.next(), (Numbers{3, 3, 3}));
}

TEST(CameraGroup, fault_52_ACameraThatIsLateIsNotWaitedForLong) {
  Group group;
  group.deliver(0, 0);
  group.deliver(2, 0);
  EXPECT_EQ(group.next(), (Numbers{0, kNone, 0}));
  // What comes too late is left out; its number is missing.
  group.deliver(1, 0);
  for (std::size_t c = 0; c < 3; ++c) group.deliver(c, 1);
  EXPECT_EQ(group.next(), (Numbers{1, 1, 1}));
}

TEST(CameraGroup, fault_52_TimesNeverGoBackHoweverLateImagesAre) {
  Group group;
  Random random{.seed = 8};
  Instant last{};
  for (std::int64_t i = 0; i < 40; ++i) {
    const auto late = static_cast<std::size_t>(random.integer(0, 3));  // 3: none
    const auto deliver = [&](std::size_t camera) {
      group.deliver(camera, i, Nanoseconds(random.integer(-2'400'000, 2'400'000)));
    };
    for (std::size_t c = 0; c < 3; ++c) {
      if (c != late) deliver(c);
    }
    group.next();
    Nanoseconds sum{0};
    std::int64_t good = 0;
    for (const Frame& frame : group.grabbed->frames) {
      if (frame.state != Frame::State::kGood) continue;
      sum += frame.time - group.begin;
      ++good;
    }
    ASSERT_GT(good, 0);
    const Instant middle = group.begin + sum / good;
    EXPECT_GE(middle, last);
    last = middle;
    if (late < 3) deliver(late);
  }
}

TEST(CameraGroup, fault_53_ADamagedImageStaysWithItsPartners) {
  Group group;
  for (std::size_t c = 0; c < 3; ++c) {
    group.deliver(c, 0, 0ns, c == 2 ? Frame::State::kDamaged : Frame::State::kGood);
  }
  EXPECT_EQ(group.next(), (Numbers{0, 0, kDamaged}));
}

TEST(CameraGroup, fault_51_WithoutACameraTheOthersGoOnAtOnce) {
  Group group;
  group.scripts[1]->plug(false);
  Numbers numbers{};
  for (std::int64_t i = 0; numbers != Numbers{i - 1, kLost, i - 1}; ++i) {
    group.deliver(0, i);
    group.deliver(2, i);
    numbers = group.next();  // the first may be kNone: its thread has not looked yet
  }
  group.scripts[0]->plug(false);
  group.scripts[2]->plug(false);
  while (!group.group->grab(group.grabbed->images, group.grabbed->frames, 1ms)) {
  }
  for (const Frame& frame : group.grabbed->frames) EXPECT_EQ(frame.state, Frame::State::kLost);
}

TEST(CameraGroup, WithoutAReaderKeepsTheNewestImages) {
  Group group;
  for (std::int64_t i = 0; i < 50; ++i) {
    for (std::size_t c = 0; c < 3; ++c) group.deliver(c, i);
  }
  Numbers numbers{};
  while (numbers[0] < 49 && numbers[1] < 49 && numbers[2] < 49) numbers = group.next();
  EXPECT_EQ(std::max({numbers[0], numbers[1], numbers[2]}), 49);
}

TEST(CameraGroup, fault_51_ADeviceThatFailsIsLostAloneAndToldOnce) {
  Group group;
  group.scripts[1]->fail(true);
  Numbers numbers{};
  std::int64_t i = 0;
  std::vector<std::string> messages;
  const auto next = [&] {
    for (std::size_t c = 0; c < 3; ++c) {
      if (c != 1 || !group.scripts[1]->fails) group.deliver(c, i);
    }
    numbers = group.next();
    for (const std::string& sentence : group.group->take_messages()) messages.push_back(sentence);
    ++i;
  };
  while (numbers != Numbers{i - 1, kLost, i - 1}) next();
  // It is tried again twice per second, and fails again.
  const int before = group.scripts[1]->failures;
  while (group.scripts[1]->failures < before + 2) next();
  EXPECT_EQ(numbers, (Numbers{i - 1, kLost, i - 1}));
  EXPECT_THAT(messages, ::testing::ElementsAre("camera180: broken"));
  group.scripts[1]->fail(false);
  while (numbers != Numbers{i - 1, i - 1, i - 1}) next();
}

TEST(CameraGroup, fault_51_InSilenceOnlyTheCameraThatIsNotThereIsLost) {
  Group group;
  group.scripts[1]->plug(false);
  do {
    EXPECT_FALSE(group.group->grab(group.grabbed->images, group.grabbed->frames, 1ms));
  } while (group.grabbed->frames[1].state != Frame::State::kLost);
  EXPECT_EQ(group.grabbed->frames[0].state, Frame::State::kNone);
  EXPECT_EQ(group.grabbed->frames[2].state, Frame::State::kNone);
}

TEST(ErrorThrottle, fault_51_ReportsOnceAndAgainEveryMinute) {
  camera::ErrorThrottle throttle;
  const Instant begin(1h);
  std::vector<int> told;
  for (int i = 0; i < 300; ++i) {
    if (throttle.is_due(i % 2 == 0 ? "it is lost" : "it is not there", begin + i * 500ms)) {
      told.push_back(i);
    }
  }
  EXPECT_THAT(told, ::testing::ElementsAre(0, 1, 120, 121, 240, 241));
  EXPECT_TRUE(throttle.end());
  EXPECT_FALSE(throttle.end());
  EXPECT_TRUE(throttle.is_due("it is lost", begin + 151s));
}

TEST(DeviceClock, GivesTimesThatAreNeverLateAndFollowTheDrift) {
  camera::DeviceClock clock;
  Random random{.seed = 5};
  const Instant begin(1h);
  Nanoseconds worst{0};
  for (int i = 0; i < 60'000; ++i) {  // ten minutes at 100 Hz
    const Instant truth = begin + i * 10ms;
    // The device's clock is 50 millionths fast and began elsewhere.
    const Nanoseconds device = 77s + i * Nanoseconds(10ms) * 20001 / 20000;
    const Nanoseconds way = 2ms + Nanoseconds(random.integer(0, 3'000'000));
    const Instant found = clock.host_time(device, truth + way);
    EXPECT_LE(found, truth + way);
    if (i > 100) worst = std::max<Nanoseconds>(worst, std::chrono::abs(found - truth - 2ms));
  }
  // What clocks may drift apart until a short way is met again.
  EXPECT_LE(worst, 600us);
}

TEST(DeviceClock, BeginsAnewWithADeviceThatWasStartedAgain) {
  camera::DeviceClock clock;
  static_cast<void>(clock.host_time(1000s, Instant(5000s)));
  EXPECT_EQ(clock.host_time(1s, Instant(5010s)), Instant(5010s));
  const Instant next = clock.host_time(2s, Instant(5011s + 3ms));
  EXPECT_GE(next, Instant(5011s));
  EXPECT_LE(next, Instant(5011s + 600us));  // what clocks may have drifted
}

TEST(DeviceClock, fault_52_AnImageThatIsLateHasTheTimeAtWhichItWasTaken) {
  camera::DeviceClock clock;
  const Instant begin(1h);
  Instant last{};
  for (int i = 0; i < 2000; ++i) {
    // Now and then all of them wait for seconds on their way.
    const Nanoseconds late = i % 1000 > 500 && i % 1000 < 600 ? 5s : 0s;
    const Instant truth = begin + i * 10ms + (i >= 600 ? 5s : 0s) + (i >= 1600 ? 5s : 0s);
    const Instant arrival = truth + 2ms + late;
    const Instant found = clock.host_time(truth - begin + 77s, arrival);
    EXPECT_LE(found, arrival);
    EXPECT_GT(found, last);
    EXPECT_LE(std::chrono::abs(found - truth - 2ms), late / 1000 + 100us) << i;
    last = found;
  }
}

TEST(DeviceClock, FollowsAClockThatStoodStill) {
  camera::DeviceClock clock;
  Instant arrival(1h);
  Nanoseconds device = 5s;
  const auto next = [&] { return clock.host_time(device += 10ms, arrival += 10ms); };
  for (int i = 0; i < 100; ++i) next();
  arrival += 30s;  // the device has counted none of these
  Instant found{};
  for (int i = 0; i < 1100; ++i) found = next();
  EXPECT_EQ(found, arrival);
}

}  // namespace
}  // namespace trifinger::test
