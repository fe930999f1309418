// SPDX-License-Identifier: BSD-3-Clause
#include <nanobind/eigen/dense.h>
#include <nanobind/nanobind.h>
#include <nanobind/stl/map.h>
#include <nanobind/stl/optional.h>
#include <nanobind/stl/pair.h>
#include <nanobind/stl/shared_ptr.h>
#include <nanobind/stl/unique_ptr.h>
#include <nanobind/stl/variant.h>
#include <nanobind/stl/vector.h>

#include <cctype>
#include <cstdint>
#include <map>
#include <string>
#include <string_view>
#include <tuple>
#include <type_traits>
#include <utility>
#include <variant>
#include <vector>

#include "bindings.hpp"
#include "conversion/array.hpp"
#include "conversion/garbage.hpp"
#include "conversion/gil.hpp"
#include "conversion/shown.hpp"
#include "conversion/text.hpp"
#include "docstrings.hpp"
#include "log/start_recorder.hpp"
#include "model/export.hpp"
#include "model/model_text.hpp"
#include "session/checks.hpp"
#include "simulation.hpp"
#include "trifinger/joint/reasons.hpp"
#include "trifinger/sim/condition.hpp"
#include "trifinger/sim/variation.hpp"

namespace nb = nanobind;
using namespace nanobind::literals;

