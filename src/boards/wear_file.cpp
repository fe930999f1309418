// SPDX-License-Identifier: BSD-3-Clause
#include "boards/wear_file.hpp"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <charconv>
#include <cstring>
#include <ctime>
#include <string_view>
#include <utility>

#include "base/regular_file.hpp"
#include "base/text_of.hpp"
#include "ipc/file_lock.hpp"
#include "trifinger/base/error.hpp"
#include "trifinger/config/file.hpp"

namespace trifinger::boards {
namespace {

constexpr std::size_t kMaxSize = std::size_t{1} << 20U;
// The newest whole record is searched in so many bytes at the end. A record has about 1000.
constexpr std::size_t kEnd = std::size_t{1} << 16U;
constexpr mode_t kMode = S_IRUSR | S_IWUSR | S_IRGRP | S_IROTH;  // and umask

// Each line ends with its checksum: {...,"crc32":"0123abcd"}
constexpr std::string_view kChecksumKey = R"(,"crc32":")";
constexpr std::string_view kLineEnd = R"("})";
constexpr std::size_t kDigits = 8;

// CRC-32 as in zip, PNG and MCAP files.
std::uint32_t crc32_of(std::string_view text) noexcept {
  std::uint32_t crc = 0xffffffffU;
  for (const char byte : text) {
    crc ^= static_cast<unsigned char>(byte);
    for (int bit = 0; bit < 8; ++bit) {
      crc = (crc >> 1U) ^ ((crc & 1U) != 0 ? 0xedb88320U : 0U);
    }
  }
  return ~crc;
}

std::string checksum_of(std::string_view text) {
  constexpr std::string_view kHex = "0123456789abcdef";
  const std::uint32_t crc = crc32_of(text);
  std::string digits;
  for (std::size_t i = 0; i < kDigits; ++i) {
    digits += kHex[crc >> (4 * (kDigits - 1 - i)) & 0xfU];
  }
  return digits;
}

bool is_whole(std::string_view line) {
  const std::size_t end = kChecksumKey.size() + kDigits + kLineEnd.size();
  if (line.size() < end || !line.ends_with(kLineEnd)) return false;
  const std::string_view text = line.substr(0, line.size() - end);
  const std::string_view rest = line.substr(text.size());
  return rest.starts_with(kChecksumKey) &&
         rest.substr(kChecksumKey.size(), kDigits) == checksum_of(text);
}

// Returns the newest whole line of the end of a file; empty if there is none. A line that was cut
// off has no line feed, but its checksum would be wrong, too.
std::string_view newest_line(std::string_view text) {
  while (!text.empty()) {
    text.remove_suffix(text.ends_with('\n') ? 1 : 0);
    const std::size_t feed = text.rfind('\n');
    const std::size_t begin = feed == std::string_view::npos ? 0 : feed + 1;
    if (is_whole(text.substr(begin))) return text.substr(begin);
    text = text.substr(0, begin);
  }
  return {};
}

// The shortest text that reads back to the same number.
template <class T>
std::string number_text(T number) {
  std::array<char, 32> text{};
  const auto result = std::to_chars(text.begin(), text.end(), number);
  return {text.begin(), result.ptr};
}

template <class T>
std::string list_text(const FieldDescription& field, std::span<const std::byte> element) {
  std::string text;
  for (std::size_t i = 0; i < field.count(); ++i) {
    T number{};
    std::memcpy(&number, element.data() + field.offset + i * sizeof(T), sizeof(T));
    text += (i > 0 ? "," : "") + number_text(number);
  }
  return field.shape.empty() ? text : "[" + text + "]";
}

template <class T>
void read_list(const config::Node& section, const FieldDescription& field,
               std::span<std::byte> element) {
  const config::Node node = section.at(field.name);
  const config::Range range{.min = 0, .max = 1e18};
  const std::vector<T> numbers =
      field.shape.empty() ? std::vector{node.as<T>(range)} : node.as<std::vector<T>>(range);
  if (numbers.size() != field.count()) {
    node.fail("has " + std::to_string(numbers.size()) + " numbers, must have " +
              std::to_string(field.count()));
  }
  std::memcpy(element.data() + field.offset, numbers.data(), numbers.size() * sizeof(T));
}

// True for what a record has: everything but the stamp.
bool is_kept(const FieldDescription& field) { return !field.name.starts_with("stamp."); }

struct stat status_of(const ipc::FileDescriptor& file, const std::filesystem::path& path) {
  struct stat status{};
  if (::fstat(file.get(), &status) != 0) throw SystemError("inspect " + path.string(), errno);
  return status;
}

}  // namespace

WearFile::WearFile(std::filesystem::path path, Owner owner, ElementDescription element)
    : path_(std::move(path)), owner_(std::move(owner)), element_(std::move(element)) {
  for (const FieldDescription& field : element_.fields()) {
    const bool is_known = field.type == ScalarType::kFloat64 || field.type == ScalarType::kUint64;
    detail::require(!is_kept(field) || is_known,
                    "running hours are of float64 and uint64, but '" + field.name + "' is not");
  }
  open();
  if (!file_) return;
  const std::string end = read_end();
  const std::string_view line = newest_line(end);
  if (!line.empty()) {
    newest_ = parse(std::string(line));
    return;
  }
  const std::filesystem::path kept = path_.string() + ".damaged";
  std::error_code error;
  std::filesystem::rename(path_, kept, error);
  if (error) throw SystemError("rename " + path_.string() + ", which is damaged", error.value());
  file_ = {};
  damage_ = path_.string() + " had no whole record; it is now " + kept.string() +
            ", and the running hours begin at zero";
}

