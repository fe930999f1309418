// SPDX-License-Identifier: BSD-3-Clause
#include "find_meshes.hpp"

#include <system_error>

namespace trifinger::detail {
namespace {

namespace fs = std::filesystem;

// Empty if there is none.
fs::path find_end(const fs::path& path, const fs::path& folder) {
  std::error_code ignored;
  for (auto first = path.begin(); first != path.end(); ++first) {
    fs::path found = folder;
    for (auto part = first; part != path.end(); ++part) found /= *part;
    if (fs::is_regular_file(found, ignored)) return found;
  }
  return {};
}

}  // namespace

void find_meshes(mjSpec* spec, const fs::path& folder) {
  // Messages about a mesh that is not there name the folder.
  mjs_setString(spec->compiler.meshdir, folder.c_str());
  for (mjsElement* element = mjs_firstElement(spec, mjOBJ_MESH); element != nullptr;
       element = mjs_nextElement(spec, element)) {
    mjString* const file = mjs_asMesh(element)->file;
    const fs::path found = find_end(mjs_getString(file), folder);
    if (!found.empty()) mjs_setString(file, found.c_str());
  }
}

}  // namespace trifinger::detail
