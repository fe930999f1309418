// SPDX-License-Identifier: BSD-3-Clause
#include "trifinger/config/file.hpp"

#include <algorithm>
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
constexpr std::string_view kSuffix = ".yml";

using Folders = std::vector<std::filesystem::path>;

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

// What `folder` has under the name `name`, written with or without ".yml"; empty if nothing.
std::filesystem::path find_in(const std::filesystem::path& folder, const std::string& name) {
  std::error_code ignored;
  for (const std::string& file : {name, name + std::string(kSuffix)}) {
    if (std::filesystem::is_regular_file(folder / file, ignored)) return folder / file;
  }
  return {};
}

[[noreturn]] void fail_to_find(const Location& location, const std::string& name,
                               const std::filesystem::path& beside, const Folders& folders) {
  std::string text = "extends is '" + name + "', but there is no such file in " +
                     (beside.empty() ? "the working directory" : beside.string());
  std::vector<std::string> known;
  std::string others;
  std::error_code ignored;
  for (const std::filesystem::path& folder : folders) {
    for (const auto& entry : std::filesystem::directory_iterator(folder, ignored)) {
      if (entry.path().extension() == kSuffix) known.push_back(entry.path().stem().string());
    }
    if (std::filesystem::is_directory(folder, ignored)) others += " or " + folder.string();
  }
  if (!others.empty())
    text += ", nor among the files that come with the program in " + others.substr(4);
  const std::string stem = std::filesystem::path(name).stem().string();
  const std::string_view meant = closest(stem, {known.begin(), known.end()});
  if (!meant.empty()) text += "; did you mean '" + std::string(meant) + "'?";
  throw ConfigError(location, text);
}

// Puts the sections into `root` that it lacks and the file that it extends has, and so on until a
// file extends no other one.
void resolve_extends(Element& root, const std::filesystem::path& name, const Folders& folders) {
  std::vector<std::filesystem::path> chain{name};
  while (const Entry* const extends = root.find(kExtends)) {
    const Location location = extends->value.location;
    const auto base_name =
        Node(std::make_shared<Element>(extends->value), std::string(kExtends)).as<std::string>();
    const std::filesystem::path beside = chain.back().parent_path();
    std::filesystem::path base_path = find_in(beside, base_name);
    for (auto folder = folders.begin(); base_path.empty() && folder != folders.end(); ++folder) {
      base_path = find_in(*folder, base_name);
    }
    if (base_path.empty()) fail_to_find(location, base_name, beside, folders);
    const auto is_base = [&base_path](const std::filesystem::path& other) {
      std::error_code ignored;
      return std::filesystem::equivalent(base_path, other, ignored);
    };
    if (std::ranges::any_of(chain, is_base)) {
      throw ConfigError(location, "extends is '" + base_name + "', which is " + base_path.string() +
                                      ": a file must not extend itself, nor one that extends it");
    }
    Element base = parse_sections(read_text(base_path), base_path);
    std::erase_if(root.entries, [](const Entry& entry) { return entry.key == kExtends; });
    // Its own `extends` comes along, for the next turn.
    for (Entry& entry : base.entries) {
      if (root.find(entry.key) == nullptr) root.entries.push_back(std::move(entry));
    }
    chain.push_back(std::move(base_path));
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

void collect_values(const Element& element, const std::string& path,
                    std::map<std::string, std::string>& values) {
  if (element.kind == Element::Kind::kSection) {
    for (const Entry& entry : element.entries) {
      collect_values(entry.value, detail::join(path, entry.key), values);
    }
    return;
  }
  const bool has_sections = std::ranges::any_of(
      element.items, [](const Element& item) { return item.kind == Element::Kind::kSection; });
  if (!has_sections) values[path] = detail::canonical_text(element);
}

}  // namespace

File::File(std::shared_ptr<const Element> root) : root_(std::move(root)) {}

File File::load(const std::filesystem::path& path, const std::vector<std::string>& overrides,
                const std::vector<std::filesystem::path>& folders) {
  return parse(read_text(path), path, overrides, folders);
}

File File::parse(std::string_view text, const std::filesystem::path& name,
                 const std::vector<std::string>& overrides,
                 const std::vector<std::filesystem::path>& folders) {
  auto root = std::make_shared<Element>(parse_sections(text, name));
  resolve_extends(*root, name, folders);
  for (const std::string& assignment : overrides) apply_override(*root, assignment);
  return File(std::move(root));
}

Node File::root() const { return {root_, ""}; }

std::string File::text() const { return detail::yaml_of(*root_); }

std::map<std::string, std::string> File::values() const {
  std::map<std::string, std::string> values;
  collect_values(*root_, "", values);
  return values;
}

void File::reject_unknown_keys() const {
  std::string problems;
  std::optional<Location> first;
  find_unknown_keys(*root_, "", problems, first);
  if (first) throw ConfigError(*first, problems);
}

}  // namespace trifinger::config
