// SPDX-License-Identifier: BSD-3-Clause
#include <yaml-cpp/eventhandler.h>
#include <yaml-cpp/exceptions.h>
#include <yaml-cpp/mark.h>
#include <yaml-cpp/parser.h>

#include <optional>
#include <sstream>
#include <utility>

#include "element.hpp"

namespace trifinger::config::detail {
namespace {

// Builds the tree from the parser's events. YAML::Node is not enough, because only events show
// duplicate keys, aliases and the place of every key.
class TreeBuilder final : public YAML::EventHandler {
 public:
  TreeBuilder(std::string source, bool is_override)
      : source_(std::move(source)), is_override_(is_override) {}

  [[nodiscard]] Element take_root() { return std::move(root_); }

  void OnDocumentStart(const YAML::Mark& mark) override {
    if (has_document_) fail(mark, "a second document begins here, there must be only one");
    has_document_ = true;
    root_.location = location(mark);
  }
  void OnDocumentEnd() override {}

  void OnNull(const YAML::Mark& mark, YAML::anchor_t anchor) override {
    refuse_anchor(mark, anchor);
    if (expects_key()) fail(mark, "a key is empty, must be a word");
    place(make_element(Element::Kind::kNull, location(mark)));
  }

  void OnAlias(const YAML::Mark& mark, YAML::anchor_t /*anchor*/) override {
    refuse_anchor(mark, 1);
  }

  void OnScalar(const YAML::Mark& mark, const std::string& tag, YAML::anchor_t anchor,
                const std::string& value) override {
    refuse_anchor(mark, anchor);
    refuse_tag(mark, tag);
    if (expects_key()) {
      begin_entry(mark, value);
    } else {
      Element element = make_element(Element::Kind::kScalar, location(mark));
      element.scalar = value;
      element.quoted = tag == "!";
      place(std::move(element));
    }
  }

  void OnSequenceStart(const YAML::Mark& mark, const std::string& tag, YAML::anchor_t anchor,
                       YAML::EmitterStyle::value /*style*/) override {
    open(mark, tag, anchor, Element::Kind::kList);
  }
  void OnSequenceEnd() override { close(); }

  void OnMapStart(const YAML::Mark& mark, const std::string& tag, YAML::anchor_t anchor,
                  YAML::EmitterStyle::value /*style*/) override {
    open(mark, tag, anchor, Element::Kind::kSection);
  }
  void OnMapEnd() override { close(); }

  [[noreturn]] void fail(const YAML::Mark& mark, const std::string& problem) const {
    throw ConfigError(location(mark), problem);
  }

 private:
  [[nodiscard]] Location location(const YAML::Mark& mark) const {
    if (is_override_) return {.source = source_};
    return {.source = source_, .line = mark.line + 1, .column = mark.column + 1};
  }

  void refuse_anchor(const YAML::Mark& mark, YAML::anchor_t anchor) const {
    if (anchor != 0) fail(mark, "anchors and aliases are not supported, write the value out");
  }

  // The parser gives plain values the tag "?" and quoted ones the tag "!".
  void refuse_tag(const YAML::Mark& mark, const std::string& tag) const {
    if (!tag.empty() && tag != "?" && tag != "!")
      fail(mark, "tags are not supported: '" + tag + "'");
  }

  // True if the innermost open section expects its next key.
  [[nodiscard]] bool expects_key() const {
    return !open_.empty() && open_.back().kind == Element::Kind::kSection && !keys_.back();
  }

  void begin_entry(const YAML::Mark& mark, const std::string& key) {
    if (const Entry* first = open_.back().find(key)) {
      std::string problem = "'" + key + "' is given twice";
      if (!is_override_) problem += ", first in line " + std::to_string(first->location.line);
      fail(mark, problem);
    }
    keys_.back() = Entry{.key = key, .location = location(mark), .value = {}};
  }

  void open(const YAML::Mark& mark, const std::string& tag, YAML::anchor_t anchor,
            Element::Kind kind) {
    refuse_anchor(mark, anchor);
    refuse_tag(mark, tag);
    if (expects_key())
      fail(mark, "a key is a list or a section, must be a word; is a bracket not closed?");
    if (open_.size() == kMaxDepth) {
      fail(mark, "sections and lists are nested deeper than " + std::to_string(kMaxDepth) +
                     " levels, which is not allowed");
    }
    open_.push_back(make_element(kind, location(mark)));
    keys_.emplace_back();
  }

  void close() {
    Element element = std::move(open_.back());
    open_.pop_back();
    keys_.pop_back();
    place(std::move(element));
  }

  void place(Element element) {
    if (open_.empty()) {
      root_ = std::move(element);
    } else if (open_.back().kind == Element::Kind::kList) {
      open_.back().items.push_back(std::move(element));
    } else {
      keys_.back()->value = std::move(element);
      open_.back().add(std::move(*keys_.back()));
      keys_.back().reset();
    }
  }

  std::string source_;
  bool is_override_;
  bool has_document_{false};
  Element root_;
  std::vector<Element> open_;  // from the root to the innermost list or section
  std::vector<std::optional<Entry>>
      keys_;  // one for each element of open_: the entry whose value comes next
};

}  // namespace

const Entry* Element::find(const std::string& key) const noexcept {
  const auto place = places.find(key);
  return place == places.end() ? nullptr : &entries[place->second];
}

Entry* Element::find(const std::string& key) noexcept {
  const auto place = places.find(key);
  return place == places.end() ? nullptr : &entries[place->second];
}

Entry& Element::add(Entry entry) {
  places.emplace(entry.key, entries.size());
  return entries.emplace_back(std::move(entry));
}

void Element::remove(const std::string& key) {
  std::erase_if(entries, [&key](const Entry& entry) { return entry.key == key; });
  places.clear();
  for (std::size_t i = 0; i < entries.size(); ++i) places.emplace(entries[i].key, i);
}

Element parse(const std::string& text, const std::string& source, bool is_override) {
  // Without the comment at the end, the parser would take the last newline for the end of a quote
  // that is never closed.
  std::istringstream stream(text + (text.ends_with('\n') ? "#" : "\n#"));
  TreeBuilder builder(source, is_override);
  try {
    YAML::Parser parser(stream);
    while (parser.HandleNextDocument(builder)) {
    }
  } catch (const YAML::Exception& error) {
    builder.fail(error.mark, "malformed YAML: " + error.msg);
  }
  return builder.take_root();
}

std::string join(const std::string& path, std::string_view key) {
  return path.empty() ? std::string(key) : path + "." + std::string(key);
}

}  // namespace trifinger::config::detail
