// SPDX-License-Identifier: BSD-3-Clause
#include "policy_file.hpp"

#include <algorithm>
#include <bit>
#include <cstdint>
#include <initializer_list>
#include <nlohmann/json.hpp>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "base/regular_file.hpp"
#include "base/suggestion.hpp"

namespace trifinger::learning::detail {
namespace {

static_assert(std::endian::native == std::endian::little, "numbers are copied as they are");

using Json = nlohmann::ordered_json;
using RowMajor = Eigen::Matrix<float, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

constexpr std::string_view kFirstWords = "trifinger policy ";
constexpr std::string_view kFirstLine = "trifinger policy 1\n";
constexpr std::size_t kMaxHeader = std::size_t{1} << 20U;  // [bytes]
constexpr std::uint64_t kMaxWidth = 65'536;                // Largest width of a layer.
constexpr std::uint64_t kMaxNumbers = 100'000'000;         // Largest number of weights and biases.

const std::vector<std::string_view> kActivations{"identity", "relu", "tanh", "elu"};
const std::vector<std::string_view> kBoundings{"scale", "clip"};

// ---- the header ----

// A part of the header and its name in messages.
class Section {
 public:
  Section(const Json& json, std::string name) : json_(json), name_(std::move(name)) {}

  // Throws on unknown keys: a reader that ignores a key would run another policy than the one
  // written.
  void expect(std::initializer_list<std::string_view> keys) const {
    if (!json_.is_object()) throw InvalidArgument(name_ + " is not a JSON object");
    for (const auto& item : json_.items()) {
      if (std::ranges::find(keys, std::string_view(item.key())) == keys.end()) {
        throw InvalidArgument(name_ + " has the unknown key '" + item.key() + "'");
      }
    }
  }

  [[nodiscard]] bool has(const char* key) const { return json_.contains(key); }

  [[nodiscard]] Section at(const char* key) const {
    const auto found = json_.find(key);
    if (found == json_.end()) throw InvalidArgument(name_ + " has no '" + key + "'");
    return {*found, "'" + std::string(key) + "' of " + name_};
  }

  [[nodiscard]] std::size_t size() const {
    if (!json_.is_array()) throw InvalidArgument(name_ + " is not a JSON array");
    return json_.size();
  }
  [[nodiscard]] const Json& entry(std::size_t i) const { return json_[i]; }

  [[nodiscard]] std::string text() const {
    if (!json_.is_string()) throw InvalidArgument(name_ + " is not a string");
    return json_.get<std::string>();
  }

  // Returns the index of the word among `words`.
  [[nodiscard]] std::size_t choice(const std::vector<std::string_view>& words) const {
    const std::string word = text();
    const auto found = std::ranges::find(words, word);
    if (found == words.end()) {
      throw InvalidArgument(name_ + " is '" + word + "', must be " + quoted_list(words, "or"));
    }
    return static_cast<std::size_t>(found - words.begin());
  }

  [[nodiscard]] std::uint64_t width() const {
    if (json_.is_number_unsigned()) {
      const auto width = json_.get<std::uint64_t>();
      if (width >= 1 && width <= kMaxWidth) return width;
    }
    throw InvalidArgument(name_ + " is " + shown() + ", must be a whole number from 1 to " +
                          std::to_string(kMaxWidth));
  }

  [[nodiscard]] double number() const {
    if (!json_.is_number()) throw InvalidArgument(name_ + " is " + shown() + ", not a number");
    return json_.get<double>();
  }

  [[nodiscard]] Eigen::VectorXd numbers() const {
    Eigen::VectorXd numbers(static_cast<Eigen::Index>(size()));
    std::ranges::transform(json_, numbers.begin(), [&](const Json& entry) {
      return Section(entry, "a number in " + name_).number();
    });
    return numbers;
  }

