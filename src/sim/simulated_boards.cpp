// SPDX-License-Identifier: BSD-3-Clause
#include "sim/simulated_boards.hpp"

#include <chrono>
#include <utility>

namespace trifinger {
namespace {

constexpr Nanoseconds kTick = std::chrono::milliseconds(1);

}  // namespace

SimulatedBoards::SimulatedBoards(boards::BoardRobotOptions boards,
                                 const SimulationOptions& simulation, ManualClock& clock)
    : options_(std::move(boards)), clock_(clock), plant_(simulation) {
  make();
}

void SimulatedBoards::pass(Nanoseconds time) noexcept {
  for (Nanoseconds passed{0}; passed < time; passed += kTick) tick();
}

void SimulatedBoards::restart() {
  robot_.reset();
  emulator_.reset();
  buses_.clear();
  make();
}

void SimulatedBoards::add(const boards::EmulatedFault& fault) {
  emulator_->add(fault, clock_.now());
}

DriverReport SimulatedBoards::prepare(TimeIndex step) noexcept {
  tick();
  return robot_->prepare(step);
}

const RobotTypes& SimulatedBoards::description() const noexcept { return robot_->description(); }

DriverReport SimulatedBoards::get_latest_observation(void* observation) noexcept {
  return robot_->get_latest_observation(observation);
}

DriverReport SimulatedBoards::apply_action(const void* desired, void* applied) noexcept {
  const DriverReport report = robot_->apply_action(desired, applied);
  tick();
  return report;
}

DriverReport SimulatedBoards::hold(const void* observation, void* action) noexcept {
  return robot_->hold(observation, action);
}

void SimulatedBoards::cut() noexcept {}

DriverReport SimulatedBoards::stop(TimeIndex step) noexcept {
  tick();
  return robot_->stop(step);
}

std::string_view SimulatedBoards::fault_text(std::int32_t fault_code) const noexcept {
  return robot_->fault_text(fault_code);
}

std::string_view SimulatedBoards::rejection_text() const noexcept {
  return robot_->rejection_text();
}

void SimulatedBoards::make() {
  std::vector<std::unique_ptr<can::Bus>> of_robot;
  std::vector<std::unique_ptr<can::Bus>> of_boards;
  for (std::size_t i = 0; i < options_.interfaces.size(); ++i) {
    buses_.push_back(std::make_unique<can::MemoryBus>(clock_));
    of_robot.push_back(buses_.back()->connect());
    of_boards.push_back(buses_.back()->connect());
  }
  emulator_.emplace(options_, std::move(of_boards), plant_, clock_.now());
  robot_.emplace(options_, std::move(of_robot), clock_);
}

void SimulatedBoards::tick() noexcept {
  clock_.advance(kTick);
  emulator_->tick(clock_.now());
}

}  // namespace trifinger
