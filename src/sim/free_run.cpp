// SPDX-License-Identifier: BSD-3-Clause
#include "sim/free_run.hpp"

#include <mujoco/mujoco.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "trifinger/base/error.hpp"
#include "trifinger/sim/simulator.hpp"

namespace trifinger {
namespace {

SimulationOptions bare(SimulationOptions options) {
  options.description.objects.clear();
  options.description.boundary = false;
  options.identified.torque_delay = 0;
  options.identified.measurement_delay = 0;
  options.condition = Condition::kAsDocumented;
  return options;
}

}  // namespace

FreeRun::FreeRun(SimulationOptions options)
    : torque_delay_(options.identified.torque_delay),
      measurement_delay_(options.identified.measurement_delay),
      options_(bare(std::move(options))),
      model_(make_model(options_)) {}

std::vector<double> FreeRun::described(const IdentifiedField& field) const {
  const std::vector<double>& own = options_.identified.*field.value;
  if (!own.empty()) return own;
  std::vector<double> values(num_joints());
  for (std::size_t i = 0; i < values.size(); ++i) values[i] = model_->described(field.name, i);
  return values;
}

std::vector<int> FreeRun::trees() const {
  // A torque on one joint accelerates those that it moves with.
  const mjModel& model = *model_->mujoco();
  const SceneModel::Data data = model_->make_data();
  model_->reset(*data);
  std::vector<int> trees;
  for (std::size_t i = 0; i < num_joints(); ++i) {
    std::fill_n(data->qvel, model.nv, 0.0);
    model_->set_velocity(i, 1.0, *data);
    const double* const moved = std::find_if(data->qvel, data->qvel + model.nv,
                                             [](double velocity) { return velocity != 0.0; });
    trees.push_back(model.dof_treeid[moved - data->qvel]);
  }
  return trees;
}

void FreeRun::run(const Identified& robot, const LoggedPieces& pieces,
                  std::span<double> position) const {
  const std::size_t n = num_joints();
  const std::size_t count = pieces.begin.size();
  detail::require(pieces.position.size() == count * 2 * n &&
                      pieces.velocity.size() == count * 2 * n &&
                      position.size() == count * pieces.length * n,
                  "each piece of a log needs two positions and velocities of each joint");
  for (const std::size_t begin : pieces.begin) {
    detail::require(begin >= pieces.lead && (begin + pieces.length) * n <= pieces.torque.size(),
                    "a piece of a log is beyond its torques");
  }
  robot.validate(n);

  SimulationOptions options = options_;
  options.identified = robot;
  options.identified.torque_delay = 0;
  options.identified.measurement_delay = 0;
  const SceneModel::Compiled model = model_->copy();
  // The model has the masses and their centres of the configuration already.
  Identified change = robot;
  for (std::size_t i = 0; i < change.link_mass.size(); ++i)
    change.link_mass[i] /= Identified::of(options_.identified.link_mass, i, 1.0);
  for (const auto list :
       {&Identified::link_center_x, &Identified::link_center_y, &Identified::link_center_z})
    for (std::size_t i = 0; i < (change.*list).size(); ++i)
      (change.*list)[i] -= Identified::of(options_.identified.*list, i, 0.0);
  model_->apply(change, *model);
  model->opt.disableflags |= mjDSBL_CONTACT;

  const Simulator simulator(model_, options);
  const SceneModel::Data data = model_->make_data();
  Simulator::State state = simulator.make_state();
  PerJoint<double> torque(n, 0.0);
  // Puts the joints where the motors in their play say that they are.
  const auto place = [&](std::size_t row) {
    for (std::size_t i = 0; i < n; ++i) {
      const double offset = Identified::of(robot.zero_offset, i, 0.0);
      model_->set_position(i, pieces.position[row * n + i] - offset - state.memory.in_play[i],
                           *data);
      model_->set_velocity(i, pieces.velocity[row * n + i] - state.memory.play_speed[i], *data);
    }
  };
  for (std::size_t piece = 0; piece < count; ++piece) {
    const double* const commanded = pieces.torque.data() + pieces.begin[piece] * n;
    const auto move = [&](std::ptrdiff_t step) {
      std::copy_n(commanded + step * static_cast<std::ptrdiff_t>(n), n, torque.begin());
      return simulator.move(torque, *model, *data, state);
    };
    const auto lead = static_cast<std::ptrdiff_t>(pieces.lead);
    simulator.reset(simulator.initial_position(), Random{}, *data, state);
    for (std::size_t i = 0; i < n; ++i) {
      const double push = (commanded - lead * static_cast<std::ptrdiff_t>(n))[i];
      state.memory.in_play[i] = std::copysign(0.5 * Identified::of(robot.backlash, i, 0.0), push);
    }
    place(2 * piece);
    bool is_finite = true;
    for (std::ptrdiff_t step = -lead; step < 0; ++step) is_finite = is_finite && move(step);
    place(2 * piece + 1);
    for (std::size_t step = 0; step < pieces.length; ++step) {
      is_finite = is_finite && move(static_cast<std::ptrdiff_t>(step));
      if (is_finite) simulator.observe(*data, state);
      std::ranges::copy(
          state.observation.position,
          position.begin() + static_cast<std::ptrdiff_t>((piece * pieces.length + step) * n));
    }
  }
}

}  // namespace trifinger
