// SPDX-License-Identifier: BSD-3-Clause
#include "sensor_file.hpp"

#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <optional>
#include <system_error>
#include <utility>
#include <vector>

#include "base/regular_file.hpp"
#include "ipc/file_lock.hpp"
#include "session_directory.hpp"
#include "trifinger/base/error.hpp"
#include "trifinger/core/session.hpp"
#include "trifinger/ipc/process.hpp"

namespace trifinger::detail {
namespace {

std::string file_of(const char* kind, const std::string& robot, const std::string& sensor) {
  require_valid_name(robot);
  require_valid_name(sensor);
  return kind + robot + "." + sensor;
}

// Removes the hidden names of files that killed processes have left: they keep memory. Only the
// owner of the lock may do this. A process that is just making its lock begins again.
void remove_leftovers(const std::string& file) {
  std::error_code error;
  for (const auto& entry : std::filesystem::directory_iterator(session_folder(), error)) {
    const std::string name = entry.path().filename().string();
    if (name.starts_with("." + file + ".")) ::unlink(entry.path().c_str());
  }
}

}  // namespace

std::string sensor_file(const std::string& robot, const std::string& sensor) {
  return file_of("trifinger-sensor.", robot, sensor);
}

std::string payload_file(const std::string& robot, const std::string& sensor) {
  return file_of("trifinger-payload.", robot, sensor);
}

ipc::SharedMemory own_sensor_file(const std::string& file, const std::string& what) {
  const auto directory = directory_in(session_folder());
  const std::string name = file + ".lock";
  std::optional<ipc::SharedMemory> lock =
      claim([&] { return directory->open_or_create(name, kOwnerAlone); });
  const ipc::LockTimeout timeout;
  while (!lock || !ipc::try_lock(lock->file())) {
    const std::vector<ipc::ProcessIdentity> owners = ipc::owners_of(session_folder() / name);
    const bool is_ending = std::ranges::any_of(owners, &ipc::ProcessIdentity::is_ending);
    if (lock && timeout.wait(is_ending)) continue;
    if (lock) leave(*lock);
    throw Error((owners.empty() ? "another process" : ipc::describe(owners.front())) +
                " is already " + what + "; end it first");
  }
  ipc::unlock(lock->file(), ipc::Lock::kClaim);
  remove_leftovers(file);
  return std::move(*lock);
}

void require_own_file(const ipc::FileDescriptor& file, const std::string& name) {
  struct stat status{};
  if (::fstat(file.get(), &status) != 0) throw SystemError("inspect " + name, errno);
  require(status.st_uid == ::geteuid() || status.st_uid == 0,
          "it belongs to user " + user_name(status.st_uid));
}

}  // namespace trifinger::detail
