// SPDX-License-Identifier: BSD-3-Clause
#include "trifinger/config/file.hpp"

#include <algorithm>
#include <charconv>
#include <utility>

#include "base/regular_file.hpp"
#include "base/suggestion.hpp"
#include "element.hpp"

namespace trifinger::config {
namespace {

using detail::Element;
using detail::Entry;

const std::string kExtends = "extends";
constexpr std::string_view kSuffix = ".yml";
// A hundred times the size of the largest reasonable configuration [bytes].
constexpr std::size_t kMaxSize = 4'000'000;
// Largest number of unknown keys that an error names.
constexpr int kMaxProblems = 20;

using Folders = std::vector<std::filesystem::path>;

std::string read_text(const std::filesystem::path& path) {
  // A file that is a little too large gives an error with a place in the file. This limit stops
  // reading files that never end.
  return read_file(path, 4 * kMaxSize);
}

Element parse_sections(std::string_view text, const std::filesystem::path& name) {
  if (text.size() > kMaxSize) {
    throw ConfigError({.source = name.string(), .line = 1, .column = 1},
                      "the file has " + std::to_string(text.size()) +
                          " bytes, a configuration has at most " + std::to_string(kMaxSize));
  }
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

// The file `name` in `folder`, written with or without ".yml". Empty if there is none.
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

// Adds to the sections inside `own` what they lack and those of `base` have.
void fill_inner_sections(Element& own, Element& base) {
  for (Entry& entry : base.entries) {
    if (entry.value.kind != Element::Kind::kSection) continue;
    Entry* const inner = own.find(entry.key);
    if (inner == nullptr) {
      own.add(std::move(entry));
    } else if (inner->value.kind == Element::Kind::kSection) {
      for (Entry& one : entry.value.entries) {
        if (inner->value.find(one.key) == nullptr) inner->value.add(std::move(one));
      }
    }
  }
}

// Adds to `root` the sections that it lacks and the extended file has. Repeats this until a file
// extends no other one.
void resolve_extends(Element& root, const std::filesystem::path& name, const Folders& folders) {
  std::vector<std::filesystem::path> chain{name};
  while (const Entry* const extends = root.find(kExtends)) {
    const Location location = extends->value.location;
    const auto base_name =
        Node(std::make_shared<Element>(extends->value), kExtends).as<std::string>();
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
    root.remove(kExtends);
    // The `extends` of the base file comes along and is handled in the next turn.
    for (Entry& entry : base.entries) {
      Entry* const own = root.find(entry.key);
      if (own == nullptr) {
        root.add(std::move(entry));
      } else if (own->value.kind == Element::Kind::kSection) {
        fill_inner_sections(own->value, entry.value);
      }
    }
    chain.push_back(std::move(base_path));
  }
}

// Anybody may have written a text that is in no file of this machine, such as that in a log.
void refuse_extends(const Element& root) {
  const Entry* const extends = root.find(kExtends);
  if (extends == nullptr) return;
  const auto name = Node(std::make_shared<Element>(extends->value), kExtends).as<std::string>();
  throw ConfigError(extends->value.location,
                    "extends is '" + name +
                        "', but only a file may extend another one; the configuration in a log, a "
                        "session, a motion or a policy must be whole");
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

// Returns the place that `key` names in `parent`. A section gets a new entry if it has none: if the
// key is misspelled, `reject_unknown_keys` finds it.
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
    throw ConfigError(location, parent_path + " is not a section, so it has no '" + key + "'");
  }
  if (Entry* entry = parent.find(key)) return entry->value;
  return parent
      .add({.key = key,
            .location = location,
            .value = detail::make_element(Element::Kind::kSection, location)})
      .value;
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

  const std::vector<std::string> keys = split(path);
  if (keys.size() > detail::kMaxDepth) {
    constexpr std::size_t kEnough = 40;
    throw ConfigError({.source = "--set " + path.substr(0, kEnough) + "..."},
                      "nests " + std::to_string(keys.size()) + " keys, at most " +
                          std::to_string(detail::kMaxDepth) + " are allowed");
  }
  Element* element = &root;
  std::string reached;
  for (const std::string& key : keys) {
    if (key.empty()) throw ConfigError(location, "a key in '" + path + "' is empty");
    element = &descend(*element, key, reached, location);
    reached = detail::join(reached, key);
  }
  *element = std::move(value);
}

// Collects the entries of a configuration that nobody has asked for.
class UnknownKeys {
 public:
  // Looks at `element` and everything below it.
  void find(const Element& element, const std::string& path) {
    if (element.is_left_out) return;
    for (std::size_t i = 0; i < element.items.size(); ++i) {
      find(element.items[i], detail::join(path, std::to_string(i)));
    }
    const std::vector<std::string_view> known(element.asked.begin(), element.asked.end());
    for (const Entry& entry : element.entries) {
      const std::string name = detail::join(path, entry.key);
      if (element.asked.contains(entry.key)) {
        find(entry.value, name);
      } else {
        add(entry, name, known);
      }
    }
  }

