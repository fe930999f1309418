// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <string>
#include <string_view>
#include <vector>

#include "trifinger/base/time.hpp"

namespace trifinger::apps {

// From one drawing of what is always up to date to the next.
inline constexpr Nanoseconds kRefresh = std::chrono::milliseconds(200);

enum class Style : unsigned char { kPlain, kBold, kDim, kGood, kWarning, kBad };

// What standard output is and can show.
class Terminal {
 public:
  // Looks at standard output and at NO_COLOR and TERM.
  Terminal();

  // Somebody watches, and lines may be drawn over: not a file, and not a terminal that shows
  // another program.
  [[nodiscard]] bool is_live() const noexcept { return is_live_; }
  // Of the window, now; 80 where there is none.
  [[nodiscard]] std::size_t width() const noexcept;
  // `text` in colour, where colours are wanted.
  [[nodiscard]] std::string paint(std::string_view text, Style style) const;

 private:
  bool is_live_;
  bool has_colours_;
};

// Columns that `text` (UTF-8, painted or not) takes on a terminal.
[[nodiscard]] std::size_t columns_of(std::string_view text) noexcept;
// The beginning of `text`, at most `width` columns; what was cut off ends in "…".
[[nodiscard]] std::string clip(std::string_view text, std::size_t width);
// `text` filled up with spaces.
[[nodiscard]] std::string pad(std::string_view text, std::size_t width);
// `text` in lines of at most `width` columns, broken at spaces where there are some.
[[nodiscard]] std::vector<std::string> wrap(std::string_view text, std::size_t width);

// One thing in a line that should fit in a window.
struct Segment {
  std::string text;
  int importance{0};  // The least important ones are left out first.
  Style style{Style::kPlain};
};

// The segments that fit into `width` columns, in their order and two spaces apart.
[[nodiscard]] std::string fit(std::vector<Segment> segments, std::size_t width,
                              const Terminal& terminal);

// A few lines at the end of the output that are drawn again and again in the same place.
class LiveLines {
 public:
  explicit LiveLines(const Terminal& terminal) : terminal_(terminal) {}
  LiveLines(const LiveLines&) = delete;
  LiveLines& operator=(const LiveLines&) = delete;
  // Leaves the last lines where they are.
  ~LiveLines();

  // Shows `lines`, none of them wider than the window.
  void draw(const std::vector<std::string>& lines);
  // Takes the lines away, so that others can be printed in their place.
  void clear();

 private:
  // What takes the cursor to the beginning of the first line.
  [[nodiscard]] std::string to_first_line() const;

  const Terminal& terminal_;
  std::vector<std::string> drawn_;
};

// What a long-running command tells: a line for each event, and on a terminal a few lines below
// them that are always up to date.
class Console {
 public:
  // Prints `text`, broken to the width of the window, behind what it is about: "sim: text".
  void print(const std::string& about, const std::string& text, Style style = Style::kPlain);
  // Shows what is always up to date, if somebody watches.
  void draw(const std::vector<Segment>& line);
  [[nodiscard]] bool is_live() const noexcept { return terminal_.is_live(); }

 private:
  Terminal terminal_;
  LiveLines live_{terminal_};
};

}  // namespace trifinger::apps
