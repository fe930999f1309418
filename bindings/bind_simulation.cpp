// SPDX-License-Identifier: BSD-3-Clause
#include <nanobind/eigen/dense.h>
#include <nanobind/nanobind.h>
#include <nanobind/stl/map.h>
#include <nanobind/stl/optional.h>
#include <nanobind/stl/pair.h>
#include <nanobind/stl/shared_ptr.h>
#include <nanobind/stl/unique_ptr.h>
#include <nanobind/stl/vector.h>

#include <cctype>
#include <map>
#include <memory>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "array.hpp"
#include "bindings.hpp"
#include "checks.hpp"
#include "garbage.hpp"
#include "gil.hpp"
#include "numpy.hpp"
#include "recorder.hpp"
#include "simulation.hpp"
#include "text.hpp"
#include "trifinger/joint/reasons.hpp"
#include "trifinger/model/export.hpp"
#include "trifinger/model/kinematics.hpp"

namespace nb = nanobind;
using namespace nanobind::literals;

namespace trifinger::python {
namespace {

using Values = Eigen::VectorXd;

// Converts whatever NumPy accepts as a list of `size` numbers.
Values to_values(nb::handle object, Eigen::Index size, const char* what) {
  const nb::object array =
      nb::steal(PyArray_FROM_OTF(object.ptr(), NPY_DOUBLE, NPY_ARRAY_IN_ARRAY));
  if (!array.is_valid()) throw nb::python_error();
  auto* const numbers = reinterpret_cast<PyArrayObject*>(array.ptr());
  if (PyArray_NDIM(numbers) != 1 || PyArray_DIM(numbers, 0) != size) {
    throw InvalidArgument(std::string(what) + " has shape " +
                          nb::str(nb::handle(array).attr("shape")).c_str() + ", must have (" +
                          std::to_string(size) + ",)");
  }
  return Eigen::Map<const Values>(static_cast<const double*>(PyArray_DATA(numbers)), size);
}

JointValues joints(const Kinematics& kinematics, nb::handle position) {
  return to_values(position, kinematics.num_joints(), "position");
}

int checked_finger(const Kinematics& kinematics, int finger) {
  if (finger < 0 || finger >= kinematics.num_fingers()) {
    throw InvalidArgument("finger is " + std::to_string(finger) + ", must be 0 to " +
                          std::to_string(kinematics.num_fingers() - 1));
  }
  return finger;
}

std::string_view name_of(Reach reach) {
  switch (reach) {
    case Reach::kYes:
      return "yes";
    case Reach::kTooFar:
      return "too_far";
    case Reach::kTooClose:
      return "too_close";
    case Reach::kOutsideLimits:
      return "outside_limits";
  }
  return "";
}

// Returns "OWN_CHECK" for "own_check".
std::string constant_name(std::string_view name) {
  std::string constant(name);
  for (char& letter : constant) letter = static_cast<char>(std::toupper(letter));
  return constant;
}

void bind_reasons(nb::module_& m) {
  nb::enum_<Reason> reasons(
      m, "Reason", nb::is_flag(), nb::is_arithmetic(),
      "Why a joint did not get what was requested: bits of `reasons` in an applied action.");
  for (const Reason reason : all_reasons()) {
    reasons.value(constant_name(name_of(reason)).c_str(), reason,
                  std::string(describe(reason)).c_str());
  }
}

void bind_kinematics(nb::module_& m) {
  nb::class_<Kinematics>(m, "Kinematics",
                         "Kinematics and dynamics of the fingers, without contacts and objects. "
                         "Everything is in the world\nframe: z up, origin on the table. One object "
                         "must not be used by several threads at once: make one\nfor each.")
      .def(
          "__init__",
          [](Kinematics* self, const std::string& config, const nb::dict& overrides) {
            new (self) Kinematics(description_of(load_config(config, overrides)));
          },
          "config"_a = "sim", "overrides"_a = nb::dict(),
          nb::sig(
              "def __init__(self, config: str = 'sim', overrides: dict[str, object] = {}) -> None"),
          "`config` is the name of a configuration that comes with the package, or a file. "
          "`overrides` changes\nsingle values.")
      .def_prop_ro("num_fingers", &Kinematics::num_fingers, "Number of fingers: 1 or 3.")
      .def_prop_ro("num_joints", &Kinematics::num_joints,
                   "Number of joints: three for each finger.")
      .def(
          "tip_positions",
          [](Kinematics& kinematics, nb::handle position) {
            kinematics.update(joints(kinematics, position));
            return RowMajor(
                kinematics.tip_positions().reshaped<Eigen::RowMajor>(kinematics.num_fingers(), 3));
          },
          "position"_a,
          nb::sig("def tip_positions(self, position: numpy.typing.ArrayLike) -> "
                  "numpy.typing.NDArray[numpy.float64]"),
          "Centres of the tip spheres at the joint positions `position` [rad]: a row x, y, z for "
          "each finger [m].")
      .def(
          "tip_jacobian",
          [](Kinematics& kinematics, int finger, nb::handle position) {
            kinematics.update(joints(kinematics, position));
            return RowMajor(kinematics.tip_jacobian(checked_finger(kinematics, finger)));
          },
          "finger"_a, "position"_a,
          nb::sig("def tip_jacobian(self, finger: int, position: numpy.typing.ArrayLike) -> "
                  "numpy.typing.NDArray[numpy.float64]"),
          "Derivative of one tip's position by all joints [m/rad]: 3 rows, `num_joints` columns.")
      .def(
          "tip_jacobians",
          [](Kinematics& kinematics, nb::handle position) {
            kinematics.update(joints(kinematics, position));
            return RowMajor(kinematics.tip_jacobians());
          },
          "position"_a,
          nb::sig("def tip_jacobians(self, position: numpy.typing.ArrayLike) -> "
                  "numpy.typing.NDArray[numpy.float64]"),
          "The Jacobians of all tips, one below the other [m/rad]: square, `num_joints` rows and "
          "columns.")
      .def(
          "tip_accelerations",
          [](Kinematics& kinematics, nb::handle position, nb::handle velocity) {
            kinematics.update(joints(kinematics, position));
            return RowMajor(
                kinematics
                    .tip_accelerations(to_values(velocity, kinematics.num_joints(), "velocity"))
                    .reshaped<Eigen::RowMajor>(kinematics.num_fingers(), 3));
          },
          "position"_a, "velocity"_a,
          nb::sig("def tip_accelerations(self, position: numpy.typing.ArrayLike, velocity: "
                  "numpy.typing.ArrayLike) -> numpy.typing.NDArray[numpy.float64]"),
          "Accelerations of the tips when joints move with constant `velocity` [rad/s]: a row x, "
          "y, z for each\nfinger [m/s^2].")
      .def(
          "gravity_torques",
          [](Kinematics& kinematics, nb::handle position) {
            kinematics.update(joints(kinematics, position));
            return Values(kinematics.gravity_torques());
          },
          "position"_a,
          nb::sig("def gravity_torques(self, position: numpy.typing.ArrayLike) -> "
                  "numpy.typing.NDArray[numpy.float64]"),
          "Torques that hold the pose against gravity [Nm].")
      .def(
          "bias_torques",
          [](Kinematics& kinematics, nb::handle position, nb::handle velocity) {
            kinematics.update(joints(kinematics, position));
            return Values(
                kinematics.bias_torques(to_values(velocity, kinematics.num_joints(), "velocity")));
          },
          "position"_a, "velocity"_a,
          nb::sig("def bias_torques(self, position: numpy.typing.ArrayLike, velocity: "
                  "numpy.typing.ArrayLike) -> numpy.typing.NDArray[numpy.float64]"),
          "Torques that keep joints at their `velocity` [rad/s] without acceleration, against "
          "gravity, Coriolis\nand centrifugal forces [Nm]. Friction is not included.")
      .def(
          "mass_matrix",
          [](Kinematics& kinematics, nb::handle position) {
            kinematics.update(joints(kinematics, position));
            return RowMajor(kinematics.mass_matrix());
          },
          "position"_a,
          nb::sig("def mass_matrix(self, position: numpy.typing.ArrayLike) -> "
                  "numpy.typing.NDArray[numpy.float64]"),
          "Inertia at the joints, including that of the rotors [kg m^2].")
      .def(
          "inverse_kinematics",
          [](const Kinematics& kinematics, int finger, nb::handle tip, nb::handle near) {
            checked_finger(kinematics, finger);
            const Eigen::Vector3d point = to_values(tip, 3, "tip");
            const FingerPose pose = near.is_none() ? kinematics.inverse_kinematics(finger, point)
                                                   : kinematics.inverse_kinematics(
                                                         finger, point, to_values(near, 3, "near"));
            const std::string_view reach = name_of(pose.reach);
            return std::pair(pose.position, nb::str(reach.data(), reach.size()));
          },
          "finger"_a, "tip"_a, "near"_a = nb::none(),
          nb::sig("def inverse_kinematics(self, finger: int, tip: numpy.typing.ArrayLike, "
                  "near: numpy.typing.ArrayLike | None = None) -> "
                  "tuple[numpy.typing.NDArray[numpy.float64], str]"),
          "Joint positions of `finger` [rad] that bring its tip to `tip` [m], and whether it can "
          "reach it:\n'yes', 'too_far', 'too_close' or 'outside_limits'. If it cannot, the result "
          "is a pose within the\nhard limits whose tip is near the point. Among several poses the "
          "result is the one nearest to `near`\n[rad]; default: the initial pose.");
}

void bind_recorder(nb::module_& m) {
  nb::class_<log::RecorderThread>(
      m, "Recorder",
      "Records a robot of this process in a thread of its own. Nothing is lost, because the "
      "simulation\nwaits for the recorder. The end of the program stops it.")
      .def(
          "stop",
          [](log::RecorderThread& recorder) {
            const GilRelease release;
            recorder.stop();
          },
          "Writes what is left and finishes the file. Nothing is recorded after this.")
      .def_prop_ro(
          "file",
          [](const log::RecorderThread& recorder) -> nb::object {
            const std::filesystem::path file = recorder.file();
            return file.empty() ? nb::none() : to_python(file);
          },
          nb::sig("def file(self) -> pathlib.Path | None"),
          "The newest file; None before the first session.")
      .def(
          "__enter__", [](nb::handle self) { return nb::borrow(self); },
          nb::sig("def __enter__(self) -> Recorder"))
      .def(
          "__exit__",
          [](log::RecorderThread& recorder, const nb::args&) {
            const GilRelease release;
            recorder.stop();
          },
          nb::sig("def __exit__(self, *exception: object) -> None"));
}

}  // namespace

void bind_simulation(nb::module_& m) {
  // NOLINTNEXTLINE(bugprone-unused-raii): its constructor registers the class.
  nb::class_<Checks>(m, "_Checks", nb::type_slots(garbage_collected<Checks>()));
  bind_reasons(m);
  bind_recorder(m);
  nb::class_<Variation>(m, "Variation",
                        "How a simulation differs from its configuration in an episode. "
                        "`Simulation.vary` explains the numbers.")
      .def_ro("object_mass", &Variation::object_mass)
      .def_ro("friction", &Variation::friction)
      .def_prop_ro("pair_friction",
                   [](const Variation& variation) {
                     std::map<std::string, double> factors;
                     for (const SurfacePair pair : all_surface_pairs()) {
                       factors.emplace(name_of(pair), variation.pair_friction[pair]);
                     }
                     return factors;
                   })
      .def_ro("contact_time", &Variation::contact_time)
      .def_ro("motor_gain", &Variation::motor_gain)
      .def_ro("torque_delay", &Variation::torque_delay)
      .def_ro("rotor_inertia", &Variation::rotor_inertia)
      .def_ro("joint_damping", &Variation::joint_damping)
      .def_ro("joint_friction", &Variation::joint_friction)
      .def_ro("stop_margin", &Variation::stop_margin);
  nb::class_<PythonSimulation>(
      m, "Simulation", nb::type_slots(garbage_collected<PythonSimulation>()),
      "A simulated robot in this process. Its back-end runs inside the waits of its front-end: no "
      "threads,\ndeterministic, as fast as the physics. simulate() is the short form.\n\nEvery "
      "session begins in the state that the last reset(), place_object(), set_object_velocity() "
      "or\nrestore() has left. During a session they take effect at once.")
      .def(
          "__init__",
          [](PythonSimulation* self, const std::string& config, const nb::dict& overrides) {
            new (self) PythonSimulation(load_config(config, overrides));
          },
          "config"_a = "sim", "overrides"_a = nb::dict(),
          nb::sig(
              "def __init__(self, config: str = 'sim', overrides: dict[str, object] = {}) -> None"),
          "`config` is the name of a configuration that comes with the package, or a file; "
          "`overrides` changes "
          "single\nvalues: {\"fingers.height\": 0.3, \"simulation.seed\": 7}.")
      .def("__repr__",
           [](const PythonSimulation& simulation) {
             return "<Simulation of '" + simulation.name() + "'>";
           })
      .def("connect", &PythonSimulation::connect, nb::kw_only(), "strict"_a = true,
           "Controls the robot in a new session. Raises ControlHeld while another front-end "
           "controls it.")
      .def("reset", &PythonSimulation::reset, "position"_a = nb::none(), "seed"_a = nb::none(),
           "episode"_a = 0,
           "Resets the simulation: joints at `position` [rad] (default: the configuration's), "
           "objects as they\nare at the start of the configuration, random numbers of `episode` of "
           "`seed` (default: the\nconfiguration's).")
      .def("vary", &PythonSimulation::vary, "variation"_a,
           "Makes the simulation differ from its configuration as `variation` says.")
      .def(
          "vary",
          [](const PythonSimulation& simulation, double object_mass, double friction,
             const std::map<std::string, double>& pair_friction, double contact_time,
             double motor_gain, TimeIndex torque_delay, double rotor_inertia, double joint_damping,
             double joint_friction, double stop_margin) {
            Variation variation{.object_mass = object_mass,
                                .friction = friction,
                                .contact_time = contact_time,
                                .motor_gain = motor_gain,
                                .torque_delay = torque_delay,
                                .rotor_inertia = rotor_inertia,
                                .joint_damping = joint_damping,
                                .joint_friction = joint_friction,
                                .stop_margin = stop_margin};
            for (const auto& [name, factor] : pair_friction) {
              variation.pair_friction[surface_pair_from_name(name)] = factor;
            }
            simulation.vary(variation);
          },
          nb::kw_only(), "object_mass"_a = 1.0, "friction"_a = 1.0, "pair_friction"_a = nb::dict(),
          "contact_time"_a = 1.0, "motor_gain"_a = 1.0, "torque_delay"_a = 0,
          "rotor_inertia"_a = 1.0, "joint_damping"_a = 1.0, "joint_friction"_a = 0.0,
          "stop_margin"_a = 1.0,
          nb::sig("def vary(self, *, object_mass: float = 1.0, friction: float = 1.0, "
                  "pair_friction: dict[str, float] = {}, contact_time: float = 1.0, "
                  "motor_gain: float = 1.0, torque_delay: int = 0, rotor_inertia: float = 1.0, "
                  "joint_damping: float = 1.0, joint_friction: float = 0.0, "
                  "stop_margin: float = 1.0) -> None"),
          "Makes the simulation differ from its configuration from now on. A reset does not change "
          "this. Each\nnumber is a factor, except `torque_delay`, the steps until motors deliver a "
          "torque, and\n`joint_friction`, the dry friction added in the joints [Nm]. "
          "`pair_friction` has additional factors\nfor pairs of surfaces, for example "
          "{\"tip_object\": 0.8}; docs/simulation.md names them.")
      .def("place_object", &PythonSimulation::place_object, "name"_a, "position"_a,
           "orientation"_a = std::vector<double>{1.0, 0.0, 0.0, 0.0},
           "Places an object at rest: `position` x, y, z [m] and `orientation`, a quaternion w, x, "
           "y, z.")
      .def("set_object_velocity", &PythonSimulation::set_object_velocity, "name"_a, "linear"_a,
           "angular"_a = std::vector<double>{0.0, 0.0, 0.0},
           "Sets an object in motion from where it is, in the world frame: velocity of its centre "
           "[m/s] and\nangular velocity [rad/s].")
      .def("push_object", &PythonSimulation::push_object, "name"_a, "force"_a,
           "Applies a force to an object's centre of mass [N], in the world frame. It acts from "
           "the next step of\nthe session on until the next call, reset() or session.")
      .def(
          "object_velocity",
          [](const PythonSimulation& simulation, const std::string& name) {
            const ObjectVelocity velocity = simulation.object_velocity(name);
            return std::pair(Eigen::Vector3d(velocity.linear.data()),
                             Eigen::Vector3d(velocity.angular.data()));
          },
          "name"_a,
          "The object's velocity now, without delay and noise: velocity of its centre [m/s] and "
          "angular velocity [rad/s].")
      .def(
          "object_pose",
          [](const PythonSimulation& simulation, const std::string& name) {
            const ObjectPose pose = simulation.object_pose(name);
            return std::pair(Eigen::Vector3d(pose.position.data()),
                             Eigen::Vector4d(pose.orientation.data()));
          },
          "name"_a,
          "The object's pose now, without delay and noise: position [m] and quaternion w, x, y, z.")
      .def("save", &PythonSimulation::save,
           "Saves the state: physics, safety chain, delays, random numbers.")
      .def("restore", &PythonSimulation::restore, "state"_a,
           "Continues from `state` exactly as the saved simulation continued, bit for bit.")
      .def("state_before_divergence", &PythonSimulation::state_before_divergence,
           "The last state before the simulation diverged; empty if it has not diverged.")
      .def(
          "configuration",
          [](const PythonSimulation& simulation) {
            const std::vector<double> values = simulation.configuration();
            return Values(
                Eigen::Map<const Values>(values.data(), static_cast<Eigen::Index>(values.size())));
          },
          "Positions and velocities of joints and objects, to draw the scene of mjcf(): MuJoCo's "
          "qpos, then qvel.")
      .def("add_check", &PythonSimulation::add_check, "function"_a,
           nb::sig("def add_check(self, function: collections.abc.Callable[[Observation, Action], "
                   "None]) -> None"),
           "Adds a safety check of your own; call it between sessions. `function(observation, "
           "action)` changes\nthe action in place. The robot's own limits are checked after it. An "
           "exception ends the session with\na fault that has the exception's text. Ctrl-C is no "
           "fault: KeyboardInterrupt reaches the program\nthat waits for the robot.")
      .def(
          "record",
          [](const PythonSimulation& simulation, nb::handle folder, const std::string& precision) {
            return simulation.record(to_path(folder), precision);
          },
          "folder"_a, nb::kw_only(), "precision"_a = "double",
          nb::sig("def record(self, folder: str | os.PathLike[str], *, precision: str = 'double') "
                  "-> Recorder"),
          "Records every session from the next one on, without loss, into a file in `folder`. The "
          "precision\n\"single\" takes half of the space.")
      .def("mjcf", &PythonSimulation::mjcf, "The scene in MuJoCo's format.");

  m.def(
      "simulate",
      [](const std::string& config, const nb::dict& overrides, bool strict, nb::handle record,
         const nb::iterable& checks) {
        PythonSimulation simulation(load_config(config, overrides));
        for (const nb::handle check : checks) simulation.add_check(nb::borrow(check));
        if (!record.is_none()) static_cast<void>(simulation.record(to_path(record), "double"));
        return simulation.connect(strict);
      },
      "config"_a = "sim", "overrides"_a = nb::dict(), nb::kw_only(), "strict"_a = true,
      "record"_a = nb::none(), "checks"_a = nb::tuple(),
      nb::sig("def simulate(config: str = 'sim', overrides: dict[str, object] = {}, *, strict: "
              "bool = True, record: str | os.PathLike[str] | None = None, "
              "checks: collections.abc.Iterable[collections.abc.Callable[[Observation, Action], "
              "None]] = ()) -> Frontend"),
      "Starts a simulated robot in this process and controls it; see Simulation. `record` is the "
      "folder for\na log. `checks` are safety checks of your own, see Simulation.add_check(). For "
      "a robot that runs\nelsewhere, use connect().");

  m.def(
      "export_mjcf",
      [](const std::string& config, const nb::dict& overrides) {
        return export_mjcf(description_of(load_config(config, overrides)));
      },
      "config"_a = "sim", "overrides"_a = nb::dict(),
      nb::sig("def export_mjcf(config: str = 'sim', overrides: dict[str, object] = {}) -> str"),
      "The scene of a configuration in MuJoCo's format, with objects, cameras and lights.");
  m.def(
      "export_urdf",
      [](const std::string& config, const nb::dict& overrides) {
        return export_urdf(description_of(load_config(config, overrides)));
      },
      "config"_a = "sim", "overrides"_a = nb::dict(),
      nb::sig("def export_urdf(config: str = 'sim', overrides: dict[str, object] = {}) -> str"),
      "The robot of a configuration as URDF.");

  bind_kinematics(m);
}

}  // namespace trifinger::python
