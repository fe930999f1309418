// SPDX-License-Identifier: BSD-3-Clause
// Finds a stroke with which three tips throw the ball that lies on them: the numbers in
// config/skills/throw.yml. First it tries many cradles that move along a line, then the
// cross-entropy method (Rubinstein 1999) moves the joint targets of the best of them. Each stroke
// counts by what it does with several balls, tips and robots as built, the worst of them once more.
#include <fmt/core.h>

#include <CLI/CLI.hpp>
#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <exception>
#include <fstream>
#include <functional>
#include <limits>
#include <memory>
#include <numbers>
#include <optional>
#include <random>
#include <string>
#include <vector>

#include "evaluation/landing.hpp"
#include "manipulation/skills/throw/stroke.hpp"
#include "trifinger/base/error.hpp"
#include "trifinger/config/file.hpp"
#include "trifinger/manipulation/run_skill.hpp"
#include "trifinger/model/kinematics.hpp"
#include "trifinger/sim/condition.hpp"
#include "trifinger/sim/robot_config.hpp"
#include "trifinger/sim/simulated_robot.hpp"

namespace trifinger::evaluation {
namespace {

using control::SafetyLimits;
using control::Seconds;
using manipulation::Stroke;
using Vector3 = Eigen::Vector3d;

constexpr double kPi = std::numbers::pi;
constexpr TimeIndex kSettling = 150;     // Steps in which the ball comes to rest in the cradle.
constexpr TimeIndex kFlight = 250;       // Steps after a stroke until the ball is looked at.
constexpr double kOffset = 0.0015;       // Of each joint at the start [rad].
constexpr double kFree = 0.003;          // A ball this far from all tips is released [m].
constexpr double kFault = -5.0;          // What a robot that stops counts [m].
constexpr double kPenetration = 0.0015;  // Tips that press deeper are not believed [m].

class Dice {
 public:
  explicit Dice(std::uint64_t seed) : engine_(seed) {}
  double between(double low, double high) {
    return std::uniform_real_distribution<double>(low, high)(engine_);
  }
  double normal() { return normal_(engine_); }

 private:
  std::mt19937_64 engine_;
  std::normal_distribution<double> normal_;
};

// Returns the stroke of joints that follow these targets.
Stroke stroke_of(std::vector<JointValues> targets) {
  return {
      .spacing = Seconds(0.025), .targets = std::move(targets), .stiffness = 15.0, .damping = 0.02};
}

// The tips around the ball, as a rigid triangle.
struct Cradle {
  Vector3 centre;  // Of the circle on which the tips' centres are [m].
  double radius;   // Of that circle [m].
};

// A simulated robot whose ball and tips differ a little from what is believed.
class Plant {
 public:
  Plant(SimulationOptions options, double mass, double friction, JointValues offset,
        const Variation& robot = {})
      : offset_(std::move(offset)),
        limits_(manipulation::safety_limits_of(options)),
        kinematics_(options.description),
        ball_radius_(options.description.objects.front().size[0] / 2),
        tip_radius_(figures(options.description).tip_radius),
        weight_(options.description.objects.front().mass),
        robot_((options.description.objects.front().mass *= mass,
                options.description.contact.tip_friction = friction, options)) {
    robot_.vary(robot);
  }

  // Puts the ball at `ball` on the tips at `start`. False if it does not come to rest there.
  bool settle(const JointValues& start, const Vector3& ball) {
    TriFinger::Action hold;
    const Stroke rest = stroke_of({start + offset_});
    kinematics_.update(start);
    const Vector3 third = -weight_ / 3.0 * control::gravity();
    const TipPositions forces = third.replicate<3, 1>();
    carrying_ = kinematics_.tip_jacobians().transpose() * forces;
    manipulation::follow(rest, manipulation::targets_at(rest, Seconds(-1)), limits_,
                         kinematics_.gravity_torques() + carrying_, hold);
    JointVector<TriFinger::kJoints> position;
    JointValues::Map(position.data(), start.size()) = start + offset_;
    robot_.reset(position, Random{.seed = 0});
    robot_.place_object("ball",
                        {.position = {ball.x(), ball.y(), ball.z()}, .orientation = {1, 0, 0, 0}});
    if (!run(kSettling, [&](TimeIndex) { return hold; })) return false;
    const ObjectVelocity velocity = robot_.object_velocity("ball");
    robot_.restore(robot_.save());
    return (ball_position() - ball).norm() < 0.006 &&
           Vector3::Map(velocity.linear.data()).norm() < 0.02;
  }

