// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace trifinger::detail {

// An element of an XML text. Texts between elements, comments and declarations are left out.
struct XmlElement {
  std::string name;
  int line{0};  // where it begins
  std::vector<std::pair<std::string, std::string>> attributes{};
  std::vector<XmlElement> children{};
  // What stands in it before its first child, if that is not only spaces. `write_xml` leaves it
  // out.
  std::string text{};

  // Returns the value of an attribute; null if there is none of this name.
  [[nodiscard]] const std::string* find(std::string_view attribute) const noexcept;
};

// Elements may be inside each other up to this depth, as in MuJoCo's own reader.
inline constexpr int kMaxDepth = 500;
// Attributes of one element. MuJoCo knows no element with half as many.
inline constexpr std::size_t kMaxAttributes = 100;

// What `find` of a text gives if there is nothing to find.
inline constexpr std::size_t kNowhere = std::string_view::npos;

[[nodiscard]] constexpr bool is_space(char letter) noexcept {
  return letter == ' ' || (letter >= '\t' && letter <= '\r');
}

// Reads the first element of a text with all that is in it. Each element takes one of
// `elements_left`. Throws InvalidArgument that names `source` and the line; also if none is left.
[[nodiscard]] XmlElement parse_xml(std::string_view text, const std::string& source,
                                   std::size_t& elements_left);

// Writes an element. Each element inside begins in the line where it was read, so that errors of
// whoever reads this name the right line.
[[nodiscard]] std::string write_xml(const XmlElement& root);

}  // namespace trifinger::detail
