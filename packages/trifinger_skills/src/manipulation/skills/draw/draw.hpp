// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string_view>
#include <utility>
#include <vector>

#include "manipulation/parts/closing.hpp"
#include "manipulation/parts/object_of.hpp"
#include "manipulation/parts/tips_skill.hpp"
#include "manipulation/skills/draw/draw_config.hpp"
#include "manipulation/skills/draw/line_part.hpp"
#include "manipulation/skills/draw/pen_grip.hpp"
#include "trifinger/control/force_optimizer.hpp"

namespace trifinger::manipulation {

enum class DrawPhase : std::uint8_t {
  kLook,
  kPlan,
  kApproach,
  kClose,
  kGrip,
  kLift,
  kCarry,
  kHop,
  kLand,
  kDraw,
  kReturn,
  kLower,
  kRelease,
  kCheck,
  kDone,
  kFailed,
};

// Takes a pen from its holder, draws with it, and puts it back.
//
// The pen is led at its nib: where the nib and the pen's direction should be follows from the
// drawing, and the tips follow with the pen. Only their distance is not kept: there the force of
// the grip acts. What poses show of the nib and the direction is made up for slowly.
// `draw.cpp` says what happens in its phases, `draw_tips.cpp` what its tips do.
class Draw final : public TipsSkill<Draw, DrawPhase> {
 public:
  Draw(const SkillContext& context, DrawConfig config)
      : TipsSkill(context),
        config_(std::move(config)),
        pen_(object_of(context.description, config_.object, ObjectShape::kStick)),
        limits_(context.limits),
        planning_(context.description),
        pen_radius_(pen_.size[1] / 2),
        reach_(pen_.size[0] / 2 - pen_radius_),
        radii_(pen_radius_ + servo_.tip_radius()),
        closing_(config_.closing_speed, config_.closing_force, config_.tips) {
    for (const PenStroke& stroke : config_.wanted.lines)
      strokes_.push_back(parts_of(stroke, config_.line_speed, config_.ramp));
  }

  [[nodiscard]] std::string_view object() const noexcept override { return config_.object; }
  [[nodiscard]] Seconds max_duration() const noexcept override { return config_.max_duration; }
  void see(TimeIndex captured, const Pose& pose) noexcept override;
  void plan() override;
  void begin() noexcept override;
  [[nodiscard]] std::vector<Figure> figures(const SkillTrace& trace,
                                            std::span<const SeenPose> poses) const override;
  [[nodiscard]] std::vector<ReportFile> report_files(
      const SkillTrace& trace, std::span<const SeenPose> poses) const override;

 private:
  using Phase = DrawPhase;
  using enum DrawPhase;
  friend TipsSkill;
  friend Phased;
  static const std::array<Row, 16> kPhases;

  // The tips press on the pen.
  [[nodiscard]] bool grips() const noexcept {
    return phase_ >= Phase::kClose && phase_ <= Phase::kLower;
  }
  // The pen follows the tips.
  [[nodiscard]] bool leads() const noexcept {
    return phase_ >= Phase::kLift && phase_ <= Phase::kLower;
  }
  [[nodiscard]] PenAxis axis_of(const Pose& pose) const noexcept {
    const Eigen::Vector3d along = pose.orientation * Eigen::Vector3d::UnitX();
    return {.nib = pose.position + reach_ * along, .up = -along};
  }
  [[nodiscard]] double travel_height() const noexcept {
    return config_.holder_height + config_.carry_clearance + pen_radius_;
  }
  [[nodiscard]] Eigen::Vector3d on_paper(const Eigen::Vector2d& point,
                                         double height) const noexcept {
    return {point.x(), point.y(), pen_radius_ + height};
  }
  [[nodiscard]] Eigen::Vector3d above_holder(double height) const noexcept {
    return {hole_.x(), hole_.y(), height};
  }

  // What happens in phases, between them, and when the skill is stopped; see `kPhases`.
  void look(Seconds elapsed) noexcept;
  void begin_closing() noexcept;
  void close(Seconds elapsed) noexcept;
  void grip(Seconds elapsed) noexcept;
  void hold() noexcept;
  void begin_carrying() noexcept;
  void begin_stroke() noexcept;
  void hover(Seconds elapsed) noexcept;
  [[nodiscard]] bool is_over_line() const noexcept;
  void land() noexcept;
  void draw(Seconds elapsed) noexcept;
  void begin_lowering() noexcept;
  void take_tips_off() noexcept;
  void release(Seconds elapsed) noexcept;
  void check(Seconds elapsed) noexcept;
  void watch(Seconds elapsed) noexcept;
  void open(std::string_view failure) noexcept;
  void put_back(std::string_view failure) noexcept;
  [[nodiscard]] bool has_closed() const noexcept;
  [[nodiscard]] bool has_gripped() const noexcept {
    return squeeze_ >= config_.grip.force && clock_.in_phase() >= config_.look_time + Seconds(0.05);
  }
  [[nodiscard]] bool is_nib_there() const noexcept { return nib_trajectory_.is_complete(); }
  // What the pen has turned in the holder is made up for before it draws.
  [[nodiscard]] bool is_upright_there() const noexcept {
    return is_nib_there() && clock_.in_phase() > Seconds(2.0);
  }

