// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "trifinger/core/frontend.hpp"
#include "trifinger/core/session.hpp"

namespace trifinger {

// The action that holds the joints of a robot where they are.
// Throws InvalidArgument if the elements of the session have no positions of joints.
[[nodiscard]] HoldAction hold_action_of(const Session& session);

}  // namespace trifinger
