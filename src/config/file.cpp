// SPDX-License-Identifier: BSD-3-Clause
#include "trifinger/config/file.hpp"

#include <cerrno>
#include <charconv>
#include <fstream>
#include <iterator>
#include <optional>
#include <utility>

#include "element.hpp"
#include "trifinger/base/suggestion.hpp"

namespace trifinger::config {
namespace {

using detail::Element;
using detail::Entry;

constexpr std::string_view kExtends = "extends";

std::string read_text(const std::filesystem::path& path) {
  // Opening a directory succeeds and reads as an empty file.
  if (std::filesystem::is_directory(path)) throw SystemError("read " + path.string(), EISDIR);
  errno = 0;
  std::ifstream stream(path, std::ios::binary);
  if (!stream) throw SystemError("open " + path.string(), errno);
  return {std::istreambuf_iterator<char>(stream), std::istreambuf_iterator<char>()};
}

Element parse_sections(std::string_view text, const std::filesystem::path& name) {
  Element root = detail::parse(std::string(text), name.string(), false);
  if (root.kind == Element::Kind::kNull) {
    root.kind = Element::Kind::kSection;
    root.location = {.source = name.string(), .line = 1, .column = 1};
  }
  if (root.kind != Element::Kind::kSection) {
    throw ConfigError(root.location, "the file must be made of sections, as in 'fingers:'");
  }
  return root;
}

// Takes `extends: other.yml` out of `root` and puts in the sections of the other file that `root`
// lacks.
void resolve_extends(Element& root, const std::filesystem::path& name) {
  const Entry* extends = root.find(kExtends);
  if (extends == nullptr) return;
  const auto base_name =
      Node(std::make_shared<Element>(extends->value), std::string(kExtends)).as<std::string>();
  const std::filesystem::path base_path = name.parent_path() / base_name;
  std::error_code ignored;
  if (!std::filesystem::is_regular_file(base_path, ignored)) {
    throw ConfigError(extends->value.location,
                      "extends is '" + base_name + "', but there is no file " + base_path.string());
  }
  Element base = parse_sections(read_text(base_path), base_path);
  if (const Entry* third = base.find(kExtends)) {
    throw ConfigError(third->location, "a file that others extend must not extend one itself (" +
                                           name.string() + " extends this one)");
  }
  std::erase_if(root.entries, [](const Entry& entry) { return entry.key == kExtends; });
  for (Entry& entry : base.entries) {
    if (root.find(entry.key) == nullptr) root.entries.push_back(std::move(entry));
  }
}

std::vector<std::string> split(std::string_view path) {
  std::vector<std::string> keys;
  for (;;) {
    const std::size_t dot = path.find('.');
    keys.emplace_back(path.substr(0, dot));
    if (dot == std::string_view::npos) return keys;
    path.remove_prefix(dot + 1);
  }
}

// The place that `key` names in `parent`; a section gets a new entry if it has none, and a misspelt
// one is found by `reject_unknown_keys`.
Element& descend(Element& parent, const std::string& key, const std::string& parent_path,
                 const Location& location) {
  if (parent.kind == Element::Kind::kList) {
    std::size_t index = 0;
    const auto result = std::from_chars(key.data(), key.data() + key.size(), index);
    if (result.ec != std::errc{} || result.ptr != key.data() + key.size() ||
        index >= parent.items.size()) {
      throw ConfigError(location, parent_path + " has no entry '" + key + "', it has " +
                                      std::to_string(parent.items.size()) + ", counted from 0");
    }
    return parent.items[index];
  }
  if (parent.kind != Element::Kind::kSection) {
    throw ConfigError(location, parent_path + " is no section, it has no '" + key + "'");
  }
  for (Entry& entry : parent.entries) {
    if (entry.key == key) return entry.value;
  }
  parent.entries.push_back({.key = key,
                            .location = location,
                            .value = detail::make_element(Element::Kind::kSection, location)});
  return parent.entries.back().value;
}

void apply_override(Element& root, const std::string& text) {
  const std::size_t equals = text.find('=');
  const std::string path = text.substr(0, equals);
  const Location location{.source = "--set " + path};
  if (equals == std::string::npos || path.empty()) {
    throw ConfigError({.source = "--set " + text},
                      "has no key and value, must look like fingers.height=0.3");
  }
  Element value = detail::parse(text.substr(equals + 1), location.source, true);
  value.location = location;
  if (value.kind == Element::Kind::kNull) {
    throw ConfigError(location, "has no value, must look like " + path + "=0.3");
  }
  if (value.kind == Element::Kind::kSection) {
    throw ConfigError(location, "the value is a section, must be a value or a list");
  }

  Element* element = &root;
  std::string reached;
  for (const std::string& key : split(path)) {
    if (key.empty()) throw ConfigError(location, "a key in '" + path + "' is empty");
    element = &descend(*element, key, reached, location);
    reached = detail::join(reached, key);
  }
  *element = std::move(value);
}

// Appends one line for every entry below `element` that nobody has asked for.
void find_unknown_keys(const Element& element, const std::string& path, std::string& problems,
                       std::optional<Location>& first) {
  for (std::size_t i = 0; i < element.items.size(); ++i) {
    find_unknown_keys(element.items[i], detail::join(path, std::to_string(i)), problems, first);
  }
  const std::vector<std::string_view> known(element.asked.begin(), element.asked.end());
  for (const Entry& entry : element.entries) {
    const std::string name = detail::join(path, entry.key);
    if (element.asked.contains(entry.key)) {
      find_unknown_keys(entry.value, name, problems, first);
      continue;
    }
    // The first location is added by ConfigError.
    if (first) {
      problems += "\n" + entry.location.text() + ": ";
    } else {
      first = entry.location;
    }
    problems += name + " is not a known key";
    if (const std::string_view meant = closest(entry.key, known); !meant.empty()) {
      problems += "; did you mean '" + std::string(meant) + "'?";
    } else if (!known.empty()) {
      problems += "; known are " + quoted_list(known, "and");
    }
  }
}

}  // namespace

File::File(std::shared_ptr<const Element> root) : root_(std::move(root)) {}

File File::load(const std::filesystem::path& path, const std::vector<std::string>& overrides) {
  return parse(read_text(path), path, overrides);
}

File File::parse(std::string_view text, const std::filesystem::path& name,
                 const std::vector<std::string>& overrides) {
  auto root = std::make_shared<Element>(parse_sections(text, name));
  resolve_extends(*root, name);
  for (const std::string& assignment : overrides) apply_override(*root, assignment);
  return File(std::move(root));
}

Node File::root() const { return {root_, ""}; }

std::string File::text() const { return detail::yaml_of(*root_); }

void File::reject_unknown_keys() const {
  std::string problems;
  std::optional<Location> first;
  find_unknown_keys(*root_, "", problems, first);
  if (first) throw ConfigError(*first, problems);
}

}  // namespace trifinger::config
