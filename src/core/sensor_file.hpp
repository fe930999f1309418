// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>

#include "ipc/shared_memory.hpp"

// The files of sensors in other processes: elements, and payloads beside them. What they have in
// common is who owns them and what a killed owner leaves.
namespace trifinger::detail {

inline constexpr unsigned kOwnerAlone = 0600;

// The names of a sensor's files, in the session folder. Files of robots begin with "trifinger.";
// whoever takes a robot's name removes those. Both throw InvalidArgument for impossible names.
[[nodiscard]] std::string sensor_file(const std::string& robot, const std::string& sensor);
[[nodiscard]] std::string payload_file(const std::string& robot, const std::string& sensor);

// Takes the lock of a file, which its process keeps as long as it lives, and removes the hidden
// names of files that killed processes have left. `what` it is, for the error, is for example
// "sensor 'object' of robot 'sim'". Throws Error if another process has it, SystemError.
[[nodiscard]] ipc::SharedMemory own_sensor_file(const std::string& file, const std::string& what);

// Throws InvalidArgument if the open file belongs to another user: what it says moves the robot.
void require_own_file(const ipc::FileDescriptor& file, const std::string& name);

}  // namespace trifinger::detail
