// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>

namespace trifinger {

/// A text that belongs to a robot's sessions and explains them: its configuration, its model.
struct Document {
  std::string name;        ///< For example "configuration.yml"; unique within a robot.
  std::string media_type;  ///< For example "application/yaml".
  std::string text;

  friend bool operator==(const Document&, const Document&) = default;
};

}  // namespace trifinger
