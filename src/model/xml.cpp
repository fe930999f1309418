// SPDX-License-Identifier: BSD-3-Clause
#include "xml.hpp"

#include <algorithm>
#include <array>
#include <charconv>
#include <cstdint>

#include "base/text_of.hpp"
#include "trifinger/base/error.hpp"

namespace trifinger::detail {
namespace {

bool begins_name(char letter) noexcept {
  return (letter >= 'a' && letter <= 'z') || (letter >= 'A' && letter <= 'Z') || letter == '_' ||
         letter == ':' || (static_cast<unsigned char>(letter) & 0x80U) != 0;
}

bool continues_name(char letter) noexcept {
  return begins_name(letter) || (letter >= '0' && letter <= '9') || letter == '.' || letter == '-';
}

void append_utf8(std::uint32_t code, std::string& text) {
  const auto tail = [&](unsigned shift) {
    text += static_cast<char>(0x80U | ((code >> shift) & 0x3FU));
  };
  if (code < 0x80U) {
    text += static_cast<char>(code);
  } else if (code < 0x800U) {
    text += static_cast<char>(0xC0U | (code >> 6U));
    tail(0);
  } else if (code < 0x10000U) {
    text += static_cast<char>(0xE0U | (code >> 12U));
    tail(6);
    tail(0);
  } else {
    text += static_cast<char>(0xF0U | (code >> 18U));
    tail(12);
    tail(6);
    tail(0);
  }
}

// Appends the character that `name` means, such as "lt" or "#x3c". Returns false if it means none.
bool append_entity(std::string_view name, std::string& text) {
  constexpr std::array<std::pair<std::string_view, char>, 5> kNamed{
      {{"lt", '<'}, {"gt", '>'}, {"amp", '&'}, {"quot", '"'}, {"apos", '\''}}};
  const auto* const found =
      std::ranges::find(kNamed, name, &std::pair<std::string_view, char>::first);
  if (found != kNamed.end()) {
    text += found->second;
    return true;
  }
  if (name.size() < 2 || name[0] != '#') return false;
  const bool is_hex = name[1] == 'x';
  const std::string_view digits = name.substr(is_hex ? 2 : 1);
  std::uint32_t code = 0;
  const auto [end, problem] =
      std::from_chars(digits.data(), digits.data() + digits.size(), code, is_hex ? 16 : 10);
  const bool is_whole = problem == std::errc() && end == digits.data() + digits.size();
  if (!is_whole || code == 0 || code > 0x10FFFFU) return false;
  append_utf8(code, text);
  return true;
}

// Replaces entities; what only looks like one stays.
std::string decoded(std::string_view raw) {
  std::string text;
  text.reserve(raw.size());
  constexpr std::size_t kLongest = 12;  // letters of an entity
  for (std::size_t at = 0; at < raw.size(); ++at) {
    const std::size_t end = raw[at] == '&' ? raw.substr(at, kLongest).find(';') : kNowhere;
    if (end != kNowhere && append_entity(raw.substr(at + 1, end - 1), text)) {
      at += end;
    } else {
      text += raw[at];
    }
  }
  return text;
}

class Parser {
 public:
  Parser(std::string_view text, const std::string& source, std::size_t& elements_left)
      : text_(text), source_(source), elements_left_(elements_left) {}

  XmlElement parse() {
    if (text_.starts_with("\xEF\xBB\xBF")) at_ = 3;
    XmlElement root;
    // Elements that are open. Only the last one grows, so none of them moves.
    std::vector<XmlElement*> open;
    do {
      skip_to_element(open.empty() ? nullptr : open.back());
      if (text_.substr(at_).starts_with("</")) {
        close(open);
        continue;
      }
      require_room(open.size());
      XmlElement& element = open.empty() ? root : open.back()->children.emplace_back();
      if (begin(element)) open.push_back(&element);
    } while (!open.empty());
    return root;
  }

 private:
  [[noreturn]] void fail(const std::string& problem) const {
    throw InvalidArgument(text_of(source_, ":", line_, ": it is no XML: ", problem));
  }

  void require_room(std::size_t depth) {
    if (depth >= static_cast<std::size_t>(kMaxDepth)) {
      fail(text_of("elements are inside each other more than ", kMaxDepth, " deep"));
    }
    if (elements_left_ == 0) {
      throw InvalidArgument(
          text_of(source_, ":", line_, ": the model has more elements than are allowed"));
    }
    --elements_left_;
  }

  [[nodiscard]] char peek() const noexcept { return at_ < text_.size() ? text_[at_] : '\0'; }

  // Moves on to `end`, which is not beyond the text.
  void move_to(std::size_t end) noexcept {
    line_ += static_cast<int>(std::ranges::count(text_.substr(at_, end - at_), '\n'));
    at_ = end;
  }

  void skip_spaces() noexcept {
    std::size_t end = at_;
    while (end < text_.size() && is_space(text_[end])) ++end;
    move_to(end);
  }

  void skip_behind(std::string_view last, const char* what) {
    const std::size_t found = text_.find(last, at_);
    if (found == kNowhere) fail(std::string("the end of a ") + what + " is missing");
    move_to(found + last.size());
  }