namespace trifinger::bindings {
namespace {

using Values = Eigen::VectorXd;
using ShownCheck = Shown<"collections.abc.Callable[[Observation, Action], None]">;

// Returns "OWN_CHECK" for "own_check".
std::string constant_name(std::string_view name) {
  std::string constant(name);
  for (char& letter : constant) letter = static_cast<char>(std::toupper(letter));
  return constant;
}

void bind_reasons(nb::module_& m) {
  nb::enum_<Reason> reasons(m, "Reason", nb::is_flag(), nb::is_arithmetic(), docs::Reason::Reason);
  for (const Reason reason : all_reasons()) {
    reasons.value(constant_name(name_of(reason)).c_str(), reason,
                  std::string(describe(reason)).c_str());
  }
}

// Calls `use` with each row of `Variation::fields()`.
template <class Use>
void for_each_value(const Use& use) {
  std::apply([&use](const auto&... row) { (use(row), ...); }, Variation::fields());
}

using Factors = std::map<std::string, double>;
using FactorsField = VariationField<OfSurfacePairs<double>>;

void bind_variation(nb::module_& m) {
  nb::class_<Variation> variation(
      m, "Variation",
      "How a simulation differs from its configuration in an episode. `Simulation.vary` explains "
      "the numbers.");
  for_each_value([&variation]<class Row>(const Row& row) {
    if constexpr (std::is_same_v<Row, FactorsField>) {
      variation.def_prop_ro(row.name, [value = row.value](const Variation& self) {
        Factors factors;
        for (const SurfacePair pair : all_surface_pairs()) {
          factors.emplace(name_of(pair), (self.*value)[pair]);
        }
        return factors;
      });
    } else {
      variation.def_ro(row.name, row.value);
    }
  });
  variation.def_static(
      "of",
      [](const std::string& condition, std::uint64_t seed) {
        Random random{.seed = seed};
        return draw(condition_from_name(condition), random);
      },
      "condition"_a, "seed"_a,
      "A robot that is \"as documented\", \"as built\" or \"worn\", for `Simulation.vary`; equal "
      "seeds give equal robots.\ndocs/simulation.md says how far its joints, motors, encoders and "
      "tips are from what is documented.\nRaises InvalidArgument for another condition.");
}

std::string signature_of_vary() {
  std::string text = "def vary(self, *";
  const auto add = [&text](const char* name, const char* type, const nb::object& value) {
    text += std::string(", ") + name + ": " + type + " = " + nb::repr(value).c_str();
  };
  for_each_value([&]<class T>(const VariationField<T>& row) {
    if constexpr (std::is_same_v<T, double>) {
      add(row.name, "float", nb::float_(Variation{}.*row.value));
    } else if constexpr (std::is_integral_v<T>) {
      add(row.name, "int", nb::int_(Variation{}.*row.value));
    } else {
      add(row.name, "dict[str, float]", nb::dict());
    }
  });
  return text + ") -> None";
}

Variation to_variation(const nb::kwargs& given) {
  Variation variation;
  std::size_t num_known = 0;
  const auto read = [&](const char* name, auto& value) {
    if (!given.contains(name)) return;
    ++num_known;
    if (nb::try_cast(given[name], value)) return;
    throw nb::type_error((std::string("vary(): ") + name + " is of a wrong type").c_str());
  };
  for_each_value([&]<class Row>(const Row& row) {
    if constexpr (std::is_same_v<Row, FactorsField>) {
      Factors factors;
      read(row.name, factors);
      for (const auto& [pair, factor] : factors) {
        (variation.*row.value)[surface_pair_from_name(pair)] = factor;
      }
    } else {
      read(row.name, variation.*row.value);
    }
  });
  if (num_known != given.size()) {
    throw nb::type_error("vary() got a name that no variation has; see its signature");
  }
  return variation;
}

std::pair<Eigen::Vector3d, Eigen::Vector4d> to_arrays(const ObjectPose& pose) {
  return {Eigen::Vector3d(pose.position.data()), Eigen::Vector4d(pose.orientation.data())};
}

}  // namespace

void bind_simulation(nb::module_& m) {
  // NOLINTNEXTLINE(bugprone-unused-raii): its constructor registers the class.
  nb::class_<Checks>(m, "_Checks", nb::type_slots(garbage_collected<Checks>()));
  bind_reasons(m);
  bind_variation(m);
  nb::class_<PythonSimulation>(
      m, "Simulation", nb::type_slots(garbage_collected<PythonSimulation>()),
      "A simulated robot in this process. Its back-end runs inside the waits of its front-end: no "
      "threads,\ndeterministic, as fast as the physics. simulate() is the short form.\n\nEvery "
      "session begins in the state that the last reset(), place_object(), set_object_velocity() "
      "or\nrestore() has left. During a session they take effect at once.")
      .def(
          "__init__",
          [](PythonSimulation* self, const std::string& config, const Overrides& overrides) {
            new (self) PythonSimulation(load_config(config, overrides));
          },
          "config"_a = "sim", "overrides"_a = nb::dict(),
          "`config` is the name of a configuration that comes with the package, or a file; "
          "`overrides` changes "
          "single\nvalues: {\"fingers.height\": 0.3, \"simulation.seed\": 7}.")
      .def("__repr__",
           [](const PythonSimulation& simulation) {
             return "<Simulation of '" + simulation.name() + "'>";
           })
      .def("connect", &PythonSimulation::connect, nb::kw_only(), "strict"_a = true,
           docs::Simulation::connect)
      .def("reset", &PythonSimulation::reset, "position"_a = nb::none(), "seed"_a = nb::none(),
           "episode"_a = 0, "joints"_a = nb::none(),
           "Resets the simulation: joints at `position` [rad] (default: the configuration's), "
           "objects as they\nare at the start of the configuration, random numbers of `episode` of "
           "`seed` (default: the\nconfiguration's). `joints` are positions of the first hinges and "
           "slides of a robot from a file, driven or\nnot; NaN: as always.")
      .def("vary", &PythonSimulation::vary, "variation"_a,
           "Makes the simulation differ from its configuration as `variation` says.")
      .def(
          "vary",
          [](const PythonSimulation& simulation, const nb::kwargs& values) {
            simulation.vary(to_variation(values));
          },
          nb::sig(signature_of_vary().c_str()),
          "Makes the simulation differ from its configuration from now on. A reset does not change "
          "this.\ndocs/simulation.md explains every number, and names the pairs of surfaces for "
          "which `pair_friction` has\nadditional factors, as in {\"tip_object\": 0.8}.")
      .def(
          "place_object", &PythonSimulation::place_object, "name"_a, "position"_a,
          "orientation"_a = std::vector<double>{1.0, 0.0, 0.0, 0.0},
          also(docs::SimulatedRobot::place_object,
               R"(The pose is `position` x, y, z [m] and `orientation`, a quaternion w, x, y, z.)"))
      .def("set_object_velocity", &PythonSimulation::set_object_velocity, "name"_a, "linear"_a,
           "angular"_a = std::vector<double>{0.0, 0.0, 0.0},
           docs::SimulatedRobot::set_object_velocity)
      .def("push_object", &PythonSimulation::push_object, "name"_a, "force"_a,
           docs::SimulatedRobot::push_object)
      .def(
          "pull",
          [](const PythonSimulation& simulation,
             const std::variant<std::int64_t, std::string>& body, const Vector3& target,
             const Vector3& point,
             double stiffness) { simulation.pull(body, to_pull(target, point, stiffness)); },
          "body"_a, "target"_a, nb::kw_only(), "point"_a = zeros(),
          "stiffness"_a = Pull{}.stiffness,
          also(
              docs::SimulatedRobot::pull,
              R"(`body` is a name or a number in `bodies`, `target` is in the world frame [m], `point` is where
the spring is fixed, from the centre of the tip or object, in the axes of its body [m], and
`stiffness` is above 0 and at most 5000 [N/m].)"))
      .def("let_go", &PythonSimulation::let_go, docs::SimulatedRobot::let_go)
      .def_prop_ro("bodies", &PythonSimulation::bodies, docs::pullable_bodies)
      .def(
          "object_velocity",
          [](const PythonSimulation& simulation, const std::string& name) {
            const ObjectVelocity velocity = simulation.object_velocity(name);
            return std::pair(Eigen::Vector3d(velocity.linear.data()),
                             Eigen::Vector3d(velocity.angular.data()));
          },
          "name"_a, docs::SimulatedRobot::object_velocity)
      .def(
          "object_pose",
          [](const PythonSimulation& simulation, const std::string& name) {
            return to_arrays(simulation.object_pose(name));
          },
          "name"_a, docs::SimulatedRobot::object_pose)
      .def(
          "observed_object_pose",
          [](const PythonSimulation& simulation, const std::string& name) {
            return to_arrays(simulation.observed_object_pose(name));
          },
          "name"_a, docs::SimulatedRobot::observed_object_pose)
      .def("save", &PythonSimulation::save, docs::SimulatedRobot::save)
      .def("restore", &PythonSimulation::restore, "state"_a, docs::SimulatedRobot::restore)
      .def("state_before_divergence", &PythonSimulation::state_before_divergence,
           docs::SimulatedRobot::state_before_divergence)
      .def(
          "configuration",
          [](const PythonSimulation& simulation) {
            const std::vector<double> values = simulation.configuration();
            return Values(
                Eigen::Map<const Values>(values.data(), static_cast<Eigen::Index>(values.size())));
          },
          docs::SimulatedRobot::configuration)
      .def("add_check", &PythonSimulation::add_check, "function"_a,
           nb::sig("def add_check(self, function: collections.abc.Callable[[Observation, Action], "
                   "None]) -> None"),
           "Adds a safety check of your own; call it between sessions. `function(observation, "
           "action)` changes\nthe action in place. The robot's own limits are checked after it. An "
           "exception ends the session with\na fault that has the exception's text. Ctrl-C is no "
           "fault: KeyboardInterrupt reaches the program\nthat waits for the robot.")
      .def(
          "record",
          [](const PythonSimulation& simulation, const ShownPath& folder,
             const std::string& precision, const std::string& images) {
            return simulation.record(to_path(folder), precision, images);
          },
          "folder"_a, nb::kw_only(), "precision"_a = "double", "images"_a = "jpeg",
          "Records every session from the next one on, without loss, into a file in `folder`. The "
          "precision\n\"single\" takes half of the space. `images` says what is kept of images: "
          "\"jpeg\", \"raw\" or \"none\".")
      .def("mjcf", &PythonSimulation::mjcf, "The scene in MuJoCo's format.");

  m.def(
      "simulate",
      [](const std::string& config, const Overrides& overrides, bool strict,
         const ShownPath& record, const nb::typed<nb::iterable, ShownCheck>& checks) {
        PythonSimulation simulation(load_config(config, overrides));
        for (const nb::handle check : checks) simulation.add_check(nb::borrow(check));
        if (!record.is_none())
          static_cast<void>(simulation.record(to_path(record), "double", "jpeg"));
        return simulation.connect(strict);
      },
      "config"_a = "sim", "overrides"_a = nb::dict(), nb::kw_only(), "strict"_a = true,
      "record"_a = nb::none(), "checks"_a = nb::tuple(),
      also(docs::simulate,
           R"(`record` is the folder for a log. `checks` are safety checks of your own, see
Simulation.add_check().)"));

  m.def(
      "export_mjcf",
      [](const std::string& config, const Overrides& overrides) {
        return make_model(load_config(config, overrides).simulation)->mjcf();
      },
      "config"_a = "sim", "overrides"_a = nb::dict(), docs::export_mjcf);
  m.def(
      "export_urdf",
      [](const std::string& config, const Overrides& overrides) {
        return export_urdf(description_of(load_config(config, overrides)));
      },
      "config"_a = "sim", "overrides"_a = nb::dict(), docs::export_urdf);
  m.def(
      "checked_model_text", [](const std::string& text) { return checked_model_text(text); },
      "text"_a, nb::call_guard<nb::gil_scoped_release>(), docs::checked_model_text);
}

}  // namespace trifinger::bindings
