// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <set>
#include <string>
#include <string_view>
#include <unordered_map>
#include <utility>
#include <vector>

#include "trifinger/config/node.hpp"

namespace trifinger::config::detail {

struct Entry;

// Largest depth of nested sections and lists. Deeper ones would only exhaust the stack.
inline constexpr std::size_t kMaxDepth = 32;

// One value of a configuration and the place where it was written.
struct Element {
  enum class Kind : std::uint8_t { kNull, kScalar, kList, kSection };

  Kind kind{Kind::kNull};
  Location location;
  std::string scalar;
  bool quoted{false};  // A quoted scalar is text, whatever it looks like.
  std::vector<Element> items;
  std::vector<Entry> entries;                           // changed by `add` and `remove` alone
  std::unordered_map<std::string, std::size_t> places;  // in `entries`, by key
  // The keys that readers have asked for, whether or not they exist. Not a part of the value.
  mutable std::set<std::string, std::less<>> asked;
  mutable bool is_left_out{false};  // Nobody needs to ask for what is in it. Not a part either.
  // What the last reader of this value allowed, as in "0.2 to 0.6 m". Not a part of it either.
  mutable std::string allowed;

  [[nodiscard]] const Entry* find(const std::string& key) const noexcept;
  [[nodiscard]] Entry* find(const std::string& key) noexcept;
  // Adds an entry. Its key must be new.
  Entry& add(Entry entry);
  void remove(const std::string& key);
};

struct Entry {
  std::string key;
  Location location;
  Element value;
};

[[nodiscard]] inline Element make_element(Element::Kind kind, Location location) {
  Element element;
  element.kind = kind;
  element.location = std::move(location);
  return element;
}

// Reads one document. An empty document is an empty section. With `is_override` every location is
// `source` alone, without line and column. Throws ConfigError.
[[nodiscard]] Element parse(const std::string& text, const std::string& source, bool is_override);

// The value as YAML text. `parse` reads it back as the same value.
[[nodiscard]] std::string yaml_of(const Element& element);

// A scalar, or a list without sections, in a form that is the same for equal values. Numbers have
// no unit and are as short as possible. A list of equal scalars becomes one of them, because one
// can stand for as many as are needed.
[[nodiscard]] std::string canonical_text(const Element& element);

// Joins "fingers" and "height" to "fingers.height".
[[nodiscard]] std::string join(const std::string& path, std::string_view key);

}  // namespace trifinger::config::detail
