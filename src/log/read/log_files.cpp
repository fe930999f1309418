// SPDX-License-Identifier: BSD-3-Clause
#include "log/read/log_files.hpp"

#include <algorithm>
#include <tuple>

#include "base/regular_file.hpp"
#include "log/format/format.hpp"
#include "log/format/records.hpp"
#include "log/format/text.hpp"
#include "trifinger/base/error.hpp"

namespace trifinger::log::detail {

namespace {

// Leaves only the files of the newest recording, and the damage of its parts.
void leave_newest_recording(std::vector<LogFile>& files, std::vector<Damage>& damage) {
  const auto age = [](const LogFile& file) {
    return std::tuple(file.began(), file.created(), file.path);
  };
  const std::string newest = std::ranges::max_element(files, {}, age)->recording();
  std::erase_if(files, [&](const LogFile& file) { return file.recording() != newest; });
  // A file that is not a log counts as a part of this recording if its name fits.
  const auto stem = [](const std::filesystem::path& path) {
    const std::string name = path.filename().string();
    return name.substr(0, name.rfind('_'));
  };
  std::erase_if(damage, [&](const Damage& one) {
    return std::ranges::none_of(
        files, [&](const LogFile& file) { return stem(file.path) == stem(one.file); });
  });
}

}  // namespace

LogFile::LogFile(const std::filesystem::path& its_path)
    : path(its_path), size(FileReader(its_path).size()), reader(its_path) {
  const mcap::Contents& contents = reader.contents();
  for (const mcap::Metadata& record : contents.metadata) {
    if (record.name == kLogRecord) origin = record.entries;
  }
  const bool is_ours = !origin.empty() || contents.library.starts_with("trifinger") ||
                       std::ranges::any_of(contents.channels, [](const auto& channel) {
                         return channel.second.metadata.contains("role") &&
                                channel.second.metadata.contains("session");
                       });
  if (!is_ours) {
    throw mcap::FormatError(path.string() +
                            " is an MCAP file but no log of robots: it has no record " +
                            "'trifinger.log'");
  }
  const std::int64_t version =
      number_of<std::int64_t>(entry_of(origin, "format_version")).value_or(1);
  if (version > kFormatVersion) {
    throw mcap::FormatError(
        path.string() + " has log format " + std::to_string(version) +
        ", known are formats up to " + std::to_string(kFormatVersion) +
        ": reading it needs trifinger >= " + entry_of(origin, "trifinger_version"));
  }
}

std::int64_t LogFile::part() const {
  return number_of<std::int64_t>(entry_of(origin, "part")).value_or(0);
}

std::string LogFile::recording() const { return entry_of(origin, "recording"); }

std::string LogFile::created() const { return entry_of(origin, "created"); }

std::string LogFile::began() const {
  const std::string name = path.filename().string();
  if (const std::string_view date = date_in(name); !date.empty()) return std::string(date);
  // Somebody has chosen the name. "2026-11-20T09:05:12Z" becomes a date as in names.
  std::string date = created().substr(0, kDatePattern.size());
  std::ranges::replace(date, 'T', '_');
  std::ranges::replace(date, ':', '-');
  return date;
}

std::vector<LogFile> open_parts(const std::vector<std::filesystem::path>& parts, Several several,
                                std::vector<Damage>& damage) {
  std::vector<LogFile> files;
  for (const std::filesystem::path& path : parts) {
    try {
      files.emplace_back(path);
    } catch (const mcap::FormatError& error) {
      if (parts.size() == 1) throw;
      // A recorder that was killed while it began a part leaves such a file.
      damage.push_back({path, 0, FileReader(path).size(), error.what()});
    }
  }
  if (files.empty()) {
    throw mcap::FormatError("none of the files is a log: " + parts.front().string() +
                            " and others");
  }
  if (several == Several::kTakeNewest) leave_newest_recording(files, damage);

  std::ranges::stable_sort(files, {}, &LogFile::part);
  const LogFile* before = nullptr;
  for (const LogFile& file : files) {
    if (before != nullptr && file.recording() != before->recording()) {
      throw InvalidArgument(before->path.string() + " and " + file.path.string() +
                            " are of two recordings; name the files of one");
    }
    if (before != nullptr && file.part() == before->part()) {
      throw InvalidArgument(before->path.string() + " and " + file.path.string() +
                            " are the same part of a recording");
    }
    if (before != nullptr && file.part() != before->part() + 1) {
      damage.push_back({file.path, 0, 0,
                        "Part " + std::to_string(before->part() + 1) +
                            " of the recording and what follows it is missing"});
    }
    before = &file;
  }
  return files;
}

std::vector<Damage> damage_of(const std::filesystem::path& file, std::uint64_t size,
                              const mcap::Contents& contents) {
  std::vector<Damage> all;
  std::uint64_t end = contents.complete_size;
  for (const mcap::Damage& damage : contents.damage) {
    all.push_back({file, damage.offset, damage.size, damage.reason});
    end = std::max(end, damage.offset + damage.size);
  }
  if (end < size) all.push_back({file, end, size - end, "The file ends inside a record"});
  return all;
}

std::uint64_t lost_bytes_of(const std::vector<Damage>& damage, std::uint64_t size) {
  std::vector<std::pair<std::uint64_t, std::uint64_t>> intervals;
  for (const Damage& one : damage) {
    const std::uint64_t first = std::min(one.offset, size);
    intervals.emplace_back(first, first + std::min(one.size, size - first));
  }
  std::ranges::sort(intervals);
  std::uint64_t sum = 0;
  std::uint64_t end = 0;
  for (const auto& [first, last] : intervals) {
    if (last <= end) continue;
    sum += last - std::max(first, end);
    end = last;
  }
  return sum;
}

}  // namespace trifinger::log::detail
