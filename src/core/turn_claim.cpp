// SPDX-License-Identifier: BSD-3-Clause
#include "trifinger/core/turn_claim.hpp"

#include <fcntl.h>

#include <cerrno>
#include <filesystem>

#include "session_directory.hpp"
#include "trifinger/base/error.hpp"
#include "trifinger/core/session.hpp"
#include "trifinger/ipc/file_lock.hpp"

namespace trifinger {

ipc::FileDescriptor claim_turn(const std::string& robot) {
  detail::require_valid_name(robot);
  const std::filesystem::path path = session_folder() / detail::lock_file(robot);
  ipc::FileDescriptor file(
      [&path] { return ::open(path.c_str(), O_RDWR | O_NOFOLLOW | O_CLOEXEC); });
  if (!file && errno == ENOENT) return file;
  if (!file) throw SystemError("claim the robot '" + robot + "': open " + path.string(), errno);
  if (ipc::try_lock(file, ipc::Lock::kTurn)) return file;
  throw Error("'" + robot + "' is in use: another 'trifinger job' has not ended yet");
}

}  // namespace trifinger
