// SPDX-License-Identifier: BSD-3-Clause
#include "self_contained.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <limits>
#include <map>
#include <utility>
#include <vector>

#include "spec.hpp"
#include "trifinger/base/error.hpp"

namespace trifinger::detail {
namespace {

// A mesh that only looks keeps details down to this part of its size: half a pixel on a screen that
// it fills.
constexpr double kDetail = 1.0 / 512;
// Meshes with fewer triangles are left as they are.
constexpr int kFewFaces = 1000;

using Vertex = std::array<double, 3>;

struct Triangles {
  std::vector<float> vertices;
  std::vector<int> faces;
};

// Calls `visit` with each element of a type, together with its number in the compiled model.
template <class Visit>
void for_each_element(mjSpec* spec, mjtObj type, const Visit& visit) {
  // A visit may remove elements, which changes the numbers of the others.
  std::vector<std::pair<mjsElement*, int>> elements;
  for (mjsElement* element = mjs_firstElement(spec, type); element != nullptr;
       element = mjs_nextElement(spec, element)) {
    elements.emplace_back(element, mjs_getId(element));
  }
  for (const auto& [element, id] : elements) visit(element, id);
}

// The vertices of a mesh as they were in its file, but scaled: the compiler has moved them.
std::vector<Vertex> vertices_of(const mjModel& model, int mesh) {
  std::vector<Vertex> vertices(static_cast<std::size_t>(model.mesh_vertnum[mesh]));
  for (std::size_t i = 0; i < vertices.size(); ++i) {
    const std::size_t first = 3 * (static_cast<std::size_t>(model.mesh_vertadr[mesh]) + i);
    Vertex moved{};
    std::copy_n(model.mesh_vert + first, moved.size(), moved.begin());
    mju_rotVecQuat(vertices[i].data(), moved.data(), model.mesh_quat + 4 * mesh);
    mju_addTo3(vertices[i].data(), model.mesh_pos + 3 * mesh);
  }
  return vertices;
}

// Joins vertices in the same cell of a grid, and leaves out triangles that become lines. Files
// often have each corner once for each triangle at it. Cells of size 0 join equal vertices only.
Triangles joined(const mjModel& model, int mesh, double cell) {
  const std::vector<Vertex> vertices = vertices_of(model, mesh);
  const auto cell_of = [cell](const Vertex& vertex) {
    Vertex place = vertex;
    if (cell > 0.0) {
      for (double& value : place) value = std::round(value / cell);
    } else {
      // The compiler's rotation leaves errors of rounding, which differ from vertex to vertex.
      for (double& value : place) value = static_cast<double>(static_cast<float>(value));
    }
    return place;
  };
  Triangles triangles;
  std::map<Vertex, int> numbers;
  std::vector<int> renumbered;
  renumbered.reserve(vertices.size());
  for (const Vertex& vertex : vertices) {
    const auto [found, is_new] =
        numbers.emplace(cell_of(vertex), static_cast<int>(triangles.vertices.size() / 3));
    renumbered.push_back(found->second);
    if (!is_new) continue;
    for (const double value : vertex) triangles.vertices.push_back(static_cast<float>(value));
  }
  for (int i = 0; i < model.mesh_facenum[mesh]; ++i) {
    std::array<int, 3> face{};
    for (std::size_t corner = 0; corner < face.size(); ++corner) {
      const std::size_t index = 3 * static_cast<std::size_t>(model.mesh_faceadr[mesh] + i) + corner;
      face[corner] = renumbered[static_cast<std::size_t>(model.mesh_face[index])];
    }
    if (face[0] == face[1] || face[1] == face[2] || face[2] == face[0]) continue;
    triangles.faces.insert(triangles.faces.end(), face.begin(), face.end());
  }
  return triangles;
}

// True for each mesh that something may touch.
std::vector<bool> touched_meshes(const mjModel& model) {
  std::vector<bool> touched(static_cast<std::size_t>(model.nmesh), false);
  const auto touch = [&](int geom) {
    const int type = model.geom_type[geom];
    if ((type == mjGEOM_MESH || type == mjGEOM_SDF) && model.geom_dataid[geom] >= 0) {
      touched[static_cast<std::size_t>(model.geom_dataid[geom])] = true;
    }
  };
  for (int geom = 0; geom < static_cast<int>(model.ngeom); ++geom) {
    if (model.geom_contype[geom] != 0 || model.geom_conaffinity[geom] != 0) touch(geom);
  }
  for (int pair = 0; pair < static_cast<int>(model.npair); ++pair) {
    touch(model.pair_geom1[pair]);
    touch(model.pair_geom2[pair]);
  }
  return touched;
}

double size_of_mesh(const mjModel& model, int mesh) {
  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  Vertex least{kInfinity, kInfinity, kInfinity};
  Vertex most{-kInfinity, -kInfinity, -kInfinity};
  for (const Vertex& vertex : vertices_of(model, mesh)) {
    for (std::size_t axis = 0; axis < 3; ++axis) {
      least[axis] = std::min(least[axis], vertex[axis]);
      most[axis] = std::max(most[axis], vertex[axis]);
    }
  }
  return std::max({most[0] - least[0], most[1] - least[1], most[2] - least[2]});
}

void put_meshes_into_text(mjSpec* spec, const mjModel& model, bool is_coarse) {
  const std::vector<bool> touched = touched_meshes(model);
  for_each_element(spec, mjOBJ_MESH, [&](mjsElement* element, int id) {
    mjsMesh* const old = mjs_asMesh(element);
    const bool may_change =
        is_coarse && !touched[static_cast<std::size_t>(id)] && model.mesh_facenum[id] >= kFewFaces;
    const double cell = may_change ? kDetail * size_of_mesh(model, id) : 0.0;
    const Triangles triangles = joined(model, id, cell);
    // The old mesh would remember what the compiler has read from its file.
    const std::string name = mj_id2name(&model, mjOBJ_MESH, id);
    mjs_setName(element, (name + " from its file").c_str());
    mjsMesh* const mesh = mjs_addMesh(spec, nullptr);
    mjs_setName(mesh->element, name.c_str());
    mesh->inertia = old->inertia;
    mesh->smoothnormal = old->smoothnormal;
    mesh->needsdf = old->needsdf;
    mesh->maxhullvert = old->maxhullvert;
    mjs_setString(mesh->material, mjs_getString(old->material));
    std::ranges::fill(mesh->scale, 1.0);
    mjs_setFloat(mesh->uservert, triangles.vertices.data(),
                 static_cast<int>(triangles.vertices.size()));
    mjs_setInt(mesh->userface, triangles.faces.data(), static_cast<int>(triangles.faces.size()));
    mjs_delete(spec, element);
  });
  for_each_element(spec, mjOBJ_HFIELD, [&](mjsElement* element, int id) {
    mjsHField* const field = mjs_asHField(element);
    field->nrow = model.hfield_nrow[id];
    field->ncol = model.hfield_ncol[id];
    mjs_setString(field->file, "");
    mjs_setString(field->content_type, "");
    mjs_setFloat(field->userdata, model.hfield_data + model.hfield_adr[id],
                 field->nrow * field->ncol);
  });
}

// The mean colour of a texture, from 0 to 1.
std::array<float, 3> mean_colour(const mjModel& model, int texture) {
  std::array<double, 3> sum{};
  const auto channels = static_cast<std::size_t>(model.tex_nchannel[texture]);
  const std::size_t pixels = static_cast<std::size_t>(model.tex_width[texture]) *
                             static_cast<std::size_t>(model.tex_height[texture]);
  const mjtByte* const first = model.tex_data + model.tex_adr[texture];
  for (std::size_t i = 0; i < pixels; ++i) {
    for (std::size_t channel = 0; channel < 3; ++channel) {
      sum[channel] += first[i * channels + std::min(channel, channels - 1)];
    }
  }
  std::array<float, 3> mean{1.0F, 1.0F, 1.0F};
  for (std::size_t channel = 0; pixels > 0 && channel < 3; ++channel) {
    mean[channel] = static_cast<float>(sum[channel] / (255.0 * static_cast<double>(pixels)));
  }
  return mean;
}

// Removes textures; materials get their mean colour. Skins have no place in a text of this kind.
void replace_pictures(mjSpec* spec, const mjModel& model) {
  for_each_element(spec, mjOBJ_MATERIAL, [&](mjsElement* element, int id) {
    mjsMaterial* const material = mjs_asMaterial(element);
    for (int role = 0; role < mjNTEXROLE; ++role) {
      const int texture = model.mat_texid[mjNTEXROLE * id + role];
      if (texture < 0) continue;
      if (role == mjTEXROLE_USER || role == mjTEXROLE_RGB || role == mjTEXROLE_RGBA) {
        const std::array<float, 3> mean = mean_colour(model, texture);
        for (std::size_t channel = 0; channel < 3; ++channel) {
          material->rgba[channel] *= mean[channel];
        }
      }
      mjs_setInStringVec(material->textures, role, "");
    }
  });
  for_each_element(spec, mjOBJ_TEXTURE,
                   [&](mjsElement* element, int) { mjs_delete(spec, element); });
  for_each_element(spec, mjOBJ_SKIN, [&](mjsElement* element, int) { mjs_delete(spec, element); });
}

// Sorts geoms into groups as viewers here expect: 2 is what one sees, 3 are shapes for collisions
// alone. Group 1, which many files have for what looks, means surroundings here.
void sort_into_groups(mjSpec* spec, const mjModel& model) {
  constexpr int kSeen = 2;
  constexpr int kHidden = 3;
  const auto touches = [&model](int geom) {
    return model.geom_contype[geom] != 0 || model.geom_conaffinity[geom] != 0;
  };
  // A body that has shapes to look at hides those that it touches with.
  std::vector<bool> has_looks(static_cast<std::size_t>(model.nbody), false);
  for (int geom = 0; geom < static_cast<int>(model.ngeom); ++geom) {
    const bool is_shown = model.geom_group[geom] < kHidden && model.geom_rgba[4 * geom + 3] > 0.0F;
    if (is_shown && !touches(geom)) {
      has_looks[static_cast<std::size_t>(model.geom_bodyid[geom])] = true;
    }
  }
  for_each_element(spec, mjOBJ_GEOM, [&](mjsElement* element, int id) {
    mjsGeom* const geom = mjs_asGeom(element);
    if (geom->group >= kHidden) return;
    const bool is_hidden =
        touches(id) && has_looks[static_cast<std::size_t>(model.geom_bodyid[id])];
    geom->group = is_hidden ? kHidden : kSeen;
  });
}

std::string saved(mjSpec* spec) {
  std::array<char, 1000> error{};
  std::string xml(std::size_t{1} << 22U, '\0');
  for (;;) {
    const int result = mj_saveXMLString(spec, xml.data(), static_cast<int>(xml.size()),
                                        error.data(), static_cast<int>(error.size()));
    if (result == 0) break;
    // Otherwise it is the number of characters that there must be room for.
    if (result < 0 || static_cast<std::size_t>(result) < xml.size()) {
      throw Error("MuJoCo cannot write the model: " + std::string(error.data()));
    }
    xml.assign(static_cast<std::size_t>(result) + 1, '\0');
  }
  xml.resize(xml.find('\0'));
  return xml;
}

}  // namespace

std::string self_contained_mjcf(const mjSpec& spec, const mjModel& model) {
  std::string problem;
  // If a coarse mesh is no body any more, such as a thin foil, all meshes are kept whole.
  for (const bool is_coarse : {true, false}) {
    const Spec copy(mj_copySpec(&spec));
    if (copy == nullptr) throw Error("MuJoCo cannot copy the model");
    put_meshes_into_text(copy.get(), model, is_coarse);
    replace_pictures(copy.get(), model);
    sort_into_groups(copy.get(), model);
    // Bodies keep the inertia that they have, whatever has become of their meshes.
    copy->compiler.saveinertial = true;
    mjs_setString(copy->compiler.meshdir, "");
    mjs_setString(copy->compiler.texturedir, "");
    const SceneModel::Compiled compiled(mj_compile(copy.get(), nullptr));
    if (compiled != nullptr) return saved(copy.get());
    problem = mjs_getError(copy.get());
  }
  throw Error("MuJoCo refuses the model without its files: " + problem);
}

}  // namespace trifinger::detail
