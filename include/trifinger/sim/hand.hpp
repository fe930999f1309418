// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "trifinger/base/time.hpp"
#include "trifinger/core/driver.hpp"
#include "trifinger/model/scene_model.hpp"

// A hand that pulls at a tip or at an object of a simulated robot: the mouse of a user, or a script
// that teaches. docs/simulation.md says how it feels.
namespace trifinger {

/// The hand pulls at most this hard [N].
inline constexpr double kMaxPullForce = 20.0;
/// The spring of the hand is at most this stiff [N/m].
inline constexpr double kMaxPullStiffness = 5000.0;
/// The hand draws a free body at most this fast [m/s]. Objects faster than 10 m/s would fly through
/// the wall.
inline constexpr double kMaxPullSpeed = 2.0;

/// A pull at a body: a damped spring from a point of the body to a target.
///
/// The damping is critical for what the point weighs, so the body comes to rest at the target and
/// does not swing about it. Spring and damper stay stable for any mass, stiffness and period.
struct Pull {
  std::array<double, 3> target{};  ///< Where the spring ends, in the world frame [m].
  /// Where the spring is fixed, from the centre of the tip or object, in the axes of its body [m].
  std::array<double, 3> point{};
  double stiffness{300.0};  ///< Above 0, at most `kMaxPullStiffness` [N/m].

  /// @throws InvalidArgument that names the number and the values allowed
  void validate() const;
  /// True if `validate` does not throw.
  [[nodiscard]] bool is_valid() const noexcept;

  friend bool operator==(const Pull&, const Pull&) = default;
};

/// An element of the companion "hand" of a simulated robot: the pull that acted in the step
/// `stamp.capture_index`. While a hand pulls there is one element for each step, and one when it
/// has let go.
struct HandObservation {
  Stamp stamp{};
  std::int64_t process{0};  ///< The process that pulls; 0: the program of the simulation itself.
  /// Number of the body in `pullable_bodies`; -1: nothing is pulled.
  std::int64_t body{-1};
  std::array<double, 3> point{};   ///< See `Pull` [m].
  std::array<double, 3> target{};  ///< See `Pull` [m].
  double stiffness{0.0};           ///< See `Pull` [N/m].
  std::array<double, 3> force{};   ///< Mean force on the body in this step, in the world frame [N].

  static constexpr auto fields() {
    return std::tuple{field("stamp", &HandObservation::stamp),
                      field("process", &HandObservation::process),
                      field("body", &HandObservation::body),
                      field("point", &HandObservation::point, "m"),
                      field("target", &HandObservation::target, "m"),
                      field("stiffness", &HandObservation::stiffness, "N/m"),
                      field("force", &HandObservation::force, "N")};
  }
};

/// Name of the companion that says what a hand does, and of the sensor that is the hand.
inline constexpr const char* kHandCompanion = "hand";

/// Describes this companion.
[[nodiscard]] CompanionDescription hand_companion();

/// A hand that writes nothing for this long has let go. A `HandWriter` writes all the time, so this
/// is how long a process pulls that was stopped.
inline constexpr Nanoseconds kHandTimeout = std::chrono::milliseconds(200);

/// Names of what can be pulled: "tip_0" and so on, one for each finger, then the names of the
/// objects. A robot from a file has no tips: its `end_frames` come after the objects.
[[nodiscard]] std::vector<std::string> pullable_bodies(const SceneModel& model);

/// The number of a body in `pullable_bodies`.
/// @throws InvalidArgument that names the bodies
[[nodiscard]] std::int64_t find_body(std::span<const std::string> bodies, const std::string& name);
/// Checks the number of a body in `pullable_bodies`.
/// @throws InvalidArgument that names the bodies
void require_body(std::span<const std::string> bodies, std::int64_t body);

/// The hand of a simulated robot that `trifinger run` runs in another process.
///
/// The robot has one hand. A pull acts while the robot holds its pose and while a session runs, not
/// during its orderly stop. It begins with the next step, the first one up to 0.1 s after the
/// writer was made. It ends with `let_go`, with this object, or with its process: 0.1 s after a
/// kill, and 0.3 s after the process was stopped.
///
/// The process of the robot may be started again at any time. The bodies are those of the robot
/// that ran when this object was made.
class HandWriter {
 public:
  /// Becomes the hand of `robot`.
  /// @throws SessionNotFound, InvalidArgument if the robot cannot be pulled, Error with the
  /// holder's number if another process is the hand, SystemError
  explicit HandWriter(const std::string& robot);
  ~HandWriter();

  /// What can be pulled, see `pullable_bodies`.
  [[nodiscard]] const std::vector<std::string>& bodies() const noexcept;

  /// Pulls at a body, in place of what was pulled before. The hand lets go by itself after
  /// `length`, unless it pulls again. Does not block. Any thread may call this.
  /// @throws InvalidArgument, InheritedHandle in a child process after fork
  void pull(const std::string& body, const Pull& pull, Timeout length = kForever);
  void pull(std::int64_t body, const Pull& pull, Timeout length = kForever);

  /// Lets go. Without effect if nothing is pulled, or in a child process after fork.
  void let_go() noexcept;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace trifinger
