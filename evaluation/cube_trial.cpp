// SPDX-License-Identifier: BSD-3-Clause
#include "evaluation/cube_trial.hpp"

#include <array>
#include <cmath>
#include <numbers>
#include <optional>
#include <random>

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
  SimulationOptions<TriFinger>& simulation = made.simulation;
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
  if (made.sight) {
    trifinger::Random light{.seed = seed};
    made.sight->rendering = rendering::RenderingVariation{}.draw(made.sight->rendering, light);
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
                        SimulatedRobot<TriFinger>& robot, TimeIndex t,
                        const manipulation::SkillState& state) mutable {
    constexpr control::Seconds kDuration{0.05};
    if (state.phase == "hold" && !hold_begin) hold_begin = t - 1;
    if (!hold_begin) return;
    const control::Seconds since = period * static_cast<double>(t - *hold_begin);
    const bool pushes = since >= after && since < after + kDuration;
    robot.push_object("cube", pushes ? wanted : std::array<double, 3>{});
  };
}

}  // namespace trifinger::evaluation
