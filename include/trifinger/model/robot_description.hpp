// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <cstddef>
#include <initializer_list>
#include <limits>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

/// \file
/// What a robot is, as plain data: no physics, no files. `RobotModel` builds it, `export_mjcf` and
/// `export_urdf` write it. Where a figure is not measured, its comment says `estimate`.

namespace trifinger {

inline constexpr int kJointsPerFinger = 3;
inline constexpr int kMaxFingers = 3;
inline constexpr int kMaxJoints = kMaxFingers * kJointsPerFinger;

/// One value per joint of a finger, from the base to the tip.
using FingerJoints = std::array<double, kJointsPerFinger>;

/// A point or direction, x y z.
using Triple = std::array<double, 3>;

/// Which hardware: they share link lengths and drives and differ in mounting, inertia and limits.
enum class Variant {
  kEdu,  ///< The paper's robot, open hardware.
  kPro,  ///< The competition robot, the best measured one.
  kOne,  ///< The early laboratory robot; its joint 1 turns the other way.
};

enum class Arrangement {
  kTriFinger,     ///< Three fingers at 0, -120 and -240 degrees about the vertical axis.
  kSingleFinger,  ///< One finger on a stand.
};

/// The motor and belt drive of one joint. All figures are at the joint unless they say motor.
struct ActuatorParameters {
  /// Largest torque [Nm]: current limit x torque constant x gear. Edu and One 2.0 A, Pro 2.2 A.
  double torque_limit{0.36};
  /// Torque that the motor carries for ever [Nm]; estimate, 1.8 A. The paper calls 2.0 A
  /// admissible, without saying for how long.
  double continuous_torque{0.32};
  /// Time constant of the motor's warming [s]; estimate for a motor of 53 g.
  double thermal_time{30.0};
  /// Motor torque per current [Nm/A]; finger drivers. Another robot's driver says 0.025 for this
  /// motor.
  double torque_constant{0.02};
  /// Motor turns per joint turn; two belt stages of 3:1.
  double gear_ratio{9.0};
  /// Inertia of one motor's rotor [kg m^2]; estimate, from the Solo robot's driver (same motor).
  double rotor_inertia{4.5e-6};
  /// Viscous damping [Nm s/rad]; estimate: a hundredth of the damping that the safety layer adds.
  double damping{1e-3};
  /// Dry friction [Nm]; estimate. Zero by default: no source measured it, and each value above zero
  /// costs simulation speed.
  double friction{0.0};
  /// Speed without load [rad/s]; 416 rpm, the paper's appendix.
  double no_load_speed{43.56};
  /// Torque at standstill without a current limit [Nm]; the actuator module's peak at 12 A.
  double stall_torque{2.5};
};

/// Inertia of the rotor as felt at the joint [kg m^2].
[[nodiscard]] constexpr double reflected_inertia(const ActuatorParameters& actuator) noexcept {
  return actuator.rotor_inertia * actuator.gear_ratio * actuator.gear_ratio;
}

/// The torque [Nm] that the motor delivers when asked for `torque` at joint speed `velocity`
/// [rad/s].
///
/// Driving torque falls on a straight line from `stall_torque` to zero at `no_load_speed`; braking
/// torque does not fall. Both stay within `torque_limit`.
[[nodiscard]] double available_torque(const ActuatorParameters& actuator, double torque,
                                      double velocity) noexcept;

/// What touches, as far as friction is concerned. A link is any part of a finger but its tip.
enum class Surface { kTip, kLink, kObject, kTable, kBoundary };

/// Two kinds of surfaces that can touch each other.
enum class SurfacePair {
  kTipTip,
  kTipLink,
  kTipObject,
  kTipTable,
  kTipBoundary,
  kLinkLink,
  kLinkObject,
  kLinkTable,
  kLinkBoundary,
  kObjectObject,
  kObjectTable,
  kObjectBoundary,
};
inline constexpr std::size_t kNumSurfacePairs = 12;

/// All of them, in the order of the enumeration.
[[nodiscard]] const std::array<SurfacePair, kNumSurfacePairs>& all_surface_pairs() noexcept;
/// As in configurations: "tip_object".
[[nodiscard]] std::string_view name_of(SurfacePair pair) noexcept;
/// Finds "tip_object". @throws InvalidArgument naming those there are.
[[nodiscard]] SurfacePair surface_pair_from_name(std::string_view name);
/// The pair that two kinds of surfaces are, in either order. Not for table and boundary alone,
/// which never meet.
[[nodiscard]] SurfacePair pair_of(Surface one, Surface other) noexcept;

/// A value for each pair of surfaces: `{{SurfacePair::kTipObject, 0.8}}` gives one, the others stay
/// T{}.
template <class T>
class OfSurfacePairs {
 public:
  constexpr OfSurfacePairs() = default;
  constexpr OfSurfacePairs(std::initializer_list<std::pair<SurfacePair, T>> given) {
    for (const auto& [pair, value] : given) (*this)[pair] = value;
  }
  /// The same value for all.
  [[nodiscard]] static constexpr OfSurfacePairs all(const T& value) {
    OfSurfacePairs pairs;
    pairs.values_.fill(value);
    return pairs;
  }

