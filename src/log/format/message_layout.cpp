// SPDX-License-Identifier: BSD-3-Clause
#include "log/message_layout.hpp"

#include <algorithm>
#include <array>
#include <bit>
#include <cstddef>
#include <cstring>
#include <map>
#include <set>
#include <utility>

#include "log/format/format.hpp"
#include "log/format/ros_messages.hpp"
#include "log/format/text.hpp"
#include "trifinger/base/error.hpp"

namespace trifinger::log {

using namespace detail;

namespace {

static_assert(std::endian::native == std::endian::little, "messages are copies of memory");

constexpr std::string_view kPackage = "trifinger_msgs";
// More nested fields than anybody needs, and few enough for the stack.
constexpr std::size_t kMaxDepth = 32;
// CDR encapsulation header: plain, little endian, no options.
constexpr std::array<std::byte, kCdrHeaderSize> kCdrHeader{std::byte{0}, std::byte{1}, std::byte{0},
                                                           std::byte{0}};

// Converts "object_observation" to "ObjectObservation".
std::string camel_case(std::string_view words) {
  std::string name;
  bool is_first_of_word = true;
  for (const char c : words) {
    if (!is_lower(c) && !is_upper(c) && !is_digit(c)) {
      is_first_of_word = true;
      continue;
    }
    name += is_first_of_word && is_lower(c) ? static_cast<char>(c - 'a' + 'A') : c;
    is_first_of_word = false;
  }
  return name;
}

void require_message_name(std::string_view name) {
  const bool is_valid =
      !name.empty() && is_upper(name.front()) &&
      std::ranges::all_of(name, [](char c) { return is_lower(c) || is_upper(c) || is_digit(c); });
  if (!is_valid) {
    throw InvalidArgument("'" + std::string(name) +
                          "' cannot name a message in a log: it must begin with a letter, then "
                          "letters and digits");
  }
}

void require_field_name(std::string_view name) {
  const bool is_valid =
      !name.empty() && is_lower(name.front()) && name.back() != '_' &&
      name.find("__") == std::string_view::npos &&
      std::ranges::all_of(name, [](char c) { return is_lower(c) || is_digit(c) || c == '_'; });
  if (!is_valid) {
    throw InvalidArgument("'" + std::string(name) +
                          "' cannot name a field in a log: ROS 2 allows lower-case letters, digits "
                          "and single underscores between them");
  }
}

ScalarType stored(ScalarType type, Precision precision) noexcept {
  return precision == Precision::kSingle && type == ScalarType::kFloat64 ? ScalarType::kFloat32
                                                                         : type;
}

// Writes the definition of a message and of the messages inside it.
class DefinitionWriter {
 public:
  explicit DefinitionWriter(Precision precision) : precision_(precision) {}

  // Returns the whole text: the message itself, then the messages that it uses.
  std::string write(std::string_view type, const std::vector<MessagePart>& parts) {
    names_.emplace(type);
    std::string text;
    std::set<std::string_view> own_fields;
    for (const MessagePart& part : parts) {
      if (part.name.empty()) {
        text += fields(type, part.element.fields(), 0, 0, own_fields);
        continue;
      }
      require_field_name(part.name);
      require_message_name(part.type);
      require_new(part.name, own_fields);
      // Two parts of one type share its definition.
      const auto [known, is_new] = part_types_.emplace(part.type, &part.element);
      if (!is_new && *known->second != part.element) {
        throw InvalidArgument("two parts of a message are called '" + part.type +
                              "' and have different fields");
      }
      if (is_new) define(part.type, part.element.fields(), 0, 1);
      text += part.type + " " + part.name + "\n";
    }
    return text + used_;
  }

 private:
  using Fields = std::span<const FieldDescription>;

  static void require_new(std::string_view name, std::set<std::string_view>& names) {
    if (names.insert(name).second) return;
    throw InvalidArgument("two fields of a message are called '" + std::string(name) + "'");
  }

  // Returns the lines of `fields`. The names are read from position `begin` on.
  std::string fields(std::string_view type, Fields fields, std::size_t begin, std::size_t depth,
                     std::set<std::string_view>& names) {
    if (depth > kMaxDepth) {
      throw InvalidArgument("the fields of '" + std::string(type) + "' lie too deep inside others");
    }
    std::string text;
    while (!fields.empty()) {
      const std::string_view rest = std::string_view(fields.front().name).substr(begin);
      const std::string_view name = rest.substr(0, rest.find('.'));
      require_field_name(name);
      require_new(name, names);
      if (name.size() == rest.size()) {
        text += line(fields.front(), name);
        fields = fields.subspan(1);
        continue;
      }
      const std::string_view prefix = rest.substr(0, name.size() + 1);
      const auto other = std::ranges::find_if(fields, [&](const FieldDescription& field) {
        return !std::string_view(field.name).substr(begin).starts_with(prefix);
      });
      const auto count = static_cast<std::size_t>(other - fields.begin());
      const std::string inner = unused_name(std::string(type) + camel_case(name));
      define(inner, fields.first(count), begin + prefix.size(), depth + 1);
      text += inner + " " + std::string(name) + "\n";
      fields = fields.subspan(count);
    }
    return text;
  }

  void define(const std::string& type, Fields inner, std::size_t begin, std::size_t depth) {
    names_.insert(type);
    std::set<std::string_view> names;
    const std::string text = fields(type, inner, begin, depth, names);
    used_ += used_type(std::string(kPackage) + "/" + type, text);
  }

