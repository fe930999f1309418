// SPDX-License-Identifier: BSD-3-Clause
#include "endurance/history.hpp"

#include <fmt/core.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <string>

#include "endurance/page.hpp"
#include "trifinger/base/error.hpp"
#include "trifinger/base/random.hpp"

namespace trifinger::apps {
namespace {

using namespace std::chrono_literals;

const Owner kOwner{.robot = "sim", .type = "trifinger", .joints = {"a", "b"}};

// Random numbers that sums of any order give exactly.
Tally random_tally(Random& random) {
  const auto count = [&] { return static_cast<std::uint64_t>(random.integer(0, 1000)); };
  Tally tally(2);
  tally.time = std::chrono::seconds(random.integer(1, 30));
  tally.steps = count();
  tally.collisions = count();
  tally.recoveries = count();
  for (auto* counts :
       {&tally.reasons[3], &tally.failures[5], &tally.failures[22], &tally.moves[1]}) {
    *counts = count();
  }
  for (int i = 0; i < 5; ++i) tally.lateness.add(Nanoseconds(random.integer(0, 3'000'000'000)));
  tally.recovery_times.add(Nanoseconds(random.integer(0, 100'000'000'000)));
  for (JointTally& joint : tally.joints) {
    joint.travel = static_cast<double>(count()) / 8.0;
    joint.friction_sum = static_cast<double>(count()) / 64.0;
    joint.friction_most = static_cast<double>(count()) / 64.0;
    joint.thermal_margin = static_cast<double>(count()) / 1024.0;
    joint.passes = count();
  }
  return tally;
}

struct Folder {
  Folder() { std::filesystem::remove_all(path); }
  Folder(const Folder&) = delete;
  Folder& operator=(const Folder&) = delete;
  ~Folder() { std::filesystem::remove_all(path); }
  std::filesystem::path path{std::filesystem::temp_directory_path() /
                             ("trifinger_endurance_test_" + std::to_string(::getpid()))};
};

std::string text_of(const std::filesystem::path& path) {
  std::ifstream file(path);
  return {std::istreambuf_iterator<char>(file), {}};
}

TEST(History, LosesNothingButDetailAndDoesNotGrow) {
  Random random{.seed = 1};
  History history(kOwner);
  Tally all(2);
  std::size_t largest = 0;
  for (int i = 0; i < 40'000; ++i) {
    const Tally tally = random_tally(random);
    history.add(tally, i);
    all.add(tally);
    ASSERT_LE(history.intervals().size(), History::kMaxIntervals);
    if (i % 1000 == 0) largest = std::max(largest, history.text().size());
  }
  Tally sum(2);
  for (const Interval& interval : history.intervals()) sum.add(interval.tally);
  EXPECT_EQ(sum, all);
  EXPECT_EQ(history.total(), all);
  EXPECT_GT(history.length(), 16min);
  EXPECT_EQ(history.intervals().front().begin, 0);
  EXPECT_LT(largest, 500'000U);
  // All intervals but the last one have about the same length.
  for (std::size_t i = 0; i + 1 < history.intervals().size(); ++i) {
    EXPECT_GE(history.intervals()[i].tally.time, history.length() / 2);
    EXPECT_LE(history.intervals()[i].tally.time, 2 * history.length());
  }
  EXPECT_LT(make_page(history, {.state = "moves", .now = 5}).size(), 500'000U);
}

TEST(History, IsTheSameAfterItWasWrittenAndRead) {
  Random random{.seed = 2};
  History history(kOwner);
  history.count_start();
  history.set_last_words(Failure::kStuck, "joint 3 <is> \"stuck\"\nnow");
  for (int i = 0; i < 100; ++i) history.add(random_tally(random), 1000 + i);
  const History again = History::parse(history.text());
  EXPECT_EQ(again, history);
  EXPECT_EQ(again.text(), history.text());
}

TEST(History, BelievesNoTextThatWasChangedOrCutOffAnywhere) {
  Random random{.seed = 3};
  History history(kOwner);
  for (int i = 0; i < 3; ++i) history.add(random_tally(random), i);
  const std::string text = history.text();
  for (std::size_t i = 0; i < text.size(); ++i) {
    std::string changed = text;
    changed[i] = static_cast<char>(changed[i] ^ 1);
    EXPECT_THROW((void)History::parse(changed), InvalidArgument) << i;
    EXPECT_THROW((void)History::parse(text.substr(0, i)), InvalidArgument) << i;
  }
}

TEST(HistoryFolder, GoesOnWithWhatIsOnDisk) {
  const Folder folder;
  Random random{.seed = 4};
  History history(kOwner);
  history.add(random_tally(random), 1);
  {
    HistoryFolder files(folder.path);
    EXPECT_FALSE(files.read(kOwner).has_value());
    files.write(history, "a page");
  }
  HistoryFolder files(folder.path);
  EXPECT_EQ(files.read(kOwner), history);
  EXPECT_EQ(text_of(files.page_file()), "a page");
}

TEST(HistoryFolder, SetsADamagedFileAsideAndSaysSo) {
  const Folder folder;
  HistoryFolder files(folder.path);
  std::ofstream(files.data_file()) << "{\"format\": 1}\n";
  EXPECT_FALSE(files.read(kOwner).has_value());
  EXPECT_NE(files.damage().find("health.jsonl.damaged"), std::string::npos) << files.damage();
  EXPECT_FALSE(std::filesystem::exists(files.data_file()));
  EXPECT_EQ(text_of(files.data_file().string() + ".damaged"), "{\"format\": 1}\n");
}

TEST(HistoryFolder, RefusesTheHistoryOfAnotherRobotAndASecondProcess) {
  const Folder folder;
  HistoryFolder files(folder.path);
  files.write(History(kOwner), "");
  Owner other = kOwner;
  other.robot = "left";
  EXPECT_THROW((void)files.read(other), Error);
  EXPECT_TRUE(std::filesystem::exists(files.data_file()));
  EXPECT_THROW(HistoryFolder{folder.path}, Error);
}

TEST(Page, ShowsTextsOfRobotsAsTexts) {
  History history({.robot = "<script>", .type = "trifinger", .joints = {"a", "b"}});
  Tally tally(2);
  tally.failures[static_cast<std::size_t>(Failure::kDriver)] = 1;
  history.add(tally, 0);
  history.set_last_words(Failure::kDriver, "<b>&");
  const std::string page = make_page(history, {.state = "<i>", .now = 0});
  EXPECT_EQ(page.find("<script>"), std::string::npos);
  EXPECT_EQ(page.find("<i>"), std::string::npos);
  EXPECT_NE(page.find("&lt;b&gt;&amp;"), std::string::npos);
}

TEST(Page, ShowsTheNewestChecksAndNothingThatIsNone) {
  const Folder folder;
  std::filesystem::create_directories(folder.path);
  const std::filesystem::path checks = folder.path / "history.jsonl";
  const History history(kOwner);
  const auto page = [&] {
    return make_page(history, {.state = "moves", .now = 0, .checks = checks});
  };
  EXPECT_NE(page().find("No check yet"), std::string::npos);
  std::ofstream file(checks);
  for (int i = 0; i < 60; ++i)
    file << fmt::format(R"({{"time": "day {}", "changed": []}})", i) << '\n';
  file << R"({"time": "today", "changed": ["<b> is 2, was 1"]})" << "\nno JSON\n[]\n{}\n";
  file.close();
  const std::string text = page();
  EXPECT_EQ(text.find("day 10<"), std::string::npos);
  EXPECT_NE(text.find("day 59<"), std::string::npos);
  EXPECT_NE(text.find("&lt;b&gt; is 2, was 1"), std::string::npos);
  EXPECT_EQ(make_page(history, {.state = "moves", .now = 0}).find("identified"), std::string::npos);
}

TEST(Times, KnowQuantilesToTheRootOfTwo) {
  Times times;
  for (int i = 1; i <= 1000; ++i) times.add(std::chrono::microseconds(i));
  for (const double fraction : {0.1, 0.5, 0.9, 0.99}) {
    const double found = 1e-3 * static_cast<double>(times.quantile(fraction).count());
    EXPECT_GE(found, 1000 * fraction);
    EXPECT_LE(found, 1.51 * 1000 * fraction);
  }
  EXPECT_EQ(times.longest(), 1ms);
}

}  // namespace
}  // namespace trifinger::apps