  [[nodiscard]] constexpr T& operator[](SurfacePair pair) noexcept {
    return values_[static_cast<std::size_t>(pair)];
  }
  [[nodiscard]] constexpr const T& operator[](SurfacePair pair) const noexcept {
    return values_[static_cast<std::size_t>(pair)];
  }

  friend bool operator==(const OfSurfacePairs&, const OfSurfacePairs&) = default;

 private:
  std::array<T, kNumSurfacePairs> values_{};
};

/// How bodies touch. Stiffness and friction are estimates: no source has measured them.
struct ContactParameters {
  double tip_friction{1.0};              ///< Sliding friction of a tip against anything.
  double tip_torsional_friction{0.005};  ///< Friction against twisting at a tip [m].
  double floor_friction{0.5};            ///< Sliding friction of links, table, boundary, objects.
  /// Sliding friction between two kinds of surfaces, in place of the figures above. Those that
  /// involve the boundary cost simulation speed: every pair of parts is listed.
  OfSurfacePairs<std::optional<double>> friction{};
  /// Stiffness: how long a contact takes to push apart what has met [s]. Twice the time step is the
  /// least that stays stable.
  double time_constant{0.002};
  double tip_time_constant{0.006};  ///< Of tips of rubber [s].
};

/// Sliding friction between two kinds of surfaces: what is given, or what follows from the rest.
[[nodiscard]] double sliding_friction(const ContactParameters& contact, SurfacePair pair) noexcept;

/// Where the joints meet a mechanical stop; estimates. The stops lie beyond the hard limits so that
/// crossing a hard limit can happen, and be tested.
struct StopParameters {
  double margin{0.2};          ///< From a hard limit to the stop [rad].
  double time_constant{0.02};  ///< Stiffness: how long a stop takes to push the joint back [s].
};

enum class ObjectShape {
  kBox,    ///< `size` is x, y, z.
  kStick,  ///< A rod with round ends along x: `size` is length, diameter, (unused).
  kBall,   ///< `size` is diameter, (unused), (unused).
};

/// A loose object. It has a free joint and a body, both of the object's name.
struct ObjectDescription {
  std::string name;
  ObjectShape shape{ObjectShape::kBox};
  Triple size{};   ///< Whole lengths, not halves [m].
  double mass{0};  ///< [kg], spread evenly over the volume.
  /// Where the centre starts [m]. Without a value the first four objects have places of their own,
  /// at rest on the table and clear of the fingers' initial pose.
  std::optional<Triple> position{};
  /// How it is turned at the start: a quaternion w, x, y, z of any length but zero.
  std::array<double, 4> orientation{1.0, 0.0, 0.0, 0.0};
  /// How it moves at the start, in the world frame: of its centre [m/s], and about it [rad/s].
  Triple velocity{};
  Triple angular_velocity{};
};

/// The cube of 65 mm and 94 g with a colour on each face.
[[nodiscard]] ObjectDescription cube(std::string name = "cube");
/// The cuboid of 20 x 80 x 20 mm. Its mass of 16 g comes from a simulation, no source weighed it.
[[nodiscard]] ObjectDescription cuboid(std::string name = "cuboid");
/// A stick like a pen, 140 x 10 mm and 12 g; estimate.
[[nodiscard]] ObjectDescription stick(std::string name = "stick");
/// A ball of 60 mm and 50 g; estimate.
[[nodiscard]] ObjectDescription ball(std::string name = "ball");

/// A whole scene. The default is the paper's robot with a cube on the table.
struct RobotDescription {
  Variant variant{Variant::kEdu};
  Arrangement arrangement{Arrangement::kTriFinger};
  /// Height of the joint-0 axes above the table [m], from 0.20 to 0.60; default: the variant's own.
  std::optional<double> finger_height{};
  /// Turns the whole platform upside down, for throwing and catching: the fingers point up.
  ///
  /// Frame, fingers, boundary and cameras turn by half a turn about the y axis and then stand on
  /// their posts; table and objects stay. All positions stay in the world frame: z up, origin on
  /// the table.
  bool flipped{false};
  /// The wall around the arena.
  bool boundary{true};
  /// Tips of rubber; otherwise tips as hard as the time step allows.
  bool soft_tips{true};
  /// The three cameras at their measured poses.
  bool cameras{true};
  /// The motors; default: the variant's own.
  std::optional<ActuatorParameters> actuator{};
  StopParameters stops{};
  ContactParameters contact{};
  std::vector<ObjectDescription> objects{cube()};
};

/// What is known about one variant in one arrangement: limits, gains and poses, equal for all
/// fingers.
struct VariantFigures {
  std::string_view name;    ///< "edu", "pro", "one", "edu-single", "pro-single", "one-single".
  double finger_height;     ///< Of the joint-0 axes above the table [m].
  double tip_radius;        ///< Of the sphere that touches [m].
  FingerJoints soft_lower;  ///< The position controller keeps targets inside these [rad].
  FingerJoints soft_upper;
  FingerJoints hard_lower;  ///< Outside of these the robot stops with a fault [rad].
  FingerJoints hard_upper;
  FingerJoints initial_position;  ///< [rad]
  FingerJoints kp;                ///< Default stiffness [Nm/rad].
  FingerJoints kd;                ///< Default damping [Nm s/rad].
  FingerJoints safety_kd;         ///< Damping that the safety layer always adds [Nm s/rad].
  FingerJoints braking;           ///< With which it stops at its soft limits [rad/s^2].
  ActuatorParameters actuator;
};

/// Figures of the real robots. docs/decisions/ says what was chosen where sources disagree.
[[nodiscard]] const VariantFigures& variant_figures(
    Variant variant, Arrangement arrangement = Arrangement::kTriFinger) noexcept;

/// Finds "edu", "pro" or "one". @throws InvalidArgument naming the three.
[[nodiscard]] Variant variant_from_name(std::string_view name);

/// A calibrated camera of the platform: one robot's, measured, images of 540 x 540 pixels.
struct CameraFigures {
  std::string_view name;  ///< "camera60", "camera180", "camera300": clockwise from finger 0.
  Triple position;        ///< In the upright platform's frame [m].
  /// Columns are the camera's x (right), y (down) and z (forward) axes in the upright platform's
  /// frame; row by row. Orthonormal to rounding.
  std::array<double, 9> rotation;
  double fx, fy;                     ///< Focal lengths [pixel].
  double cx, cy;                     ///< Principal point [pixel].
  std::array<double, 5> distortion;  ///< k1 k2 p1 p2 k3, as OpenCV orders them.
  double vertical_view;              ///< Angle of view, `2 atan(270 / fy)` [rad].
};

inline constexpr int kCameraImageSize = 540;  ///< Width and height [pixel].

/// The three cameras, in the order 60, 180, 300.
[[nodiscard]] const std::array<CameraFigures, 3>& camera_figures();

/// @name What a description amounts to
/// @{
[[nodiscard]] const VariantFigures& figures(const RobotDescription& description) noexcept;
[[nodiscard]] int num_fingers(const RobotDescription& description) noexcept;
[[nodiscard]] int num_joints(const RobotDescription& description) noexcept;
[[nodiscard]] double finger_height(const RobotDescription& description) noexcept;
[[nodiscard]] ActuatorParameters actuator(const RobotDescription& description) noexcept;

/// How high above the table the flipped platform carries what was the table's height [m].
[[nodiscard]] double flip_height(const RobotDescription& description) noexcept;

/// Names in the order f0 j0..j2, f120 j0..j2, f240 j0..j2, which is the order of every joint
/// vector.
[[nodiscard]] std::vector<std::string> joint_names(const RobotDescription& description);

/// Names of the tip frames, which are the centres of the tip spheres; one per finger.
[[nodiscard]] std::vector<std::string> tip_names(const RobotDescription& description);

/// @throws InvalidArgument naming the first value that cannot be built, and what is allowed.
void validate(const RobotDescription& description);
/// @}

}  // namespace trifinger
