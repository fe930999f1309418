// SPDX-License-Identifier: BSD-3-Clause
#include <nanobind/nanobind.h>

#include "bindings.hpp"
#include "conversion/array.hpp"
#include "trifinger/control/motion.hpp"
#include "trifinger/control/trajectories.hpp"

namespace nb = nanobind;
using namespace nanobind::literals;

namespace trifinger::bindings {
namespace {

using namespace control;

using Vector4 = Array<Eigen::Vector4d>;

// Quaternions are w, x, y, z in Python.
Eigen::Quaterniond to_quaternion(const Eigen::Vector4d& numbers) {
  return {numbers[0], numbers[1], numbers[2], numbers[3]};
}
Vector4 from_quaternion(const Eigen::Quaterniond& quaternion) {
  return {{quaternion.w(), quaternion.x(), quaternion.y(), quaternion.z()}};
}

void bind_poses(nb::module_& m) {
  nb::class_<Pose>(m, "Pose", "Position and orientation of a body. Cannot be changed.")
      .def(
          "__init__",
          [](Pose* self, const Vector3& position, const Vector4& orientation) {
            new (self) Pose{position, to_quaternion(orientation)};
          },
          "position"_a = zeros(), "orientation"_a = nb::make_tuple(1.0, 0.0, 0.0, 0.0),
          "`position` is that of the centre of mass [m]. `orientation` is the rotation from the "
          "body's frame, a\nquaternion w, x, y, z of unit length.")
      .def_prop_ro("position", array_of(&Pose::position), "Position of the centre of mass [m].")
      .def_prop_ro(
          "orientation", [](const Pose& pose) { return from_quaternion(pose.orientation); },
          "Rotation from the body's frame: a quaternion w, x, y, z.");

  const auto bind_rates = []<class T>(nb::class_<T> type, const char* linear, const char* angular) {
    type.def(
            "__init__",
            [](T* self, const Vector3& linear_part, const Vector3& angular_part) {
              new (self) T{linear_part, angular_part};
            },
            "linear"_a = zeros(), "angular"_a = zeros())
        .def_prop_ro("linear", array_of(&T::linear), linear)
        .def_prop_ro("angular", array_of(&T::angular), angular);
  };
  bind_rates(
      nb::class_<Twist>(m, "Twist", "Velocity and angular velocity of a body. Cannot be changed."),
      "Velocity of the centre of mass [m/s].", "[rad/s], not in the body's frame.");
  bind_rates(nb::class_<Acceleration>(m, "Acceleration",
                                      "Rate of change of a body's twist. Cannot be changed."),
             "[m/s^2]", "[rad/s^2]");

  nb::class_<Motion>(m, "Motion", "A body at one instant of a motion. Cannot be changed.")
      .def(
          "__init__",
          [](Motion* self, const Pose& pose, const Twist& twist, const Acceleration& acceleration) {
            new (self) Motion{pose, twist, acceleration};
          },
          "pose"_a = Pose{}, "twist"_a = Twist{}, "acceleration"_a = Acceleration{},
          nb::sig("def __init__(self, pose: Pose = ..., twist: Twist = ..., acceleration: "
                  "Acceleration = ...) -> None"))
      .def_ro("pose", &Motion::pose)
      .def_ro("twist", &Motion::twist)
      .def_ro("acceleration", &Motion::acceleration);

  nb::class_<PointMotion>(m, "PointMotion",
                          "A point at one instant of a motion. Cannot be changed.")
      .def(
          "__init__",
          [](PointMotion* self, const Vector3& position, const Vector3& velocity,
             const Vector3& acceleration) {
            new (self) PointMotion{position, velocity, acceleration};
          },
          "position"_a = zeros(), "velocity"_a = zeros(), "acceleration"_a = zeros())
      .def_prop_ro("position", array_of(&PointMotion::position), "[m]")
      .def_prop_ro("velocity", array_of(&PointMotion::velocity), "[m/s]")
      .def_prop_ro("acceleration", array_of(&PointMotion::acceleration), "[m/s^2]");

  m.def(
      "rotation_from_vector",
      [](const Vector3& vector) { return from_quaternion(rotation_from_vector(vector)); },
      "vector"_a,
      "The rotation about the direction of `vector` by its length [rad], as a quaternion w, x, y, "
      "z.");
  m.def(
      "rotation_vector",
      [](const Vector4& rotation) { return Array{rotation_vector(to_quaternion(rotation))}; },
      "rotation"_a,
      "The shortest vector [rad] that `rotation_from_vector` turns into `rotation`. Its length is "
      "at most pi.");
  m.def(
      "rotation_error",
      [](const Vector4& desired, const Vector4& actual) {
        return Array{rotation_error(to_quaternion(desired), to_quaternion(actual))};
      },
      "desired"_a, "actual"_a,
      "The rotation that still turns `actual` into `desired` [rad], in the frame in which both are "
      "given.");
  m.def(
      "moved",
      [](const Pose& pose, const Twist& twist, double duration) {
        return moved(pose, twist, Seconds(duration));
      },
      "pose"_a, "twist"_a, "duration"_a,
      "The pose after moving from `pose` with a constant `twist` for `duration` [s], which may be "
      "negative.");
  m.def(
      "point_of_body",
      [](const Motion& body, const Vector3& point) { return point_of_body(body, point); }, "body"_a,
      "point"_a,
      "The motion of a point that is fixed to a body. `point` is in the body's frame, from its "
      "centre [m].");
}

void bind_trajectories(nb::module_& m) {
  nb::class_<control::Progress>(m, "Progress", "Progress of a movement, with its derivatives.")
      .def_ro("value", &control::Progress::value, "0 at the beginning, 1 at the end.")
      .def_ro("rate", &control::Progress::rate, "[1/s]")
      .def_ro("acceleration", &control::Progress::acceleration, "[1/s^2]");
  m.def(
      "minimum_jerk",
      [](double time, double duration) { return minimum_jerk(Seconds(time), Seconds(duration)); },
      "time"_a, "duration"_a, "The movement of least jerk from rest to rest; times in [s].");

  const auto bind_trajectory = []<class T>(nb::class_<T> type) {
    type.def_prop_ro(
            "duration", [](const T& way) { return way.duration().count(); }, "[s]")
        .def(
            "at", [](const T& way, double time) { return way.at(Seconds(time)); }, "time"_a,
            "The motion at `time` since the beginning [s]. Before time 0 it rests at its start, "
            "and after\n`duration` at its end.");
  };
  nb::class_<LineTrajectory> line(m, "LineTrajectory", "A straight line with the least jerk.");
  line.def(
      "__init__",
      [](LineTrajectory* self, const Vector3& start, const Vector3& end, double duration) {
        new (self) LineTrajectory(start, end, Seconds(duration));
      },
      "start"_a, "end"_a, "duration"_a);
  bind_trajectory(line);

  nb::class_<PoseTrajectory> pose(m, "PoseTrajectory",
                                  "A straight line, and a rotation about a fixed axis through the "
                                  "smaller angle, with least jerk.");
  pose.def(
      "__init__",
      [](PoseTrajectory* self, const Pose& start, const Pose& end, double duration) {
        new (self) PoseTrajectory(start, end, Seconds(duration));
      },
      "start"_a, "end"_a, "duration"_a);
  bind_trajectory(pose);

  const CircleConfig usual;
  nb::class_<CircleTrajectory> circle(
      m, "CircleTrajectory",
      "A horizontal circle that gains its speed smoothly and loses it at the end.");
  circle.def(
      "__init__",
      [](CircleTrajectory* self, const Vector3& centre, double radius, double start_angle,
         double turns, double period, double ramp_time) {
        new (self) CircleTrajectory({.centre = centre,
                                     .radius = radius,
                                     .start_angle = start_angle,
                                     .turns = turns,
                                     .period = Seconds(period),
                                     .ramp_time = Seconds(ramp_time)});
      },
      "centre"_a, "radius"_a = usual.radius, "start_angle"_a = usual.start_angle,
      "turns"_a = usual.turns, "period"_a = usual.period.count(),
      "ramp_time"_a = usual.ramp_time.count(),
      "`start_angle` is measured from x towards y [rad]. Negative `turns` go clockwise. `period` "
      "is the\ntime of one turn at full speed, `ramp_time` the time from rest to full speed and "
      "back to rest [s].");
  bind_trajectory(circle);
}

}  // namespace

void bind_motion(nb::module_& m) {
  bind_poses(m);
  bind_trajectories(m);
}

}  // namespace trifinger::bindings
