// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <filesystem>

namespace trifinger {

/// The folder where programs leave logs and other files for people to look at after a fault:
/// $TRIFINGER_LOG_DIR, else $XDG_STATE_HOME/trifinger, else ~/.local/state/trifinger. The path is
/// absolute. Missing folders are created, accessible to this user only.
/// @throws SystemError that names the folder that cannot be made, InvalidArgument if the
/// environment names none
[[nodiscard]] std::filesystem::path log_folder();

}  // namespace trifinger