  // How far a stroke throws the ball [m]; less for what should not be.
  double throw_ball(const Stroke& stroke) {
    double deepest = 0.0;
    const auto length = static_cast<TimeIndex>(std::lround(stroke.duration().count() * 1e3));
    TriFinger::Action action;
    double gap = 0.0;
    JointValues end;
    // What the skill does.
    const bool runs = run(length + kFlight, [&](TimeIndex t) {
      kinematics_.update(joint_values(observation_.position));
      gap = clearance();
      deepest = std::max(deepest, -gap);
      const JointValues gravity = kinematics_.gravity_torques();
      if (t >= length + std::lround(manipulation::kReleaseTime.count() * 1e3)) {
        if (end.size() == 0) end = joint_values(observation_.position);
        manipulation::brake(end, limits_, gravity, action);
        return action;
      }
      const double left = std::max(1.0 - static_cast<double>(t) / static_cast<double>(length), 0.0);
      manipulation::follow(stroke,
                           manipulation::targets_at(stroke, Seconds(1e-3 * static_cast<double>(t))),
                           limits_, gravity + left * carrying_, action);
      return action;
    });
    if (!runs) return kFault;
    const ObjectVelocity velocity = robot_.object_velocity("ball");
    const Vector3 position = ball_position();
    if (position.z() < ball_radius_ + 0.05) return -0.5;
    double distance = landing(position, Vector3::Map(velocity.linear.data()), ball_radius_);
    if (gap < kFree) distance *= 0.3;
    return distance - 300.0 * std::max(0.0, deepest - kPenetration);
  }

 private:
  template <class Controller>
  bool run(TimeIndex steps, const Controller& controller) {
    if (robot_.prepare(0).state != DriverReport::State::kReady) return false;
    TriFinger::AppliedAction applied;
    for (TimeIndex t = 0; t < steps; ++t) {
      static_cast<void>(robot_.get_latest_observation(&observation_));
      const TriFinger::Action action = controller(t);
      if (robot_.apply_action(&action, &applied).state != DriverReport::State::kReady) return false;
    }
    return true;
  }

  [[nodiscard]] Vector3 ball_position() const {
    return Vector3::Map(robot_.object_pose("ball").position.data());
  }
  [[nodiscard]] double clearance() const {
    const TipPositions tips = kinematics_.tip_positions();
    const Vector3 ball = ball_position();
    double least = std::numeric_limits<double>::infinity();
    for (int i = 0; i < 3; ++i) {
      const Vector3 tip = tips.segment<3>(3 * i);
      least = std::min(least, (ball - tip).norm() - ball_radius_ - tip_radius_);
    }
    return least;
  }

  JointValues offset_;
  SafetyLimits limits_;
  Kinematics kinematics_;
  double ball_radius_;
  double tip_radius_;
  double weight_;         // Believed mass of the ball [kg].
  JointValues carrying_;  // Torques that carry it at the start of the stroke [Nm].
  SimulatedRobot robot_;
  TriFinger::Observation observation_;
};

class Finder {
 public:
  Finder(const SimulationOptions& options, std::uint64_t seed)
      : options_(options),
        limits_(manipulation::safety_limits_of(options)),
        kinematics_(options.description),
        dice_(seed),
        ball_radius_(options.description.objects.front().size[0] / 2),
        tip_radius_(figures(options.description).tip_radius) {}

  std::unique_ptr<Plant> make_plant(double mass, double friction, double offset) {
    JointValues offsets(9);
    for (double& value : offsets) value = offset * dice_.normal();
    return std::make_unique<Plant>(options_, mass, friction, offsets);
  }
  std::unique_ptr<Plant> any_plant() {
    const double mass = dice_.between(0.8, 1.2);
    return make_plant(mass, dice_.between(0.6, 1.0), kOffset);
  }

  // A robot as built. The skill centres the ball by what it sees: homing does not count here.
  std::unique_ptr<Plant> plant_as_built(std::uint64_t seed) {
    Random random{.seed = seed};
    Variation robot = draw(Condition::kAsBuilt, random);
    robot.homing_error = 0.0;
    return std::make_unique<Plant>(options_, dice_.between(0.8, 1.2), dice_.between(0.6, 1.0),
                                   JointValues::Zero(9), robot);
  }

  [[nodiscard]] double height_over(const Cradle& cradle) const {
    const double reach = ball_radius_ + tip_radius_ - 0.0002;
    return std::sqrt(reach * reach - cradle.radius * cradle.radius);
  }

