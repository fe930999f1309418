// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <string>
#include <vector>

// Files of ONNX, https://onnx.ai/onnx/repo-docs/IR.html, as far as policies need them.
namespace trifinger::onnx {

using Shape = std::vector<std::int64_t>;

// Returns the number of numbers, or the largest number there is if that is larger.
[[nodiscard]] std::int64_t count_of(const Shape& shape) noexcept;

// Numbers in the file: `floats`, or `integers` if these are whole ones.
struct Tensor {
  Shape shape{};
  std::vector<float> floats{};
  std::vector<std::int64_t> integers{};
};

struct Attribute {
  float number{0.0F};
  std::int64_t integer{0};
  std::string text{};
  std::vector<std::int64_t> integers{};
  Tensor tensor{};
};

struct Node {
  std::string op{};
  std::vector<std::string> inputs{};  // An empty name: not given.
  std::vector<std::string> outputs{};
  std::map<std::string, Attribute> attributes{};
};

// A name that a graph takes or gives. -1: a size that is not known.
struct Place {
  std::string name{};
  bool has_shape{false};
  Shape shape{};
};

struct Model {
  std::int64_t opset{0};
  std::vector<Node> nodes{};
  std::map<std::string, Tensor> tensors{};
  std::vector<Place> inputs{};
  std::vector<Place> outputs{};
  std::map<std::string, std::string> metadata{};
};

// Reads a file whose content is not trusted. Takes no more memory than some dozen times its size.
// Throws InvalidArgument, which says what is wrong, and SystemError.
[[nodiscard]] Model read_model(const std::filesystem::path& path);
[[nodiscard]] Model model_of(std::string_view bytes);

}  // namespace trifinger::onnx
