// SPDX-License-Identifier: BSD-3-Clause
#include <gtest/gtest.h>

#include <cstdlib>

namespace trifinger::test {
namespace {

// Of all tests of a program: the configurations are those of the source tree.
class SourceConfigurations final : public ::testing::Environment {
 public:
  void SetUp() override { ::setenv("TRIFINGER_CONFIG_DIR", TRIFINGER_CONFIG_DIR, 1); }
};
const ::testing::Environment* const kConfigurations =
    ::testing::AddGlobalTestEnvironment(new SourceConfigurations);

}  // namespace
}  // namespace trifinger::test