void WearFile::open() {
  try {
    file_ = ipc::FileDescriptor(
        [this] { return open_regular_file(path_, O_RDWR | O_APPEND, NamedBy::kProgram); });
  } catch (const SystemError& error) {
    if (error.error_number() == ENOENT) return;
    throw;
  }
  // A process that was killed keeps its lock for a moment.
  const ipc::LockTimeout timeout;
  while (!ipc::try_lock(file_)) {
    const auto owners = ipc::owners_of(path_);
    if (timeout.wait(std::ranges::all_of(owners, &ipc::ProcessIdentity::is_ending))) continue;
    const std::string owner = owners.empty() ? "another process" : ipc::describe(owners.back());
    throw InvalidArgument(owner + " is writing " + path_.string() +
                          "; give the robots different names, or different folders with "
                          "TRIFINGER_LOG_DIR");
  }
}

std::string WearFile::read_end() const {
  const auto size = static_cast<std::size_t>(status_of(file_, path_).st_size);
  std::string text(std::min(size, kEnd), '\0');
  text.resize(
      read_at(file_.get(), size - text.size(), std::as_writable_bytes(std::span(text)), path_));
  return text;
}

std::vector<std::byte> WearFile::parse(const std::string& line) const {
  // JSON is YAML, too.
  const config::File file = config::File::parse(line, path_);
  const config::Node root = file.root();
  const Owner found{.robot = root.required<std::string>("robot"),
                    .type = root.required<std::string>("type")};
  if (found.robot != owner_.robot || found.type != owner_.type) {
    throw InvalidArgument(path_.string() + " has the running hours of '" + found.robot + "' (" +
                          found.type + ") instead of '" + owner_.robot + "' (" + owner_.type +
                          "); move it away");
  }
  std::vector<std::byte> element(element_.size());
  const config::Node wear = root.section("wear");
  for (const FieldDescription& field : element_.fields()) {
    if (!is_kept(field)) continue;
    if (field.type == ScalarType::kFloat64) {
      read_list<double>(wear, field, element);
    } else {
      read_list<std::uint64_t>(wear, field, element);
    }
  }
  return element;
}

std::string WearFile::line_of(std::span<const std::byte> element) const {
  // Names of robots are names of files without special characters.
  std::string text = R"({"time":")" + trifinger::detail::utc_text(std::time(nullptr), "%FT%TZ") +
                     R"(","robot":")" + owner_.robot + R"(","type":")" + owner_.type +
                     R"(","wear":{)";
  const char* separator = "";
  for (const FieldDescription& field : element_.fields()) {
    if (!is_kept(field)) continue;
    text += std::exchange(separator, ",");
    text += '"' + field.name + "\":" +
            (field.type == ScalarType::kFloat64 ? list_text<double>(field, element)
                                                : list_text<std::uint64_t>(field, element));
  }
  text += '}';
  const std::string checksum = checksum_of(text);
  text.append(kChecksumKey).append(checksum).append(kLineEnd);
  return text + '\n';
}

void WearFile::append(std::span<const std::byte> element) {
  detail::require(element.size() == element_.size(), "this is no element of running hours");
  const std::string line = line_of(element);
  // Somebody may have removed the file.
  struct stat status{};
  if (file_) status = status_of(file_, path_);
  const auto size = static_cast<std::size_t>(status.st_size);
  if (status.st_nlink == 0 || size + line.size() > kMaxSize) {
    replace_by(line);
    return;
  }

  char last = '\n';
  if (size > 0) static_cast<void>(::pread(file_.get(), &last, 1, status.st_size - 1));
  try {
    // A kill may have left a part of a line.
    write(file_, last == '\n' ? line : '\n' + line);
  } catch (const SystemError&) {
    static_cast<void>(::ftruncate(file_.get(), status.st_size));
    throw;
  }
}

void WearFile::replace_by(const std::string& line) {
  const std::filesystem::path path = path_.string() + ".new";
  // A kill may have left it.
  if (::unlink(path.c_str()) != 0 && errno != ENOENT) {
    throw SystemError("remove " + path.string(), errno);
  }
  ipc::FileDescriptor file([&path] {
    return open_regular_file(path, O_RDWR | O_APPEND | O_CREAT | O_EXCL, NamedBy::kProgram, kMode);
  });
  static_cast<void>(ipc::try_lock(file));
  write(file, line);
  if (::rename(path.c_str(), path_.c_str()) != 0) {
    throw SystemError("rename " + path.string() + " to " + path_.string(), errno);
  }
  file_ = std::move(file);
  // Otherwise a loss of power could bring the old file back. Some file systems cannot do this.
  const ipc::FileDescriptor folder(
      [this] { return ::open(path_.parent_path().c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC); });
  if (folder) static_cast<void>(::fsync(folder.get()));
}

void WearFile::write(const ipc::FileDescriptor& file, std::string_view text) const {
  const std::string doing = "write " + path_.string();
  while (!text.empty()) {
    const ssize_t count = ::write(file.get(), text.data(), text.size());
    if (count > 0) {
      text.remove_prefix(static_cast<std::size_t>(count));
    } else if (count == 0 || errno != EINTR) {
      throw SystemError(doing, count == 0 ? ENOSPC : errno);
    }
  }
  int result = 0;
  do {
    result = ::fdatasync(file.get());
  } while (result != 0 && errno == EINTR);
  if (result != 0) throw SystemError(doing, errno);
}

}  // namespace trifinger::boards
