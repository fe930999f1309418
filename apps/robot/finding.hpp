// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>

namespace trifinger::apps {

enum class Verdict : unsigned char {
  kGood,
  kNote,   // Could be better; enough for simulation.
  kFails,  // Deadlines will be missed, sessions cannot be made, or the robot cannot start.
};

// What `trifinger doctor` says of one thing.
struct Finding {
  std::string what;
  Verdict verdict;
  std::string found;
  std::string remedy;  // Empty if the verdict is good.
};

}  // namespace trifinger::apps
