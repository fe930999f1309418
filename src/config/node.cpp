// SPDX-License-Identifier: BSD-3-Clause
#include "trifinger/config/node.hpp"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <iterator>
#include <system_error>

#include "base/suggestion.hpp"
#include "base/text_of.hpp"
#include "element.hpp"

namespace trifinger::config {
namespace {

using detail::Element;
using detail::Entry;

// The shortest text that reads back as the same number.
std::string text_of(double number) {
  std::array<char, 32> buffer{};
  const auto result = std::to_chars(buffer.begin(), buffer.end(), number);
  return {buffer.begin(), result.ptr};
}

std::string with_unit(std::string text, std::string_view unit) {
  if (!unit.empty()) text += " " + std::string(unit);
  return text;
}

std::string text_of(const Range& range, bool is_integer) {
  const bool has_min = range.min > -std::numeric_limits<double>::infinity();
  const bool has_max = range.max < std::numeric_limits<double>::infinity();
  if (has_min && has_max && !range.above_min) {
    return with_unit(text_of(range.min) + " to " + text_of(range.max), range.unit);
  }
  const std::string min = (range.above_min ? "more than " : "at least ") + text_of(range.min);
  const std::string max = "at most " + text_of(range.max);
  if (has_min && has_max) return with_unit(min + " and " + max, range.unit);
  if (has_min) return with_unit(min, range.unit);
  if (has_max) return with_unit(max, range.unit);
  const std::string kind = is_integer ? "a whole number" : "a finite number";
  return range.unit.empty() ? kind : kind + " [" + std::string(range.unit) + "]";
}

std::string text_of_number(const Range& range) {
  return text_of(range, false) + (range.allow_infinite ? ", or .inf" : "");
}

std::string text_of(const Element& element) {
  switch (element.kind) {
    case Element::Kind::kNull:
      return "empty";
    case Element::Kind::kScalar:
      return "'" + element.scalar + "'";
    case Element::Kind::kList:
      return "a list";
    case Element::Kind::kSection:
      return "a section";
  }
  return {};
}

struct NumberText {
  std::string_view digits;
  std::string_view unit;
};

// Splits "0.3 m" into "0.3" and "m".
NumberText split_unit(std::string_view text) {
  const std::size_t space = text.find(' ');
  if (space == std::string_view::npos) return {text, {}};
  const std::size_t unit = text.find_first_not_of(' ', space);
  return {text.substr(0, space), text.substr(unit)};
}

template <class Number>
std::optional<Number> parse_number(std::string_view text) {
  if (text.starts_with('+')) text.remove_prefix(1);
  Number number{};
  const auto result = std::from_chars(text.begin(), text.end(), number);
  if (result.ec != std::errc{} || result.ptr != text.end()) return std::nullopt;
  return number;
}

std::optional<double> parse_double(std::string_view text) {
  if (text == ".nan") return std::numeric_limits<double>::quiet_NaN();
  if (text == ".inf" || text == "+.inf") return std::numeric_limits<double>::infinity();
  if (text == "-.inf") return -std::numeric_limits<double>::infinity();
  return parse_number<double>(text);
}

// All entries of a list, or a scalar; numbers have no unit and are as short as possible.
std::string entries_text(const detail::Element& element) {
  if (element.kind == detail::Element::Kind::kScalar) {
    if (element.quoted) return element.scalar;
    const std::optional<double> number = parse_double(split_unit(element.scalar).digits);
    return number ? text_of(*number) : element.scalar;
  }
  if (element.kind != detail::Element::Kind::kList) return {};
  std::vector<std::string> items;
  items.reserve(element.items.size());
  for (const detail::Element& item : element.items) items.push_back(entries_text(item));
  return "[" + trifinger::detail::joined(items) + "]";
}

}  // namespace

std::string Location::text() const {
  if (line == 0) return source;
  return source + ":" + std::to_string(line) + ":" + std::to_string(column);
}

ConfigError::ConfigError(Location location, const std::string& problem)
    : Error(location.text() + ": " + problem), location_(std::move(location)) {}

namespace detail {

std::string canonical_text(const Element& element) {
  const std::vector<Element>& items = element.items;
  const auto is_list = [](const Element& item) { return item.kind == Element::Kind::kList; };
  if (items.empty() || std::ranges::any_of(items, is_list)) return entries_text(element);
  const std::string first = entries_text(items.front());
  const bool are_equal =
      std::ranges::all_of(items, [&](const Element& item) { return entries_text(item) == first; });
  return are_equal ? first : entries_text(element);
}

}  // namespace detail

Node::Node(std::shared_ptr<const Element> element, std::string path)
    : element_(std::move(element)), path_(std::move(path)) {}

const Location& Node::location() const noexcept { return element_->location; }

bool Node::is_list() const noexcept { return element_->kind == Element::Kind::kList; }
bool Node::is_section() const noexcept { return element_->kind == Element::Kind::kSection; }

void Node::fail(const std::string& problem) const {
  throw ConfigError(location(), (path_.empty() ? "the configuration" : path_) + " " + problem);
}

void Node::require_section() const {
  if (!is_section()) fail("is " + text_of(*element_) + ", must be a section");
}

Node Node::child(const Element& element, std::string_view key) const {
  return {std::shared_ptr<const Element>(element_, &element), detail::join(path_, key)};
}

std::optional<Node> Node::find(std::string_view key) const {
  require_section();
  element_->asked.emplace(key);
  const Entry* entry = element_->find(std::string(key));
  if (entry == nullptr) return std::nullopt;
  return child(entry->value, key);
}

Node Node::at(std::string_view key, std::string_view unit) const {
  if (const std::optional<Node> value = find(key)) return *value;

  std::string problem = detail::join(path_, key);
  if (!unit.empty()) problem += " [" + std::string(unit) + "]";
  problem += " is missing";
  std::vector<std::string_view> unasked;
  for (const Entry& entry : element_->entries) {
    if (!element_->asked.contains(entry.key)) unasked.push_back(entry.key);
  }
  const std::string_view misspelt = closest(key, unasked);
  if (misspelt.empty()) throw ConfigError(location(), problem);
  throw ConfigError(element_->find(std::string(misspelt))->location,
                    problem + "; is '" + std::string(misspelt) + "' a misspelling of it?");
}

Node Node::section(std::string_view key) const {
  Node value = at(key);
  value.require_section();
  return value;
}

std::optional<Node> Node::optional_section(std::string_view key) const {
  std::optional<Node> value = find(key);
  if (value) value->require_section();
  return value;
}

void Node::leave_out(std::string_view key) const {
  if (const std::optional<Node> value = find(key)) value->element_->is_left_out = true;
}

std::vector<Node> Node::items() const {
  if (!is_list()) fail("is " + text_of(*element_) + ", must be a list");
  std::vector<Node> nodes;
  for (const Element& item : element_->items) {
    nodes.push_back(child(item, std::to_string(nodes.size())));
  }
  return nodes;
}

void Node::require_size(std::size_t size) const {
  const std::size_t found = element_->items.size();
  if (found == size) return;
  fail("has " + std::to_string(found) + (found == 1 ? " entry" : " entries") + ", must have " +
       std::to_string(size));
}

bool Node::as_bool() const {
  element_->allowed = "true or false";
  if (element_->kind == Element::Kind::kScalar && !element_->quoted) {
    if (element_->scalar == "true") return true;
    if (element_->scalar == "false") return false;
  }
  fail("is " + text_of(*element_) + ", must be true or false");
}

void Node::require_unit(std::string_view unit, std::string_view allowed) const {
  if (unit.empty() || unit == allowed) return;
  fail("has the unit '" + std::string(unit) + "', must " +
       (allowed.empty() ? "have none" : "be in '" + std::string(allowed) + "'"));
}

double Node::as_number(const Range& range) const {
  element_->allowed = text_of_number(range);
  const auto [digits, unit] = split_unit(element_->scalar);
  const std::optional<double> number = parse_double(digits);
  if (element_->kind != Element::Kind::kScalar || element_->quoted || !number) {
    fail("is " + text_of(*element_) + ", must be a number" +
         (range.unit.empty() ? "" : " [" + std::string(range.unit) + "]"));
  }
  require_unit(unit, range.unit);
  const bool is_allowed = std::isfinite(*number) || (range.allow_infinite && std::isinf(*number));
  const bool is_inside =
      (range.above_min ? *number > range.min : *number >= range.min) && *number <= range.max;
  if (!is_allowed || !is_inside) {
    fail("is " + with_unit(std::string(digits), range.unit) + ", must be " + text_of(range, false));
  }
  return *number;
}

std::int64_t Node::as_integer(std::int64_t min, std::int64_t max, const Range& range) const {
  element_->allowed = text_of(range, true);
  const auto [digits, unit] = split_unit(element_->scalar);
  const std::optional<std::int64_t> number = parse_number<std::int64_t>(digits);
  if (element_->kind != Element::Kind::kScalar || element_->quoted || !number) {
    fail("is " + text_of(*element_) + ", must be a whole number" +
         (range.unit.empty() ? "" : " [" + std::string(range.unit) + "]"));
  }
  require_unit(unit, range.unit);
  const auto value = static_cast<double>(*number);
  if (value < range.min || value > range.max || (range.above_min && value <= range.min)) {
    fail("is " + with_unit(std::string(digits), range.unit) + ", must be " + text_of(range, true));
  }
  if (*number < min || *number > max) {
    fail("is " + std::string(digits) + ", must be " + std::to_string(min) + " to " +
         std::to_string(max));
  }
  return *number;
}

std::string Node::as_string() const {
  element_->allowed = "a text";
  if (element_->kind != Element::Kind::kScalar || element_->scalar.empty()) {
    fail("is " + text_of(*element_) + ", must be a text");
  }
  return element_->scalar;
}

std::size_t Node::index_of_choice(const std::vector<std::string_view>& names) const {
  element_->allowed = quoted_list(names, "or");
  for (std::size_t i = 0; i < names.size(); ++i) {
    if (element_->kind == Element::Kind::kScalar && element_->scalar == names[i]) return i;
  }
  std::string problem = "is " + text_of(*element_) + ", must be " + quoted_list(names, "or");
  const std::string_view meant = closest(element_->scalar, names);
  if (!meant.empty()) problem += "; did you mean '" + std::string(meant) + "'?";
  fail(problem);
}

}  // namespace trifinger::config