  // Joint positions with the tips on a circle that is tilted about a horizontal axis.
  std::optional<JointValues> joints_of(const Cradle& cradle, double azimuth, double tilt,
                                       const JointValues* near) {
    JointValues joints(9);
    const Eigen::AngleAxisd turn(tilt, Vector3(-std::sin(azimuth), std::cos(azimuth), 0.0));
    for (int i = 0; i < 3; ++i) {
      const double angle = kinematics_.finger_azimuth(i);
      const Vector3 tip =
          cradle.centre + turn * (cradle.radius * Vector3(std::cos(angle), std::sin(angle), 0.0));
      const FingerPose pose = near == nullptr
                                  ? kinematics_.inverse_kinematics(i, tip)
                                  : kinematics_.inverse_kinematics(i, tip, near->segment<3>(3 * i));
      if (!pose && near == nullptr) return std::nullopt;
      joints.segment<3>(3 * i) = pose.position;
    }
    return within_limits(joints);
  }

  [[nodiscard]] JointValues within_limits(JointValues joints) const {
    constexpr double kMargin = 0.01;
    for (Eigen::Index i = 0; i < joints.size(); ++i) {
      const auto k = static_cast<std::size_t>(i);
      joints[i] =
          std::clamp(joints[i], limits_.soft_lower[k] + kMargin, limits_.soft_upper[k] - kMargin);
    }
    return joints;
  }

  struct Found {
    Stroke stroke{stroke_of({})};
    Vector3 ball{Vector3::Zero()};
    double value{-10.0};
  };

  // A cradle that moves along a line.
  std::optional<Found> random_stroke() {
    const double reach = ball_radius_ + tip_radius_;
    const double azimuth = dice_.between(-kPi, kPi);
    const double back = dice_.between(-0.03, 0.13);
    const double aside = dice_.between(-0.04, 0.04);
    const Cradle cradle{.centre = {-back * std::cos(azimuth) - aside * std::sin(azimuth),
                                   -back * std::sin(azimuth) + aside * std::cos(azimuth),
                                   dice_.between(0.40, 0.58)},
                        .radius = reach * dice_.between(0.55, 0.92)};
    const double elevation = dice_.between(0.0, 1.2);
    const double length = dice_.between(0.1, 0.4);
    const double tilt = dice_.between(-1.2, 1.2);
    const double spread = dice_.between(-0.01, 0.01);
    const double power = dice_.between(1.3, 2.6);
    const int knots = static_cast<int>(dice_.between(5, 13));
    const auto start = joints_of(cradle, azimuth, 0.0, nullptr);
    if (!start) return std::nullopt;
    const Vector3 direction(std::cos(azimuth) * std::cos(elevation),
                            std::sin(azimuth) * std::cos(elevation), std::sin(elevation));
    Found found;
    found.ball = cradle.centre + Vector3(0, 0, height_over(cradle));
    found.stroke.targets.push_back(*start);
    for (int i = 1; i <= knots; ++i) {
      const double share = std::pow(static_cast<double>(i) / knots, power);
      const Cradle there{.centre = cradle.centre + share * length * direction,
                         .radius = cradle.radius + share * spread};
      found.stroke.targets.push_back(
          *joints_of(there, azimuth, share * tilt, &found.stroke.targets.back()));
    }
    return found;
  }

  double value_of(Found& found, std::vector<std::unique_ptr<Plant>>& plants, bool is_settled) {
    double sum = 0.0;
    double least = 10.0;
    for (auto& plant : plants) {
      if (!is_settled && !plant->settle(found.stroke.targets.front(), found.ball)) return -2.0;
      const double distance = plant->throw_ball(found.stroke);
      sum += distance;
      least = std::min(least, distance);
    }
    return 0.8 * sum / static_cast<double>(plants.size()) + 0.2 * least;
  }

  // Called with the best stroke from time to time.
  std::function<void(const Found&)> keep;

