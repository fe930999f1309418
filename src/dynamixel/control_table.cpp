// SPDX-License-Identifier: BSD-3-Clause
#include "dynamixel/control_table.hpp"

#include <algorithm>

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

const Register* find_register(std::string_view name) noexcept {
  const auto* const found = std::ranges::find(kControlTable, name, &Register::name);
  return found == kControlTable.end() ? nullptr : found;
}

const Register* register_at(std::size_t address) noexcept {
  const auto* const found = std::ranges::find_if(kControlTable, [address](const Register& entry) {
    return address >= entry.address && address < entry.end();
  });
  return found == kControlTable.end() ? nullptr : found;
}

const MotorModel* find_model(std::string_view name) noexcept {
  const auto* const found = std::ranges::find(kMotorModels, name, &MotorModel::name);
  return found == kMotorModels.end() ? nullptr : found;
}

const MotorModel* find_model(std::uint16_t number) noexcept {
  const auto* const found = std::ranges::find(kMotorModels, number, &MotorModel::number);
  return found == kMotorModels.end() ? nullptr : found;
}

}  // namespace trifinger::dynamixel
