// SPDX-License-Identifier: BSD-3-Clause
#include "boards/wear.hpp"

#include <cmath>
#include <cstddef>
#include <cstring>
#include <numbers>
#include <utility>

namespace trifinger::boards {
namespace {

// Half of the movement to and fro that does not count [revolutions]: 20 steps of the encoder.
constexpr double kPlay = 0.001;
// The boards' own limit: one degree.
constexpr double kLargestIndexError = 1.0 / 360.0;

bool is_whole(double revolutions) noexcept {
  return std::abs(revolutions - std::round(revolutions)) <= kLargestIndexError;
}

// Calls `use` with the bytes of each number of `wear`, in the order of an element.
template <class W, class Use>
void for_each_part(W& wear, Use use) {
  use(&wear.starts, sizeof(wear.starts));
  use(&wear.homings, sizeof(wear.homings));
  use(&wear.faults, sizeof(wear.faults));
  for (auto* const values :
       {&wear.powered_time, &wear.revolutions, &wear.work, &wear.squared_current}) {
    use(values->data(), values->size() * sizeof(double));
  }
  use(wear.index_slips.data(), wear.index_slips.size() * sizeof(std::uint64_t));
}

}  // namespace

Wear::Wear(std::size_t joints)
    : powered_time(joints),
      revolutions(joints),
      work(joints),
      squared_current(joints),
      index_slips(joints) {}

ElementDescription Wear::describe(std::size_t joints) {
  std::vector<FieldDescription> fields;
  for (const FieldDescription& field : trifinger::describe<Stamp>().fields()) {
    fields.push_back(field);
    fields.back().name = "stamp." + field.name;
  }
  std::size_t size = sizeof(Stamp);
  const auto add = [&](const char* name, ScalarType type, std::vector<std::size_t> shape,
                       const char* unit = "") {
    fields.push_back(
        {.name = name, .type = type, .shape = std::move(shape), .unit = unit, .offset = size});
    size += fields.back().count() * size_of(type);
  };
  add("starts", ScalarType::kUint64, {});
  add("homings", ScalarType::kUint64, {});
  add("faults", ScalarType::kUint64, {});
  add("powered_time", ScalarType::kFloat64, {joints}, "s");
  add("revolutions", ScalarType::kFloat64, {joints});
  add("work", ScalarType::kFloat64, {joints}, "J");
  add("squared_current", ScalarType::kFloat64, {joints}, "A^2s");
  add("index_slips", ScalarType::kUint64, {joints});
  return ElementDescription(std::move(fields));
}

void Wear::write(const Stamp& stamp, void* element) const noexcept {
  auto* next = static_cast<std::byte*>(element);
  std::memcpy(next, &stamp, sizeof(stamp));
  next += sizeof(stamp);
  for_each_part(*this, [&next](const void* part, std::size_t size) {
    std::memcpy(next, part, size);
    next += size;
  });
}

void Wear::read(const void* element) noexcept {
  const auto* next = static_cast<const std::byte*>(element) + sizeof(Stamp);
  for_each_part(*this, [&next](void* part, std::size_t size) {
    std::memcpy(part, next, size);
    next += size;
  });
}

MotorMeter::Step MotorMeter::measure(const MotorReading& motor, double elapsed,
                                     double torque_constant, double most_revolutions) noexcept {
  Step step{.powered_time = elapsed, .squared_current = motor.amperes * motor.amperes * elapsed};
  if (place_ && std::abs(motor.revolutions - *place_) > most_revolutions) forget(motor);
  if (!place_) place_ = motor.revolutions;
  const double distance = motor.revolutions - *place_;
  if (std::abs(distance) > kPlay) {
    const double travel = distance - std::copysign(kPlay, distance);
    *place_ += travel;
    step.revolutions = std::abs(travel);
    step.work = std::abs(torque_constant * motor.amperes * 2.0 * std::numbers::pi * travel);
  }
  if (motor.index_pulses != pulses_) {
    step.has_slipped = index_ && !is_whole(*motor.index - *index_);
    index_ = motor.index;
    pulses_ = motor.index_pulses;
  }
  return step;
}

}  // namespace trifinger::boards
