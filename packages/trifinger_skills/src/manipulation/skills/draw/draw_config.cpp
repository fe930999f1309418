// SPDX-License-Identifier: BSD-3-Clause
#include "manipulation/skills/draw/draw_config.hpp"

#include <array>

#include "manipulation/parts/settings.hpp"
#include "manipulation/skills/makers.hpp"

namespace trifinger::manipulation {
namespace {

using config::Range;

WantedDrawing read_drawing(const config::Node& root) {
  const Range length = above_zero("m", 0.3);
  WantedDrawing wanted;
  const config::Node paper = root.section("paper");
  const auto centre =
      paper.required<std::array<double, 2>>("centre", {.unit = "m", .min = -0.2, .max = 0.2});
  const auto size = paper.required<std::array<double, 2>>("size", length);
  wanted.paper = {.centre = Eigen::Vector2d::Map(centre.data()),
                  .size = Eigen::Vector2d::Map(size.data()),
                  .turn = paper.required<double>("turn", {.unit = "rad", .min = -10, .max = 10})};
  const auto word = root.required<std::string>("word");
  const auto strokes = root.required<std::string>("strokes");
  const auto height = root.required<double>("letter_height", above_zero("m", 0.1));
  wanted.lines =
      placed(strokes == "none" ? written(word, height) : load_strokes(strokes), wanted.paper);
  return wanted;
}

}  // namespace

DrawConfig read_draw(const config::Node& root) {
  const Range length = above_zero("m", 0.3);
  const Range speed = above_zero("m/s", 1);
  const Range force = above_zero("N", 5);
  const Range damping = above_zero("Ns/m", 100);
  const config::Node holder = root.section("holder");
  const config::Node approach = root.section("approach");
  const config::Node grip = root.section("grip");
  const config::Node carry = root.section("carry");
  const config::Node line = root.section("line");
  const config::Node feedback = root.section("feedback");
  return {.object = root.required<std::string>("object"),
          .holder_height = holder.required<double>("height", length),
          .hole = holder.required<double>("hole", length),
          .wanted = read_drawing(root),
          .look_time = read_time(root, "look_time"),
          .max_duration = read_time(root, "max_duration"),
          .approach_speed = approach.required<double>("speed", speed),
          .grip = {.height = grip.required<double>("height", length),
                   .spread = grip.required<double>("spread", length),
                   .force = grip.required<double>("force", force),
                   .clearance = approach.required<double>("clearance", length),
                   .detour = approach.required<double>("detour", length)},
          .closing_force = grip.required<double>("closing_force", force),
          .closing_speed = grip.required<double>("closing_speed", above_zero("m/s", 1)),
          .friction = grip.required<double>("friction", above_zero("", 5)),
          .tips = {.stiffness = grip.required<double>("tip_stiffness", above_zero("N/m", 5000)),
                   .damping = grip.required<double>("tip_damping", damping)},
          .carry_clearance = carry.required<double>("clearance", length),
          .carry_speed = carry.required<double>("speed", speed),
          .holder_speed = carry.required<double>("holder_speed", speed),
          .line_speed = line.required<double>("speed", speed),
          .ramp = read_time(line, "ramp"),
          .press = line.required<double>("force", force),
          .paper_friction = line.required<double>("friction", {.min = 0, .max = 5}),
          .hop = line.required<double>("hop", length),
          .hop_speed = line.required<double>("hop_speed", speed),
          .sight_gain = feedback.required<double>("sight", {.unit = "1/s", .min = 0, .max = 20}),
          .nib_gain = feedback.required<double>("nib", {.unit = "1/s", .min = 0, .max = 100}),
          .tilt_gain = feedback.required<double>("tilt", {.unit = "1/s", .min = 0, .max = 100})};
}

WantedDrawing load_wanted_drawing(const std::string& config,
                                  const std::vector<std::string>& overrides) {
  return read_drawing(load_skill_file(config.empty() ? "draw" : config, overrides).root());
}

}  // namespace trifinger::manipulation
