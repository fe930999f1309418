// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>

#include "trifinger/ipc/file_descriptor.hpp"

namespace trifinger {

/// Claims the right to give users turns on a robot, for as long as the descriptor is open. It is a
/// lock in the robot's own lock file, so only who may drive the robot can have it. It ends with its
/// process, whatever happens. Returns no descriptor if there is no such file, because the robot has
/// never run.
/// @throws Error if another has it, InvalidArgument, SystemError
[[nodiscard]] ipc::FileDescriptor claim_turn(const std::string& robot);

}  // namespace trifinger
