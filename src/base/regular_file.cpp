// SPDX-License-Identifier: BSD-3-Clause
#include "base/regular_file.hpp"

#include <fcntl.h>
#include <pwd.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <climits>
#include <string_view>
#include <vector>

#include "trifinger/base/error.hpp"

namespace trifinger {
namespace {

// Returns nullptr for a regular file.
const char* kind_of(mode_t mode) noexcept {
  switch (mode & S_IFMT) {
    case S_IFREG:
      return nullptr;
    case S_IFDIR:
      return "a folder";
    case S_IFIFO:
      return "a FIFO";
    case S_IFLNK:
      return "a symbolic link";
    case S_IFSOCK:
      return "a socket";
    case S_IFCHR:
    case S_IFBLK:
      return "a device";
    default:
      return "of an unknown kind";
  }
}

int error_of(mode_t mode) noexcept {
  if (S_ISDIR(mode)) return EISDIR;
  return S_ISLNK(mode) ? ELOOP : EINVAL;
}

// True for files of this user or the administrator, and for files shared with one of our groups.
bool is_trusted(const struct stat& status) {
  if (status.st_uid == ::geteuid() || status.st_uid == 0) return true;
  if ((status.st_mode & S_IRGRP) == 0) return false;
  std::vector<gid_t> groups(static_cast<std::size_t>(std::max(0, ::getgroups(0, nullptr))));
  const int count = ::getgroups(static_cast<int>(groups.size()), groups.data());
  groups.resize(static_cast<std::size_t>(std::max(0, count)));
  groups.push_back(::getegid());
  return std::ranges::find(groups, status.st_gid) != groups.end();
}

void require_suitable(const std::filesystem::path& path, const struct stat& status,
                      NamedBy named_by) {
  const std::string of_user = " of user " + user_name(status.st_uid);
  if (const char* const kind = kind_of(status.st_mode)) {
    std::string text = "open " + path.string() + ", which is " + kind + of_user +
                       " where a regular file is expected";
    if (named_by == NamedBy::kProgram) text += "; remove it, or choose another name or folder";
    throw SystemError(text, error_of(status.st_mode));
  }
  if (named_by == NamedBy::kProgram && !is_trusted(status)) {
    throw SystemError("open " + path.string() + ", which is a file" + of_user +
                          " that is shared with none of your groups; let " +
                          user_name(status.st_uid) + " remove it, or choose another name or folder",
                      EPERM);
  }
}

}  // namespace

std::string user_name(uid_t user) {
  passwd entry{};
  passwd* found = nullptr;
  std::array<char, 4096> text{};
  ::getpwuid_r(user, &entry, text.data(), text.size(), &found);
  return found != nullptr ? found->pw_name : std::to_string(user);
}

int open_regular_file(const std::filesystem::path& path, int flags, NamedBy named_by, mode_t mode) {
  // O_NONBLOCK: opening a FIFO would wait for its other end, and opening a file with a lease would
  // wait for the lease's holder.
  flags |= O_NONBLOCK | O_NOCTTY | O_CLOEXEC;
  if (named_by == NamedBy::kProgram) flags |= O_NOFOLLOW;
  const int file = ::open(path.c_str(), flags, mode);
  const int error = errno;
  struct stat status{};
  if (file < 0) {
    // If opening fails, the path may not be a regular file. With O_EXCL any existing file is
    // refused.
    const bool is_new = (flags & O_EXCL) != 0;
    const int follow = named_by == NamedBy::kProgram ? AT_SYMLINK_NOFOLLOW : 0;
    if (!is_new && ::fstatat(AT_FDCWD, path.c_str(), &status, follow) == 0 &&
        kind_of(status.st_mode) != nullptr) {
      require_suitable(path, status, named_by);
    }
    if ((error == EACCES || error == EPERM) && named_by == NamedBy::kProgram &&
        ::lstat(path.c_str(), &status) == 0 && status.st_uid != ::geteuid()) {
      throw SystemError("open " + path.string() + ", which is a file of user " +
                            user_name(status.st_uid) + "; let " + user_name(status.st_uid) +
                            " remove it, or choose another name or folder",
                        error);
    }
    throw SystemError("open " + path.string(), error);
  }
  try {
    if (::fstat(file, &status) != 0) throw SystemError("inspect " + path.string(), errno);
    require_suitable(path, status, named_by);
  } catch (...) {
    ::close(file);
    throw;
  }
  return file;
}

std::size_t read_at(int file, std::uint64_t offset, std::span<std::byte> bytes,
                    const std::filesystem::path& path) {
  std::size_t done = 0;
  while (done < bytes.size()) {
    const ssize_t count =
        ::pread(file, bytes.data() + done, bytes.size() - done, static_cast<off_t>(offset + done));
    if (count == 0) break;
    if (count > 0) {
      done += static_cast<std::size_t>(count);
    } else if (errno != EINTR) {
      throw SystemError("read " + path.string(), errno);
    }
  }
  return done;
}

FileReader::FileReader(const std::filesystem::path& path)
    : path_(path), file_(open_regular_file(path, O_RDONLY, NamedBy::kUser)) {
  struct stat status{};
  size_ = ::fstat(file_, &status) == 0 ? static_cast<std::uint64_t>(status.st_size) : 0;
}

FileReader::~FileReader() { ::close(file_); }

std::size_t FileReader::read(std::span<char> bytes) {
  const std::size_t done = read_at(file_, offset_, std::as_writable_bytes(bytes), path_);
  offset_ += done;
  return done;
}

std::string read_file(const std::filesystem::path& path, std::size_t max_size) {
  FileReader file(path);
  constexpr std::size_t kPiece = 64 * 1024;
  std::string text;
  // The size of the file is not used: kernel files report none, and other files may grow.
  while (true) {
    const std::size_t before = text.size();
    text.resize(before + kPiece);
    const std::size_t count = file.read(std::span(text).subspan(before));
    text.resize(before + count);
    if (text.size() > max_size) {
      throw SystemError("read " + path.string() + ", which has more than the " +
                            std::to_string(max_size) + " bytes that are allowed",
                        EFBIG);
    }
    if (count < kPiece) return text;
  }
}

namespace {

// What a file gets unless it has a mode already, less the umask.
constexpr mode_t kMode = S_IRUSR | S_IWUSR | S_IRGRP | S_IWGRP | S_IROTH | S_IWOTH;
constexpr mode_t kPrivate = S_IRUSR | S_IWUSR;

// Writes these bytes to `file`, which it closes; `sync` makes them survive a loss of power. Returns
// the number of an error, or 0.
int write_and_close(int file, std::span<const std::byte> bytes, bool sync) {
  int error = 0;
  while (!bytes.empty() && error == 0) {
    const ssize_t count = ::write(file, bytes.data(), bytes.size());
    if (count > 0) {
      bytes = bytes.subspan(static_cast<std::size_t>(count));
    } else if (count == 0 || errno != EINTR) {
      error = count == 0 ? ENOSPC : errno;
    }
  }
  if (sync && error == 0 && ::fsync(file) != 0) error = errno;
  if (::close(file) != 0 && error == 0) error = errno;
  return error;
}

// Creates the file `path` with these bytes. `mode` is less the umask.
void write_new(const std::filesystem::path& path, std::span<const std::byte> bytes, bool sync,
               mode_t mode = kMode) {
  const int file = open_regular_file(path, O_WRONLY | O_CREAT | O_EXCL, NamedBy::kProgram, mode);
  const int error = write_and_close(file, bytes, sync);
  if (error == 0) return;
  ::unlink(path.c_str());
  throw SystemError("write " + path.string(), error);
}

// The name under which a file is written until it is whole.
std::filesystem::path draft_of(const std::filesystem::path& path) {
  constexpr std::string_view kEnding = ".new";
  std::string name = path.filename().string();
  // A shortened name is shorter than all that are shortened, so it is never `path` itself.
  if (name.size() + kEnding.size() > NAME_MAX) name.resize(NAME_MAX - 2 * kEnding.size());
  return path.parent_path() / name.append(kEnding);
}

}  // namespace

void write_new_file(const std::filesystem::path& path, std::span<const std::byte> bytes) {
  write_new(path, bytes, /*sync=*/false);
}

void replace_file(const std::filesystem::path& path, std::span<const std::byte> bytes) {
  const std::filesystem::path draft = draft_of(path);
  // A kill may have left it.
  if (::unlink(draft.c_str()) != 0 && errno != ENOENT) {
    throw SystemError("remove " + draft.string(), errno);
  }
  struct stat before{};
  const bool is_new = ::lstat(path.c_str(), &before) != 0 || !S_ISREG(before.st_mode);
  // Whoever may not read the file may not read its draft, either.
  try {
    write_new(draft, bytes, /*sync=*/true, is_new ? kMode : kPrivate);
  } catch (const SystemError& error) {
    throw SystemError("write " + path.string(), error.error_number());  // nobody knows the draft
  }
  // A file system without modes refuses this.
  if (!is_new) ::chmod(draft.c_str(), before.st_mode & (S_IRWXU | S_IRWXG | S_IRWXO));
  if (::rename(draft.c_str(), path.c_str()) != 0) {
    const int error = errno;
    ::unlink(draft.c_str());
    if (error != EBUSY) {
      throw SystemError("rename " + draft.string() + " to " + path.string(), error);
    }
    // The file alone is mounted there, as containers do it: no other can take its place.
    const int file = open_regular_file(path, O_WRONLY | O_TRUNC, NamedBy::kProgram);
    const int failure = write_and_close(file, bytes, /*sync=*/true);
    if (failure != 0) throw SystemError("write " + path.string(), failure);
    return;
  }
  // Otherwise a loss of power could bring the old file back. Some file systems cannot do this.
  const std::filesystem::path folder = path.has_parent_path() ? path.parent_path() : ".";
  const int opened = ::open(folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
  if (opened < 0) return;
  ::fsync(opened);
  ::close(opened);
}

}  // namespace trifinger
