// SPDX-License-Identifier: BSD-3-Clause
#include "evaluation/cube_trial.hpp"

#include <fmt/core.h>

#include <array>
#include <cmath>
#include <numbers>
#include <optional>
#include <random>
#include <utility>

namespace trifinger::evaluation {
namespace {

constexpr double kPi = std::numbers::pi;

// Random numbers that are equal with every standard library.
class Random {
 public:
  explicit Random(std::uint64_t seed) : engine_(seed) {}
  double between(double low, double high) {
    constexpr double kUlp = 0x1p-53;
    return low + (high - low) * kUlp * static_cast<double>(engine_() >> 11U);
  }

 private:
  std::mt19937_64 engine_;
};

}  // namespace

SkillTrial varied(const SkillTrial& trial, std::uint64_t seed) {
  Random random(seed);
  SkillTrial made = trial;
  made.after = control::Seconds(0);
  SimulationOptions& simulation = made.simulation;
  ObjectDescription& object = simulation.description.objects.front();
  constexpr double kDistance = 0.03;
  // Draws a place within a circle, evenly distributed.
  const double distance = kDistance * std::sqrt(random.between(0, 1));
  const double azimuth = random.between(-kPi, kPi);
  object.position = {distance * std::cos(azimuth), distance * std::sin(azimuth),
                     object.size[2] / 2};
  const double yaw = random.between(-kPi, kPi);
  object.orientation = {std::cos(yaw / 2), 0.0, 0.0, std::sin(yaw / 2)};
  object.mass *= random.between(0.8, 1.2);
  simulation.description.contact.tip_friction = random.between(0.6, 1.0);
  simulation.object_delay = std::lround(random.between(9.5, 30.5));
  simulation.object_position_noise = 1e-3;
  simulation.object_orientation_noise = 0.5 * kPi / 180;
  simulation.seed = seed;
  if (made.vision) {
    trifinger::Random light{.seed = seed};
    made.vision->rendering = rendering::RenderingVariation{}.draw(made.vision->rendering, light);
  }
  return made;
}

void push_from_any_side(SkillTrial& trial, std::uint64_t seed, double force,
                        control::Seconds after) {
  Random random(seed + 1000);
  const double height = random.between(-1, 1);
  const double azimuth = random.between(-kPi, kPi);
  const double width = std::sqrt(1 - height * height);
  const std::array<double, 3> wanted{force * (width * std::cos(azimuth)),
                                     force * (width * std::sin(azimuth)), force * height};
  const control::Seconds period = trial.simulation.period;
  trial.interfere = [=, hold_begin = std::optional<TimeIndex>()](
                        SimulatedRobot& robot, TimeIndex t,
                        const manipulation::SkillState& state) mutable {
    constexpr control::Seconds kDuration{0.05};
    if (state.phase == "hold" && !hold_begin) hold_begin = t - 1;
    if (!hold_begin) return;
    const control::Seconds since = period * static_cast<double>(t - *hold_begin);
    const bool pushes = since >= after && since < after + kDuration;
    robot.push_object("cube", pushes ? wanted : std::array<double, 3>{});
  };
}

SkillRow cube_row(std::string what, std::string reach, double needed, SkillTrial trial,
                  const Limits& limits) {
  const auto judge = [limits](const SkillTrial&, const SkillTrialResult& result) {
    const Report report{.judgement = {}, .figures = result.figures};
    Judgement judgement{.figure = report.at("position_rms"),
                        .why = std::string(result.trace.failure)};
    if (judgement.why.empty() && report.at("grasps") != 1) judgement.why = "it was grasped again";
    const bool is_within = judgement.figure <= limits.position_rms &&
                           report.at("orientation_rms") <= limits.orientation_rms &&
                           report.at("hold_drift") <= limits.hold_drift;
    if (judgement.why.empty() && !is_within) judgement.why = "beyond the reach";
    judgement.succeeds = judgement.why.empty();
    return judgement;
  };
  return {.what = std::move(what),
          .reach = std::move(reach),
          .needed = needed,
          .trial = std::move(trial),
          .vary = [](SkillTrial& made, std::uint64_t seed) { made = varied(made, seed); },
          .judge = judge,
          .figure = "position rms",
          .unit = "mm",
          .scale = 1 / kMillimetre};
}

std::string_view cube_columns() {
  return "| what | reach | succeed | worst position rms | worst orientation rms | worst drift | "
         "normal forces | least torque left | holds |\n"
         "|---|---|---|---|---|---|---|---|---|\n";
}

std::string line_of(const JudgedRow& done) {
  const double drift = done.worst("hold_drift");
  return fmt::format(
      "| {} | {} | {} of {} | {:.2f} mm | {:.2f}° | {} | {:.2f} to {:.2f} N | {:.0f} % | {} |\n",
      done.row.what, done.row.reach, done.successes(), done.reports.size(),
      done.worst("position_rms") / kMillimetre, done.worst("orientation_rms") / kDegree,
      drift > 0.0 ? fmt::format("{:.2f} mm", drift / kMillimetre) : "",
      done.least("normal_force_min"), done.worst("normal_force_max"),
      100 * done.least("torque_margin"), done.holds() ? "yes" : "**no**");
}

std::string details_of(const JudgedRow& done, std::uint64_t first_seed) {
  std::string text = fmt::format(
      "\n## {}\n\n| seed | position rms, max [mm] | orientation rms, max [°] | drift, slip while "
      "held [mm] | normal force "
      "[N] | tangential force [N] | torque left [%] | grasps | "
      "|\n|---|---|---|---|---|---|---|---|---|\n",
      done.row.what);
  for (std::size_t i = 0; i < done.reports.size(); ++i) {
    const Report& r = done.reports[i];
    text += fmt::format(
        "| {} | {:.2f}, {:.2f} | {:.2f}, {:.2f} | {:.2f}, {:.2f} | {:.2f} to {:.2f} | {:.2f} | "
        "{:.0f} | {:.0f} | {} |\n",
        first_seed + i, r.at("position_rms") / kMillimetre, r.at("position_max") / kMillimetre,
        r.at("orientation_rms") / kDegree, r.at("orientation_max") / kDegree,
        r.at("hold_drift") / kMillimetre, r.at("hold_slip") / kMillimetre, r.at("normal_force_min"),
        r.at("normal_force_max"), r.at("tangential_force_max"), 100 * r.at("torque_margin"),
        r.at("grasps"), r.judgement.why);
  }
  return text;
}

}  // namespace trifinger::evaluation
