// SPDX-License-Identifier: BSD-3-Clause
#include "trifinger/model/robot_description.hpp"

#include <algorithm>
#include <cctype>
#include <cmath>
#include <set>

#include "base/suggestion.hpp"
#include "base/text_of.hpp"
#include "face_colours.hpp"
#include "file_objects.hpp"
#include "trifinger/base/error.hpp"

namespace trifinger {
namespace {

// The posts of the frame are 600 mm profiles. If the robot is flipped, the platform stands on them.
constexpr double kPostLength = 0.6;
// Distance between the joint-0 axes and the ground if the robot is flipped. The middle links then
// never touch the ground.
constexpr double kFlippedClearance = 0.2;
constexpr double kLowestFingers = 0.2;
constexpr double kHighestFingers = 0.6;
// Faster objects pass through a wall of 10 mm between two steps [m/s], [rad/s].
constexpr double kMaxObjectSpeed = 10;
constexpr double kMaxObjectSpin = 100;

constexpr ActuatorParameters kTwoAmpere{.torque_limit = 0.36};
// The motor needs 0.37 Nm to hold its middle link level, so heat does not reduce its torque.
constexpr ActuatorParameters kTwoPointTwoAmpere{.torque_limit = 0.396, .continuous_torque = 0.396};

constexpr FingerJoints kUsualSafetyDamping{0.09, 0.09, 0.05};

constexpr VariantFigures kEduTri{
    .name = "edu",
    .finger_height = 0.283,
    .tip_radius = 0.0095,
    .soft_lower = {-1.6, -1.2, -3.0},
    .soft_upper = {1.0, 1.6, 3.0},
    .hard_lower = {-2.0, -1.4, -3.2},
    .hard_upper = {1.6, 1.8, 3.2},
    .initial_position = {0, 0.9, -1.7},
    .kp = {7, 7, 6.5},
    .kd = {0.01, 0.015, 0.02},
    .safety_kd = kUsualSafetyDamping,
    .braking = {10, 10, 10},
    .actuator = kTwoAmpere,
};

constexpr VariantFigures kProTri{
    .name = "pro",
    .finger_height = 0.29,
    .tip_radius = 0.010,
    .soft_lower = {-0.33, 0, -2.7},
    .soft_upper = {1.0, 1.57, 0},
    .hard_lower = {-1.0, -1.67, -2.8},
    .hard_upper = {1.5, 1.67, 2.8},
    .initial_position = {0, 0.9, -1.7},
    .kp = {9, 9, 9},
    .kd = {0.01, 0.01, 0.01},
    .safety_kd = kUsualSafetyDamping,
    .braking = {5, 5, 5},
    .actuator = kTwoPointTwoAmpere,
};

constexpr VariantFigures kOneTri{
    .name = "one",
    .finger_height = 0.29,
    .tip_radius = 0.010,
    // The source sets none; ours lie 0.1 rad inside the hard limits.
    .soft_lower = {-1.7, -1.3, -3.0},
    .soft_upper = {1.7, 4.4, 3.0},
    .hard_lower = {-1.8, -1.4, -3.1},
    .hard_upper = {1.8, 4.5, 3.1},
    .initial_position = {0, -0.9, -1.7},
    .kp = {6, 6, 6},
    .kd = {0.03, 0.03, 0.03},
    .safety_kd = kUsualSafetyDamping,
    .braking = {10, 10, 10},
    .actuator = kTwoAmpere,
};

constexpr VariantFigures single(VariantFigures figures, std::string_view name) {
  figures.name = name;
  return figures;
}

constexpr VariantFigures kEduSingle = single(kEduTri, "edu-single");
constexpr VariantFigures kProSingle = single(kProTri, "pro-single");
constexpr VariantFigures kOneSingle{
    .name = "one-single",
    .finger_height = 0.34,
    .tip_radius = 0.013,
    .soft_lower = {-1.6, -1.4, -3.1},
    .soft_upper = {1.6, 4.5, 3.1},
    .hard_lower = {-1.8, -1.6, -3.3},
    .hard_upper = {1.8, 4.7, 3.3},
    .initial_position = {0, 0, 0},
    .kp = {6, 6, 6},
    .kd = {0.03, 0.03, 0.03},
    .safety_kd = {0.08, 0.08, 0.04},
    .braking = {10, 10, 10},
    .actuator = kTwoAmpere,
};

template <typename... Parts>
[[noreturn]] void reject(const Parts&... parts) {
  throw InvalidArgument(detail::text_of(parts...));
}

void require_in(std::string_view what, double value, double lowest, double highest) {
  const bool allowed = value >= lowest && value <= highest;  // false for NaN
  if (!allowed) reject(what, " is ", value, "; allowed is ", lowest, " to ", highest, ".");
}

constexpr std::array<SurfacePair, kNumSurfacePairs> kSurfacePairs{
    SurfacePair::kTipTip,       SurfacePair::kTipLink,     SurfacePair::kTipObject,
    SurfacePair::kTipTable,     SurfacePair::kTipBoundary, SurfacePair::kLinkLink,
    SurfacePair::kLinkObject,   SurfacePair::kLinkTable,   SurfacePair::kLinkBoundary,
    SurfacePair::kObjectObject, SurfacePair::kObjectTable, SurfacePair::kObjectBoundary,
};

constexpr std::array<std::string_view, kNumSurfacePairs> kSurfacePairNames{
    "tip_tip",       "tip_link",      "tip_object",   "tip_table",
    "tip_boundary",  "link_link",     "link_object",  "link_table",
    "link_boundary", "object_object", "object_table", "object_boundary",
};

void validate_contact(const ContactParameters& contact) {
  constexpr double kLeast = 1e-3;
  constexpr double kMost = 10;
  require_in("contact.tip_friction", contact.tip_friction, kLeast, kMost);
  require_in("contact.tip_torsional_friction [m]", contact.tip_torsional_friction, 0, 1);
  require_in("contact.floor_friction", contact.floor_friction, kLeast, kMost);
  for (const SurfacePair pair : kSurfacePairs)
    if (const auto friction = contact.friction[pair])
      require_in("contact.friction." + std::string(name_of(pair)), *friction, kLeast, kMost);
  require_in("contact.time_constant [s]", contact.time_constant, 0.002, 1);
  require_in("contact.tip_time_constant [s]", contact.tip_time_constant, 0.002, 1);
  require_in("contact.tip_damping_ratio", contact.tip_damping_ratio, 0.1, 10);
}

void validate_actuator(const ActuatorParameters& actuator) {
  require_in("actuator.torque_limit [Nm]", actuator.torque_limit, 1e-3, 10);
  require_in("actuator.continuous_torque [Nm]", actuator.continuous_torque, 1e-3, 10);
  require_in("actuator.thermal_time [s]", actuator.thermal_time, 1e-3, 1e6);
  require_in("actuator.torque_constant [Nm/A]", actuator.torque_constant, 1e-6, 10);
  require_in("actuator.gear_ratio", actuator.gear_ratio, 1e-3, 1e4);
  require_in("actuator.rotor_inertia [kg m^2]", actuator.rotor_inertia, 0, 1);
  require_in("actuator.damping [Nm s/rad]", actuator.damping, 0, 10);
  require_in("actuator.friction [Nm]", actuator.friction, 0, 10);
  require_in("actuator.no_load_speed [rad/s]", actuator.no_load_speed, 1e-3, 1e4);
  require_in("actuator.stall_torque [Nm]", actuator.stall_torque, 1e-3, 1e3);
}

int num_lengths(ObjectShape shape) {
  switch (shape) {
    case ObjectShape::kBox:
      return 3;
    case ObjectShape::kStick:
      return 2;
    case ObjectShape::kBall:
      break;
  }
  return 1;
}

}  // namespace

void detail::validate_object(const ObjectDescription& object) {
  // Names become those of bodies in files and of fields in sessions.
  const bool is_name = !object.name.empty() && std::ranges::all_of(object.name, [](char letter) {
    return std::isalnum(static_cast<unsigned char>(letter)) != 0 || letter == '_';
  });
  if (!is_name)
    reject("An object cannot be called '", object.name, "': names are letters, digits and '_'.");
  const std::string name = "object '" + object.name + "': ";
  for (int i = 0; i < num_lengths(object.shape); ++i)
    require_in(name + "size [m]", object.size[static_cast<std::size_t>(i)], 0.001, 1);
  if (object.shape == ObjectShape::kStick && object.size[0] <= object.size[1])
    reject(name, "a stick of length ", object.size[0], " m must be longer than its diameter of ",
           object.size[1], " m.");
  require_in(name + "mass [kg]", object.mass, 1e-4, 100);
  if (object.position)
    for (const double coordinate : *object.position)
      require_in(name + "position [m]", coordinate, -10, 10);
  for (const double speed : object.velocity)
    require_in(name + "velocity [m/s]", speed, -kMaxObjectSpeed, kMaxObjectSpeed);
  for (const double speed : object.angular_velocity)
    require_in(name + "angular_velocity [rad/s]", speed, -kMaxObjectSpin, kMaxObjectSpin);
  double norm = 0;
  for (const double number : object.orientation) {
    require_in(name + "orientation", number, -1e3, 1e3);
    norm = std::hypot(norm, number);
  }
  if (norm < 1e-3) reject(name, "its orientation is zero; a quaternion w x y z is needed.");
  for (const std::string& colour : object.colours) {
    if (!detail::rgb_of(colour)) {
      reject(name, "its faces cannot be '", colour,
             "', only red, green, blue, cyan, magenta, yellow, or a colour like #0a7dcf.");
    }
  }
}

BoxColours competition_colours() {
  BoxColours colours;
  std::ranges::transform(detail::kFaceColours, colours.begin(),
                         [](const detail::FaceColour& colour) { return colour.name; });
  return colours;
}

const std::array<SurfacePair, kNumSurfacePairs>& all_surface_pairs() noexcept {
  return kSurfacePairs;
}

std::string_view name_of(SurfacePair pair) noexcept {
  return kSurfacePairNames[static_cast<std::size_t>(pair)];
}

SurfacePair surface_pair_from_name(std::string_view name) {
  for (const SurfacePair pair : kSurfacePairs)
    if (name_of(pair) == name) return pair;
  reject("There is no pair of surfaces '", name, "'; there are ",
         quoted_list({kSurfacePairNames.begin(), kSurfacePairNames.end()}, "and"), ".");
}

SurfacePair pair_of(Surface one, Surface other) noexcept {
  const auto [first, second] = std::minmax(one, other);
  constexpr std::array<std::size_t, 3> kFirstOf{
      static_cast<std::size_t>(SurfacePair::kTipTip),
      static_cast<std::size_t>(SurfacePair::kLinkLink),
      static_cast<std::size_t>(SurfacePair::kObjectObject)};
  const auto row = static_cast<std::size_t>(first);
  return kSurfacePairs[kFirstOf[row] + static_cast<std::size_t>(second) - row];
}

double sliding_friction(const ContactParameters& contact, SurfacePair pair) noexcept {
  const double usual =
      pair <= SurfacePair::kTipBoundary ? contact.tip_friction : contact.floor_friction;
  return contact.friction[pair].value_or(usual);
}

double available_torque(const ActuatorParameters& actuator, double torque,
                        double velocity) noexcept {
  const double limit = actuator.torque_limit;
  const double clipped = std::clamp(torque, -limit, limit);
  if (clipped * velocity <= 0) return clipped;
  const double driving =
      std::max(0.0, actuator.stall_torque * (1 - std::abs(velocity) / actuator.no_load_speed));
  return std::clamp(clipped, -driving, driving);
}

ObjectDescription cube(std::string name) {
  return {.name = std::move(name),
          .shape = ObjectShape::kBox,
          .size = {0.065, 0.065, 0.065},
          .mass = 0.094};
}

ObjectDescription cuboid(std::string name) {
  return {.name = std::move(name),
          .shape = ObjectShape::kBox,
          .size = {0.02, 0.08, 0.02},
          .mass = 0.016};
}

ObjectDescription stick(std::string name) {
  return {.name = std::move(name),
          .shape = ObjectShape::kStick,
          .size = {0.14, 0.01, 0},
          .mass = 0.012};
}

ObjectDescription ball(std::string name) {
  return {.name = std::move(name), .shape = ObjectShape::kBall, .size = {0.06, 0, 0}, .mass = 0.05};
}

double box_rim(const ObjectDescription& box) noexcept { return 0.06 * box.size[0]; }

const VariantFigures& variant_figures(Variant variant, Arrangement arrangement) noexcept {
  const bool single_finger = arrangement == Arrangement::kSingleFinger;
  switch (variant) {
    case Variant::kPro:
      return single_finger ? kProSingle : kProTri;
    case Variant::kOne:
      return single_finger ? kOneSingle : kOneTri;
    case Variant::kEdu:
      break;
  }
  return single_finger ? kEduSingle : kEduTri;
}

Variant variant_from_name(std::string_view name) {
  for (const Variant variant : {Variant::kEdu, Variant::kPro, Variant::kOne})
    if (variant_figures(variant).name == name) return variant;
  reject("There is no robot variant '", name, "'; known are edu, pro and one.");
}

const VariantFigures& figures(const RobotDescription& description) noexcept {
  return variant_figures(description.variant, description.arrangement);
}

int num_fingers(const RobotDescription& description) noexcept {
  return description.arrangement == Arrangement::kTriFinger ? 3 : 1;
}

int num_joints(const RobotDescription& description) noexcept {
  return num_fingers(description) * kJointsPerFinger;
}

double finger_height(const RobotDescription& description) noexcept {
  return description.finger_height.value_or(figures(description).finger_height);
}

ActuatorParameters actuator(const RobotDescription& description) noexcept {
  return description.actuator.value_or(figures(description).actuator);
}

double flip_height(const RobotDescription& description) noexcept {
  return std::max(kPostLength, finger_height(description) + kFlippedClearance);
}

namespace {

std::vector<std::string> with_finger_suffix(const RobotDescription& description,
                                            std::initializer_list<const char*> names) {
  std::vector<std::string> all;
  for (const char* suffix : {"_0", "_120", "_240"}) {
    const bool single_finger = description.arrangement == Arrangement::kSingleFinger;
    for (const char* name : names) all.push_back(single_finger ? name : std::string(name) + suffix);
    if (single_finger) break;
  }
  return all;
}

}  // namespace

std::vector<std::string> joint_names(const RobotDescription& description) {
  return with_finger_suffix(description,
                            {"finger_base_to_upper_joint", "finger_upper_to_middle_joint",
                             "finger_middle_to_lower_joint"});
}

std::vector<std::string> tip_names(const RobotDescription& description) {
  return with_finger_suffix(description, {"finger_tip_link"});
}

void validate(const RobotDescription& description) {
  require_in("finger_height [m]", finger_height(description), kLowestFingers, kHighestFingers);
  validate_actuator(actuator(description));
  require_in("stops.margin [rad]", description.stops.margin, 0, 3);
  require_in("stops.time_constant [s]", description.stops.time_constant, 0.002, 1);
  validate_contact(description.contact);

  std::set<std::string> names;
  std::size_t without_position = 0;
  for (const ObjectDescription& object : description.objects) {
    if (!names.insert(object.name).second)
      reject("Two objects are called '", object.name, "'; names must differ.");
    // Bodies of the robot use these names.
    if (object.name == "world" || object.name == "platform" || object.name == "table" ||
        object.name.starts_with("finger_"))
      reject("An object cannot be called '", object.name,
             "': 'world', 'platform', 'table' and names that begin with 'finger_' are taken.");
    detail::validate_object(object);
    if (!object.position && ++without_position > 4)
      reject("object '", object.name,
             "' needs a position: only the first four objects have places of their own.");
  }
}

}  // namespace trifinger
