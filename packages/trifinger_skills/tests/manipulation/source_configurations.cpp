// SPDX-License-Identifier: BSD-3-Clause
#include <gtest/gtest.h>

#include <cstdlib>

namespace trifinger::test {
namespace {

// All tests of this program use the configurations of the source tree.
class SourceConfigurations final : public ::testing::Environment {
 public:
  void SetUp() override { ::setenv("TRIFINGER_CONFIG_DIR", TRIFINGER_CONFIG_DIR, 1); }
};
const ::testing::Environment* const kConfigurations =
    ::testing::AddGlobalTestEnvironment(new SourceConfigurations);

}  // namespace
}  // namespace trifinger::test
