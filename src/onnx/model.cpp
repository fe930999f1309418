// SPDX-License-Identifier: BSD-3-Clause
#include "onnx/model.hpp"

#include <Eigen/Core>
#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>
#include <string_view>
#include <utility>

#include "base/regular_file.hpp"
#include "base/text_of.hpp"
#include "trifinger/base/error.hpp"

namespace trifinger::onnx {
namespace {

using trifinger::detail::text_of;

static_assert(std::endian::native == std::endian::little, "numbers are copied as they are");

constexpr std::uint64_t kMaxFile = std::uint64_t{1} << 27U;  // [bytes]
constexpr std::int64_t kMaxNumbers = 100'000'000;            // of a tensor

// ---- protocol buffers: https://protobuf.dev/programming-guides/encoding ----

struct Field {
  std::uint64_t number{0};
  std::uint64_t value{0};
  std::string_view bytes{};
  bool is_bytes{false};
};

// Goes through the fields of a message. Each read is bounded by what is left.
class Message {
 public:
  explicit Message(std::string_view bytes) : left_(bytes) {}

  [[nodiscard]] bool next(Field& field) {
    if (left_.empty()) return false;
    const std::uint64_t key = varint();
    field = {.number = key >> 3U};
    switch (key & 7U) {
      case 0:
        field.value = varint();
        break;
      case 1:
        field.bytes = take(8);
        break;
      case 2:
        field.bytes = take(varint());
        field.is_bytes = true;
        break;
      case 5:
        field.bytes = take(4);
        break;
      default:
        throw InvalidArgument("it is no ONNX file: it has a field of an unknown kind");
    }
    return true;
  }

  [[nodiscard]] bool is_at_end() const noexcept { return left_.empty(); }

  std::uint64_t varint() {
    std::uint64_t value = 0;
    for (unsigned shift = 0; shift < 64; shift += 7) {
      const auto byte = static_cast<std::uint8_t>(take(1).front());
      value |= std::uint64_t{byte & 0x7FU} << shift;
      if (byte < 0x80U) return value;
    }
    throw InvalidArgument("it is no ONNX file: a number in it is too long");
  }

 private:
  std::string_view take(std::uint64_t size) {
    if (size > left_.size()) throw InvalidArgument("it is no ONNX file, or it ends early");
    const std::string_view taken = left_.substr(0, size);
    left_.remove_prefix(size);
    return taken;
  }

