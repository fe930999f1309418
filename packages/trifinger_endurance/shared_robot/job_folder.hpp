// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <filesystem>
#include <optional>

#include "shared_robot/confined_program.hpp"

namespace trifinger::apps {

// Makes the folder of a job where it is missing, with the folders on the way to it, and returns its
// real path. Root does this for others, so no link is followed then, and nobody else may be able to
// exchange a folder on the way: each belongs to root, and only root may write in it, or it is
// sticky like /tmp. Throws UsageError that names the folder, SystemError.
[[nodiscard]] std::filesystem::path make_job_folder(const std::filesystem::path& wanted);

// Makes `folder`/work, the working folder of a job, and work/tmp in it, which must be new. They are
// given to `user` if there is one. Throws UsageError, SystemError.
void make_work_folder(const std::filesystem::path& folder, const std::optional<SystemUser>& user);

}  // namespace trifinger::apps
