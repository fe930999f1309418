// SPDX-License-Identifier: BSD-3-Clause
#include "camera/source_contract.hpp"

#include <algorithm>
#include <chrono>
#include <cstdint>
#include <string>
#include <thread>
#include <vector>

namespace trifinger::test {

TEST_P(SourceContract, HasThreeCamerasThatNeverChange) {
  const std::vector<std::string> names = under_test_.source->names();
  const std::vector<camera::ImageFormat> formats = under_test_.source->formats();
  EXPECT_EQ(names.size(), 3U);
  EXPECT_EQ(formats.size(), 3U);
  for (int i = 0; i < 3; ++i) grab();
  EXPECT_EQ(under_test_.source->names(), names);
  EXPECT_EQ(under_test_.source->formats(), formats);
}

TEST_P(SourceContract, CountsImagesAndTimesRise) {
  constexpr int kImages = 8;
  std::vector<camera::Frame> last(3);
  std::vector<int> good(3);
  while (good[0] < kImages || good[1] < kImages || good[2] < kImages) {
    grab();
    if (HasFatalFailure()) return;
    for (std::size_t i = 0; i < 3; ++i) {
      const camera::Frame& frame = grabbed_.frames[i];
      if (frame.state != camera::Frame::State::kGood) continue;
      EXPECT_GE(frame.number, 0);
      EXPECT_GE(frame.exposure, Nanoseconds(0));
      EXPECT_LE(frame.time, std::chrono::steady_clock::now());
      if (good[i] > 0) {
        EXPECT_GT(frame.number, last[i].number);
        EXPECT_GT(frame.time, last[i].time);
      }
      last[i] = frame;
      ++good[i];
    }
  }
}

TEST_P(SourceContract, DeliversElementsWhoseTimesDoNotGoBack) {
  Instant last = Instant::min();
  for (int element = 0; element < 20;) {
    grab();
    if (HasFatalFailure()) return;
    Instant first = Instant::max();
    for (const camera::Frame& frame : grabbed_.frames) {
      if (frame.state == camera::Frame::State::kGood) first = std::min(first, frame.time);
    }
    if (first == Instant::max()) continue;
    Nanoseconds sum{0};
    std::int64_t count = 0;
    for (const camera::Frame& frame : grabbed_.frames) {
      if (frame.state != camera::Frame::State::kGood) continue;
      sum += frame.time - first;
      ++count;
    }
    EXPECT_GE(first + sum / count, last);
    last = first + sum / count;
    ++element;
  }
}

TEST_P(SourceContract, DeliversAgainAfterNobodyTookItsImages) {
  grab();
  const std::int64_t number = grabbed_.frames[0].number;
  std::this_thread::sleep_for(std::chrono::milliseconds(300));  // more than any queue holds
  do {
    grab();
    if (HasFatalFailure()) return;
  } while (grabbed_.frames[0].state != camera::Frame::State::kGood);
  EXPECT_GT(grabbed_.frames[0].number, number);
}

TEST_P(SourceContract, LooksWithoutWaiting) {
  for (int i = 0; i < 100; ++i) {
    static_cast<void>(
        under_test_.source->grab(grabbed_.images, grabbed_.frames, Nanoseconds::zero()));
  }
  grab();
}

}  // namespace trifinger::test
