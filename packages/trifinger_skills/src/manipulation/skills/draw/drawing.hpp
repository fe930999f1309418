// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <filesystem>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "trifinger/manipulation/skill.hpp"

namespace trifinger::manipulation {

// A line without a break: its points in order [m].
using PenStroke = std::vector<Eigen::Vector2d>;
// Strokes in the order in which they are drawn.
using Drawing = std::vector<PenStroke>;

// A sheet on the table.
struct Paper {
  Eigen::Vector2d centre;  // [m]
  Eigen::Vector2d size;    // Along the lines of writing, and across [m].
  double turn;             // Direction of the lines of writing, from x towards y [rad].

  [[nodiscard]] bool contains(const Eigen::Vector2d& point) const noexcept;
};

// `word` in capitals of this height [m] on one line, which begins at the origin. Its letters are
// single strokes of our own: A to Z, 0 to 9 and some signs.
// Throws InvalidArgument that lists the letters if there is none for one of them
[[nodiscard]] Drawing written(std::string_view word, double height);

// Reads strokes: a line of names, then a row per point with the number of its stroke and x, y [m],
// with commas in between. Rows of one stroke follow each other.
// Throws InvalidArgument that names the line that is wrong
[[nodiscard]] Drawing load_strokes(const std::filesystem::path& path);

// The drawing in the middle of the paper, in the world frame.
// Throws InvalidArgument if it does not fit
[[nodiscard]] Drawing placed(const Drawing& drawing, const Paper& paper);

// What a skill of drawing should draw, in the world frame, and on which paper.
struct WantedDrawing {
  Paper paper;
  Drawing lines;
};
// Reads this from the configuration of the skill "draw", as `make_skill` does.
[[nodiscard]] WantedDrawing load_wanted_drawing(const std::string& config = {},
                                                const std::vector<std::string>& overrides = {});

// Where the end of `pen` along its x axis touched the paper, if it was at `poses` one after the
// other: strokes of points that are at least 0.1 mm apart. It touches if its lowest point is at
// most `touch` above the table [m].
[[nodiscard]] Drawing drawn_by(const ObjectDescription& pen, std::span<const SeenPose> poses,
                               const Paper& paper, double touch);

// How far what was drawn is from what was wanted.
struct DrawingError {
  double rms{0.0};  // Root mean square of the distances of what was drawn from the wanted line [m].
  double largest{0.0};  // [m]
  // Share of the wanted line along which something was drawn not more than 1.5 mm away.
  double share{0.0};
};
[[nodiscard]] DrawingError compare(const Drawing& wanted, const Drawing& drawn);

// A table of both: kind, number of the stroke, x, y.
[[nodiscard]] std::string csv_of(const Drawing& wanted, const Drawing& drawn);
// A picture of both on the paper, in millimetres.
[[nodiscard]] std::string svg_of(const Drawing& wanted, const Drawing& drawn, const Paper& paper);

}  // namespace trifinger::manipulation
