// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cerrno>
#include <filesystem>
#include <fstream>
#include <span>
#include <string_view>
#include <system_error>

#include "base/regular_file.hpp"
#include "trifinger/base/error.hpp"

namespace trifinger::apps {

// Writes a file that the user has named: it appears whole or not at all. A link to a file is
// followed; the file replaces a link that leads nowhere. A device, such as /dev/stdout, is written
// as it is. Throws SystemError.
inline void write_output_file(const std::filesystem::path& path, std::string_view bytes) {
  std::error_code missing;
  const std::filesystem::path target = std::filesystem::canonical(path, missing);
  if (missing || std::filesystem::is_regular_file(target)) {
    replace_file(missing ? path : target, std::as_bytes(std::span(bytes)));
    return;
  }
  std::ofstream file(path, std::ios::binary);
  file << bytes;
  file.close();
  if (!file) throw SystemError("write " + path.string(), errno);
}

}  // namespace trifinger::apps
