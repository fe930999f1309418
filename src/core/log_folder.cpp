// SPDX-License-Identifier: BSD-3-Clause
#include "core/log_folder.hpp"

#include "base/user_folder.hpp"

namespace trifinger {

std::filesystem::path log_folder() {
  return UserFolder{.purpose = "logs",
                    .variable = "TRIFINGER_LOG_DIR",
                    .xdg_variable = "XDG_STATE_HOME",
                    .at_home = ".local/state"}
      .make();
}

}  // namespace trifinger
