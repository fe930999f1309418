// SPDX-License-Identifier: BSD-3-Clause
#include "trifinger/core/description.hpp"

#include <charconv>
#include <functional>
#include <numeric>
#include <set>

#include "trifinger/base/error.hpp"

namespace trifinger {
namespace {

constexpr std::array<std::string_view, 10> kScalarNames{
    "int8", "uint8", "int16", "uint16", "int32", "uint32", "int64", "uint64", "float32", "float64"};
constexpr std::array<std::size_t, 10> kScalarSizes{1, 1, 2, 2, 4, 4, 8, 8, 4, 8};  // [bytes]

// One line of ElementDescription::text(): "NAME TYPE[SHAPE] UNIT". Shape and unit are optional.
FieldDescription parse_field(std::string_view line) {
  const auto malformed = [line] {
    return InvalidArgument("not the description of a field: '" + std::string(line) + "'");
  };
  const std::size_t end_of_name = line.find(' ');
  if (end_of_name == std::string_view::npos || end_of_name == 0) throw malformed();
  FieldDescription field;
  field.name = line.substr(0, end_of_name);
  std::string_view type = line.substr(end_of_name + 1);
  if (const std::size_t end_of_type = type.find(' '); end_of_type != std::string_view::npos) {
    field.unit = type.substr(end_of_type + 1);
    type = type.substr(0, end_of_type);
  }

  std::string_view shape;
  if (const std::size_t bracket = type.find('['); bracket != std::string_view::npos) {
    if (type.back() != ']') throw malformed();
    shape = type.substr(bracket + 1, type.size() - bracket - 2);
    type = type.substr(0, bracket);
  }
  while (!shape.empty()) {
    std::size_t length = 0;
    const auto [end, error] = std::from_chars(shape.data(), shape.data() + shape.size(), length);
    constexpr std::size_t kMaxLength = std::size_t{1} << 30U;
    if (error != std::errc{} || length == 0 || length > kMaxLength / field.count()) {
      throw malformed();
    }
    field.shape.push_back(length);
    shape.remove_prefix(static_cast<std::size_t>(end - shape.data()));
    if (!shape.empty() && shape.front() != ',') throw malformed();
    if (!shape.empty()) shape.remove_prefix(1);
  }

  for (std::size_t i = 0; i < kScalarNames.size(); ++i) {
    if (kScalarNames[i] == type) {
      field.type = static_cast<ScalarType>(i);
      return field;
    }
  }
  throw malformed();
}

}  // namespace

std::string_view name_of(ScalarType type) noexcept {
  return kScalarNames[static_cast<std::size_t>(type)];
}

std::size_t size_of(ScalarType type) noexcept {
  return kScalarSizes[static_cast<std::size_t>(type)];
}

std::size_t FieldDescription::count() const noexcept {
  return std::accumulate(shape.begin(), shape.end(), std::size_t{1}, std::multiplies<>{});
}

ElementDescription::ElementDescription(std::vector<FieldDescription> fields)
    : fields_(std::move(fields)) {
  std::set<std::string_view> names;
  for (const FieldDescription& field : fields_) {
    if (field.offset != size_) {
      throw InvalidArgument("field '" + field.name + "' begins at byte " +
                            std::to_string(field.offset) + ", expected " + std::to_string(size_) +
                            ": list the fields in the order of their declaration, without gaps");
    }
    if (!names.insert(field.name).second) {
      throw InvalidArgument("two fields are called '" + field.name + "'");
    }
    if (field.name.empty() || field.name.find_first_of(" \n") != std::string::npos ||
        field.unit.find('\n') != std::string::npos) {
      throw InvalidArgument("'" + field.name + "' cannot be the name of a field");
    }
    size_ += field.count() * size_of(field.type);
  }
}

ElementDescription ElementDescription::parse(std::string_view text) {
  const std::string_view whole = text;
  std::vector<FieldDescription> fields;
  std::size_t offset = 0;
  while (!text.empty()) {
    const std::size_t end = text.find('\n');
    fields.push_back(parse_field(text.substr(0, end)));
    fields.back().offset = offset;
    offset += fields.back().count() * size_of(fields.back().type);
    text.remove_prefix(end == std::string_view::npos ? text.size() : end + 1);
  }
  ElementDescription description(std::move(fields));
  if (description.text() != whole) {
    throw InvalidArgument("not the description of an element: '" + std::string(whole) + "'");
  }
  return description;
}

const FieldDescription* ElementDescription::find(std::string_view name) const noexcept {
  for (const FieldDescription& field : fields_) {
    if (field.name == name) return &field;
  }
  return nullptr;
}

std::string ElementDescription::text() const {
  std::string text;
  for (const FieldDescription& field : fields_) {
    text.append(field.name).append(" ").append(name_of(field.type));
    for (std::size_t i = 0; i < field.shape.size(); ++i) {
      text.append(i == 0 ? "[" : ",").append(std::to_string(field.shape[i]));
    }
    if (!field.shape.empty()) text.append("]");
    if (!field.unit.empty()) text.append(" ").append(field.unit);
    text.append("\n");
  }
  return text;
}

}  // namespace trifinger
