// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <cstddef>
#include <initializer_list>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

/// \file
/// The description of a robot as plain data, without physics and files. `RobotModel` builds it;
/// `export_mjcf` and `export_urdf` write it. If a figure is not measured, its comment says
/// `estimate`.

namespace trifinger {

inline constexpr int kJointsPerFinger = 3;
inline constexpr int kMaxFingers = 3;
inline constexpr int kMaxJoints = kMaxFingers * kJointsPerFinger;

/// One value per joint of a finger, from the base to the tip.
using FingerJoints = std::array<double, kJointsPerFinger>;

/// A point or direction, x y z.
using Triple = std::array<double, 3>;

/// The hardware. The variants share link lengths and drives, and differ in mounting, inertia and
/// limits.
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
  /// Torque that the motor can give for ever [Nm]; estimate, 1.8 A. The paper calls 2.0 A
  /// admissible, but does not say for how long.
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

/// The kind of a surface, as far as friction is concerned. A link is any part of a finger except
/// its tip.
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

/// All pairs, in the order of the enumeration.
[[nodiscard]] const std::array<SurfacePair, kNumSurfacePairs>& all_surface_pairs() noexcept;
/// Name of the pair in configurations, for example "tip_object".
[[nodiscard]] std::string_view name_of(SurfacePair pair) noexcept;
/// Finds a pair by its name. @throws InvalidArgument that names the existing pairs.
[[nodiscard]] SurfacePair surface_pair_from_name(std::string_view name);
/// The pair of two kinds of surfaces, in either order. Table and boundary never meet, so they must
/// not be given together or with themselves.
[[nodiscard]] SurfacePair pair_of(Surface one, Surface other) noexcept;

/// A value for each pair of surfaces. `{{SurfacePair::kTipObject, 0.8}}` sets one pair; the others
/// stay T{}.
template <class T>
class OfSurfacePairs {
 public:
  constexpr OfSurfacePairs() = default;
  constexpr OfSurfacePairs(std::initializer_list<std::pair<SurfacePair, T>> given) {
    for (const auto& [pair, value] : given) (*this)[pair] = value;
  }
  /// Sets one value for all pairs.
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

/// Parameters of contacts. Stiffness and friction are estimates: no source has measured them.
struct ContactParameters {
  double tip_friction{1.0};              ///< Sliding friction of a tip against anything.
  double tip_torsional_friction{0.005};  ///< Friction against twisting at a tip [m].
  double floor_friction{0.5};            ///< Sliding friction of links, table, boundary, objects.
  /// Sliding friction between two kinds of surfaces, instead of the figures above. Values for the
  /// boundary cost simulation speed, because every pair of parts is then listed.
  OfSurfacePairs<std::optional<double>> friction{};
  /// Stiffness: the time that a contact takes to push apart what has met [s]. Values below twice
  /// the time step are not stable.
  double time_constant{0.002};
  double tip_time_constant{0.006};  ///< Time constant of rubber tips [s].
  /// Damping ratio of rubber tips: below 1 they bounce. How much they yield depends on the product
  /// of this and of the time constant.
  double tip_damping_ratio{1.0};
};

/// Sliding friction between two kinds of surfaces: the given value, or the one that follows from
/// the other figures.
[[nodiscard]] double sliding_friction(const ContactParameters& contact, SurfacePair pair) noexcept;

/// Mechanical stops of the joints; estimates. The stops lie beyond the hard limits, so that a joint
/// can cross a hard limit, and tests can check this.
struct StopParameters {
  double margin{0.2};          ///< Distance from a hard limit to the stop [rad].
  double time_constant{0.02};  ///< Stiffness: time in which a stop pushes the joint back [s].
};

enum class ObjectShape {
  kBox,    ///< `size` is x, y, z.
  kStick,  ///< A rod with round ends along x: `size` is length, diameter, (unused).
  kBall,   ///< `size` is diameter, (unused), (unused).
};

/// The colours of a box's faces, by name: +x, +y, +z, -z, -x, -y.
using BoxColours = std::array<std::string, 6>;
/// The colours of the competition's cubes, versions 2 and 3, and of its cuboid: red, green, blue,
/// cyan, magenta, yellow. Boxes can have these six colours, in any order and more than once. They
/// can also have others, as "#rrggbb" in hexadecimal digits; trackers need a colour model with
/// them.
[[nodiscard]] BoxColours competition_colours();

/// A loose object. It has a free joint and a body, both with the object's name.
struct ObjectDescription {
  std::string name;  ///< Letters, digits and '_'.
  ObjectShape shape{ObjectShape::kBox};
  Triple size{};   ///< Whole lengths, not halves [m].
  double mass{0};  ///< [kg], spread evenly over the volume.
  /// Initial position of the centre [m]. Without a value, each of the first four objects has a
  /// default place. There it rests on the table, clear of the fingers' initial pose.
  std::optional<Triple> position{};
  /// Initial orientation: a quaternion w, x, y, z of any length but zero.
  std::array<double, 4> orientation{1.0, 0.0, 0.0, 0.0};
  /// Initial velocity in the world frame: of its centre [m/s], and about its centre [rad/s].
  Triple velocity{};
  Triple angular_velocity{};
  /// Colours of the faces of a box: drawn in pictures, looked for in images. Other shapes have no
  /// faces.
  BoxColours colours{competition_colours()};
};

/// The cube of 65 mm and 94 g with a colour on each face.
[[nodiscard]] ObjectDescription cube(std::string name = "cube");
/// The cuboid of 20 x 80 x 20 mm. Its mass of 16 g comes from a simulation; no source weighed it.
[[nodiscard]] ObjectDescription cuboid(std::string name = "cuboid");
/// A stick like a pen, 140 x 10 mm and 12 g; estimate.
[[nodiscard]] ObjectDescription stick(std::string name = "stick");
/// A ball of 60 mm and 50 g; estimate.
[[nodiscard]] ObjectDescription ball(std::string name = "ball");

/// How wide the dark rim around each coloured face of a drawn box is [m].
[[nodiscard]] double box_rim(const ObjectDescription& box) noexcept;

/// A whole scene. The default is the paper's robot with a cube on the table.
struct RobotDescription {
  Variant variant{Variant::kEdu};
  Arrangement arrangement{Arrangement::kTriFinger};
  /// Height of the joint-0 axes above the table [m], from 0.20 to 0.60; default: the variant's own.
  std::optional<double> finger_height{};
  /// Turns the whole platform upside down, for throwing and catching: the fingers point up.
  ///
  /// Frame, fingers, boundary and cameras turn by half a turn about the y axis and then stand on
  /// their posts. Table and objects stay. All positions stay in the world frame: z up, origin on
  /// the table.
  bool flipped{false};
  /// The wall around the arena.
  bool boundary{true};
  /// True: tips of rubber. False: tips as hard as the time step allows.
  bool soft_tips{true};
  /// The three cameras at their measured poses.
  bool cameras{true};
  /// The motors; default: the variant's own.
  std::optional<ActuatorParameters> actuator{};
  StopParameters stops{};
  ContactParameters contact{};
  std::vector<ObjectDescription> objects{cube()};
};

/// The known figures of one variant in one arrangement: limits, gains and poses, equal for all
/// fingers.
struct VariantFigures {
  std::string_view name;    ///< "edu", "pro", "one", "edu-single", "pro-single", "one-single".
  double finger_height;     ///< Height of the joint-0 axes above the table [m].
  double tip_radius;        ///< Radius of the sphere that touches [m].
  FingerJoints soft_lower;  ///< The position controller keeps targets inside these [rad].
  FingerJoints soft_upper;
  FingerJoints hard_lower;  ///< Outside these limits the robot stops with a fault [rad].
  FingerJoints hard_upper;
  FingerJoints initial_position;  ///< [rad]
  FingerJoints kp;                ///< Default stiffness [Nm/rad].
  FingerJoints kd;                ///< Default damping [Nm s/rad].
  FingerJoints safety_kd;         ///< Damping that the safety layer always adds [Nm s/rad].
  FingerJoints braking;           ///< Deceleration before its soft limits [rad/s^2].
  ActuatorParameters actuator;
};

/// Figures of the real robots. docs/decisions/ explains the choice where sources disagree.
[[nodiscard]] const VariantFigures& variant_figures(
    Variant variant, Arrangement arrangement = Arrangement::kTriFinger) noexcept;

/// Finds "edu", "pro" or "one". @throws InvalidArgument that names the three.
[[nodiscard]] Variant variant_from_name(std::string_view name);

/// A calibrated camera of the platform. The figures were measured on one robot, with images of 540
/// x 540 pixels.
struct CameraFigures {
  std::string_view name;  ///< "camera60", "camera180", "camera300": clockwise from finger 0.
  Triple position;        ///< Position in the upright platform's frame [m].
  /// Columns are the camera's x (right), y (down) and z (forward) axes in the upright platform's
  /// frame. The numbers are stored row by row. The matrix is orthonormal except for rounding.
  std::array<double, 9> rotation;
  double fx, fy;                     ///< Focal lengths [pixel].
  double cx, cy;                     ///< Principal point [pixel].
  std::array<double, 5> distortion;  ///< k1 k2 p1 p2 k3, as OpenCV orders them.
  double vertical_view;              ///< Angle of view, `2 atan(270 / fy)` [rad].
};

inline constexpr int kCameraImageSize = 540;  ///< Width and height [pixel].

/// The three cameras, in the order 60, 180, 300.
[[nodiscard]] const std::array<CameraFigures, 3>& camera_figures();

/// @name Figures that follow from a description
/// @{
[[nodiscard]] const VariantFigures& figures(const RobotDescription& description) noexcept;
[[nodiscard]] int num_fingers(const RobotDescription& description) noexcept;
[[nodiscard]] int num_joints(const RobotDescription& description) noexcept;
[[nodiscard]] double finger_height(const RobotDescription& description) noexcept;
[[nodiscard]] ActuatorParameters actuator(const RobotDescription& description) noexcept;

/// Height above the table of the flipped platform's point that was at the table's height [m].
[[nodiscard]] double flip_height(const RobotDescription& description) noexcept;

/// Joint names in the order f0 j0..j2, f120 j0..j2, f240 j0..j2. This is the order of every joint
/// vector.
[[nodiscard]] std::vector<std::string> joint_names(const RobotDescription& description);

/// Names of the tip frames, one per finger. A tip frame is at the centre of the tip sphere.
[[nodiscard]] std::vector<std::string> tip_names(const RobotDescription& description);

/// @throws InvalidArgument that names the first value that cannot be built, and what is allowed.
void validate(const RobotDescription& description);
/// @}

}  // namespace trifinger
