// SPDX-License-Identifier: BSD-3-Clause
#include "evaluation/board_world.hpp"

#include <chrono>
#include <utility>

#include "trifinger/sim/object_observation.hpp"

namespace trifinger::evaluation {

BoardWorld::BoardWorld(const boards::BoardRobotOptions& boards, const SimulationOptions& simulation)
    : plant_(simulation) {
  std::vector<std::unique_ptr<can::Bus>> of_robot;
  std::vector<std::unique_ptr<can::Bus>> of_boards;
  for (std::size_t i = 0; i < boards.interfaces.size(); ++i) {
    buses_.push_back(std::make_unique<can::MemoryBus>(clock_));
    of_robot.push_back(buses_.back()->connect());
    of_boards.push_back(buses_.back()->connect());
  }
  emulator_.emplace(boards, std::move(of_boards), plant_, clock_.now());
  robot_.emplace(boards, std::move(of_robot), clock_);
  if (auto objects = object_companion(simulation.description.objects)) {
    companions_.push_back(std::move(*objects));
  }
}

void BoardWorld::pass() noexcept {
  clock_.advance(std::chrono::milliseconds(1));
  emulator_->tick(clock_.now());
  is_seen_ = false;
}

DriverReport BoardWorld::prepare(TimeIndex step) noexcept {
  pass();
  const DriverReport report = robot_->prepare(step);
  if (report.state == DriverReport::State::kReady) plant_.reset_objects();
  return report;
}

DriverReport BoardWorld::get_latest_observation(void* observation) noexcept {
  return robot_->get_latest_observation(observation);
}

DriverReport BoardWorld::apply_action(const void* desired, void* applied) noexcept {
  const DriverReport report = robot_->apply_action(desired, applied);
  pass();
  return report;
}

DriverReport BoardWorld::hold(const void* observation, void* action) noexcept {
  return robot_->hold(observation, action);
}

DriverReport BoardWorld::stop(TimeIndex step) noexcept {
  pass();
  return robot_->stop(step);
}

std::span<const CompanionDescription> BoardWorld::companions() const noexcept {
  return companions_;
}

bool BoardWorld::get_companion_element(std::size_t, TimeIndex time_index, void* element) noexcept {
  if (std::exchange(is_seen_, true)) return false;
  const auto* const seen = plant_.receive_poses();
  if (seen == nullptr) return false;
  const std::chrono::milliseconds age(plant_.step_count() - seen->capture_index);
  const Stamp stamp{.arrival_index = time_index,
                    .capture_index = Stamp::kFromTime,
                    .arrival_time = 0,
                    .capture_time = (clock_.now() - age).time_since_epoch().count()};
  write_objects(stamp, seen->objects, static_cast<std::byte*>(element));
  return true;
}

std::string_view BoardWorld::fault_text(std::int32_t fault_code) const noexcept {
  return robot_->fault_text(fault_code);
}

std::string_view BoardWorld::rejection_text() const noexcept { return robot_->rejection_text(); }

}  // namespace trifinger::evaluation
