// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <variant>

#include "boards/read_options.hpp"
#include "trifinger/joint/types.hpp"

namespace trifinger {

/// The motor boards of a robot in a configuration file.
struct BoardsConfig {
  boards::BusKind bus{boards::BusKind::kSocketCan};
  std::variant<boards::BoardRobotOptions<TriFinger>, boards::BoardRobotOptions<Finger>> options;
};

}  // namespace trifinger
