// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <set>
#include <string>
#include <string_view>
#include <unordered_map>
#include <utility>
#include <vector>

#include "trifinger/config/node.hpp"

namespace trifinger::config::detail {

struct Entry;

// Sections and lists in each other; deeper ones would only exhaust the stack.
inline constexpr std::size_t kMaxDepth = 32;

// One value of a configuration, with the place where it was written.
struct Element {
  enum class Kind : std::uint8_t { kNull, kScalar, kList, kSection };

  Kind kind{Kind::kNull};
  Location location;
  std::string scalar;
  bool quoted{false};  // A quoted scalar is text, whatever it looks like.
  std::vector<Element> items;
  std::vector<Entry> entries;                           // changed by `add` and `remove` alone
  std::unordered_map<std::string, std::size_t> places;  // in `entries`, by key
  // The keys that readers have asked for, there or not. Not a part of the value.
  mutable std::set<std::string, std::less<>> asked;

  [[nodiscard]] const Entry* find(const std::string& key) const noexcept;
  [[nodiscard]] Entry* find(const std::string& key) noexcept;
  // The key must be new.
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

// Reads one document; an empty one is an empty section. Throws ConfigError.
// `source` alone is the location if `is_override`.
[[nodiscard]] Element parse(const std::string& text, const std::string& source, bool is_override);

// The value in YAML, which `parse` reads as the same value.
[[nodiscard]] std::string yaml_of(const Element& element);

// A scalar or a list without sections in the one way in which equal values are written: numbers
// without unit, as short as they can be; a list of equal values, which stands for as many as are
// needed, is one of them.
[[nodiscard]] std::string canonical_text(const Element& element);

// "fingers" and "height" make "fingers.height".
[[nodiscard]] std::string join(const std::string& path, std::string_view key);

}  // namespace trifinger::config::detail
