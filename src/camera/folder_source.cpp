// SPDX-License-Identifier: BSD-3-Clause
#include "camera/folder_source.hpp"

#include <algorithm>
#include <cctype>
#include <charconv>
#include <cstring>
#include <limits>
#include <map>
#include <optional>
#include <system_error>
#include <thread>
#include <utility>

#include "base/regular_file.hpp"
#include "camera/image_file.hpp"
#include "trifinger/base/error.hpp"

namespace trifinger::camera {
namespace {

namespace fs = std::filesystem;

bool is_image(const fs::path& path) {
  std::string ending = path.extension().string();
  std::ranges::transform(ending, ending.begin(),
                         [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  return ending == ".png" || ending == ".jpg" || ending == ".jpeg";
}

// A name such that numbers in it compare as numbers: each has its length before it.
std::string sort_key(const std::string& name) {
  std::string key;
  for (std::size_t i = 0; i < name.size();) {
    std::size_t end = i;
    while (end < name.size() && std::isdigit(static_cast<unsigned char>(name[end])) != 0) ++end;
    if (end == i) {
      key += name[i++];
      continue;
    }
    while (i + 1 < end && name[i] == '0') ++i;
    key += static_cast<char>('0' + std::min<std::size_t>(end - i, 64));
    key.append(name, i, end - i);
    i = end;
  }
  return key;
}

std::vector<fs::path> images_of(const fs::path& folder, const std::string& camera) {
  const bool has_own = fs::is_directory(folder / camera);
  std::vector<fs::path> files;
  for (const auto& entry : fs::directory_iterator(has_own ? folder / camera : folder)) {
    const std::string stem = entry.path().stem().string();
    if (!is_image(entry.path())) continue;
    // "camera6" is not the beginning of "camera60".
    const bool is_its = stem.starts_with(camera) &&
                        (stem.size() == camera.size() ||
                         std::isdigit(static_cast<unsigned char>(stem[camera.size()])) == 0);
    if (has_own || is_its) files.push_back(entry.path());
  }
  std::ranges::sort(files, {}, [](const fs::path& path) { return sort_key(path.stem().string()); });
  return files;
}

// The time in nanoseconds at the end of a name.
std::optional<std::int64_t> time_of(const fs::path& file) {
  constexpr std::size_t kFewestDigits = 12;
  const std::string stem = file.stem().string();
  std::size_t begin = stem.size();
  while (begin > 0 && std::isdigit(static_cast<unsigned char>(stem[begin - 1])) != 0) --begin;
  std::int64_t time = 0;
  const auto [end, error] = std::from_chars(stem.data() + begin, stem.data() + stem.size(), time);
  if (error != std::errc{} || stem.size() - begin < kFewestDigits) return std::nullopt;
  return time;
}

}  // namespace

FolderSource::FolderSource(const std::vector<Camera>& cameras, FolderOptions options)
    : options_(std::move(options)) {
  detail::require(options_.period > Nanoseconds(0), "the period of images must be above 0");
  detail::require(fs::is_directory(options_.folder),
                  "'" + options_.folder.string() + "' is no folder with images");
  std::vector<std::vector<fs::path>> files;
  bool has_times = true;
  for (const Camera& camera : cameras) {
    names_.push_back(camera.name);
    formats_.push_back(camera.format);
    files.push_back(images_of(options_.folder, camera.name));
    detail::require(!files.back().empty(),
                    "the folder '" + options_.folder.string() + "' has no images of " +
                        camera.name + ": neither a subfolder of this name nor files like " +
                        camera.name + "_1.png");
    for (const fs::path& file : files.back()) has_times = has_times && time_of(file);
  }
  std::map<std::int64_t, std::vector<fs::path>> sets;
  for (std::size_t camera = 0; camera < files.size(); ++camera) {
    for (std::size_t i = 0; i < files[camera].size(); ++i) {
      const fs::path& file = files[camera][i];
      auto& set =
          sets[has_times ? *time_of(file) : static_cast<std::int64_t>(i) * options_.period.count()];
      set.resize(files.size());
      set[camera] = file;
    }
  }
  for (auto& [time, set] : sets) {
    sets_.push_back({.files = std::move(set), .time = Nanoseconds(time - sets.begin()->first)});
  }
}

FolderSource::~FolderSource() = default;

const std::vector<std::string>& FolderSource::names() const noexcept { return names_; }
const std::vector<ImageFormat>& FolderSource::formats() const noexcept { return formats_; }

bool FolderSource::has_ended() const noexcept { return !options_.repeats && count_ == size(); }

Instant FolderSource::due(std::int64_t count) const noexcept {
  const Nanoseconds round = sets_.back().time + options_.period;
  return begin_ + (count / size()) * round + sets_[static_cast<std::size_t>(count % size())].time;
}

void FolderSource::catch_up(Instant now) noexcept {
  // Whole rounds at once, for a reader that has slept for a day.
  const Nanoseconds round = sets_.back().time + options_.period;
  if (options_.repeats) {
    count_ = std::max(count_, (now - begin_) / round * size());
  }
  const std::int64_t end = options_.repeats ? std::numeric_limits<std::int64_t>::max() : size();
  while (count_ + 1 < end && due(count_ + 1) <= now) ++count_;
}

std::vector<std::string> FolderSource::take_messages() { return std::exchange(messages_, {}); }

bool FolderSource::grab(std::span<const std::span<std::byte>> images, std::span<Frame> frames,
                        Timeout timeout) {
  if (has_ended()) return false;
  const Instant now = std::chrono::steady_clock::now();
  if (count_ == 0) begin_ = now;
  if (options_.keeps_pace) catch_up(now);
  const Set& set = sets_[static_cast<std::size_t>(count_ % size())];
  const Instant due = this->due(count_);
  if (timeout != kForever && due - now > timeout) {
    std::this_thread::sleep_for(timeout);
    return false;
  }
  std::this_thread::sleep_until(due);
  const bool is_new = reported_.insert(&set).second;  // a damaged file is reported once
  for (std::size_t i = 0; i < set.files.size(); ++i) {
    frames[i] = Frame{};
    if (set.files[i].empty()) continue;
    frames[i] = {.state = Frame::State::kGood, .number = count_, .time = due, .exposure = {}};
    constexpr std::size_t kMaxSize = std::size_t{256} << 20U;
    try {
      const Picture picture = decode_image(read_file(set.files[i], kMaxSize));
      const std::vector<std::byte> pixels = converted(picture, formats_[i]);
      std::memcpy(images[i].data(), pixels.data(), pixels.size());
    } catch (const InvalidArgument& error) {
      frames[i].state = Frame::State::kDamaged;
      if (is_new) messages_.push_back(set.files[i].string() + ": " + error.what());
    } catch (const SystemError& error) {
      frames[i].state = Frame::State::kDamaged;
      if (is_new) messages_.emplace_back(error.what());
    }
  }
  ++count_;
  return true;
}

}  // namespace trifinger::camera
