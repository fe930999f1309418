// SPDX-License-Identifier: BSD-3-Clause
#include "trial.hpp"

#include <Eigen/Geometry>
#include <cmath>
#include <exception>
#include <numbers>
#include <random>
#include <utility>

#include "evaluation/board_world.hpp"
#include "trifinger/base/error.hpp"
#include "trifinger/core/backend.hpp"
#include "trifinger/manipulation/config.hpp"
#include "trifinger/manipulation/run.hpp"
#include "trifinger/rendering/simulation_that_sees.hpp"
#include "trifinger/sim/robot_config.hpp"
#include "trifinger/sim/simulation.hpp"

namespace trifinger::evaluation {
namespace {

using manipulation::Phase;

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

// Runs a trial on `robot`, in which `true_pose` tells where the object is now and `push` pushes it.
template <class TruePose, class Push>
TrialResult run_trial(const Trial& trial, Frontend<TriFinger>& robot, const TruePose& true_pose,
                      const Push& push) {
  TrialResult result;
  const control::Seconds period = trial.simulation.period;
  result.truth.reserve(static_cast<std::size_t>(trial.config.max_duration / period));
  std::optional<TimeIndex> hold_begin;
  TimeIndex now = 0;
  const auto look = [&](TimeIndex t) {
    now = t;
    // The simulation is one step ahead of the newest observation.
    const ObjectPose pose = true_pose();
    const auto& q = pose.orientation;
    result.truth.push_back(
        {t + 1,
         {Eigen::Vector3d::Map(pose.position.data()), Eigen::Quaterniond(q[0], q[1], q[2], q[3])}});
    if (!trial.push || !hold_begin) return;
    const control::Seconds since = period * static_cast<double>(t - *hold_begin);
    const bool pushes =
        since >= trial.push->after && since < trial.push->after + trial.push->duration;
    const Eigen::Vector3d force = pushes ? trial.push->force : Eigen::Vector3d::Zero();
    push({force.x(), force.y(), force.z()});
  };
  const auto note = [&](const manipulation::Manipulation& at) {
    if (at.phase() == Phase::kHold && !hold_begin) hold_begin = now;
  };
  result.trace = manipulation::run(
      robot, trial.believed, trial.config,
      {.realtime = {.demand = Demand::kOff}, .stop = nullptr, .on_step = look, .on_phase = note});
  result.report = manipulation::make_report(result.trace, result.truth);
  return result;
}

Simulation<TriFinger> simulation_of(const Trial& trial) {
  if (!trial.sight) return Simulation<TriFinger>(trial.simulation);
  RobotConfig config = trial.sight->config;
  config.simulation = trial.simulation;
  return rendering::make_simulation<TriFinger>(config, trial.sight->rendering);
}

}  // namespace

Trial make_trial(const std::string& robot, const std::vector<std::string>& settings,
                 const std::string& manipulation, const std::string& task,
                 const std::vector<std::string>& manipulation_settings) {
  RobotConfig config = load_robot_config(robot, settings);
  auto* const simulation = std::get_if<SimulationOptions<TriFinger>>(&config.simulation);
  if (simulation == nullptr) throw InvalidArgument("'" + robot + "' has not three fingers");
  Trial trial{.simulation = std::move(*simulation),
              .believed = {},
              .config = manipulation::load_config(manipulation, task, manipulation_settings),
              .push = {}};
  if (config.boards) {
    trial.boards = std::get<boards::BoardRobotOptions<TriFinger>>(config.boards->options);
  }
  trial.believed = trial.simulation.description;
  if (config.tracks_objects) trial.sight = Trial::Sight{.config = std::move(config)};
  return trial;
}

Trial varied(const Trial& trial, std::uint64_t seed) {
  Random random(seed);
  Trial made = trial;
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

Push push_from_any_side(std::uint64_t seed) {
  Random random(seed + 1000);
  const double height = random.between(-1, 1);
  const double azimuth = random.between(-kPi, kPi);
  const double width = std::sqrt(1 - height * height);
  return {.force = {width * std::cos(azimuth), width * std::sin(azimuth), height}};
}

TrialResult run_trial(const Trial& trial) {
  if (trial.boards) {
    BoardWorld world(*trial.boards, trial.simulation);
    SessionHost host = SessionHost::anonymous();
    Backend backend(world, host,
                    {.mode = BackendOptions::Mode::kNonRealTime, .period = trial.simulation.period},
                    world.clock());
    Frontend<TriFinger> robot(backend, {.strict = true});
    return run_trial(
        trial, robot, [&] { return world.plant().object_pose(trial.config.object); },
        [](const std::array<double, 3>&) {
          throw InvalidArgument("nobody pushes what is beside emulated boards");
        });
  }
  const Simulation<TriFinger> simulation = simulation_of(trial);
  auto robot = simulation.connect();
  const std::string& object = trial.config.object;
  return run_trial(
      trial, robot, [&] { return simulation.robot().object_pose(object); },
      [&](const std::array<double, 3>& force) { simulation.robot().push_object(object, force); });
}

}  // namespace trifinger::evaluation
