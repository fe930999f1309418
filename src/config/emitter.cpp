// SPDX-License-Identifier: BSD-3-Clause
#include <yaml-cpp/emitter.h>
#include <yaml-cpp/emittermanip.h>

#include <algorithm>

#include "element.hpp"

namespace trifinger::config::detail {
namespace {

void emit(YAML::Emitter& out, const Element& element) {
  switch (element.kind) {
    case Element::Kind::kNull:
      out << YAML::Null;
      break;
    case Element::Kind::kScalar:
      if (element.quoted) out << YAML::DoubleQuoted;
      out << element.scalar;
      break;
    case Element::Kind::kList: {
      const bool is_flat = std::ranges::none_of(
          element.items, [](const Element& item) { return item.kind == Element::Kind::kSection; });
      out << (is_flat ? YAML::Flow : YAML::Block) << YAML::BeginSeq;
      for (const Element& item : element.items) emit(out, item);
      out << YAML::EndSeq;
      break;
    }
    case Element::Kind::kSection:
      out << YAML::Block << YAML::BeginMap;
      for (const Entry& entry : element.entries) {
        out << YAML::Key << entry.key << YAML::Value;
        emit(out, entry.value);
      }
      out << YAML::EndMap;
      break;
  }
}

}  // namespace

std::string yaml_of(const Element& element) {
  YAML::Emitter out;
  emit(out, element);
  return std::string(out.c_str(), out.size()) + "\n";
}

}  // namespace trifinger::config::detail
