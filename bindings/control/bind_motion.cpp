// SPDX-License-Identifier: BSD-3-Clause
#include <nanobind/nanobind.h>

#include "bindings.hpp"
#include "conversion/array.hpp"
#include "docstrings.hpp"
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
  nb::class_<Pose>(m, "Pose", docs::Pose::Pose)
      .def(
          "__init__",
          [](Pose* self, const Vector3& position, const Vector4& orientation) {
            new (self) Pose{position, to_quaternion(orientation)};
          },
          "position"_a = zeros(), "orientation"_a = nb::make_tuple(1.0, 0.0, 0.0, 0.0))
      .def_prop_ro("position", array_of(&Pose::position), docs::Pose::position)
      .def_prop_ro(
          "orientation", [](const Pose& pose) { return from_quaternion(pose.orientation); },
          docs::Pose::orientation);

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
  bind_rates(nb::class_<Twist>(m, "Twist", docs::Twist::Twist), docs::Twist::linear,
             docs::Twist::angular);
  bind_rates(nb::class_<Acceleration>(m, "Acceleration", docs::Acceleration::Acceleration),
             docs::Acceleration::linear, docs::Acceleration::angular);

  nb::class_<Motion>(m, "Motion", docs::Motion::Motion)
      .def(
          "__init__",
          [](Motion* self, const Pose& pose, const Twist& twist, const Acceleration& acceleration) {
            new (self) Motion{pose, twist, acceleration};
          },
          nb::arg("pose").sig("...") = Pose{}, nb::arg("twist").sig("...") = Twist{},
          nb::arg("acceleration").sig("...") = Acceleration{})
      .def_ro("pose", &Motion::pose)
      .def_ro("twist", &Motion::twist)
      .def_ro("acceleration", &Motion::acceleration);

  nb::class_<PointMotion>(m, "PointMotion", docs::PointMotion::PointMotion)
      .def(
          "__init__",
          [](PointMotion* self, const Vector3& position, const Vector3& velocity,
             const Vector3& acceleration) {
            new (self) PointMotion{position, velocity, acceleration};
          },
          "position"_a = zeros(), "velocity"_a = zeros(), "acceleration"_a = zeros())
      .def_prop_ro("position", array_of(&PointMotion::position), docs::PointMotion::position)
      .def_prop_ro("velocity", array_of(&PointMotion::velocity), docs::PointMotion::velocity)
      .def_prop_ro("acceleration", array_of(&PointMotion::acceleration),
                   docs::PointMotion::acceleration);

  m.def(
      "rotation_from_vector",
      [](const Vector3& vector) { return from_quaternion(rotation_from_vector(vector)); },
      "vector"_a, docs::rotation_from_vector);
  m.def(
      "rotation_vector",
      [](const Vector4& rotation) { return Array{rotation_vector(to_quaternion(rotation))}; },
      "rotation"_a, docs::rotation_vector);
  m.def(
      "rotation_error",
      [](const Vector4& desired, const Vector4& actual) {
        return Array{rotation_error(to_quaternion(desired), to_quaternion(actual))};
      },
      "desired"_a, "actual"_a, docs::rotation_error);
  m.def(
      "moved",
      [](const Pose& pose, const Twist& twist, double duration) {
        return moved(pose, twist, Seconds(duration));
      },
      "pose"_a, "twist"_a, "duration"_a, docs::moved);
  m.def(
      "point_of_body",
      [](const Motion& body, const Vector3& point) { return point_of_body(body, point); }, "body"_a,
      "point"_a, docs::point_of_body);
}

void bind_trajectories(nb::module_& m) {
  nb::class_<control::Progress>(m, "Progress", docs::control::Progress::Progress)
      .def_ro("value", &control::Progress::value, docs::control::Progress::value)
      .def_ro("rate", &control::Progress::rate, docs::control::Progress::rate)
      .def_ro("acceleration", &control::Progress::acceleration,
              docs::control::Progress::acceleration);
  m.def(
      "minimum_jerk",
      [](double time, double duration) { return minimum_jerk(Seconds(time), Seconds(duration)); },
      "time"_a, "duration"_a, docs::minimum_jerk);

  const auto bind_trajectory = []<class T>(nb::class_<T> type, const char* duration,
                                           const char* at) {
    type.def_prop_ro(
            "duration", [](const T& trajectory) { return trajectory.duration().count(); }, duration)
        .def(
            "at", [](const T& trajectory, double time) { return trajectory.at(Seconds(time)); },
            "time"_a, at);
  };
  nb::class_<LineTrajectory> line(m, "LineTrajectory", docs::LineTrajectory::LineTrajectory);
  line.def(
      "__init__",
      [](LineTrajectory* self, const Vector3& start, const Vector3& end, double duration) {
        new (self) LineTrajectory(start, end, Seconds(duration));
      },
      "start"_a, "end"_a, "duration"_a);
  bind_trajectory(line, docs::LineTrajectory::duration, docs::LineTrajectory::at);

  nb::class_<PoseTrajectory> pose(m, "PoseTrajectory", docs::PoseTrajectory::PoseTrajectory);
  pose.def(
      "__init__",
      [](PoseTrajectory* self, const Pose& start, const Pose& end, double duration) {
        new (self) PoseTrajectory(start, end, Seconds(duration));
      },
      "start"_a, "end"_a, "duration"_a);
  bind_trajectory(pose, docs::PoseTrajectory::duration, docs::PoseTrajectory::at);

  const CircleConfig usual;
  nb::class_<CircleTrajectory> circle(m, "CircleTrajectory",
                                      docs::CircleTrajectory::CircleTrajectory);
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
      "is "
      "the time of one\nturn at full speed [s], `ramp_time` that from rest to full speed and "
      "back.");
  bind_trajectory(circle, docs::CircleTrajectory::duration, docs::CircleTrajectory::at);
}

}  // namespace

void bind_motion(nb::module_& m) {
  bind_poses(m);
  bind_trajectories(m);
}

}  // namespace trifinger::bindings
