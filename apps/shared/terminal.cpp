// SPDX-License-Identifier: BSD-3-Clause
#include "shared/terminal.hpp"

#include <fmt/core.h>
#include <sys/ioctl.h>
#include <unistd.h>

#include <algorithm>
#include <cstdio>
#include <cstdlib>

#include "base/printable.hpp"

namespace trifinger::apps {
namespace {

// True if the variable has a value. An empty value counts as not set: https://no-color.org.
bool is_set(const char* variable) {
  const char* const value = std::getenv(variable);
  return value != nullptr && *value != '\0';
}

bool is_dumb() {
  const char* const terminal = std::getenv("TERM");
  return terminal == nullptr || std::string_view(terminal) == "dumb";
}

bool is_first_byte(char byte) noexcept {
  return (static_cast<unsigned char>(byte) & 0xc0U) != 0x80;
}

std::string_view code_of(Style style) noexcept {
  switch (style) {
    case Style::kPlain:
      break;
    case Style::kBold:
      return "\x1b[1m";
    case Style::kDim:
      return "\x1b[2m";
    case Style::kGood:
      return "\x1b[32m";
    case Style::kWarning:
      return "\x1b[33m";
    case Style::kBad:
      return "\x1b[31m";
  }
  return {};
}

}  // namespace

Terminal::Terminal()
    // A background job of a shell has a terminal, but the user is doing something else there.
    : is_live_(::isatty(STDOUT_FILENO) == 1 && !is_dumb() &&
               ::tcgetpgrp(STDOUT_FILENO) == ::getpgrp()),
      has_colours_(::isatty(STDOUT_FILENO) == 1 && !is_dumb() && !is_set("NO_COLOR")) {}

std::size_t Terminal::width() const noexcept {
  if (!is_live_) return std::string::npos;
  winsize size{};
  if (::ioctl(STDOUT_FILENO, TIOCGWINSZ, &size) != 0 || size.ws_col == 0) return 80;
  return size.ws_col;
}

std::string Terminal::paint(std::string_view text, Style style) const {
  std::string shown = printable(text);
  if (!has_colours_ || style == Style::kPlain) return shown;
  return fmt::format("{}{}\x1b[0m", code_of(style), shown);
}

std::size_t columns_of(std::string_view text) noexcept {
  std::size_t columns = 0;
  bool is_escape = false;
  for (const char byte : text) {
    if (byte == '\x1b') is_escape = true;
    if (!is_escape && is_first_byte(byte)) ++columns;
    if (byte == 'm') is_escape = false;
  }
  return columns;
}

std::string clip(std::string_view text, std::size_t width) {
  if (columns_of(text) <= width) return std::string(text);
  if (width == 0) return {};
  std::string kept;
  std::size_t columns = 0;
  for (const char byte : text) {
    if (is_first_byte(byte) && ++columns == width) break;
    kept += byte;
  }
  return kept + "…";
}

std::string pad(std::string_view text, std::size_t width) {
  const std::size_t columns = columns_of(text);
  return std::string(text) + std::string(columns < width ? width - columns : 0, ' ');
}

std::vector<std::string> wrap(std::string_view text, std::size_t width) {
  width = std::max<std::size_t>(width, 1);
  std::vector<std::string> lines(1);
  while (!text.empty()) {
    const std::string_view word = text.substr(0, text.find(' '));
    text.remove_prefix(std::min(text.size(), word.size() + 1));
    std::string& line = lines.back();
    if (line.empty()) {
      line = clip(word, width);
    } else if (columns_of(line) + 1 + columns_of(word) <= width) {
      line += ' ';
      line += word;
    } else {
      lines.push_back(clip(word, width));
    }
  }
  return lines;
}

std::vector<std::string> hang(const std::string& head, std::string_view text, std::size_t width,
                              const Terminal& terminal, Style style) {
  std::vector<std::string> lines;
  for (const std::string& line : wrap(printable(text), width)) {
    lines.push_back((lines.empty() ? head : std::string(columns_of(head), ' ')) +
                    terminal.paint(line, style));
  }
  return lines;
}

std::string fit(std::vector<Segment> segments, std::size_t width, const Terminal& terminal) {
  std::erase_if(segments, [](const Segment& segment) { return segment.text.empty(); });
  const auto columns = [&segments] {
    std::size_t sum = 0;
    for (const Segment& segment : segments) sum += columns_of(segment.text) + 2;
    return sum == 0 ? 0 : sum - 2;
  };
  while (segments.size() > 1 && columns() > width) {
    segments.erase(std::ranges::min_element(segments, {}, &Segment::importance));
  }
  std::string line;
  for (const Segment& segment : segments) {
    if (!line.empty()) line += "  ";
    line += terminal.paint(clip(segment.text, width), segment.style);
  }
  return line;
}

LiveLines::~LiveLines() {
  if (!drawn_.empty()) fmt::print("\n");
}

void LiveLines::draw(const std::vector<std::string>& lines) {
  // One single write, so that nobody sees half of it.
  std::string text = to_first_line();
  for (std::size_t i = 0; i < lines.size(); ++i) {
    text += (i > 0 ? "\n" : "") + lines[i] + "\x1b[K";
  }
  text += "\x1b[J";
  drawn_ = lines;
  fmt::print("{}", text);
  std::fflush(stdout);
}

void LiveLines::clear() {
  if (drawn_.empty()) return;
  fmt::print("{}\x1b[J", to_first_line());
  drawn_.clear();
}

void Console::print(const std::string& about, const std::string& text, Style style) {
  live_.clear();
  const std::string head = terminal_.paint(about + ": ", Style::kBold);
  const std::size_t indent = columns_of(head);
  const std::size_t width = terminal_.width();
  const std::size_t room = width > 2 * indent ? width - indent : std::string::npos;
  for (const std::string& line : hang(head, text, room, terminal_, style)) fmt::print("{}\n", line);
  std::fflush(stdout);
}

void Console::draw(const std::vector<Segment>& line) {
  if (terminal_.is_live()) live_.draw({fit(line, terminal_.width(), terminal_)});
}

std::string LiveLines::to_first_line() const {
  // If the window has become narrower, it has broken the lines.
  const std::size_t width = std::max<std::size_t>(terminal_.width(), 1);
  std::size_t rows = 0;
  for (const std::string& line : drawn_) {
    rows += std::max<std::size_t>((columns_of(line) + width - 1) / width, 1);
  }
  return rows > 1 ? fmt::format("\r\x1b[{}A", rows - 1) : "\r";
}

}  // namespace trifinger::apps
