// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Geometry>
#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "manipulation/parts/closing.hpp"
#include "manipulation/parts/tips_skill.hpp"
#include "trifinger/config/node.hpp"
#include "trifinger/control/impedance.hpp"

namespace trifinger::manipulation {

// How two tips pinch a box and a third one turns it. config/skills/turn.yml explains every key.
struct PinchedHandlingConfig {
  std::string object;
  Seconds look_time;
  Seconds max_duration;
  int attempts;
  double end_tolerance;  // Of the orientation at the end [rad].
  double approach_speed;
  double approach_height;
  double clearance;     // Of tips from faces before they pinch [m].
  double pinch_height;  // Of the pinching tips above the table [m].
  double closing_force;
  double closing_speed;  // By which the tips come nearer to each other [m/s].
  double pinch_force;
  double loose_force;  // While the box settles on the table [N].
  control::TipGains tips;
  double lift_height;  // Of the axis above the table while the box is turned [m].
  Seconds lift_time;
  double arm;  // From the axis to the tip that turns [m].
  double turn_angle;
  Seconds turn_time;
  double turn_stiffness;  // Of the tip that turns [N/m].
  double turn_gain;       // Of the integral of the angle's error [1/s].
  double turn_tolerance;
  bool across_longest;  // True: the box is only pinched across its longest edge.
};
// Reads the keys that all such skills have.
[[nodiscard]] PinchedHandlingConfig read_pinched_handling(const config::Node& root,
                                                          bool across_longest = false);

// Which finger does what.
struct Pinch {
  int left{0};                                        // Pinches along +axis.
  int right{0};                                       // Pinches along -axis.
  int pusher{0};                                      // Turns the box.
  Eigen::Vector3d axis{Eigen::Vector3d::UnitX()};     // From the left to the right tip; horizontal.
  Eigen::Vector3d forward{Eigen::Vector3d::UnitY()};  // To the side of the pusher; horizontal.
  Eigen::Vector3d centre{Eigen::Vector3d::Zero()};    // Between the tips when they pinch [m].
  double width{0.0};                                  // Of the box along the axis [m].
  double length{0.0};                                 // Of the box along `forward` [m].
  double above{0.0};                                  // From `centre` up to the top of the box [m].
};

// The rotation of the box by which the side that points `forward` goes down.
[[nodiscard]] inline Eigen::Quaterniond turn_by(const Pinch& pinch, double angle) noexcept {
  return Eigen::Quaterniond(
      Eigen::AngleAxisd(angle, Eigen::Vector3d::UnitZ().cross(pinch.forward)));
}

// Chooses the fingers for a box that rests at `pose`: two pinch a pair of upright faces, and the
// third one, which is none of `tried`, turns the box. All points of their ways must be within
// reach. Nothing if there is no such choice.
[[nodiscard]] std::optional<Pinch> choose_pinch(const Kinematics& kinematics,
                                                const control::SafetyLimits& limits,
                                                const ObjectDescription& box, const Pose& pose,
                                                const PinchedHandlingConfig& config,
                                                double tip_radius, std::span<const int> tried = {});

enum class PinchPhase : std::uint8_t {
  kLook,
  kPlan,
  kApproach,
  kPinch,
  kLift,
  kReach,
  kTurn,
  kWithdraw,
  kLower,
  kLoosen,
  kRelease,
  kCheck,
  kDone,
  kFailed,
};

// Two tips pinch a box between them and lift it, the third tip turns it about the line between
// them by a quarter of a turn, and they put it down. The skills that do this add what it is for.
//
// The tips that pinch keep their middle and the direction of the line between them with a spring,
// but not their distance: there the force of the pinch acts, from either side the same. What the
// third tip does is known from the joints; poses of the object correct it at the end.
class PinchedHandling : public TipsSkill<PinchedHandling, PinchPhase> {
 public:
  // @throws InvalidArgument if the robot has not three fingers, or no box of this name
  PinchedHandling(const SkillContext& context, PinchedHandlingConfig config);

  [[nodiscard]] std::string_view object() const noexcept override { return config_.object; }
  [[nodiscard]] Seconds max_duration() const noexcept override { return config_.max_duration; }
  void see(TimeIndex captured, const Pose& pose) noexcept override;
  void plan() override;
  void begin() noexcept override;
  [[nodiscard]] std::vector<Figure> figures(const SkillTrace& trace,
                                            std::span<const SeenPose> poses) const override;