  std::string_view left_;
};

// Calls `visit` with each field of a message.
template <class Visitor>
void for_each_field(std::string_view bytes, const Visitor& visit) {
  Message message(bytes);
  for (Field field; message.next(field);) visit(std::as_const(field));
}

// Numbers of a repeated field come alone, or many in one field.
void append_integers(const Field& field, std::vector<std::int64_t>& integers) {
  if (!field.is_bytes) {
    integers.push_back(static_cast<std::int64_t>(field.value));
    return;
  }
  for (Message packed(field.bytes); !packed.is_at_end();) {
    integers.push_back(static_cast<std::int64_t>(packed.varint()));
  }
}

// Appends numbers that are stored as T.
template <class T, class Number>
void append(std::string_view bytes, std::vector<Number>& numbers) {
  for (; bytes.size() >= sizeof(T); bytes.remove_prefix(sizeof(T))) {
    T value;
    std::ranges::copy(bytes.substr(0, sizeof(T)), reinterpret_cast<char*>(&value));
    numbers.push_back(static_cast<Number>(value));
  }
}

// ---- the messages of ONNX: onnx/onnx.proto ----

enum Type : std::uint8_t {
  kFloat = 1,
  kUint8 = 2,
  kInt8 = 3,
  kInt32 = 6,
  kInt64 = 7,
  kBool = 9,
  kHalf = 10,
  kDouble = 11
};

void append_raw(std::uint64_t type, std::string_view raw, Tensor& tensor) {
  if (type == kFloat) append<float>(raw, tensor.floats);
  if (type == kDouble) append<double>(raw, tensor.floats);
  if (type == kHalf) append<Eigen::half>(raw, tensor.floats);
  if (type == kInt64) append<std::int64_t>(raw, tensor.integers);
  if (type == kInt32) append<std::int32_t>(raw, tensor.integers);
  if (type == kInt8) append<std::int8_t>(raw, tensor.integers);
  if (type == kUint8 || type == kBool) append<std::uint8_t>(raw, tensor.integers);
}

Tensor read_tensor(std::string_view bytes, std::string& name) {
  Tensor tensor;
  std::uint64_t type = 0;
  std::string_view raw;
  bool is_elsewhere = false;
  for_each_field(bytes, [&](const Field& field) {
    if (field.number == 1) append_integers(field, tensor.shape);
    if (field.number == 2) type = field.value;
    if (field.number == 8) name = field.bytes;
    if (field.number == 9) raw = field.bytes;
    if (field.number == 13 || (field.number == 14 && field.value != 0)) is_elsewhere = true;
  });
  if (is_elsewhere) {
    throw InvalidArgument(text_of(
        "the numbers of '", name,
        "' are in another file: save the model as one file, or let `trifinger policy import` "
        "do it for what PyTorch exports"));
  }
  constexpr std::array kTypes{kFloat, kUint8, kInt8, kInt32, kInt64, kBool, kHalf, kDouble};
  if (std::ranges::find(kTypes, type) == kTypes.end()) {
    throw InvalidArgument(
        text_of("the numbers of '", name, "' are of type ", type, ", which is not known"));
  }
  // Checked before anything is kept. What is left of the file bounds the numbers, too.
  std::int64_t count = 1;
  for (const std::int64_t size : tensor.shape) {
    if (size < 0 || size > kMaxNumbers || (size > 0 && count > kMaxNumbers / size)) {
      throw InvalidArgument(text_of("'", name, "' claims more numbers than ", kMaxNumbers));
    }
    count *= size;
  }
  append_raw(type, raw, tensor);
  for_each_field(bytes, [&](const Field& field) {
    if (field.number == 4) append<float>(field.bytes, tensor.floats);
    if (field.number == 10) append<double>(field.bytes, tensor.floats);
    if ((field.number == 5 || field.number == 7) && type != kHalf) {
      append_integers(field, tensor.integers);
    }
  });
  if (!tensor.floats.empty() && !tensor.integers.empty()) {
    throw InvalidArgument(text_of("'", name, "' has numbers of two types"));
  }
  const auto found = std::max(tensor.floats.size(), tensor.integers.size());
  if (std::cmp_not_equal(found, count)) {
    throw InvalidArgument(text_of("'", name, "' has ", found, " numbers, its shape says ", count));
  }
  if (std::ranges::any_of(tensor.floats, [](float number) { return std::isnan(number); })) {
    throw InvalidArgument(text_of("'", name, "' has a number that is not one (NaN)"));
  }
  return tensor;
}

Attribute read_attribute(std::string_view bytes, std::string& name) {
  Attribute attribute;
  for_each_field(bytes, [&](const Field& field) {
    std::vector<float> number;
    std::string ignored;
    switch (field.number) {
      case 1:
        name = field.bytes;
        break;
      case 2:
        append<float>(field.bytes, number);
        if (!number.empty()) attribute.number = number.front();
        break;
      case 3:
        attribute.integer = static_cast<std::int64_t>(field.value);
        break;
      case 4:
        attribute.text = field.bytes;
        break;
      case 5:
        attribute.tensor = read_tensor(field.bytes, ignored);
        break;
      case 8:
        append_integers(field, attribute.integers);
        break;
      default:
        break;
    }
  });
  return attribute;
}

Node read_node(std::string_view bytes) {
  Node node;
  std::string domain;
  for_each_field(bytes, [&](const Field& field) {
    if (field.number == 1) node.inputs.emplace_back(field.bytes);
    if (field.number == 2) node.outputs.emplace_back(field.bytes);
    if (field.number == 4) node.op = field.bytes;
    if (field.number == 7) domain = field.bytes;
    if (field.number == 5) {
      std::string name;
      Attribute attribute = read_attribute(field.bytes, name);
      node.attributes[name] = std::move(attribute);
    }
  });
  if (!domain.empty() && domain != "ai.onnx") {
    throw InvalidArgument(
        text_of("it has the operator '", node.op, "' of '", domain, "', which is not known"));
  }
  return node;
}

// A dimension that has a name or nothing is not known.
std::int64_t read_dimension(std::string_view bytes) {
  std::int64_t size = -1;
  for_each_field(bytes, [&](const Field& field) {
    if (field.number == 1) size = static_cast<std::int64_t>(field.value);
  });
  return size;
}

Place read_place(std::string_view bytes) {
  Place place;
  const auto read_shape = [&](std::string_view shape) {
    for_each_field(shape, [&](const Field& field) {
      if (field.number == 1) place.shape.push_back(read_dimension(field.bytes));
    });
  };
  for_each_field(bytes, [&](const Field& field) {
    if (field.number == 1) place.name = field.bytes;
    if (field.number != 2) return;
    for_each_field(field.bytes, [&](const Field& type) {
      if (type.number != 1) return;
      for_each_field(type.bytes, [&](const Field& part) {
        if (part.number != 2) return;
        place.has_shape = true;
        read_shape(part.bytes);
      });
    });
  });
  return place;
}

void read_graph(std::string_view bytes, Model& model) {
  for_each_field(bytes, [&](const Field& field) {
    if (field.number == 1) model.nodes.push_back(read_node(field.bytes));
    if (field.number == 11) model.inputs.push_back(read_place(field.bytes));
    if (field.number == 12) model.outputs.push_back(read_place(field.bytes));
    if (field.number == 5) {
      std::string name;
      Tensor tensor = read_tensor(field.bytes, name);
      model.tensors[name] = std::move(tensor);
    }
    if (field.number == 15) throw InvalidArgument("it has sparse tensors, which are not known");
  });
}

}  // namespace

std::int64_t count_of(const Shape& shape) noexcept {
  constexpr std::int64_t kMost = std::numeric_limits<std::int64_t>::max();
  std::int64_t count = 1;
  for (const std::int64_t size : shape) {
    count = size > 0 && count > kMost / size ? kMost : count * size;
  }
  return count;
}

Model model_of(std::string_view bytes) {
  Model model;
  std::uint64_t format = 0;
  for_each_field(bytes, [&](const Field& field) {
    std::string domain;
    std::int64_t version = 0;
    std::string key;
    std::string value;
    switch (field.number) {
      case 1:
        format = field.value;
        break;
      case 7:
        read_graph(field.bytes, model);
        break;
      case 8:
        for_each_field(field.bytes, [&](const Field& opset) {
          if (opset.number == 1) domain = opset.bytes;
          if (opset.number == 2) version = static_cast<std::int64_t>(opset.value);
        });
        if (domain.empty() || domain == "ai.onnx") model.opset = version;
        break;
      case 14:
        for_each_field(field.bytes, [&](const Field& entry) {
          if (entry.number == 1) key = entry.bytes;
          if (entry.number == 2) value = entry.bytes;
        });
        model.metadata[key] = value;
        break;
      default:
        break;
    }
  });
  // Weights are listed among the inputs, too, in files before version 4.
  if (format < 4) {
    std::erase_if(model.inputs,
                  [&](const Place& place) { return model.tensors.contains(place.name); });
  }
  if (model.nodes.empty() || model.inputs.empty() || model.outputs.empty()) {
    throw InvalidArgument("it is no ONNX file with a network");
  }
  return model;
}

Model read_model(const std::filesystem::path& path) {
  FileReader file(path);
  if (file.size() > kMaxFile) {
    throw InvalidArgument(text_of("it has ", file.size(), " bytes, more than ", kMaxFile));
  }
  std::string bytes(file.size(), '\0');
  if (file.read(bytes) < bytes.size()) throw InvalidArgument("it ended while it was read");
  return model_of(bytes);
}

}  // namespace trifinger::onnx
