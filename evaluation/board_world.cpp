// SPDX-License-Identifier: BSD-3-Clause
#include "evaluation/board_world.hpp"

#include <chrono>
#include <utility>

#include "trifinger/sim/object_observation.hpp"

namespace trifinger::evaluation {

BoardWorld::BoardWorld(const boards::BoardRobotOptions& boards, const SimulationOptions& simulation,
                       ManualClock& clock)
    : SimulatedBoards(boards, simulation, clock), clock_(clock) {
  if (auto objects = object_companion(simulation.description.objects)) {
    companions_.push_back(std::move(*objects));
  }
}

DriverReport BoardWorld::prepare(TimeIndex step) noexcept {
  const DriverReport report = SimulatedBoards::prepare(step);
  if (report.state == DriverReport::State::kReady) plant().reset_objects();
  return report;
}

std::span<const CompanionDescription> BoardWorld::companions() const noexcept {
  return companions_;
}

bool BoardWorld::get_companion_element(std::size_t, TimeIndex time_index, void* element) noexcept {
  const Instant now = clock_.now();
  if (std::exchange(seen_, now) == now) return false;
  const auto* const seen = plant().receive_poses();
  if (seen == nullptr) return false;
  const std::chrono::milliseconds age(plant().step_count() - seen->capture_index);
  const Stamp stamp{.arrival_index = time_index,
                    .capture_index = Stamp::kFromTime,
                    .arrival_time = 0,
                    .capture_time = (now - age).time_since_epoch().count()};
  write_objects(stamp, seen->objects, static_cast<std::byte*>(element));
  return true;
}

}  // namespace trifinger::evaluation
