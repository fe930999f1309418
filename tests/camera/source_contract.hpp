// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <gtest/gtest.h>

#include <chrono>
#include <memory>

#include "camera/grabbed.hpp"
#include "trifinger/camera/source.hpp"

// What holds for every source, wherever its images come from. A test program names its sources:
//
//     INSTANTIATE_TEST_SUITE_P(Folder, SourceContract, testing::Values(&make_folder_source));

namespace trifinger::test {

/// A source that delivers images of three cameras at 20 Hz or faster, with what it needs.
struct SourceUnderTest {
  std::shared_ptr<void> world;  ///< Outlives the source.
  std::unique_ptr<camera::Source> source;
};
using MakeSource = SourceUnderTest (*)();

class SourceContract : public ::testing::TestWithParam<MakeSource> {
 protected:
  // Waits for images.
  void grab() {
    while (!under_test_.source->grab(grabbed_.images, grabbed_.frames, std::chrono::seconds(1))) {
      ASSERT_FALSE(under_test_.source->has_ended());
    }
  }

  SourceUnderTest under_test_{GetParam()()};
  Grabbed grabbed_{*under_test_.source};
};

}  // namespace trifinger::test
