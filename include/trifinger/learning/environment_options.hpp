// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "trifinger/base/time.hpp"
#include "trifinger/model/robot_description.hpp"
#include "trifinger/sim/condition.hpp"

namespace trifinger::learning {

/// How actions and observations follow each other; see docs/learning.md.
enum class Mapping : std::uint8_t { kStateAugmentation, kApproximation };

/// The meaning of the numbers of an action, each from -1 to 1.
enum class ActionKind : std::uint8_t {
  kPosition,          ///< Joint positions, from `position_low` to `position_high` of `Environment`.
  kPositionChange,    ///< Changes of these, times `EnvironmentOptions::position_change`.
  kRelativePosition,  ///< Distances from the last measured positions, times the same.
  kTorque,            ///< Torques, times the largest torque.
};

/// The layout of an observation.
enum class Layout : std::uint8_t {
  kFlat,        ///< One vector; each number is scaled to -1 to 1.
  kDictionary,  ///< Its entries, in SI units.
  kGoal,        ///< The vector without its goal; achieved and desired values apart, in SI units.
  kImages,      ///< The entries without poses of objects, and what cameras see.
};

/// How the robot of an environment knows where its objects are.
enum class ObjectPoses : std::uint8_t {
  kExact,    ///< A simulation says it, with the delay, noise and losses of the options.
  kTracked,  ///< A tracker finds them in images of the cameras.
};

/// A range of values that are all equally probable.
template <class T>
struct Range {
  T low{};
  T high{};

  friend bool operator==(const Range&, const Range&) = default;
};

/// The options of a decision process. `default_options` gives the defaults of a task.
struct EnvironmentOptions {
  int steps_per_action{20};  ///< Number of robot steps in which one action acts.
  Mapping mapping{Mapping::kApproximation};
  ActionKind action{ActionKind::kPosition};
  double position_change{0.1};  ///< Largest change, or distance from the measured position [rad].
  /// Largest distance of a desired position that changes from the measured one [rad].
  double leash{0.12};
  /// Stiffness with which joints go to desired positions [Nm/rad]; 0: that of the robot.
  double position_kp{0.0};
  Layout layout{Layout::kFlat};
  double duration{2.0};  ///< Duration of an episode [s].
  /// Gives observations finger by finger and goals in the frame of their finger, so that the
  /// fingers cannot be distinguished. For tasks with a goal for each finger.
  bool per_finger{false};
  /// Shows positions turned about the middle by thirds of a circle, and fingers in another order,
  /// so that the goal of an object is on the side of finger 0. Actions are for fingers in this
  /// order.
  bool symmetric_view{false};
  /// Shows how a cube lies without the colours of its faces, in place of its orientation.
  bool symmetric_object{false};
  bool object_offsets{
      false};             ///< Shows how far tips are from the object, and the object from its goal.
  bool keypoints{false};  ///< Shows the corners of object and goal in place of their orientation.
  /// Sites, bodies or geoms of a robot from a file, which take the place of tips: tasks such as
  /// reach have a goal for each. Up to `kMaxFrames`.
  std::vector<std::string> frames{};
  double position_noise{0.0};  ///< Standard deviation of measured joint positions [rad].
  double velocity_noise{0.0};  ///< Standard deviation of measured velocities [rad/s].
  ObjectPoses object_poses{ObjectPoses::kExact};
  double object_period{0.01};  ///< Time between two poses of a simulated object [s].
  double object_delay{0.0};    ///< Time from a pose of a simulated object to its arrival [s].
  double object_position_noise{0.0};     ///< Standard deviation of its poses, per axis [m].
  double object_orientation_noise{0.0};  ///< Standard deviation of its rotation, per axis [rad].
  double object_loss{0.0};               ///< Probability that one of its poses never arrives.
  double camera_rate{30.0};              ///< Images of each simulated camera per second [Hz].
  double camera_delay{0.02};             ///< Time from a simulated image to its arrival [s].
  /// Light, colours, dust and noise of simulated images differ in each episode.
  bool camera_varies{false};
  int camera_size{540};  ///< Width and height of simulated images [pixel].
  /// The state in which a simulated robot is; each episode has another one in this state.
  Condition condition{Condition::kAsDocumented};
  /// A simulation draws these values at the beginning of each episode; see `Variation`. A range
  /// that is not the default takes the place of what the condition says.
  Range<double> object_mass{1.0, 1.0};
  Range<double> friction{1.0, 1.0};
  Range<double> motor_gain{1.0, 1.0};
  Range<TimeIndex> torque_delay{0, 0};
  OfSurfacePairs<std::optional<Range<double>>> pair_friction{};
  Range<double> contact_time{1.0, 1.0};
  Range<double> rotor_inertia{1.0, 1.0};
  Range<double> joint_damping{1.0, 1.0};
  Range<double> joint_friction{0.0, 0.0};  ///< [Nm]
  Range<double> stop_margin{1.0, 1.0};
  Range<double> homing_error{0.0, 0.0};  ///< [rad], [m]
  Range<double> motor_spread{0.0, 0.0};
  Range<double> torque_ripple{0.0, 0.0};
  Range<double> backlash{0.0, 0.0};  ///< [rad], [m]
  Range<TimeIndex> measurement_delay{0, 0};
  Range<double> motor_heat{0.0, 0.0};
  Range<double> tip_radius{1.0, 1.0};
  /// Speed at which a simulated object slides at the beginning of an episode, in any direction
  /// [m/s].
  Range<double> object_speed{0.0, 0.0};

  /// @throws InvalidArgument that names the option, the value found and the values allowed
  void validate() const;
  /// True if a simulation needs cameras.
  [[nodiscard]] bool needs_cameras() const noexcept {
    return layout == Layout::kImages || object_poses == ObjectPoses::kTracked;
  }
  /// True if episodes differ in more than starts and goals.
  [[nodiscard]] bool varies() const;
};

/// Describes one option, for the classes of other languages.
struct OptionDescription {
  std::string name;
  std::string type;     ///< In the words of Python, for example "tuple[float, float]".
  std::string value;    ///< The default as JSON.
  std::string meaning;  ///< One or two sentences.
};
/// All options, in the order in which `write_options` writes them.
[[nodiscard]] std::vector<OptionDescription> describe_options();

/// Names of all tasks, for example "reach".
[[nodiscard]] std::vector<std::string> task_names();
/// @throws InvalidArgument that names the existing tasks
[[nodiscard]] EnvironmentOptions default_options(std::string_view task);

/// The options as a JSON object. Keys are the names above; enumerators are words, ranges are lists.
[[nodiscard]] std::string write_options(const EnvironmentOptions& options);
/// Reads the text of `write_options`. Missing options keep the value of `EnvironmentOptions{}`.
/// @throws InvalidArgument that names what is unknown or of another type
[[nodiscard]] EnvironmentOptions read_options(std::string_view json);

}  // namespace trifinger::learning
