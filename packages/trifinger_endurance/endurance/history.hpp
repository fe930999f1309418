// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "endurance/tally.hpp"
#include "trifinger/base/time.hpp"
#include "trifinger/ipc/file_descriptor.hpp"

namespace trifinger::apps {

// Whose history it is.
struct Owner {
  std::string robot;                // name of the session
  std::string type;                 // such as "trifinger"
  std::vector<std::string> joints;  // their names

  friend bool operator==(const Owner&, const Owner&) = default;
};

// What happened in one interval.
struct Interval {
  std::int64_t begin{0};  // wall clock, seconds since 1970
  Tally tally;

  friend bool operator==(const Interval&, const Interval&) = default;
};

// A robot's health over any time in a bounded number of intervals. The first ones last a minute.
// When there are too many, each two neighbours become one, and intervals last twice as long from
// then on. Nothing is lost but detail: the sum of all intervals is everything that was ever added.
class History {
 public:
  static constexpr std::size_t kMaxIntervals = 240;
  static constexpr Nanoseconds kFirstLength = std::chrono::minutes(1);

  explicit History(Owner owner);

  [[nodiscard]] const Owner& owner() const noexcept { return owner_; }
  [[nodiscard]] std::size_t num_joints() const noexcept { return owner_.joints.size(); }
  // The last interval is not over.
  [[nodiscard]] const std::vector<Interval>& intervals() const noexcept { return intervals_; }
  // How long an interval lasts.
  [[nodiscard]] Nanoseconds length() const noexcept { return length_; }
  [[nodiscard]] const Tally& total() const noexcept { return total_; }
  // How often a program has begun to add to it.
  [[nodiscard]] std::uint64_t starts() const noexcept { return starts_; }
  // What was said last about a failure of each kind.
  [[nodiscard]] const std::vector<std::string>& last_words() const noexcept { return last_words_; }

  void count_start() noexcept { ++starts_; }
  // `now` is the wall clock, seconds since 1970.
  void add(const Tally& tally, std::int64_t now);
  void set_last_words(Failure failure, const std::string& text);

  // The history in lines of JSON: the owner, each interval, and a checksum.
  [[nodiscard]] std::string text() const;
  // Throws InvalidArgument that says what is wrong with `text`.
  [[nodiscard]] static History parse(const std::string& text);

  friend bool operator==(const History&, const History&) = default;

 private:
  void merge_neighbours();

  Owner owner_;
  std::vector<Interval> intervals_;
  Nanoseconds length_{kFirstLength};
  Tally total_;
  std::uint64_t starts_{0};
  std::vector<std::string> last_words_;
};

// A history in a folder that no other process uses: in the file "health.jsonl", which is whole
// after any kill.
class HistoryFolder {
 public:
  // Makes the folder and locks it. Throws SystemError, or Error if another process uses it.
  explicit HistoryFolder(std::filesystem::path folder);

  // What lies there; nothing if there is none. A damaged file is set aside, see `damage`.
  // Throws Error if it belongs to another robot, SystemError.
  [[nodiscard]] std::optional<History> read(const Owner& owner);
  // Says that a damaged file was set aside; otherwise empty.
  [[nodiscard]] const std::string& damage() const noexcept { return damage_; }
  // Replaces the history and the page. Throws SystemError; the files are then as before.
  void write(const History& history, const std::string& page) const;

  [[nodiscard]] std::filesystem::path data_file() const { return folder_ / "health.jsonl"; }
  [[nodiscard]] std::filesystem::path page_file() const { return folder_ / "health.html"; }

 private:
  std::filesystem::path folder_;
  ipc::FileDescriptor lock_;
  std::string damage_;
};

}  // namespace trifinger::apps
