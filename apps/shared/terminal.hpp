// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <chrono>
#include <cstddef>
#include <string>
#include <string_view>
#include <vector>

#include "trifinger/base/time.hpp"

namespace trifinger::apps {

// Time from one drawing of the live lines to the next.
inline constexpr Nanoseconds kRefresh = std::chrono::milliseconds(200);

enum class Style : unsigned char { kPlain, kBold, kDim, kGood, kWarning, kBad };

// Knows what standard output is and what it can show.
class Terminal {
 public:
  // Examines standard output and the variables NO_COLOR and TERM.
  Terminal();

  // True if somebody watches and lines may be drawn over. False for a file, and for a terminal that
  // shows another program.
  [[nodiscard]] bool is_live() const noexcept { return is_live_; }
  // Returns the present width of the window; if nobody watches, lines may have any width.
  [[nodiscard]] std::size_t width() const noexcept;
  // Returns `text`, which may be anybody's, as `printable` shows it, in colour if colours are
  // wanted.
  [[nodiscard]] std::string paint(std::string_view text, Style style) const;

 private:
  bool is_live_;
  bool has_colours_;
};

// Returns the number of columns that `text` (UTF-8, painted or not) takes on a terminal.
[[nodiscard]] std::size_t columns_of(std::string_view text) noexcept;
// Returns the beginning of `text`, at most `width` columns. If something is cut off, it ends in
// "…".
[[nodiscard]] std::string clip(std::string_view text, std::size_t width);
// Returns `text` filled up with spaces.
[[nodiscard]] std::string pad(std::string_view text, std::size_t width);
// Breaks `text` into lines of at most `width` columns, at spaces if possible.
[[nodiscard]] std::vector<std::string> wrap(std::string_view text, std::size_t width);

// Breaks `text` into lines of at most `width` columns, which are painted. It may be anybody's. The
// first one follows `head`, the others begin below it.
[[nodiscard]] std::vector<std::string> hang(const std::string& head, std::string_view text,
                                            std::size_t width, const Terminal& terminal,
                                            Style style);

// One part of a line that should fit into a window.
struct Segment {
  std::string text;
  int importance{0};  // The least important segments are left out first.
  Style style{Style::kPlain};
};

// Joins the segments that fit into `width` columns, in their order and two spaces apart.
[[nodiscard]] std::string fit(std::vector<Segment> segments, std::size_t width,
                              const Terminal& terminal);

// A few lines at the end of the output that are redrawn in place.
class LiveLines {
 public:
  explicit LiveLines(const Terminal& terminal) : terminal_(terminal) {}
  LiveLines(const LiveLines&) = delete;
  LiveLines& operator=(const LiveLines&) = delete;
  // Leaves the last lines where they are.
  ~LiveLines();

  // Shows `lines`. None of them may be wider than the window.
  void draw(const std::vector<std::string>& lines);
  // Removes the lines, so that others can be printed in their place.
  void clear();

 private:
  // Returns the codes that move the cursor to the beginning of the first line.
  [[nodiscard]] std::string to_first_line() const;

  const Terminal& terminal_;
  std::vector<std::string> drawn_;
};

// The output of a long-running command: a line for each event. On a terminal, a few live lines
// follow below them.
class Console {
 public:
  // Prints `text` after what it is about, as in "sim: text", broken to the width of the window.
  void print(const std::string& about, const std::string& text, Style style = Style::kPlain);
  // Shows the live line, if somebody watches.
  void draw(const std::vector<Segment>& line);
  [[nodiscard]] bool is_live() const noexcept { return terminal_.is_live(); }

 private:
  Terminal terminal_;
  LiveLines live_{terminal_};
};

}  // namespace trifinger::apps
