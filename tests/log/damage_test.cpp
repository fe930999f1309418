// SPDX-License-Identifier: BSD-3-Clause
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <map>
#include <random>
#include <set>
#include <string>
#include <vector>

#include "log/recordings.hpp"
#include "log/repair.hpp"
#include "support/sanitizers.hpp"
#include "trifinger/log/log.hpp"

// Whatever is done to a file, everything that is read is true, and everything lost is reported.

namespace trifinger::log {
namespace {

using test::Folder;
using test::OddLampReading;
using test::OddSession;
using test::random_session;
using test::same_bytes;

// Ten steps and the readings of the lamp between them.
constexpr TimeIndex kBlock = 10;
constexpr std::size_t kInChunk = 14;

constexpr int kNumFlips = test::kHasSanitizer ? 2'500 : 50'000;
// Number of bytes by which each prefix is shorter than the one before.
constexpr std::size_t kPrefixStep = test::kHasSanitizer ? 7 : 1;

// Asks a damaged log everything. Throws if something is not true. The sessions are those that were
// written, in their order.
class Examination {
 public:
  explicit Examination(const std::vector<OddSession>& written) : written_(written) {}

  // Returns the number of elements found.
  std::size_t examine(const Log& log) {
    std::size_t found = 0;
    is_named_ = log.lost_bytes() > 0 || !log.damage().empty();
    for (const LoggedSession& session : log.sessions()) {
      const OddSession& truth = truth_of(session);
      const test::FoundSteps steps = test::read_steps(session);
      require(test::is_true(steps, truth), "a step is wrong");
      require_gaps(session.gaps(), steps.indices, truth.steps());
      found += steps.indices.size();
      for (const LoggedSession& companion : session.companions()) {
        found += examine_companion(companion, truth);
      }
      if (session.steps()) require(*session.steps() == truth.steps(), "the steps are wrong");
    }
    return found;
  }
  [[nodiscard]] bool is_named() const noexcept { return is_named_; }

  static void require(bool is_so, const std::string& what) {
    if (!is_so) throw Error(what);
  }

 private:
  [[nodiscard]] const OddSession& truth_of(const LoggedSession& session) const {
    for (const OddSession& written : written_) {
      if (written.header.session_id == session.header().session_id &&
          written.header.name == session.name()) {
        return written;
      }
    }
    throw Error("there is a session that never was");
  }

  std::size_t examine_companion(const LoggedSession& companion, const OddSession& truth) {
    if (!companion.has_elements()) return 0;
    SeriesReader reader = companion.read({Column{}});
    std::vector<OddLampReading> elements(truth.lamp.size() + 1);
    std::vector<TimeIndex> indices(elements.size());
    void* const address = elements.data();
    const std::size_t count =
        reader.read(elements.size(), {.indices = indices.data(), .columns = {&address, 1}});
    for (std::size_t i = 0; i < count; ++i) {
      const auto index = static_cast<std::size_t>(indices[i]);
      require(index < truth.lamp.size() && same_bytes(elements[i], truth.lamp[index]),
              "an element of the companion is wrong");
    }
    indices.resize(count);
    for (const Gap& gap : companion.gaps()) is_named_ = is_named_ || gap.first <= gap.last;
    return count;
  }

  // Gaps and found steps do not overlap. Together they cover everything between the first and the
  // last step.
  void require_gaps(const std::vector<Gap>& gaps, const std::vector<TimeIndex>& indices,
                    TimeIndex steps) {
    std::set<TimeIndex> all(indices.begin(), indices.end());
    for (const Gap& gap : gaps) {
      is_named_ = true;
      for (TimeIndex t = gap.first; t <= gap.last; ++t) {
        require(t < steps && all.insert(t).second, "a gap is wrong");
      }
    }
    const TimeIndex last = all.empty() ? -1 : *all.rbegin();
    require(last + 1 == static_cast<TimeIndex>(all.size()), "something is missing without a gap");
  }

