// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>

#include "manipulation/skills/draw/drawing.hpp"
#include "manipulation/skills/draw/pen_grip.hpp"
#include "trifinger/config/file.hpp"
#include "trifinger/control/impedance.hpp"
#include "trifinger/manipulation/skill.hpp"

namespace trifinger::manipulation {

// config/skills/draw.yml explains every key.
struct DrawConfig {
  std::string object;
  double holder_height;
  double hole;
  WantedDrawing wanted;
  Seconds look_time;
  Seconds max_duration;
  double approach_speed;
  PenGripConfig grip;
  double closing_force;
  double closing_speed;
  double friction;
  control::TipGains tips;
  double carry_clearance;
  double carry_speed;
  double holder_speed;
  double line_speed;
  Seconds ramp;
  double press;
  double paper_friction;
  double hop;
  double hop_speed;
  double sight_gain;
  double nib_gain;
  double tilt_gain;
};

[[nodiscard]] DrawConfig read_draw(const config::Node& root);

}  // namespace trifinger::manipulation
