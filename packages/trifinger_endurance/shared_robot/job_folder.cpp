// SPDX-License-Identifier: BSD-3-Clause
#include "shared_robot/job_folder.hpp"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <string>
#include <utility>

#include "shared/exit_code.hpp"
#include "trifinger/base/error.hpp"
#include "trifinger/ipc/file_descriptor.hpp"

namespace trifinger::apps {
namespace {

namespace fs = std::filesystem;

constexpr int kFolder = O_RDONLY | O_DIRECTORY | O_NOFOLLOW | O_CLOEXEC;

ipc::FileDescriptor open_in(const ipc::FileDescriptor& parent, const fs::path& name) {
  return ipc::FileDescriptor([&] { return ::openat(parent.get(), name.c_str(), kFolder); });
}

// Refuses a folder that somebody else could exchange, or fill with links.
void require_trusted(const ipc::FileDescriptor& folder, const fs::path& path) {
  struct stat status{};
  if (::fstat(folder.get(), &status) != 0) throw SystemError("look at " + path.string(), errno);
  const bool is_open_to_others =
      (status.st_mode & (S_IWGRP | S_IWOTH)) != 0 && (status.st_mode & S_ISVTX) == 0;
  if (status.st_uid == 0 && !is_open_to_others) return;
  throw UsageError("others than root may change " + path.string() +
                   ", so root does not write there: --output names a folder of root's own");
}

// Opens the folder as root, step by step from above, so that each was looked at.
void make_as_root(const fs::path& path) {
  ipc::FileDescriptor folder([] { return ::open("/", kFolder); });
  if (!folder) throw SystemError("open /", errno);
  fs::path here = "/";
  for (const fs::path& name : path.relative_path()) {
    require_trusted(folder, here);
    here /= name;
    ipc::FileDescriptor next = open_in(folder, name);
    if (!next && errno == ENOENT) {
      if (::mkdirat(folder.get(), name.c_str(), 0755) != 0)
        throw SystemError("make " + here.string(), errno);
      next = open_in(folder, name);
    }
    if (!next && (errno == ELOOP || errno == ENOTDIR))
      throw UsageError(here.string() + " is not a folder but a link or a file: root follows none");
    if (!next) throw SystemError("open " + here.string(), errno);
    folder = std::move(next);
  }
  require_trusted(folder, here);
}

}  // namespace

fs::path make_job_folder(const fs::path& wanted) {
  fs::path path = fs::absolute(wanted).lexically_normal();
  if (!path.has_filename()) path = path.parent_path();
  if (::geteuid() == 0) {
    make_as_root(path);
    return path;
  }
  fs::create_directories(path);
  return fs::canonical(path);
}

void make_work_folder(const fs::path& folder, const std::optional<SystemUser>& user) {
  const ipc::FileDescriptor parent([&] { return ::open(folder.c_str(), kFolder); });
  if (!parent) throw SystemError("open " + folder.string(), errno);
  const auto make_in = [&](const ipc::FileDescriptor& place, const fs::path& path) {
    const fs::path name = path.filename();
    if (::mkdirat(place.get(), name.c_str(), 0755) != 0) {
      if (errno == EEXIST)
        throw UsageError(path.string() + " exists already; --output names a new folder");
      throw SystemError("make " + path.string(), errno);
    }
    ipc::FileDescriptor made = open_in(place, name);
    if (!made) throw SystemError("open " + path.string(), errno);
    return made;
  };
  const ipc::FileDescriptor work = make_in(parent, folder / "work");
  const ipc::FileDescriptor temporary = make_in(work, folder / "work/tmp");
  if (!user) return;
  // The inner one first: in a folder of its own the user could exchange it.
  for (const ipc::FileDescriptor* const made : {&temporary, &work}) {
    if (::fchown(made->get(), user->user, user->group) != 0)
      throw SystemError("give " + folder.string() + "/work to " + user->name, errno);
  }
}

}  // namespace trifinger::apps
