// SPDX-License-Identifier: BSD-3-Clause
#include "face_colours.hpp"

#include <algorithm>
#include <charconv>
#include <cstddef>
#include <system_error>

namespace trifinger::detail {

std::optional<std::array<float, 3>> rgb_of(std::string_view colour) {
  const auto* const named = std::ranges::find(kFaceColours, colour, &FaceColour::name);
  if (named != kFaceColours.end()) return named->rgb;
  if (colour.size() != 7 || colour.front() != '#') return std::nullopt;
  std::array<float, 3> rgb{};
  for (std::size_t i = 0; i < rgb.size(); ++i) {
    const char* const begin = &colour[1 + 2 * i];
    const char* const end = begin + 2;
    unsigned value = 0;
    const auto read = std::from_chars(begin, end, value, 16);
    if (read.ec != std::errc{} || read.ptr != end) return std::nullopt;
    rgb[i] = static_cast<float>(value) / 255.0F;
  }
  return rgb;
}

}  // namespace trifinger::detail