  [[nodiscard]] std::map<std::string, std::string> texts() const {
    if (!json_.is_object()) throw InvalidArgument(name_ + " is not a JSON object");
    std::map<std::string, std::string> texts;
    for (const auto& item : json_.items()) {
      texts[item.key()] = Section(item.value(), "'" + item.key() + "' of " + name_).text();
    }
    return texts;
  }

 private:
  [[nodiscard]] std::string shown() const {
    const std::string text = json_.dump();
    return text.size() <= 40 ? text : text.substr(0, 40) + " ...";
  }

  const Json& json_;
  std::string name_;
};

Json parse(std::string_view header) {
  // Headers have no deeper nesting than this.
  constexpr int kDepth = 4;
  try {
    return Json::parse(header, [](int depth, Json::parse_event_t /*event*/, Json& /*parsed*/) {
      if (depth > kDepth) throw InvalidArgument("its header is nested too deeply");
      return true;
    });
  } catch (const Json::exception& error) {
    throw InvalidArgument("its header is not JSON: " + std::string(error.what()));
  }
}

struct Shape {
  std::uint64_t inputs;
  std::uint64_t outputs;
  Activation activation;

  [[nodiscard]] std::uint64_t count() const noexcept { return outputs * (inputs + 1); }
};

// All of the policy except the weights, which have no memory yet.
struct Header {
  std::vector<Shape> shapes{};
  Network network{};
};

Header header_of(const Json& json) {
  const Section root(json, "the header");
  root.expect({"layers", "normalization", "bounds", "metadata"});
  Header header;
  const Section layers = root.at("layers");
  for (std::size_t i = 0; i < layers.size(); ++i) {
    const Section layer(layers.entry(i), "layer " + std::to_string(i));
    layer.expect({"inputs", "outputs", "activation"});
    const std::size_t activation = layer.at("activation").choice(kActivations);
    header.shapes.push_back({.inputs = layer.at("inputs").width(),
                             .outputs = layer.at("outputs").width(),
                             .activation = static_cast<Activation>(activation)});
  }
  if (root.has("normalization")) {
    const Section normalization = root.at("normalization");
    normalization.expect({"mean", "variance", "epsilon", "clip"});
    header.network.normalization = {.mean = normalization.at("mean").numbers(),
                                    .variance = normalization.at("variance").numbers(),
                                    .epsilon = normalization.at("epsilon").number(),
                                    .clip = normalization.at("clip").number()};
  }
  if (root.has("bounds")) {
    const Section bounds = root.at("bounds");
    bounds.expect({"low", "high", "bounding"});
    const std::size_t bounding = bounds.at("bounding").choice(kBoundings);
    header.network.bounds = {.low = bounds.at("low").numbers(),
                             .high = bounds.at("high").numbers(),
                             .bounding = static_cast<Bounding>(bounding)};
  }
  header.network.metadata = root.at("metadata").texts();
  return header;
}

Json json_of(const Eigen::VectorXd& numbers) {
  return std::vector<double>(numbers.begin(), numbers.end());
}

std::string header_text(const Network& network) {
  Json json;
  json["layers"] = Json::array();
  for (const Layer& layer : network.layers) {
    json["layers"].push_back(
        {{"inputs", layer.weights.cols()},
         {"outputs", layer.weights.rows()},
         {"activation", kActivations.at(static_cast<std::size_t>(layer.activation))}});
  }
  if (network.normalization) {
    json["normalization"] = {{"mean", json_of(network.normalization->mean)},
                             {"variance", json_of(network.normalization->variance)},
                             {"epsilon", network.normalization->epsilon},
                             {"clip", network.normalization->clip}};
  }
  if (network.bounds) {
    json["bounds"] = {
        {"low", json_of(network.bounds->low)},
        {"high", json_of(network.bounds->high)},
        {"bounding", kBoundings.at(static_cast<std::size_t>(network.bounds->bounding))}};
  }
  json["metadata"] = Json::object();
  for (const auto& [key, text] : network.metadata) json["metadata"][key] = text;
  try {
    return json.dump() + "\n";
  } catch (const Json::exception& error) {
    throw InvalidArgument("the metadata of the policy are not UTF-8: " + std::string(error.what()));
  }
}

// ---- files ----

void read(FileReader& file, std::span<char> bytes) {
  if (file.read(bytes) < bytes.size()) throw InvalidArgument("it ended while it was read");
}

// Reads the two lines of text at the beginning of a file. If they are longer than allowed, the
// result is cut off.
std::string beginning_of(FileReader& file) {
  const std::uint64_t size = file.size();
  std::string beginning(std::min<std::uint64_t>(size, kFirstLine.size()), '\0');
  read(file, beginning);
  // Checked before more is read, because this may be any large file.
  if (beginning != kFirstLine) {
    if (kFirstLine.starts_with(beginning)) throw InvalidArgument("it ends in its first line");
    if (!beginning.starts_with(kFirstWords)) {
      throw InvalidArgument("it does not begin with '" + std::string(kFirstWords) + "'");
    }
    throw InvalidArgument("its version is not 1, the only one that this program knows");
  }
  std::string header(std::min<std::uint64_t>(size - beginning.size(), kMaxHeader), '\0');
  read(file, header);
  const std::size_t end = header.find('\n');
  if (end == std::string::npos) {
    throw InvalidArgument("its header does not end within " + std::to_string(header.size()) +
                          " bytes");
  }
  header.resize(end);
  return header;
}

void check_size(const std::vector<Shape>& shapes, std::uint64_t found) {
  std::uint64_t count = 0;
  for (const Shape& shape : shapes) count += shape.count();
  if (count > kMaxNumbers) {
    throw InvalidArgument("its layers have " + std::to_string(count) + " numbers, more than " +
                          std::to_string(kMaxNumbers));
  }
  if (count * sizeof(float) == found) return;
  throw InvalidArgument("it has " + std::to_string(found) +
                        " bytes after its header, and its layers need " +
                        std::to_string(count * sizeof(float)));
}

std::span<char> bytes_of(auto& numbers) {
  return {reinterpret_cast<char*>(numbers.data()),
          static_cast<std::size_t>(numbers.size()) * sizeof(float)};
}

Layer read_layer(FileReader& file, const Shape& shape) {
  RowMajor weights(shape.outputs, shape.inputs);
  Eigen::VectorXf bias(shape.outputs);
  read(file, bytes_of(weights));
  read(file, bytes_of(bias));
  return {.weights = weights, .bias = std::move(bias), .activation = shape.activation};
}

void append(std::string& bytes, const Eigen::Ref<const RowMajor>& numbers) {
  bytes.append(reinterpret_cast<const char*>(numbers.data()),
               static_cast<std::size_t>(numbers.size()) * sizeof(float));
}

}  // namespace

Network read_policy_file(const std::filesystem::path& path) {
  FileReader file(path);
  const std::string text = beginning_of(file);
  Header header = header_of(parse(text));
  const std::uint64_t begin = kFirstLine.size() + text.size() + 1;
  check_size(header.shapes, file.size() - begin);
  file.seek(begin);
  for (const Shape& shape : header.shapes) {
    header.network.layers.push_back(read_layer(file, shape));
  }
  return std::move(header.network);
}

void write_policy_file(const Network& network, const std::filesystem::path& path) {
  const std::string header = header_text(network);
  if (header.size() > kMaxHeader) {
    throw InvalidArgument("the header of the policy would have " + std::to_string(header.size()) +
                          " bytes, more than " + std::to_string(kMaxHeader) +
                          ": shorten its metadata");
  }
  std::string bytes = std::string(kFirstLine) + header;
  for (const Layer& layer : network.layers) {
    append(bytes, layer.weights);
    append(bytes, layer.bias.transpose());
  }
  replace_file(path, std::as_bytes(std::span(bytes)));
}

}  // namespace trifinger::learning::detail
