// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <filesystem>
#include <string>

namespace trifinger {

/// Where a program keeps files of its user, as the XDG base directory specification has it.
struct UserFolder {
  std::string purpose;            ///< "logs"
  std::string variable;           ///< The program's own variable, such as "TRIFINGER_LOG_DIR".
  std::string xdg_variable;       ///< "XDG_STATE_HOME"; the files are below, in "trifinger".
  std::filesystem::path at_home;  ///< ".local/state": used if no variable is set.
  std::filesystem::path below{};  ///< A folder in "trifinger".

  /// The absolute path of the folder, which may not exist.
  /// @throws InvalidArgument if the environment names none
  [[nodiscard]] std::filesystem::path path() const;
  /// The same. Missing folders are created, accessible to this user only.
  /// @throws SystemError that names the folder that cannot be made, InvalidArgument
  [[nodiscard]] std::filesystem::path make() const;
};

}  // namespace trifinger
