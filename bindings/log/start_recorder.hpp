// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <filesystem>
#include <memory>
#include <string>

#include "log/recorder_thread.hpp"

namespace trifinger::bindings {

/// Starts a recorder of a robot of this process. The end of the program stops it at the latest.
/// @throws AlreadyRecorded, InvalidArgument, SystemError
[[nodiscard]] std::shared_ptr<log::RecorderThread> start_recorder(
    const std::string& robot, const std::filesystem::path& folder, const std::string& precision,
    const std::string& images);

/// Makes the end of the program stop all recorders, which finishes their files.
void stop_recorders_at_exit();

}  // namespace trifinger::bindings
