// SPDX-License-Identifier: BSD-3-Clause
#include "core/log_folder.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <optional>
#include <string>
#include <vector>

#include "support/session_folder.hpp"
#include "trifinger/base/error.hpp"

namespace trifinger {
namespace {

using std::filesystem::path;
using std::filesystem::perms;
using testing::HasSubstr;
using testing::ThrowsMessage;

// An environment without a log folder, and some places for one.
class LogFolder : public testing::Test {
 protected:
  LogFolder() {
    for (const char* const variable : kVariables) {
      const char* const value = std::getenv(variable);
      before_.push_back(value != nullptr ? std::optional<std::string>(value) : std::nullopt);
      ::unsetenv(variable);
    }
  }
  ~LogFolder() override {
    for (std::size_t i = 0; i < before_.size(); ++i) {
      if (before_[i]) {
        set(kVariables[i], *before_[i]);
      } else {
        ::unsetenv(kVariables[i]);
      }
    }
  }

  static void set(const char* variable, const path& value) { ::setenv(variable, value.c_str(), 1); }
  [[nodiscard]] path place() const { return folder_.path(); }

 private:
  static constexpr const char* kVariables[] = {"TRIFINGER_LOG_DIR", "XDG_STATE_HOME", "HOME"};

  test::SessionFolder folder_;
  std::vector<std::optional<std::string>> before_;
};

perms mode_of(const path& folder) { return std::filesystem::status(folder).permissions(); }

TEST_F(LogFolder, IsTheFirstThatTheEnvironmentNames) {
  set("HOME", place() / "home");
  EXPECT_EQ(log_folder(), place() / "home/.local/state/trifinger");
  set("XDG_STATE_HOME", place() / "state");
  EXPECT_EQ(log_folder(), place() / "state/trifinger");
  set("TRIFINGER_LOG_DIR", place() / "logs");
  EXPECT_EQ(log_folder(), place() / "logs");
}

TEST_F(LogFolder, IsMadeForThisUserAlone) {
  std::filesystem::create_directory(place() / "home");
  const perms mode_of_home = mode_of(place() / "home");
  set("HOME", place() / "home");
  const mode_t mask = ::umask(0);
  const path folder = log_folder();
  ::umask(mask);
  for (path made = folder; made != place() / "home"; made = made.parent_path()) {
    EXPECT_EQ(mode_of(made), perms::owner_all) << made;
  }
  EXPECT_EQ(mode_of(place() / "home"), mode_of_home);
}

TEST_F(LogFolder, StaysAsItIsWhereItExists) {
  std::filesystem::create_directory(place() / "logs");
  std::filesystem::permissions(place() / "logs", perms::owner_all | perms::group_all);
  std::ofstream(place() / "logs/kept") << "a log";
  set("TRIFINGER_LOG_DIR", place() / "logs");
  EXPECT_EQ(log_folder(), log_folder());
  EXPECT_EQ(mode_of(place() / "logs"), perms::owner_all | perms::group_all);
  EXPECT_TRUE(std::filesystem::exists(place() / "logs/kept"));
}

TEST_F(LogFolder, IsAnAbsolutePath) {
  const path before = std::filesystem::current_path();
  std::filesystem::current_path(place());
  set("TRIFINGER_LOG_DIR", "logs/today");
  EXPECT_EQ(log_folder(), std::filesystem::current_path() / "logs/today");
  EXPECT_TRUE(std::filesystem::is_directory(place() / "logs/today"));
  std::filesystem::current_path(before);
}

TEST_F(LogFolder, IsNotBelowARelativeXdgStateHome) {
  set("HOME", place());
  set("XDG_STATE_HOME", "state");
  EXPECT_EQ(log_folder(), place() / ".local/state/trifinger");
}

TEST_F(LogFolder, IsAnErrorWhereItCannotBeMade) {
  std::ofstream(place() / "file") << "no folder";
  set("TRIFINGER_LOG_DIR", place() / "file");
  EXPECT_THAT(log_folder, ThrowsMessage<SystemError>(HasSubstr((place() / "file").string())));
  set("TRIFINGER_LOG_DIR", place() / "file/logs");
  EXPECT_THAT(log_folder,
              ThrowsMessage<SystemError>(HasSubstr((place() / "file/logs: Not a dir").string())));
}

TEST_F(LogFolder, IsAnErrorWhereNothingNamesOne) {
  set("HOME", "");
  EXPECT_THAT(log_folder,
              ThrowsMessage<InvalidArgument>(HasSubstr("TRIFINGER_LOG_DIR is not set")));
}

}  // namespace
}  // namespace trifinger