  // Moves to the next "<" that begins or ends an element. `parent` is open; null: none is.
  void skip_to_element(XmlElement* parent) {
    const bool is_outside = parent == nullptr;
    for (;;) {
      const std::size_t found = text_.find('<', at_);
      const std::string_view between =
          text_.substr(at_, (found == kNowhere ? text_.size() : found) - at_);
      const bool is_empty = std::ranges::all_of(between, is_space);
      if (is_outside && !is_empty) fail("it does not begin with an element");
      if (!is_empty && parent->children.empty()) parent->text += between;
      if (found == kNowhere) {
        fail(is_outside ? "it has no element" : "the end of an element is missing");
      }
      move_to(found);
      const std::string_view rest = text_.substr(at_);
      if (rest.starts_with("<!--")) {
        skip_behind("-->", "comment");
      } else if (rest.starts_with("<![CDATA[")) {
        skip_behind("]]>", "CDATA section");
      } else if (rest.starts_with("<?")) {
        skip_behind("?>", "declaration");
      } else if (rest.starts_with("<!")) {
        skip_declaration();
      } else {
        return;
      }
    }
  }

  // A document type. What it declares means nothing here, so that no text can multiply itself.
  void skip_declaration() {
    const std::size_t end = text_.find_first_of("[>", at_);
    const bool is_list = end != kNowhere && text_[end] == '[';
    if (is_list) skip_behind("]", "document type");
    skip_behind(">", "document type");
  }

  std::string_view read_name() {
    std::size_t end = at_;
    if (end < text_.size() && begins_name(text_[end])) ++end;
    while (end > at_ && end < text_.size() && continues_name(text_[end])) ++end;
    if (end == at_) fail("a name is missing");
    const std::string_view name = text_.substr(at_, end - at_);
    at_ = end;
    return name;
  }

  // Reads the beginning of an element. Returns true if something may be in it.
  bool begin(XmlElement& element) {
    element.line = line_;
    ++at_;
    element.name = read_name();
    for (;;) {
      skip_spaces();
      if (peek() == '>') {
        ++at_;
        return true;
      }
      if (text_.substr(at_).starts_with("/>")) {
        at_ += 2;
        return false;
      }
      read_attribute(element);
    }
  }

  void read_attribute(XmlElement& element) {
    const std::string_view name = read_name();
    if (element.attributes.size() >= kMaxAttributes) {
      fail(text_of("<", element.name, "> has more than ", kMaxAttributes, " attributes"));
    }
    if (element.find(name) != nullptr) {
      fail(text_of("<", element.name, "> has two attributes '", name, "'"));
    }
    skip_spaces();
    if (peek() != '=') fail(text_of("'=' is missing after '", name, "'"));
    ++at_;
    skip_spaces();
    const char quote = peek();
    if (quote != '"' && quote != '\'') fail(text_of("the value of '", name, "' has no quotes"));
    ++at_;
    const std::size_t end = text_.find(quote, at_);
    if (end == kNowhere) fail(text_of("the end of the value of '", name, "' is missing"));
    const std::string_view value = text_.substr(at_, end - at_);
    if (value.find('\0') != kNowhere) fail(text_of("the value of '", name, "' has a byte 0"));
    element.attributes.emplace_back(name, decoded(value));
    move_to(end + 1);
  }

  void close(std::vector<XmlElement*>& open) {
    at_ += 2;
    const std::string_view name = read_name();
    // Only the first element can be read without one that is open.
    if (open.empty() || name != open.back()->name) {
      fail(text_of("</", name, "> ends what does not begin"));
    }
    skip_spaces();
    if (peek() != '>') fail(text_of("'>' is missing after </", name));
    ++at_;
    open.pop_back();
  }

  std::string_view text_;
  const std::string& source_;
  std::size_t& elements_left_;
  std::size_t at_{0};
  int line_{1};
};

void append_value(const std::string& value, std::string& text) {
  for (const char letter : value) {
    switch (letter) {
      case '&':
        text += "&amp;";
        break;
      case '<':
        text += "&lt;";
        break;
      case '"':
        text += "&quot;";
        break;
      case '\t':
        text += "&#9;";
        break;
      case '\n':  // Only the lines of elements count.
        text += "&#10;";
        break;
      case '\r':
        text += "&#13;";
        break;
      default:
        text += letter;
    }
  }
}

void append(const XmlElement& element, int& line, std::string& text) {
  for (; line < element.line; ++line) text += '\n';
  text += '<' + element.name;
  for (const auto& [name, value] : element.attributes) {
    text += ' ' + name + "=\"";
    append_value(value, text);
    text += '"';
  }
  if (element.children.empty()) {
    text += "/>";
    return;
  }
  text += '>';
  for (const XmlElement& child : element.children) append(child, line, text);
  text += "</" + element.name + '>';
}

}  // namespace

const std::string* XmlElement::find(std::string_view attribute) const noexcept {
  for (const auto& [key, value] : attributes) {
    if (key == attribute) return &value;
  }
  return nullptr;
}

XmlElement parse_xml(std::string_view text, const std::string& source, std::size_t& elements_left) {
  return Parser(text, source, elements_left).parse();
}

std::string write_xml(const XmlElement& root) {
  std::string text;
  int line = 1;
  append(root, line, text);
  return text;
}

}  // namespace trifinger::detail
