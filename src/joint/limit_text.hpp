// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cmath>
#include <string>
#include <string_view>

namespace trifinger::detail {

// A limit that nobody has said is not a number.
[[nodiscard]] inline bool is_said(double value) noexcept { return !std::isnan(value); }

// The shortest text that reads back as this number, in YAML: also ".inf".
[[nodiscard]] std::string number_text(double number);

// Any text as a value of YAML.
[[nodiscard]] std::string quoted_text(std::string_view text);

// The name of a joint as a key of YAML. Names may have any characters.
[[nodiscard]] std::string key_of(std::string_view name);

}  // namespace trifinger::detail