  // The cross-entropy method on all targets but the first.
  void improve(Found& found, std::vector<std::unique_ptr<Plant>>& plants, int iterations,
               int samples, double first_sigma) {
    found.value = value_of(found, plants, false);
    const auto knots = static_cast<Eigen::Index>(found.stroke.targets.size());
    Eigen::VectorXd mean(9 * (knots - 1));
    for (Eigen::Index i = 1; i < knots; ++i)
      mean.segment<9>(9 * (i - 1)) = found.stroke.targets[static_cast<std::size_t>(i)];
    Eigen::VectorXd sigma = Eigen::VectorXd::Constant(mean.size(), first_sigma);
    struct Sample {
      Eigen::VectorXd parameters;
      double value;
    };
    const auto with = [&](const Eigen::VectorXd& parameters) {
      Found other = found;
      for (Eigen::Index i = 1; i < knots; ++i)
        other.stroke.targets[static_cast<std::size_t>(i)] =
            within_limits(parameters.segment<9>(9 * (i - 1)));
      return other;
    };
    for (int round = 0; round < iterations; ++round) {
      std::vector<Sample> all;
      all.push_back({mean, 0.0});
      for (int s = 1; s < samples; ++s) {
        Eigen::VectorXd parameters = mean;
        // Neighbouring targets move alike, and a third of the samples moves one finger only.
        const int only = dice_.between(0, 1) < 0.4 ? static_cast<int>(dice_.between(0, 3)) : -1;
        for (Eigen::Index j = 0; j < 9; ++j) {
          double noise = dice_.normal();
          for (Eigen::Index i = 0; i + 1 < knots; ++i) {
            noise = 0.7 * noise + 0.714 * dice_.normal();
            if (only < 0 || j / 3 == only) parameters[9 * i + j] += sigma[9 * i + j] * noise;
          }
        }
        all.push_back({parameters, 0.0});
      }
      for (Sample& sample : all) {
        Found other = with(sample.parameters);
        sample.value = other.value = value_of(other, plants, true);
        if (other.value > found.value) found = other;
      }
      std::ranges::sort(all, std::greater{}, &Sample::value);
      const int elites = std::max(4, samples / 8);
      Eigen::VectorXd next = Eigen::VectorXd::Zero(mean.size());
      Eigen::VectorXd square = next;
      for (int e = 0; e < elites; ++e) next += all[static_cast<std::size_t>(e)].parameters / elites;
      for (int e = 0; e < elites; ++e)
        square += (all[static_cast<std::size_t>(e)].parameters - next).cwiseAbs2() / elites;
      mean = next;
      sigma = (0.75 * sigma + 0.25 * square.cwiseSqrt()).cwiseMax(0.012);
      if (round % 10 == 9) {
        keep(found);
        fmt::print(stderr, "  round {:3}: best {:.3f} m, elite {:.3f}, sigma {:.3f}\n", round + 1,
                   found.value, all.front().value, sigma.mean());
      }
    }
  }

