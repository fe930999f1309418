// SPDX-License-Identifier: BSD-3-Clause
#include "damage_list.hpp"

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <iterator>
#include <utility>

namespace trifinger::mcap {
namespace {

constexpr std::size_t kMaxNumDamages = 1000;

}  // namespace

void add_damage(std::vector<Damage>& damage, Damage added) {
  const auto& [offset, size, reason] = added;
  const auto next = std::ranges::upper_bound(damage, offset, {}, &Damage::offset);
  if (next != damage.begin()) {
    Damage& before = *std::prev(next);
    if (before.offset + before.size == offset && before.reason == reason) {
      before.size += size;
      return;
    }
  }
  if (damage.size() < kMaxNumDamages) {
    damage.insert(next, std::move(added));
    return;
  }
  Damage& neighbour = next == damage.begin() ? *next : *std::prev(next);
  const std::uint64_t begin = std::min(neighbour.offset, offset);
  const std::uint64_t end = std::max(neighbour.offset + neighbour.size, offset + size);
  neighbour = {.offset = begin,
               .size = end - begin,
               .reason = "There is much damage from here on; some is not named."};
}

}  // namespace trifinger::mcap
