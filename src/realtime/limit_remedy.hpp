// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>

namespace trifinger {

/// A limit of the system that real time must exceed.
enum class RealtimeLimit : std::uint8_t { kPriority, kLockedMemory };

/// How to raise a limit where this process runs: in a container by the options with which it is
/// started, in a service by its unit, elsewhere in limits.conf. The end of a sentence. `root` is
/// where the files of the machine are.
[[nodiscard]] std::string remedy_for(RealtimeLimit limit, const std::filesystem::path& root = "/");

}  // namespace trifinger
