// SPDX-License-Identifier: BSD-3-Clause
#include "core/job_claim.hpp"

#include <cerrno>

#include "ipc/file_lock.hpp"
#include "session_directory.hpp"
#include "trifinger/base/error.hpp"
#include "trifinger/core/session.hpp"

namespace trifinger {

std::optional<JobClaim> JobClaim::take(const std::string& robot) {
  detail::require_valid_name(robot);
  const auto directory = detail::directory_in(session_folder());
  std::optional<ipc::SharedMemory> lock;
  try {
    lock = detail::claim(
        [&] { return directory->open(detail::lock_file(robot), ipc::Access::kReadWrite); });
  } catch (const SystemError& error) {
    if (error.error_number() == ENOENT) return std::nullopt;
    throw;
  }
  if (!lock) throw Error("'" + robot + "' is in use: another process is just starting it");
  if (!ipc::try_lock(lock->file(), ipc::Lock::kJob)) {
    throw Error("'" + robot + "' is in use: another 'trifinger job' has not ended yet");
  }
  // Nobody removes the file from here on, so its claim is free for others.
  ipc::unlock(lock->file(), ipc::Lock::kClaim);
  return JobClaim(std::move(*lock));
}

JobClaim::~JobClaim() {
  if (!fork_.is_inherited()) detail::leave(lock_);
}

}  // namespace trifinger
