// SPDX-License-Identifier: BSD-3-Clause
#include "endurance/history.hpp"

#include <fcntl.h>
#include <fmt/core.h>

#include <algorithm>
#include <cerrno>
#include <span>
#include <string_view>
#include <system_error>
#include <utility>

#include "base/regular_file.hpp"
#include "ipc/file_lock.hpp"
#include "trifinger/base/error.hpp"

namespace trifinger::apps {
namespace {

using Json = nlohmann::ordered_json;

constexpr std::string_view kFormat = "trifinger endurance";
constexpr int kVersion = 1;
constexpr std::size_t kMaxBytes = std::size_t{64} << 20U;
constexpr std::size_t kLongestWords = 400;

// FNV-1a: it finds damage by accident, and nobody gains by damaging it on purpose.
// http://www.isthe.com/chongo/tech/comp/fnv/
std::uint64_t checksum(std::string_view text) noexcept {
  std::uint64_t sum = 0xcbf29ce484222325U;
  for (const char byte : text) {
    sum ^= static_cast<unsigned char>(byte);
    sum *= 0x100000001b3U;
  }
  return sum;
}

std::string line_of(const Json& json) {
  // A text of a driver may be no UTF-8.
  return json.dump(-1, ' ', false, Json::error_handler_t::replace) + "\n";
}

std::string last_line(std::string_view text) {
  return fmt::format("{{\"checksum\":\"{:016x}\"}}\n", checksum(text));
}

}  // namespace

History::History(Owner owner)
    : owner_(std::move(owner)), total_(owner_.joints.size()), last_words_(kNumFailures) {
  intervals_.reserve(kMaxIntervals + 1);
}

void History::add(const Tally& tally, std::int64_t now) {
  if (intervals_.empty() || intervals_.back().tally.time >= length_) {
    if (intervals_.size() == kMaxIntervals) merge_neighbours();
    // After the merging, the last one may have room again.
    if (intervals_.empty() || intervals_.back().tally.time >= length_) {
      intervals_.push_back({.begin = now, .tally = Tally(num_joints())});
    }
  }
  intervals_.back().tally.add(tally);
  total_.add(tally);
}

void History::set_last_words(Failure failure, const std::string& text) {
  last_words_[static_cast<std::size_t>(failure)] = text.substr(0, kLongestWords);
}

void History::merge_neighbours() {
  for (std::size_t i = 0; 2 * i < intervals_.size(); ++i) {
    Interval merged = std::move(intervals_[2 * i]);
    if (2 * i + 1 < intervals_.size()) merged.tally.add(intervals_[2 * i + 1].tally);
    intervals_[i] = std::move(merged);
  }
  intervals_.resize((intervals_.size() + 1) / 2);
  length_ *= 2;
}

std::string History::text() const {
  Json words = Json::object();
  for (std::size_t i = 0; i < last_words_.size(); ++i) {
    if (!last_words_[i].empty())
      words[std::string(name_of(static_cast<Failure>(i)))] = last_words_[i];
  }
  std::string text = line_of({{"format", kFormat},
                              {"version", kVersion},
                              {"robot", owner_.robot},
                              {"type", owner_.type},
                              {"joints", owner_.joints},
                              {"starts", starts_},
                              {"interval_length", length_.count()},
                              {"last_words", words}});
  for (const Interval& interval : intervals_) {
    Json json{{"begin", interval.begin}};
    json.update(interval.tally.json());
    text += line_of(json);
  }
  return text + last_line(text);
}

History History::parse(const std::string& text) {
  const std::size_t end = text.size() < 2 ? std::string::npos : text.rfind('\n', text.size() - 2);
  if (end == std::string::npos) throw InvalidArgument("it has no lines");
  const std::string_view body = std::string_view(text).substr(0, end + 1);
  if (text.substr(end + 1) != last_line(body)) throw InvalidArgument("its checksum is wrong");
  try {
    std::size_t begin = 0;
    const auto next = [&] {
      const std::size_t stop = body.find('\n', begin);
      const Json json = Json::parse(body.substr(begin, stop - begin));
      begin = stop + 1;
      return json;
    };
    const Json head = next();
    if (head.at("format").get<std::string>() != kFormat ||
        head.at("version").get<int>() != kVersion) {
      throw InvalidArgument("it is of another version");
    }
    History history({.robot = head.at("robot").get<std::string>(),
                     .type = head.at("type").get<std::string>(),
                     .joints = head.at("joints").get<std::vector<std::string>>()});
    history.starts_ = head.at("starts").get<std::uint64_t>();
    history.length_ = Nanoseconds(head.at("interval_length").get<std::int64_t>());
    for (std::size_t i = 0; i < kNumFailures; ++i) {
      history.last_words_[i] =
          head.at("last_words").value(std::string(name_of(static_cast<Failure>(i))), "");
    }
    while (begin < body.size()) {
      const Json json = next();
      history.intervals_.push_back({.begin = json.at("begin").get<std::int64_t>(),
                                    .tally = Tally::parse(json, history.num_joints())});
      history.total_.add(history.intervals_.back().tally);
    }
    if (history.intervals_.size() > kMaxIntervals || history.length_ < kFirstLength) {
      throw InvalidArgument("it has more intervals than it may have");
    }
    return history;
  } catch (const nlohmann::json::exception& error) {
    throw InvalidArgument(error.what());
  }
}

HistoryFolder::HistoryFolder(std::filesystem::path folder) : folder_(std::move(folder)) {
  std::error_code error;
  std::filesystem::create_directories(folder_, error);
  if (error) throw SystemError("make the folder " + folder_.string(), error.value());
  const std::filesystem::path file = folder_ / "lock";
  lock_ = ipc::FileDescriptor(
      [&file] { return open_regular_file(file, O_RDWR | O_CREAT, NamedBy::kUser, 0600); });
  if (!ipc::try_lock(lock_)) {
    throw Error("another process writes to " + folder_.string() +
                ": end it, or choose another folder with --output");
  }
}

std::optional<History> HistoryFolder::read(const Owner& owner) {
  std::error_code ignored;
  if (!std::filesystem::exists(data_file(), ignored)) return std::nullopt;
  const std::string text = read_file(data_file(), kMaxBytes);
  try {
    History history = History::parse(text);
    if (history.owner() != owner) {
      throw Error(fmt::format(
          "{} is the history of '{}', a {} with {} joints, and not of '{}', a {} with {} joints; "
          "choose another folder with --output",
          data_file().string(), history.owner().robot, history.owner().type, history.num_joints(),
          owner.robot, owner.type, owner.joints.size()));
    }
    return history;
  } catch (const InvalidArgument& error) {
    const std::filesystem::path aside = data_file().string() + ".damaged";
    if (::rename(data_file().c_str(), aside.c_str()) != 0) {
      throw SystemError("rename " + data_file().string(), errno);
    }
    damage_ = fmt::format("{} was damaged ({}); it is {} now, and counting begins anew",
                          data_file().string(), error.what(), aside.string());
    return std::nullopt;
  }
}

void HistoryFolder::write(const History& history, const std::string& page) const {
  const std::string text = history.text();
  replace_file(data_file(), std::as_bytes(std::span(text)));
  replace_file(page_file(), std::as_bytes(std::span(page)));
}

}  // namespace trifinger::apps