  [[nodiscard]] std::string line(const FieldDescription& field, std::string_view name) const {
    std::string text(name_of(stored(field.type, precision_)));
    if (!field.shape.empty()) text += "[" + std::to_string(field.count()) + "]";
    text.append(" ").append(name);
    if (field.shape.size() > 1) {
      text += "  # ";
      for (std::size_t i = 0; i < field.shape.size(); ++i) {
        text += (i == 0 ? "" : " x ") + std::to_string(field.shape[i]);
      }
    }
    if (!field.unit.empty()) text += (field.shape.size() > 1 ? " [" : "  # [") + field.unit + "]";
    return text + "\n";
  }

  // "left.wheel" and "left_wheel" both ask for "LeftWheel", so a name may be taken.
  [[nodiscard]] std::string unused_name(const std::string& wanted) const {
    std::string name = wanted;
    for (int i = 2; names_.contains(name); ++i) name = wanted + std::to_string(i);
    return name;
  }

  Precision precision_;
  std::string used_;
  std::set<std::string, std::less<>> names_;
  std::map<std::string, const ElementDescription*> part_types_;
};

ElementDescription head(std::string_view index) {
  FieldDescription session_id;
  session_id.name = "session_id";
  session_id.type = ScalarType::kUint64;
  FieldDescription second;
  second.name = index;
  second.type = ScalarType::kInt64;
  second.offset = offsetof(MessageHead, index);
  return ElementDescription({std::move(session_id), std::move(second)});
}

std::vector<MessagePart> parts_of(const RobotTypes& robot, const ElementDescription& status) {
  const std::string type = camel_case(robot.type);
  return {{"", "", head("time_index")},
          {"status", "Status", status},
          {"observation", type + "Observation", robot.observation},
          {"applied_action", type + "AppliedAction", robot.applied_action},
          {"desired_action", type + "Action", robot.action}};
}

}  // namespace

MessageLayout::MessageLayout(std::string_view type, const std::vector<MessagePart>& parts,
                             Precision precision)
    : type_(std::string(kPackage) + "/msg/" + std::string(type)) {
  require_message_name(type);
  definition_ = DefinitionWriter(precision).write(type, parts);

  // The layout follows the order of the fields. Alignment counts from the end of the header.
  std::size_t offset = 0;
  for (const MessagePart& part : parts) {
    std::vector<Run>& runs = parts_.emplace_back();
    for (const FieldDescription& field : part.element.fields()) {
      const ScalarType type_in_message = stored(field.type, precision);
      const std::size_t scalar_size = size_of(type_in_message);
      offset = (offset + scalar_size - 1) / scalar_size * scalar_size;
      const Run run{.element_offset = field.offset,
                    .message_offset = kCdrHeader.size() + offset,
                    .count = field.count() * (type_in_message == field.type ? scalar_size : 1),
                    .converts = type_in_message != field.type};
      offset += field.count() * scalar_size;

      const std::size_t element_step = run.converts ? sizeof(double) : 1;
      const std::size_t message_step = run.converts ? sizeof(float) : 1;
      Run* const last = runs.empty() ? nullptr : &runs.back();
      if (last != nullptr && last->converts == run.converts &&
          last->element_offset + last->count * element_step == run.element_offset &&
          last->message_offset + last->count * message_step == run.message_offset) {
        last->count += run.count;
      } else {
        runs.push_back(run);
      }
    }
  }
  size_ = kCdrHeader.size() + offset;
}

void MessageLayout::encode(std::span<const void* const> elements,
                           std::byte* message) const noexcept {
  std::memset(message, 0, size_);  // padding of zeros compresses better and leaks no memory
  std::memcpy(message, kCdrHeader.data(), kCdrHeader.size());
  for (std::size_t i = 0; i < parts_.size(); ++i) {
    const auto* const element = static_cast<const std::byte*>(elements[i]);
    for (const Run& run : parts_[i]) {
      const std::byte* source = element + run.element_offset;
      std::byte* target = message + run.message_offset;
      if (!run.converts) {
        std::memcpy(target, source, run.count);
        continue;
      }
      for (std::size_t k = 0; k < run.count; ++k) {
        double number;
        std::memcpy(&number, source + k * sizeof(double), sizeof(double));
        const auto stored_number = static_cast<float>(number);
        std::memcpy(target + k * sizeof(float), &stored_number, sizeof(float));
      }
    }
  }
}

void MessageLayout::decode(std::span<const std::byte> message, std::size_t part,
                           void* element) const noexcept {
  for (const Run& run : parts_[part]) {
    const std::byte* source = message.data() + run.message_offset;
    std::byte* target = static_cast<std::byte*>(element) + run.element_offset;
    if (!run.converts) {
      std::memcpy(target, source, run.count);
      continue;
    }
    for (std::size_t k = 0; k < run.count; ++k) {
      float stored_number;
      std::memcpy(&stored_number, source + k * sizeof(float), sizeof(float));
      const auto number = static_cast<double>(stored_number);
      std::memcpy(target + k * sizeof(double), &number, sizeof(double));
    }
  }
}

MessageLayout step_layout(const RobotTypes& robot, const ElementDescription& status,
                          Precision precision) {
  return {camel_case(robot.type) + "Step", parts_of(robot, status), precision};
}

MessageLayout end_layout(const RobotTypes& robot, const ElementDescription& status,
                         Precision precision) {
  std::vector<MessagePart> parts = parts_of(robot, status);
  parts.resize(StepPart::kObservation + 1);
  return {camel_case(robot.type) + "End", parts, precision};
}

MessageLayout companion_layout(std::string_view type, const ElementDescription& element,
                               Precision precision) {
  return {camel_case(type), {{"", "", head("index")}, {"", "", element}}, precision};
}

}  // namespace trifinger::log