  void finish_check() noexcept;
  void finish_part() noexcept;
  void lead(Seconds elapsed) noexcept;
  void press(TipsCommand& command, Seconds elapsed) noexcept;
  void follow_trajectories(TipsCommand& command, Seconds elapsed) noexcept;
  [[nodiscard]] std::array<control::PointMotion, 3> motions_with_pen(Seconds elapsed) noexcept;
  void let_roll(const std::array<Eigen::Vector3d, 3>& errors, Seconds elapsed) noexcept;
  void add_grip(TipVectors& forces) noexcept;
  void correct(TimeIndex captured, const PenAxis& seen) noexcept;
  void sense_object(const control::JointState& joints, Seconds /*elapsed*/) noexcept {
    if (leads()) feel(joints.position - last_joints_);
    last_joints_ = joints.position;
    last_tips_ = tips();
  }
  void feel(const JointValues& moved) noexcept;
  void make_up(Seconds elapsed) noexcept;
  [[nodiscard]] Motion desired() const noexcept;
  [[nodiscard]] std::size_t finger(std::size_t k) const noexcept {
    return static_cast<std::size_t>(grip_.fingers[k]);
  }
  // Distance of the first tip from the middle of the others, across the pen.
  [[nodiscard]] double gap(const std::array<Eigen::Vector3d, 3>& of) const noexcept {
    return ((of[1] + of[2]) / 2 - of[0]).dot(inward_);
  }
  [[nodiscard]] std::array<Eigen::Vector3d, 3> tips() const noexcept {
    return {servo_.tip(grip_.fingers[0]), servo_.tip(grip_.fingers[1]),
            servo_.tip(grip_.fingers[2])};
  }
  [[nodiscard]] std::array<Eigen::Vector3d, 3> velocities() const noexcept {
    return {servo_.velocity(grip_.fingers[0]), servo_.velocity(grip_.fingers[1]),
            servo_.velocity(grip_.fingers[2])};
  }
  // The turn of the pen from upright that the tips ask for.
  [[nodiscard]] Eigen::Quaterniond corrected_turn() const noexcept {
    return control::rotation_from_vector(correction_) * turn_;
  }
  // From a tip to the axis of the pen, as it is felt.
  [[nodiscard]] Eigen::Vector3d normal_at(std::size_t k) const noexcept {
    Eigen::Vector3d expected = k == 0 ? inward_ : Eigen::Vector3d(-inward_);
    if (!leads()) return expected;
    const Eigen::Vector3d from = felt_.nib - servo_.tip(grip_.fingers[k]);
    const Eigen::Vector3d across = (from - from.dot(felt_.up) * felt_.up).normalized();
    constexpr double kMinCosine = 0.5;  // Below it the tip is no longer at its side.
    return across.dot(expected) > kMinCosine ? across : expected;
  }
  [[nodiscard]] Drawing smoothed(std::span<const SeenPose> poses) const;

  DrawConfig config_;
  ObjectDescription pen_;
  control::SafetyLimits limits_;
  Kinematics planning_;  // Used by `plan` only, perhaps in another thread.
  control::ForceOptimizer optimizer_;
  double pen_radius_;
  double reach_;  // From the centre of the pen to that of its nib.
  double radii_;  // The radii of the pen and a tip together.
  std::vector<std::vector<LinePart>> strokes_;

  Pose rest_;  // Where the pen is before it is gripped.
  Seconds looked_{0};
  Eigen::Vector2d hole_{0, 0};  // Middle of the holder.
  std::array<Eigen::Vector3d, 3> tips_at_plan_;
  std::optional<PenGrip> planned_;
  PenGrip grip_;
  Eigen::Vector3d inward_{
      Eigen::Vector3d::UnitX()};          // The direction of the grip as the pen is led.
  std::array<Eigen::Vector3d, 3> touch_;  // Where the tips should touch the resting pen.

  // From here on in the order of the grip.
  std::array<Eigen::Vector3d, 3> arms_;  // From the nib to the tips, of the upright pen.
  Eigen::Vector3d tilt_{
      Eigen::Vector3d::Zero()};  // How the pen is turned from upright when it is lifted.
  Eigen::Quaterniond upright_{Eigen::Quaterniond::Identity()};  // Orientation of the upright stick.
  TipTrajectory nib_trajectory_;
  control::PointMotion nib_;  // Where the nib should be.
  Eigen::Quaterniond turn_{
      Eigen::Quaterniond::Identity()};              // How the pen should be turned from upright.
  Eigen::Vector3d shift_{Eigen::Vector3d::Zero()};  // Makes up for errors of the nib.
  Eigen::Vector3d correction_{Eigen::Vector3d::Zero()};  // Makes up for errors of the direction.
  double squeeze_{0.0};                                  // [N]
  double press_{0.0};        // The nib presses on the paper with it [N].
  double extra_press_{0.0};  // Part of it that a floating nib needs [N].
  // How far the tips have turned about the direction of the grip since they took the pen [rad].
  double twist_{0.0};
  Closing closing_;
  Seconds numb_{0};
  Seconds hovers_{0};  // Over the beginning of a line,
  Seconds over_{0};    // and of this the nib has been near to it.
  Seconds landed_{0};  // Time since the nib has come down to begin a line.
  bool is_lost_{false};
  std::size_t stroke_{0};
  std::size_t part_{0};
  TimeIndex last_seen_{-1};

  JointValues last_joints_{JointValues::Zero(kMaxJoints)};
  std::array<Eigen::Vector3d, 3> last_tips_;
  PenAxis felt_;  // Where the pen is: from how the tips move, corrected by poses.
  std::array<PenAxis, 128> history_;  // Where it was in recent steps, for late poses.
};

}  // namespace trifinger::manipulation
