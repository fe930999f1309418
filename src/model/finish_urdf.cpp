// SPDX-License-Identifier: BSD-3-Clause
#include "finish_urdf.hpp"

#include <algorithm>
#include <array>
#include <map>
#include <set>
#include <string>

namespace trifinger::detail {
namespace {

// MuJoCo sorts what only looks into this group.
constexpr int kVisualGroup = 1;

void colour(mjsGeom& geom, const std::array<float, 4>& colour) {
  constexpr std::array<float, 4> kUsual{0.5F, 0.5F, 0.5F, 1.0F};  // MuJoCo's
  const bool has_own =
      *mjs_getString(geom.material) != '\0' || !std::equal(kUsual.begin(), kUsual.end(), geom.rgba);
  if (!has_own) std::ranges::copy(colour, geom.rgba);
}

// True if nothing asks for the volume of the geom's mesh.
bool is_weightless(const mjsGeom& geom) {
  const mjsBody* const body = mjs_getParent(geom.element);
  return geom.group == kVisualGroup || body->explicitinertial;
}

// Calls `visit` with each geom or mesh.
template <class Visit>
void for_each(mjSpec* spec, mjtObj type, const Visit& visit) {
  for (mjsElement* element = mjs_firstElement(spec, type); element != nullptr;
       element = mjs_nextElement(spec, element)) {
    visit(element);
  }
}

}  // namespace

void finish_urdf(mjSpec* spec, const ForeignModel& source, UrdfCollision collision) {
  std::map<std::string, std::array<float, 4>> colours;  // of meshes
  for_each(spec, mjOBJ_MESH, [&](mjsElement* element) {
    const auto found = source.colour_of(mjs_getString(mjs_asMesh(element)->file));
    if (found) colours[mjs_getString(mjs_getName(element))] = *found;
  });
  std::set<std::string> weighed;  // meshes whose volume somebody asks for
  for_each(spec, mjOBJ_GEOM, [&](mjsElement* element) {
    mjsGeom& geom = *mjs_asGeom(element);
    const bool touches = collision != UrdfCollision::kNone &&
                         (geom.group == kVisualGroup) == (collision == UrdfCollision::kVisual);
    geom.contype = geom.conaffinity = touches ? 1 : 0;
    const std::string mesh = mjs_getString(geom.meshname);
    if (!mesh.empty() && !is_weightless(geom)) weighed.insert(mesh);
    const auto found = colours.find(mesh);
    if (found != colours.end()) colour(geom, found->second);
  });
  for_each(spec, mjOBJ_MESH, [&](mjsElement* element) {
    // A mesh that is open or flat has no volume, but may well have a surface.
    if (weighed.contains(mjs_getString(mjs_getName(element)))) return;
    mjs_asMesh(element)->inertia = mjMESH_INERTIA_SHELL;
  });
}

}  // namespace trifinger::detail
