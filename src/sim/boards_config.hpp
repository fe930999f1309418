// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "boards/read_options.hpp"

namespace trifinger {

/// The motor boards of a robot in a configuration file.
struct BoardsConfig {
  boards::BusKind bus{boards::BusKind::kSocketCan};
  boards::BoardRobotOptions options{};
};

}  // namespace trifinger
