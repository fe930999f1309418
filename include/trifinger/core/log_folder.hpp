// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <filesystem>

namespace trifinger {

/// Where programs leave what people should find behind a fault: $TRIFINGER_LOG_DIR, else
/// $XDG_STATE_HOME/trifinger, else ~/.local/state/trifinger, as an absolute path. Folders that are
/// not there are made, for this user alone.
/// @throws SystemError naming the folder that cannot be made, InvalidArgument if the environment
/// names none
[[nodiscard]] std::filesystem::path log_folder();

}  // namespace trifinger
