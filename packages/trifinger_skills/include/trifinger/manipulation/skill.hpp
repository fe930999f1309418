// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "trifinger/base/time.hpp"
#include "trifinger/control/grasp_controller.hpp"
#include "trifinger/control/motion.hpp"
#include "trifinger/control/safety_limits.hpp"
#include "trifinger/joint/types.hpp"
#include "trifinger/model/robot_description.hpp"
#include "trifinger/sim/simulation_options.hpp"

namespace trifinger::manipulation {

using control::Motion;
using control::Pose;
using control::Seconds;

/// What a skill knows of the robot that it drives.
struct SkillContext {
  RobotDescription description{};  ///< The robot and its objects, as far as they are known.
  control::SafetyLimits limits{};  ///< Limits of the checks between desired and applied actions.
  Seconds period{1e-3};            ///< Length of a step.
  /// True: the robot goes on while the skill computes. False: it waits for every action.
  bool is_real_time{false};
};

/// What the checks of a robot allow: the limits of its configuration, or those of its variant.
[[nodiscard]] control::SafetyLimits safety_limits_of(const SimulationOptions& options);

/// A pose of the object, and the step at which it was seen.
struct SeenPose {
  TimeIndex step{0};
  Pose pose{};
};

/// What three tips feel of an object that they hold.
struct FeltGrasp {
  Eigen::Vector3d normal_forces{Eigen::Vector3d::Zero()};      ///< [N]
  Eigen::Vector3d tangential_forces{Eigen::Vector3d::Zero()};  ///< [N]
  Eigen::Vector3d travel{Eigen::Vector3d::Zero()};  ///< Travel of the tips along their faces [m].
  bool is_slipping{false};  ///< A tip moves along its face faster than tips roll.
  bool is_exact{false};     ///< The forces make exactly the desired wrench.
};

/// What a skill is doing.
struct SkillState {
  std::string_view phase;    ///< A word, such as "grasp". It lives as long as the program.
  bool has_ended{false};     ///< The skill needs no further step.
  std::string_view failure;  ///< Why it has failed, in words; empty as long as it has not.
  Motion desired{};          ///< Desired motion of the object.
  Motion object{};           ///< Estimated motion of the object.
  double torque_share{0.0};  ///< Largest requested torque, as a share of its limit.
  bool is_visible{true};     ///< False: the object was not seen lately, and is known by touch.
  std::optional<FeltGrasp> grasp{};  ///< Only of a skill that holds an object with three tips.
};

/// One step of a skill, as it is kept.
struct SkillStep {
  TimeIndex step{0};
  std::string_view phase;
  Pose desired{};            ///< Desired pose of the object.
  Pose estimated{};          ///< Estimated pose of the object.
  double torque_share{0.0};  ///< Largest requested torque, as a share of its limit.
  bool is_visible{true};     ///< False: the object is known by touch.
  std::optional<FeltGrasp> grasp{};
  Seconds cycle_time{0};  ///< Time that the skill took to compute the step.
};

/// The record of a skill that was carried out. Steps and poses are in order.
struct SkillTrace {
  Seconds period{1e-3};
  std::vector<SkillStep> steps;
  std::vector<SeenPose> seen;  ///< Measured poses of the object, each only once.
  std::string_view failure;    ///< Empty if the skill has done what it should.
};

/// A number of a report, in SI units.
struct Figure {
  std::string name;  ///< Name in the file of the report, such as "distance".
  double value{0.0};
  std::string unit;     ///< "m", "rad", "s", "N", "1", or empty for a number of things.
  std::string meaning;  ///< A few words for a person: "from the axis to where it lands".
};

/// A file of a report beside the ones that all skills have.
struct ReportFile {
  std::string name;  ///< Name of the file, such as "drawing.svg".
  std::string text;
};

/// A motion with an object that a controller carries out by itself: to lift, to throw, to draw.
///
/// A skill does not use a session. Once per step it gets the measurements of joints and cameras,
/// and returns the action. Poses of the object may be few, noisy and late. `run_skill` connects a
/// skill to any front-end; `make_skill` makes one by its name.
///
/// Memory is allocated only during construction and in `plan`.
class Skill {
 public:
  virtual ~Skill() = default;

  /// Name of the object whose poses it needs; empty if it needs none.
  [[nodiscard]] virtual std::string_view object() const noexcept = 0;
  /// The longest time that it may take. It is stopped then.
  [[nodiscard]] virtual Seconds max_duration() const noexcept = 0;

  /// Says that the object was at `pose` at step `captured`. Called before the `update` of the step
  /// at which the pose arrives, once for each pose, in their order.
  virtual void see(TimeIndex captured, const Pose& pose) noexcept = 0;
  /// The action of the next step, from the measurements of the joints at `step`.
  [[nodiscard]] virtual const TriFinger::Action& update(
      TimeIndex step, const control::JointState& joints) noexcept = 0;
  /// Ends as soon as the object is safe: puts it down, releases it, and fails. May be called again.
  virtual void stop() noexcept = 0;

  /// The state after the last `update` or `begin`.
  [[nodiscard]] virtual const SkillState& state() const noexcept = 0;

  /// True while the skill waits for `plan`, which takes longer than a step.
  [[nodiscard]] virtual bool wants_plan() const noexcept { return false; }
  /// Plans from what was known when `wants_plan` became true. In real time another thread calls it,
  /// and `update` goes on meanwhile. May allocate memory and throw.
  virtual void plan() {}
  /// Continues with what `plan` has made. Called between two steps, in the thread of `update`.
  virtual void begin() noexcept {}

  /// The figures of its report, from the poses that were seen or, in an evaluation, the true ones.
  [[nodiscard]] virtual std::vector<Figure> figures(const SkillTrace& trace,
                                                    std::span<const SeenPose> poses) const = 0;
  /// What else belongs to its report: a picture, a table.
  [[nodiscard]] virtual std::vector<ReportFile> report_files(
      const SkillTrace& /*trace*/, std::span<const SeenPose> /*poses*/) const {
    return {};
  }
};

}  // namespace trifinger::manipulation
