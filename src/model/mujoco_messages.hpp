// SPDX-License-Identifier: BSD-3-Clause
#pragma once

namespace trifinger {

/// Keeps MuJoCo from writing MUJOCO_LOG.TXT into the working directory and from ending the process:
/// a warning is dropped, because its counter in `mjData` shows it, and an error is thrown as Error.
/// Handlers that the program has set itself stay. This is done before any model is made.
void silence_mujoco();

}  // namespace trifinger
