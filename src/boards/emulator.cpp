// SPDX-License-Identifier: BSD-3-Clause
#include "trifinger/boards/emulator.hpp"

#include <algorithm>
#include <numbers>
#include <utility>

#include "trifinger/base/error.hpp"

namespace trifinger::boards {

template <class R>
Emulator<R>::Emulator(const BoardRobotOptions<R>& wiring,
                      std::vector<std::unique_ptr<can::Bus>> buses, Plant<R>& plant, Instant now,
                      const EmulatedBoardOptions& options)
    : wiring_((wiring.validate(), wiring)), buses_(std::move(buses)), plant_(plant) {
  trifinger::detail::require(buses_.size() == wiring_.names.size(),
                             "every emulated board needs a bus");
  for (std::size_t i = 0; i < buses_.size(); ++i) {
    EmulatedBoardOptions its_options = options;
    // No two encoders are mounted alike, and no two draw the same noise.
    for (std::size_t motor = 0; motor < 2; ++motor) {
      double& place = its_options.index_places[motor];
      place += 0.137 * static_cast<double>(i);
      place -= static_cast<double>(static_cast<int>(place));
    }
    its_options.seed += i;
    boards_.emplace_back(its_options);
  }
  set_power(true, now);
}

template <class R>
void Emulator<R>::set_power(bool is_on, Instant now) noexcept {
  for (std::size_t i = 0; i < boards_.size(); ++i) set_power(i, is_on, now);
}

template <class R>
void Emulator<R>::set_power(std::size_t board, bool is_on, Instant now) noexcept {
  if (is_on) {
    boards_[board].switch_on(now, rotors(board));
  } else {
    boards_[board].switch_off();
  }
}

template <class R>
void Emulator<R>::tick(Instant now) noexcept {
  const double ampere = wiring_.drive.torque_per_ampere();
  typename Plant<R>::Joints torque{};
  for (std::size_t i = 0; i < R::kJoints; ++i) {
    const Terminal& place = wiring_.motors[i];
    if (boards_[place.board].is_aligning(place.number)) {
      torque[i] = holding_torque(i);
      continue;
    }
    aligned_at_[i] = plant_.position()[i];
    torque[i] = wiring_.polarity[i] * ampere * boards_[place.board].currents()[place.number];
  }
  plant_.step(torque);
  for (std::size_t i = 0; i < boards_.size(); ++i) {
    for (const can::Frame& frame : buses_[i]->receive(frames_)) boards_[i].receive(frame, now);
    static_cast<void>(buses_[i]->send(boards_[i].tick(now, rotors(i), analog_inputs(i))));
  }
}

// Currents of alignment hold the rotor where it is.
template <class R>
double Emulator<R>::holding_torque(std::size_t joint) const noexcept {
  constexpr double kStiffness = 20.0;  // [Nm/rad]
  constexpr double kDamping = 0.1;     // [Nms/rad]
  constexpr double kMost = 0.5;        // [Nm]
  const double torque = kStiffness * (aligned_at_[joint] - plant_.position()[joint]) -
                        kDamping * plant_.velocity()[joint];
  return std::clamp(torque, -kMost, kMost);
}

template <class R>
EmulatedBoard::Rotors Emulator<R>::rotors(std::size_t board) const noexcept {
  const auto position = plant_.position();
  const auto velocity = plant_.velocity();
  const double per_angle = wiring_.drive.gear_ratio / (2.0 * std::numbers::pi);
  EmulatedBoard::Rotors rotors{};
  for (std::size_t i = 0; i < R::kJoints; ++i) {
    const Terminal& place = wiring_.motors[i];
    if (place.board != board) continue;
    const double turns = wiring_.polarity[i] * per_angle;
    // From revolutions per second to 1000 revolutions per minute.
    rotors[place.number] = {.revolutions = turns * position[i],
                            .kilo_rpm = turns * velocity[i] * 60.0 / 1000.0};
  }
  return rotors;
}

template <class R>
std::array<double, 2> Emulator<R>::analog_inputs(std::size_t board) const noexcept {
  std::array<double, 2> values{};
  if constexpr (R::kTips > 0) {
    const auto force = plant_.tip_force();
    for (std::size_t i = 0; i < R::kTips; ++i) {
      const Terminal& place = wiring_.tips[i];
      if (place.board != board) continue;
      values[place.number] = wiring_.tip_sensor.zero + force[i] / wiring_.tip_sensor.scale;
    }
  }
  return values;
}

template class Emulator<TriFinger>;
template class Emulator<Finger>;
template class Emulator<TwoJoints>;
template class Emulator<OneJoint>;

}  // namespace trifinger::boards
