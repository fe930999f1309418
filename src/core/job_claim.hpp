// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <optional>
#include <string>
#include <utility>

#include "ipc/shared_memory.hpp"
#include "trifinger/ipc/fork.hpp"

namespace trifinger {

/// The right to run jobs of users on a robot, for as long as the object lives. It is a lock in the
/// robot's own lock file, so only who may drive the robot can have it. It ends with its process,
/// whatever happens. A back-end that ends meanwhile leaves the file to the next one.
class JobClaim {
 public:
  /// The claim on `robot`. Nothing if the robot has no lock file, because it does not run.
  /// @throws Error if another has it, InvalidArgument, SystemError
  [[nodiscard]] static std::optional<JobClaim> take(const std::string& robot);

  JobClaim(JobClaim&&) noexcept = default;
  JobClaim& operator=(JobClaim&&) noexcept = default;
  ~JobClaim();

 private:
  explicit JobClaim(ipc::SharedMemory lock) : lock_(std::move(lock)) {}

  ipc::SharedMemory lock_;
  ipc::ForkGuard fork_;
};

}  // namespace trifinger
