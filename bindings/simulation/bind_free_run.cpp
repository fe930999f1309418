// SPDX-License-Identifier: BSD-3-Clause
#include <nanobind/nanobind.h>
#include <nanobind/stl/map.h>
#include <nanobind/stl/pair.h>
#include <nanobind/stl/vector.h>

#include <cstddef>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include "bindings.hpp"
#include "conversion/gil.hpp"
#include "conversion/numbers.hpp"
#include "conversion/numpy.hpp"
#include "conversion/shown.hpp"
#include "conversion/text.hpp"
#include "sim/free_run.hpp"
#include "simulation.hpp"
#include "trifinger/base/error.hpp"
#include "trifinger/config/file.hpp"

namespace nb = nanobind;
using namespace nanobind::literals;

namespace trifinger::bindings {
namespace {

using JointValuesByName = std::map<std::string, std::vector<double>>;

Identified identified_of(const JointValuesByName& figures) {
  Identified robot;
  std::size_t num_known = 0;
  for (const IdentifiedField& field : Identified::fields()) {
    const auto found = figures.find(field.name);
    if (found == figures.end()) continue;
    robot.*field.value = found->second;
    ++num_known;
  }
  if (num_known != figures.size()) throw InvalidArgument("there is a figure that no robot has");
  return robot;
}

ShownArray run_pieces(const FreeRun& self, const JointValuesByName& figures,
                      const ShownNumbers& position, const ShownNumbers& velocity,
                      const std::vector<std::size_t>& begin, const ShownNumbers& torque,
                      std::size_t lead, std::size_t length) {
  const auto n = static_cast<npy_intp>(self.num_joints());
  const auto count = static_cast<npy_intp>(begin.size());
  const Doubles positions = doubles_of(position, {count, 2, n}, "position");
  const Doubles velocities = doubles_of(velocity, {count, 2, n}, "velocity");
  const Doubles torques = doubles_of(torque, {-1, n}, "torque");
  const Identified robot = identified_of(figures);
  auto [array, memory] = new_array({count, static_cast<npy_intp>(length), n}, NPY_DOUBLE);
  const std::span result(static_cast<double*>(memory), begin.size() * length * self.num_joints());
  {
    const GilRelease release;
    self.run(robot,
             {.position = positions.numbers,
              .velocity = velocities.numbers,
              .begin = begin,
              .torque = torques.numbers,
              .lead = lead,
              .length = length},
             result);
  }
  return nb::borrow<ShownArray>(array);
}

}  // namespace

void bind_free_run(nb::module_& m) {
  nb::class_<FreeRun>(m, "FreeRun",
                      "Moves a simulated robot by the torques of a log, without safety checks, "
                      "objects and contacts:\nwhat it would have measured if it were like this. "
                      "Threads may share one.")
      .def(
          "__init__",
          [](FreeRun* self, const std::string& config, const Overrides& overrides) {
            new (self) FreeRun(load_config(config, overrides).simulation);
          },
          "config"_a, "overrides"_a = nb::dict(),
          "`config` is the name of a configuration that comes with the package, or a file.")
      .def_static(
          "of_text",
          [](const std::string& text) {
            return FreeRun(
                read_robot_config(config::File::parse(text, "configuration.yml")).simulation);
          },
          "configuration"_a,
          "The robot in the text of a configuration, which may name a file of a robot.")
      .def_prop_ro(
          "joints",
          [](const FreeRun& self) {
            nb::list names;
            for (const std::string& name : self.model().joint_names()) names.append(name);
            return nb::typed<nb::list, nb::str>(names);
          },
          "Names of the driven joints.")
      .def_prop_ro(
          "delays",
          [](const FreeRun& self) {
            return std::pair(self.torque_delay(), self.measurement_delay());
          },
          "How late torques and measurements are by the configuration [steps].")
      .def_prop_ro("trees", &FreeRun::trees, "Joints with the same number move each other.")
      .def_prop_ro(
          "described",
          [](const FreeRun& self) {
            JointValuesByName figures;
            for (const IdentifiedField& field : Identified::fields())
              figures[field.name] = self.described(field);
            return figures;
          },
          "What the configuration says of each joint, by the names of `identified` in it.")
      .def("run", &run_pieces, "figures"_a, "position"_a, "velocity"_a, "begin"_a, "torque"_a,
           "lead"_a, "length"_a,
           "Positions that are measured after each step: pieces x `length` x joints. Piece i\n"
           "begins with step `begin[i]` of `torque` (steps x joints), where joints are at\n"
           "`position[i, 1]` and have `velocity[i, 1]`. `lead` steps before it they are at\n"
           "`position[i, 0]` and `velocity[i, 0]`; from there the motors come to where they are\n"
           "in their play. Delays do not count. Raises InvalidArgument.");
}

}  // namespace trifinger::bindings
