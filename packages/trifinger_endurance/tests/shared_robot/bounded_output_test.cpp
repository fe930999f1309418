// SPDX-License-Identifier: BSD-3-Clause
#include "shared_robot/bounded_output.hpp"

#include <gtest/gtest.h>
#include <rapidcheck.h>

#include <algorithm>
#include <cstddef>
#include <string>
#include <vector>

namespace trifinger::apps {
namespace {

TEST(BoundedOutput, KeepsTheBeginningAndTheEndHoweverTheOutputIsCut) {
  EXPECT_TRUE(rc::check([](const std::vector<std::string>& parts) {
    const auto limit = 2 * *rc::gen::inRange<std::size_t>(0, 20);
    BoundedOutput output(limit);
    std::string whole;
    std::string kept;
    for (const std::string& part : parts) {
      whole += part;
      kept += output.add(part);
    }
    RC_ASSERT(output.total() == whole.size());
    if (whole.size() <= limit) {
      RC_ASSERT(output.left_out() == 0U);
      RC_ASSERT(kept + output.rest() == whole);
      return;
    }
    RC_ASSERT(output.left_out() == whole.size() - limit);
    RC_ASSERT(kept == whole.substr(0, limit / 2));
    RC_ASSERT(output.rest() == "\n[" + std::to_string(whole.size() - limit) +
                                   " bytes are left out here]\n" +
                                   whole.substr(whole.size() - limit / 2));
  }));
}

TEST(BoundedOutput, StaysSmallHoweverMuchComes) {
  constexpr std::size_t kLimit = 1000;
  BoundedOutput output(kLimit);
  const std::string part(777, 'x');
  for (int i = 0; i < 10'000; ++i) static_cast<void>(output.add(part));
  EXPECT_EQ(output.total(), 7'770'000U);
  EXPECT_LE(output.rest().size(), kLimit);
}

}  // namespace
}  // namespace trifinger::apps
