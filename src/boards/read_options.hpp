// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "boards/board_robot.hpp"
#include "can/bus.hpp"
#include "joint/counted_driver.hpp"
#include "trifinger/config/node.hpp"

namespace trifinger::boards {

/// What the boards of a robot are connected to.
enum class BusKind : std::uint8_t {
  kSocketCan,  ///< CAN interfaces of this machine.
  kEmulated,   ///< Buses to an emulator in another process of this user.
};

/// The methods of homing, by the words of configurations.
[[nodiscard]] const std::vector<std::pair<std::string_view, HomingMethod>>& homing_methods();

/// Reads the section `boards` of a configuration. `robot` is all that other sections say of the
/// robot. If its joints have names, the section says by name what belongs to a joint; otherwise it
/// has lists, as in config/trifinger_edu_can.yml. The caller calls `validate`.
/// @throws config::ConfigError at the value that is wrong.
[[nodiscard]] BoardRobotOptions read_board_options(const config::Node& section,
                                                   const CountedDriverOptions& robot);

/// Reads `boards.bus`.
/// @throws config::ConfigError
[[nodiscard]] BusKind read_bus_kind(const config::Node& section);

/// The folder of the emulated bus `name` of the robot `robot`, for `can::join_unix_bus`.
[[nodiscard]] std::filesystem::path emulated_bus_folder(const std::string& robot,
                                                        const std::string& name);

/// Opens the bus of each board. `robot` is the robot's name, which emulated buses belong to.
/// @throws can::BusUnavailable, SystemError, TimedOut
[[nodiscard]] std::vector<std::unique_ptr<can::Bus>> open_buses(
    BusKind kind, const std::vector<std::string>& names, const std::string& robot);

}  // namespace trifinger::boards