  const std::vector<OddSession>& written_;
  bool is_named_{false};
};

std::size_t num_elements(const std::vector<OddSession>& sessions) {
  std::size_t sum = 0;
  for (const OddSession& session : sessions) {
    sum += session.desired_actions.size() + session.lamp.size();
  }
  return sum;
}

// A small log with everything: two sessions, companions, events, documents.
class DamagedLog : public ::testing::Test {
 protected:
  DamagedLog() {
    test::write_log(folder_ / "whole.mcap", sessions_, {}, kBlock);
    whole_ = test::read_file(folder_ / "whole.mcap");
    path_ = folder_ / "damaged.mcap";
  }

  Folder folder_;
  std::vector<OddSession> sessions_{random_session(1, 60), random_session(2, 45, false)};
  test::Bytes whole_;
  std::filesystem::path path_;
};

TEST_F(DamagedLog, fault_24_GivesAllCompleteStepsOfEveryPrefix) {
  Examination examination(sessions_);
  std::size_t longer = num_elements(sessions_);
  std::size_t num_unreadable = 0;
  test::write_file(path_, whole_);
  for (std::size_t size = whole_.size(); size >= kPrefixStep;) {
    size -= kPrefixStep;
    std::filesystem::resize_file(path_, size);
    std::size_t found = 0;
    try {
      const Log log(path_);
      EXPECT_FALSE(log.is_finished());
      found = examination.examine(log);
      EXPECT_EQ(log.size(), size);
      EXPECT_LT(log.lost_bytes(), size);
      // Only what was cut in two is lost.
      for (const Damage& damage : log.damage()) EXPECT_EQ(damage.offset + damage.size, size);
    } catch (const mcap::FormatError&) {
      ++num_unreadable;
    }
    // A few bytes fewer cost a chunk if one of them belonged to it.
    ASSERT_LE(found, longer) << size;
    ASSERT_GE(found + kInChunk, longer) << size;
    longer = found;
  }
  EXPECT_LT(num_unreadable, 50U);  // the beginning of the file
}

TEST_F(DamagedLog, fault_25_NeverYieldsAWrongNumberWhicheverBitsFlip) {
  Examination examination(sessions_);
  const std::size_t all = num_elements(sessions_);
  test::write_file(path_, whole_);
  std::fstream file(path_, std::ios::in | std::ios::out | std::ios::binary);
  const auto put = [&file](std::size_t place, char byte) {
    file.seekp(static_cast<std::streamoff>(place)).put(byte).flush();
  };
  std::mt19937 random(1);
  for (int i = 0; i < kNumFlips; ++i) {
    std::map<std::size_t, char> flipped;
    for (unsigned k = 0; k <= (random() % 4 == 0 ? 2U : 0U); ++k) {
      const std::size_t place = random() % whole_.size();
      flipped[place] = test::flipped(whole_[place], random() % 8);
    }
    for (const auto& [place, byte] : flipped) put(place, byte);
    const auto where = [&] {
      std::string text = "flipped:";
      for (const auto& [place, byte] : flipped) text += " " + std::to_string(place);
      return text;
    };
    try {
      const std::size_t found = examination.examine(Log(path_));
      ASSERT_LE(found, all) << where();
      ASSERT_TRUE(found == all || examination.is_named()) << where() << ", found " << found;
    } catch (const mcap::FormatError& error) {
      // The flip was in the magic bytes at the beginning.
      ASSERT_LT(flipped.begin()->first, 64U) << where() << ": " << error.what();
    } catch (const std::exception& error) {
      FAIL() << where() << ": " << error.what();
    }
    for (const auto& [place, byte] : flipped) put(place, whole_[place]);
  }
}

TEST_F(DamagedLog, fault_25_LosesOneChunkAtMostForOneFlippedBit) {
  std::mt19937 random(2);
  Examination examination(sessions_);
  const std::size_t all = num_elements(sessions_);
  for (int i = 0; i < 500; ++i) {
    test::Bytes bytes = whole_;
    test::flip(bytes, random);
    test::write_file(path_, bytes);
    ASSERT_GE(examination.examine(Log(path_)) + kInChunk, all);
  }
}

}  // namespace
}  // namespace trifinger::log