 protected:
  // What went wrong if the box is in another orientation at the end.
  [[nodiscard]] virtual std::string_view wrong_end() const noexcept = 0;
  // The angle by which the box is not as it should be [rad].
  [[nodiscard]] virtual double error_of(const Pose& pose, const Pose& goal) const noexcept = 0;
  // Whether another attempt may begin with the box at `now`, if the first one began at `first`.
  [[nodiscard]] virtual bool may_begin_again(const Pose& first, const Pose& now) const noexcept = 0;

 private:
  using S = PinchedHandling;
  using Phase = PinchPhase;
  using enum PinchPhase;
  friend TipsSkill;
  friend Phased;
  static const std::array<Row, 14> kPhases;

  [[nodiscard]] bool holds() const noexcept {
    return phase_ >= Phase::kPinch && phase_ <= Phase::kLoosen;
  }

  // What happens in phases, between them, and when the skill is stopped; see `kPhases`.
  void look(Seconds elapsed) noexcept;
  void begin_pinch() noexcept;
  void pinch(Seconds elapsed) noexcept;
  void begin_lift() noexcept;
  void begin_reach() noexcept;
  void begin_turn() noexcept;
  void turn(Seconds elapsed) noexcept;
  void begin_lower() noexcept;
  void loosen(Seconds elapsed) noexcept;
  void open_fingers() noexcept;
  void release(Seconds elapsed) noexcept;
  void check(Seconds elapsed) noexcept;
  void watch(Seconds elapsed) noexcept;
  void open(std::string_view failure) noexcept;
  void put_down(std::string_view failure) noexcept;
  [[nodiscard]] bool is_pressed() const noexcept { return squeeze_ >= config_.pinch_force; }
  [[nodiscard]] bool is_middle_there() const noexcept { return middle_trajectory_.is_complete(); }
  [[nodiscard]] bool is_pusher_there() const noexcept {
    return trajectories_[static_cast<std::size_t>(pinch_.pusher)].is_complete();
  }
  [[nodiscard]] bool has_loosened() const noexcept { return clock_.in_phase() > Seconds(1.0); }

  void finish_check() noexcept;
  void try_again_or_fail(std::string_view failure) noexcept;
  void withdraw_pusher() noexcept;
  void follow_roll(Seconds elapsed) noexcept;
  void sense_object(const control::JointState& joints, Seconds elapsed) noexcept;
  void press(TipsCommand& command, Seconds elapsed) noexcept;
  [[nodiscard]] Motion desired() const noexcept {
    return {.pose = goal_ && phase_ >= Phase::kTurn ? *goal_ : rest_};
  }
  [[nodiscard]] Eigen::Vector3d contact_at(double angle, double distance) const noexcept;
  [[nodiscard]] double tip_angle() const noexcept;
  [[nodiscard]] double seen_angle(const Pose& pose) const noexcept;
  [[nodiscard]] double gap() const noexcept;
  [[nodiscard]] bool is_pinched() const noexcept;

  PinchedHandlingConfig config_;
  ObjectDescription box_;
  control::SafetyLimits limits_;
  Kinematics planning_;  // Used by `plan` only, perhaps in another thread.

  int attempt_{1};
  Pose rest_;                     // Of the box before it is handled.
  std::optional<Pose> first_;     // The same in the first attempt.
  std::optional<Pinch> planned_;  // What `plan` has found.
  std::vector<int> tried_;        // The pushers of all plans.
  Pinch pinch_;
  std::optional<Pose> goal_;

  Eigen::Vector3d middle_{Eigen::Vector3d::Zero()};  // Of the pinching tips, as measured.
  double distance_{0.0};                             // Of the pinching tips.
  TipTrajectory middle_trajectory_;
  double squeeze_{0.0};  // Force of the pinch [N].
  double carried_{0.0};  // Share of the weight that is carried.
  Closing closing_;
  Seconds numb_{0};
  double turn_from_{0.0};
  double turn_to_{0.0};
  double turn_sum_{0.0};
  double rolled_{0.0};  // Travel of the tip that turns along the face, outward [m].
  int corrections_{0};
  double turned_{0.0};  // Angle of the box about the line between the tips.
};

}  // namespace trifinger::manipulation
