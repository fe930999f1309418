// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <string_view>

namespace trifinger {

/// Judges the text of a model, MJCF or URDF, that somebody else has written, such as the document
/// "model.xml" of a log, and returns it in a form that MuJoCo may read: it names no file, and what
/// it asks for stays below limits. MuJoCo itself would open any path and obey any number.
/// @throws InvalidArgument that names the line, what it asks for and the largest value allowed
[[nodiscard]] std::string checked_model_text(std::string_view text);

}  // namespace trifinger