  void throw_if_any() const {
    if (count_ == 0) return;
    const int more = count_ - kMaxProblems;
    throw ConfigError(first_, problems_ + (more > 0 ? "\nand " + std::to_string(more) +
                                                          " more keys that are not known"
                                                    : ""));
  }

 private:
  void add(const Entry& entry, const std::string& name,
           const std::vector<std::string_view>& known) {
    if (++count_ > kMaxProblems) return;
    // ConfigError adds the first location.
    if (count_ == 1) {
      first_ = entry.location;
    } else {
      problems_ += "\n" + entry.location.text() + ": ";
    }
    problems_ += name + " is not a known key";
    if (const std::string_view meant = closest(entry.key, known); !meant.empty()) {
      problems_ += "; did you mean '" + std::string(meant) + "'?";
    } else if (!known.empty()) {
      problems_ += "; known are " + quoted_list(known, "and");
    }
  }

  Location first_;
  std::string problems_;  // one line for each
  int count_{0};
};

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

void collect_keys(const Element& element, const std::string& path, std::vector<File::Key>& keys) {
  for (const Entry& entry : element.entries) {
    collect_keys(entry.value, detail::join(path, entry.key), keys);
  }
  if (element.kind == Element::Kind::kSection) return;
  const bool has_sections =
      !element.items.empty() && element.items.front().kind == Element::Kind::kSection;
  if (has_sections) {
    collect_keys(element.items.front(), detail::join(path, "0"), keys);
    return;
  }
  const Element* first = &element;  // of a list, or of a list of lists
  while (!first->items.empty()) first = &first->items.front();
  const bool is_list = element.kind == Element::Kind::kList;
  const std::string value = is_list ? detail::canonical_text(element) : element.scalar;
  if (!first->allowed.empty()) keys.push_back({path, value, first->allowed});
}

}  // namespace

File::File(std::shared_ptr<const Element> root) : root_(std::move(root)) {}

File File::load(const std::filesystem::path& path, const std::vector<std::string>& overrides,
                const std::vector<std::filesystem::path>& folders) {
  Element root = parse_sections(read_text(path), path);
  resolve_extends(root, path, folders);
  return overridden(std::move(root), overrides);
}

File File::parse(std::string_view text, const std::filesystem::path& name,
                 const std::vector<std::string>& overrides) {
  Element root = parse_sections(text, name);
  refuse_extends(root);
  return overridden(std::move(root), overrides);
}

File File::overridden(Element root, const std::vector<std::string>& overrides) {
  for (const std::string& assignment : overrides) apply_override(root, assignment);
  return File(std::make_shared<const Element>(std::move(root)));
}

Node File::root() const { return {root_, ""}; }

void File::replace(const Node& node, std::string text) {
  auto root = std::make_shared<Element>(*root_);
  Element* element = root.get();
  std::string reached;
  for (const std::string& key : split(node.path())) {
    element = &descend(*element, key, reached, node.location());
    reached = detail::join(reached, key);
  }
  *element = detail::make_element(Element::Kind::kScalar, node.location());
  element->scalar = std::move(text);
  element->quoted = true;
  root_ = std::move(root);
}

std::string File::text() const { return detail::yaml_of(*root_); }

std::map<std::string, std::string> File::values() const {
  std::map<std::string, std::string> values;
  collect_values(*root_, "", values);
  return values;
}

std::vector<File::Key> File::keys() const {
  std::vector<Key> keys;
  collect_keys(*root_, "", keys);
  return keys;
}

void File::reject_unknown_keys() const {
  UnknownKeys unknown;
  unknown.find(*root_, "");
  unknown.throw_if_any();
}

}  // namespace trifinger::config
