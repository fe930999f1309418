// SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <optional>
#include <string>

#include "spec_builder.hpp"

namespace trifinger::detail {
namespace {

Surface surface(const mjsGeom* geom) { return *surface_of(geom->contype, geom->priority); }

}  // namespace

void SpecBuilder::touch(mjsGeom* geom, int own, int meets, int mover) {
  touching_.push_back({geom, mover});
  geom->contype = own;
  geom->conaffinity = meets;
  geom->condim = 3;
  geom->friction[0] = description_.contact.floor_friction;
  geom->friction[1] = 0.005;
  geom->friction[2] = 1e-4;
  // MuJoCo's default of 20 ms lets a dropped cube sink in by 7 mm. A damping ratio above 1 keeps
  // the cube from bouncing. Contacts less than 0.3 mm deep are softer, because sliding objects
  // would rattle otherwise.
  geom->solref[0] = description_.contact.time_constant;
  geom->solref[1] = 1.5;
  constexpr double kYielding[] = {0.2, 0.95, 0.0003, 0.5, 2};
  std::ranges::copy(kYielding, geom->solimp);
}

// Adds explicit pairs for friction that does not result from the friction of two single geoms.
void SpecBuilder::add_pairs() {
  const auto& friction = description_.contact.friction;
  if (friction == OfSurfacePairs<std::optional<double>>{}) return;
  for (std::size_t i = 0; i < touching_.size(); ++i)
    for (std::size_t j = i + 1; j < touching_.size(); ++j) {
      if (!can_meet(touching_[i], touching_[j])) continue;
      const SurfacePair pair = pair_of(surface(touching_[i].geom), surface(touching_[j].geom));
      if (friction[pair]) add_pair(i, j, *friction[pair]);
    }
}

void SpecBuilder::add_pair(std::size_t first, std::size_t second, double friction) {
  const mjsGeom* const one = touching_[first].geom;
  const mjsGeom* const other = touching_[second].geom;
  mjsPair* pair = mjs_addPair(spec_.get(), nullptr);
  mjs_setString(pair->geomname1, contact_name(first).c_str());
  mjs_setString(pair->geomname2, contact_name(second).c_str());
  // All other values are mixed like in MuJoCo. Geoms of equal priority have equal stiffness here.
  const bool is_equal = one->priority == other->priority;
  const mjsGeom* const decides = one->priority >= other->priority ? one : other;
  pair->condim = is_equal ? std::max(one->condim, other->condim) : decides->condim;
  std::ranges::copy(decides->solref, pair->solref);
  std::ranges::copy(decides->solimp, pair->solimp);
  const auto mixed = [&](int kind) {
    return is_equal ? std::max(one->friction[kind], other->friction[kind])
                    : decides->friction[kind];
  };
  const double all[] = {friction, friction, mixed(1), mixed(2), mixed(2)};
  std::ranges::copy(all, pair->friction);
}

// Pairs refer to geoms by name, and most geoms have none. Objects' names never contain a space.
std::string SpecBuilder::contact_name(std::size_t index) {
  mjsElement* const element = touching_[index].geom->element;
  std::string given = mjs_getString(mjs_getName(element));
  if (!given.empty()) return given;
  const std::string made = "part " + std::to_string(index);
  name(element, made);
  return made;
}

// Parts of one finger never meet: they are neighbours, or excluded.
bool SpecBuilder::can_meet(const Touching& one, const Touching& other) {
  return one.mover != other.mover && ((one.geom->contype & other.geom->conaffinity) != 0 ||
                                      (other.geom->contype & one.geom->conaffinity) != 0);
}

std::optional<Surface> surface_of(int contype, int priority) noexcept {
  switch (contype) {
    case kTableBit:
      return Surface::kTable;
    case kBoundaryBit:
      return Surface::kBoundary;
    case kObjectBit:
      return Surface::kObject;
    case kLowerBit:
      return priority == kTipPriority ? Surface::kTip : Surface::kLink;
    case kMiddleBit:
    case kUpperBit:
      return Surface::kLink;
    default:
      return std::nullopt;
  }
}

}  // namespace trifinger::detail