 private:
  SimulationOptions options_;
  SafetyLimits limits_;
  Kinematics kinematics_;
  Dice dice_;
  double ball_radius_;
  double tip_radius_;
};

std::string text_of(const Finder::Found& found) {
  std::string text = fmt::format(
      "    ball: [{:.4f}, {:.4f}, {:.4f}]\n    spacing: {}\n    stiffness: {}\n    damping: {}\n"
      "    targets:\n",
      found.ball.x(), found.ball.y(), found.ball.z(), found.stroke.spacing.count(),
      found.stroke.stiffness, found.stroke.damping);
  for (const JointValues& target : found.stroke.targets) {
    text += "      - [";
    for (Eigen::Index i = 0; i < target.size(); ++i)
      text += fmt::format("{}{:.4f}", i > 0 ? ", " : "", target[i]);
    text += "]\n";
  }
  return text;
}

// Another stroke as a start: with more time, and with targets at the usual spacing again.
Finder::Found stretched(const Finder::Found& found, double factor) {
  Finder::Found longer = found;
  longer.stroke.targets.clear();
  const Seconds duration = factor * found.stroke.duration();
  const int count = static_cast<int>(std::ceil(duration / found.stroke.spacing - 1e-6));
  for (int i = 0; i <= count; ++i)
    longer.stroke.targets.push_back(
        manipulation::targets_at(found.stroke, i * found.stroke.spacing / factor).position);
  return longer;
}

Finder::Found read(const std::string& path) {
  const config::Node root = config::File::load(path).root();
  Finder::Found found;
  const auto ball = root.required<std::array<double, 3>>("ball");
  found.ball = Vector3::Map(ball.data());
  for (const config::Node& target : root.at("targets").items())
    found.stroke.targets.push_back(joint_values(target.as<std::array<double, 9>>()));
  return found;
}

struct FindOptions {
  std::string robot{"throw"};
  std::string from;
  std::uint64_t seed{0};
  int tries{2000};
  int candidates{3};
  int first_rounds{40};
  int rounds{40};
  int samples{64};
  int robots{10};
  std::string output{"stroke.yml"};
};

int find(const FindOptions& options) {
  const RobotConfig config = load_robot_config(options.robot);
  const auto& simulation = config.simulation;
  Finder finder(simulation, options.seed);
  double kept = -10.0;
  finder.keep = [&](const Finder::Found& found) {
    if (found.value <= kept) return;
    kept = found.value;
    std::ofstream(options.output) << text_of(found);
  };
  std::vector<std::unique_ptr<Plant>> one;
  one.push_back(finder.make_plant(1.0, 0.8, 0.0));
  std::vector<Finder::Found> all;
  for (int i = 0; i < options.tries; ++i) {
    auto found = finder.random_stroke();
    if (!found) continue;
    found->value = finder.value_of(*found, one, false);
    all.push_back(*found);
  }
  if (!options.from.empty()) {
    const Finder::Found start = read(options.from);
    for (const double factor : {1.0, 1.15, 1.3, 1.5, 1.75, 2.0}) {
      Finder::Found found = stretched(start, factor);
      found.value = finder.value_of(found, one, false);
      all.push_back(found);
    }
  }
  if (all.empty()) throw InvalidArgument("no stroke to begin with: give --tries or --from");
  std::ranges::sort(all, std::greater{}, &Finder::Found::value);
  all.resize(std::min(all.size(), static_cast<std::size_t>(std::max(options.candidates, 1))));
  for (Finder::Found& found : all) {
    fmt::print(stderr, "candidate: {:.3f} m\n", found.value);
    finder.improve(found, one, options.first_rounds, options.samples, 0.12);
  }
  Finder::Found best = *std::ranges::max_element(all, {}, &Finder::Found::value);
  std::vector<std::unique_ptr<Plant>> several;
  several.push_back(finder.make_plant(0.82, 0.95, kOffset));
  several.push_back(finder.make_plant(1.18, 0.95, kOffset));
  several.push_back(finder.make_plant(0.85, 0.65, kOffset));
  several.push_back(finder.make_plant(1.2, 0.65, kOffset));
  several.push_back(finder.make_plant(1.0, 0.8, 0.0));
  for (int i = 0; i < options.robots; ++i)
    several.push_back(finder.plant_as_built(options.seed + static_cast<std::uint64_t>(i)));
  kept = -10.0;  // What many robots can do counts less than what one can do.
  finder.improve(best, several, options.rounds, options.samples, 0.04);
  finder.keep(best);

  std::vector<double> judged;
  for (int i = 0; i < 20; ++i) {
    const auto plant = finder.any_plant();
    if (plant->settle(best.stroke.targets.front(), best.ball))
      judged.push_back(plant->throw_ball(best.stroke));
  }
  std::ranges::sort(judged);
  fmt::print("others:");
  for (const double distance : judged) fmt::print(" {:.2f}", distance);
  fmt::print(" m\n");
  return 0;
}

int run_program(int argument_count, char** arguments) {
  FindOptions options;
  CLI::App program("Finds a stroke with which three tips throw the ball that lies on them.");
  program.add_option("--robot", options.robot, "Configuration of the robot")->capture_default_str();
  program.add_option("--from", options.from, "File of a stroke to begin with, beside random ones");
  program.add_option("--seed", options.seed, "Of everything random")->capture_default_str();
  program.add_option("--tries", options.tries, "Number of random strokes")->capture_default_str();
  program.add_option("--candidates", options.candidates, "How many of the best are improved")
      ->capture_default_str();
  program.add_option("--first-rounds", options.first_rounds, "Rounds for one robot")
      ->capture_default_str();
  program.add_option("--rounds", options.rounds, "Rounds for several robots that differ")
      ->capture_default_str();
  program.add_option("--samples", options.samples, "Strokes in a round")->capture_default_str();
  program.add_option("--robots", options.robots, "How many robots as built each stroke counts by")
      ->capture_default_str();
  program.add_option("--output", options.output, "Where the stroke goes")->capture_default_str();
  CLI11_PARSE(program, argument_count, arguments);
  return find(options);
}

}  // namespace
}  // namespace trifinger::evaluation

int main(int argument_count, char** arguments) {
  try {
    return trifinger::evaluation::run_program(argument_count, arguments);
  } catch (const std::exception& error) {
    fmt::print(stderr, "find_throw: {}\n", error.what());
    return 1;
  }
}
