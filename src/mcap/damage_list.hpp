// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <vector>

#include "trifinger/mcap/reader.hpp"

namespace trifinger::mcap {

// Adds a piece of damage to a list in the order of the file. Adjacent pieces with one reason become
// one. A long list merges further pieces, because a hostile file could need any amount of memory.
void add_damage(std::vector<Damage>& damage, Damage added);

}  // namespace trifinger::mcap
