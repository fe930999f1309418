// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "boards/board_robot.hpp"
#include "trifinger/core/backend.hpp"
#include "trifinger/core/timing.hpp"
#include "trifinger/manipulation/run_skill.hpp"
#include "trifinger/manipulation/skill.hpp"
#include "trifinger/rendering/options.hpp"
#include "trifinger/sim/condition.hpp"
#include "trifinger/sim/robot_config.hpp"
#include "trifinger/sim/simulated_robot.hpp"

namespace trifinger::evaluation {

// One skill in a simulation of its own. The controller believes that robot and object are like
// `believed`; the simulation may have another mass and friction.
struct SkillTrial {
  std::string skill;
  std::vector<std::string> settings{};  // Of the skill's configuration.
  bool is_taught{false};                // Plays what was taught instead of controlling.
  SimulationOptions simulation;
  Condition condition{Condition::kAsDocumented};
  std::vector<std::pair<std::string, double>> changes{};  // Beside it: values of `Variation`.
  RobotDescription believed;
  Identified known{};  // What the controller knows of the joints.
  // How the back-end keeps time; nothing if time stands still while the skill computes.
  std::optional<BackendOptions> real_time{};
  control::Seconds after{1.0};  // Time to watch when the skill has ended: the robot holds its pose.
  // Does something to the simulation after step `t`, such as setting the object in motion.
  std::function<void(SimulatedRobot& robot, TimeIndex t, const manipulation::SkillState& state)>
      interfere{};
  // The robot has emulated motor boards, which drive the simulation. Of what is true, only poses
  // of the object are known, until the skill's end.
  std::optional<boards::BoardRobotOptions> boards{};
  // The robot knows its objects only from the images of its cameras.
  struct Vision {
    RobotConfig config;
    rendering::RenderingOptions rendering{};
  };
  std::optional<Vision> vision{};
};

// Makes a trial from the configuration of a robot and the skill's own, without any variation. If
// the robot is on motor boards, these are emulated.
[[nodiscard]] SkillTrial make_skill_trial(const std::string& robot, const std::string& skill,
                                          const std::vector<std::string>& robot_settings = {},
                                          const std::vector<std::string>& skill_settings = {});

// Runs the trial in real time, as the robot's configuration says: the robot waits for no plan.
[[nodiscard]] SkillTrial in_real_time(SkillTrial trial, const std::string& robot);

// Random numbers that are equal with every standard library.
class TrialRandom {
 public:
  explicit TrialRandom(std::uint64_t seed) : state_(seed) {}
  [[nodiscard]] double between(double low, double high);

 private:
  std::uint64_t state_;
};

// Varies what no controller knows: mass of the object (within 20 %), friction of the tips (from
// `least_friction` to 1.0), delay of the poses (10 to 30 ms) and their noise (1 mm, 0.5 degrees).
void vary_physics(SkillTrial& trial, TrialRandom& random, double least_friction = 0.6);
// Moves the object within a circle of `radius` [m] about where it lies, and turns it about the
// vertical by any angle.
void vary_place(SkillTrial& trial, TrialRandom& random, double radius = 0.03);
void vary_place_and_physics(SkillTrial& trial, std::uint64_t seed);

// What was true at a step.
struct TrueStep {
  TimeIndex step{0};
  control::Pose object{};
  control::Twist twist{};
  std::array<double, 3> tip_distances{};  // Of the tips' surfaces from the object's [m].
  std::array<Eigen::Vector3d, 3> tips{};  // Centres of the tips [m].

  // A tip is nearer than rubber gives way and a contact opens [m].
  static constexpr double kTouch = 3e-4;
  [[nodiscard]] bool is_touched_by(std::size_t finger) const {
    return tip_distances[finger] < kTouch;
  }
  [[nodiscard]] int touches() const {
    return static_cast<int>(is_touched_by(0)) + static_cast<int>(is_touched_by(1)) +
           static_cast<int>(is_touched_by(2));
  }
};

// What a trial demands of robot and object, at its worst step.
struct Strain {
  double contact_depth{0.0};  // Of any two surfaces in each other [m].
  double torque_limit{0.0};  // Share of the steps in which a motor gave all that its limit lets it.
  double speed{0.0};         // Of a joint [rad/s].
  double thermal_margin{1.0};  // Of a motor, at its least.
};

struct SkillTrialResult {
  manipulation::SkillTrace trace;
  Strain strain;
  std::vector<TrueStep> truth;                // Of all steps, those after the skill's end included.
  std::size_t end{0};                         // Index in `truth` of the skill's end.
  std::vector<manipulation::Figure> figures;  // From the true poses.
  std::optional<TimingRecord> timing{};  // How the skill's session kept its time, in real time.

  // What was true at `step`; the nearest if it is beyond what is known.
  [[nodiscard]] const TrueStep& truth_at(TimeIndex step) const;
};

[[nodiscard]] SkillTrialResult run_skill_trial(const SkillTrial& trial);

// Whether a trial has reached what it should, by what was true.
struct Judgement {
  bool succeeds{false};
  double figure{0.0};  // The row's figure, in SI units; of a success only.
  std::string why{};   // In words, if it does not.
  std::string note{};  // What else is to be reported, such as the lateness of the loop.
};
using Judge = std::function<Judgement(const SkillTrial& trial, const SkillTrialResult& result)>;

// What is kept of a trial.
struct Report {
  Judgement judgement;
  std::vector<manipulation::Figure> figures{};  // Those of the skill, from the true poses.

  // Zero if there is no such figure.
  [[nodiscard]] double at(std::string_view name) const;
};

// A row of a table in docs/results.
struct SkillRow {
  std::string name;  // In commands: "catch-thrown". The first row of a skill has its name.
  std::string what;
  std::string reach;   // In words, as asked.
  double needed{1.0};  // Share of the trials that must succeed.
  SkillTrial trial;
  int most_trials{1000};  // However many seeds are asked for: some take minutes.
  std::function<void(SkillTrial& trial, std::uint64_t seed)> vary;
  Judge judge;
  std::string figure;     // What the figure is: "distance".
  std::string unit{"m"};  // Unit in which the table shows it.
  double scale{1.0};      // Figure in SI units times this is the figure in the table.
  // A row whose rms of all trials together this one's may exceed by a fifth.
  std::string like{};
};

}  // namespace trifinger::evaluation
