// SPDX-License-Identifier: BSD-3-Clause
#include "dynamixel/control_table.hpp"

#include <algorithm>

#include "base/text_of.hpp"

namespace trifinger::dynamixel {

std::string_view name_of(OperatingMode mode) noexcept {
  switch (mode) {
    case OperatingMode::kCurrent:
      return "current";
    case OperatingMode::kVelocity:
      return "velocity";
    case OperatingMode::kPosition:
      return "position";
    case OperatingMode::kExtendedPosition:
      return "extended position";
    case OperatingMode::kCurrentBasedPosition:
      return "current-based position";
    case OperatingMode::kPwm:
      return "PWM";
  }
  return "unknown";
}

bool needs_current(OperatingMode mode) noexcept {
  return mode == OperatingMode::kCurrent || mode == OperatingMode::kCurrentBasedPosition;
}

const Register* register_at(std::span<const Register> table, std::size_t address) noexcept {
  const auto found = std::ranges::find_if(table, [address](const Register& entry) {
    return address >= entry.address && address < entry.end();
  });
  return found == table.end() ? nullptr : &*found;
}

const MotorModel* find_model(std::string_view name) noexcept {
  const auto* const found = std::ranges::find(kMotorModels, name, &MotorModel::name);
  return found == kMotorModels.end() ? nullptr : found;
}

const MotorModel* find_model(std::uint16_t number) noexcept {
  const auto* const found = std::ranges::find(kMotorModels, number, &MotorModel::number);
  return found == kMotorModels.end() ? nullptr : found;
}

bool MotorModel::has(OperatingMode mode) const noexcept {
  return name_of(mode) != "unknown" && (has_current() || !needs_current(mode));
}

std::string names_of_models() { return trifinger::detail::joined(kMotorModels, &MotorModel::name); }

std::vector<Register> control_table_of(const MotorModel& model) {
  std::vector<Register> table(kControlTable.begin(), kControlTable.end());
  for (const Register& own : model.series->registers) {
    const auto place = std::ranges::lower_bound(table, own.address, {}, &Register::address);
    if (place->address == own.address) {
      *place = own;
    } else {
      table.insert(place, own);
    }
  }
  std::erase_if(table, [](const Register& entry) { return entry.size == 0; });
  const auto change = [&table](const Register& which, std::int64_t initial, std::int64_t lowest,
                               std::int64_t highest) {
    const auto entry = std::ranges::find(table, which.address, &Register::address);
    if (entry == table.end()) return;
    entry->initial = initial;
    entry->lowest = lowest;
    entry->highest = highest;
  };
  const auto [low, high] = model.supply_limits;
  change(registers::kModelNumber, model.number, 0, 0);
  change(registers::kMaxVoltageLimit, high, low, high);
  change(registers::kMinVoltageLimit, low, low, high);
  change(registers::kCurrentLimit, model.current_limit, 0, model.current_limit);
  change(registers::kGoalCurrent, 0, -model.current_limit, model.current_limit);
  for (Register& entry : table) {
    if (entry.unit == "A") entry.scale = model.current_unit;
    if (entry.name == registers::kVelocityLimit.name) entry.initial = model.velocity_limit;
  }
  return table;
}

}  // namespace trifinger::dynamixel
