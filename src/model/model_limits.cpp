// SPDX-License-Identifier: BSD-3-Clause
#include "model_limits.hpp"

#include <algorithm>
#include <array>
#include <charconv>
#include <limits>
#include <string_view>
#include <system_error>
#include <utility>
#include <vector>

#include "base/text_of.hpp"
#include "trifinger/base/error.hpp"

namespace trifinger::detail {
namespace {

// The largest value of a number that MuJoCo obeys, however long it then computes.
struct Bound {
  std::string_view element;
  std::string_view attribute;
  double most;
};

constexpr double kMaxUserNumbers = 1'000;  // numbers of a user
constexpr double kMaxIterations = 10'000;
constexpr double kMaxPixels = 16'384;    // of a side
constexpr double kMaxSlices = 1'000;     // of a round shape in pictures
constexpr double kMaxSamples = 100'000;  // of a sensor

constexpr auto kBounds = std::to_array<Bound>({
    {"size", "nuserdata", 1'000'000},
    {"size", "nkey", 10'000},
    {"size", "nuser_body", kMaxUserNumbers},
    {"size", "nuser_jnt", kMaxUserNumbers},
    {"size", "nuser_geom", kMaxUserNumbers},
    {"size", "nuser_site", kMaxUserNumbers},
    {"size", "nuser_cam", kMaxUserNumbers},
    {"size", "nuser_tendon", kMaxUserNumbers},
    {"size", "nuser_actuator", kMaxUserNumbers},
    {"size", "nuser_sensor", kMaxUserNumbers},
    {"option", "iterations", kMaxIterations},
    {"option", "ls_iterations", kMaxIterations},
    {"option", "noslip_iterations", kMaxIterations},
    {"option", "ccd_iterations", kMaxIterations},
    {"option", "sdf_iterations", kMaxIterations},
    {"option", "sdf_initpoints", kMaxIterations},
    {"replicate", "count", kMaxCopies},
    {"flexcomp", "count", kMaxCopies},
    {"flexcomp", "cellcount", kMaxCopies},
    {"flex", "cellcount", kMaxCopies},
    {"mesh", "params", 300},
    {"hfield", "nrow", kMaxPixels},
    {"hfield", "ncol", kMaxPixels},
    {"texture", "width", kMaxPixels},
    {"texture", "height", kMaxPixels},
    {"texture", "gridsize", 100},
    {"camera", "resolution", kMaxPixels},
    {"numeric", "size", 1'000'000},
    {"global", "offwidth", kMaxPixels},
    {"global", "offheight", kMaxPixels},
    {"quality", "shadowsize", 2 * kMaxPixels},
    {"quality", "offsamples", 64},
    {"quality", "numslices", kMaxSlices},
    {"quality", "numstacks", kMaxSlices},
    {"quality", "numquads", kMaxSlices},
    // For these it does not matter where they are.
    {"", "nsample", kMaxSamples},
    {"", "dim", kMaxSamples},
    {"", "num", kMaxSamples},
});

// What elements have only in `<default>`, or for themselves.
constexpr std::array<std::string_view, 5> kOfDefaults{"nsample", "dim", "num", "width", "height"};

double number_of(const XmlElement& element, std::string_view attribute, double missing) {
  const std::string* const value = element.find(attribute);
  if (value == nullptr) return missing;
  const std::vector<double> numbers = numbers_of(*value);
  return numbers.empty() ? missing : numbers.front();
}

// Product of the numbers of an attribute that are above 1; NaN counts as 1.
double product_of(const XmlElement& element, std::string_view attribute) {
  double product = 1;
  const std::string* const value = element.find(attribute);
  if (value == nullptr) return product;
  for (const double number : numbers_of(*value)) product *= number > 1 ? number : 1;
  return product;
}

bool has_value(const XmlElement& element, std::string_view attribute, std::string_view value) {
  const std::string* const found = element.find(attribute);
  return found != nullptr && *found == value;
}

// Number of words.
double length_of(const std::string& value) {
  double words = 0;
  bool is_in_word = false;
  for (const char letter : value) {
    if (!is_space(letter) && !is_in_word) ++words;
    is_in_word = !is_space(letter);
  }
  return words;
}

// `missing`: of a joint that does not say its type.
double freedoms_of(const XmlElement& element, double missing) {
  if (element.name == "freejoint" || element.name == "floating_base") return 6;
  if (element.name != "joint") return 0;
  if (element.find("type") == nullptr) return missing;
  if (has_value(element, "type", "free") || has_value(element, "type", "floating")) return 6;
  return has_value(element, "type", "ball") ? 3 : 1;
}

// Bytes of the sides of a texture.
double bytes_of_texture(const XmlElement& element, double width, double height) {
  constexpr double kSides = 6;
  constexpr double kChannels = 4;
  // MuJoCo makes all sides of a cube, whatever its height is said to be.
  return kChannels * width *
         (has_value(element, "type", "2d") ? height : std::max(height, kSides * width));
}

// Bytes of an element that `<default>` says nothing of.
double own_bytes_of(const XmlElement& element) {
  constexpr double kNumber = sizeof(double);
  double bytes = 0;
  if (element.name == "hfield") {
    // Trees of boxes take more than the heights.
    bytes += 8 * kNumber * product_of(element, "nrow") * product_of(element, "ncol");
  }
  if (element.name == "numeric") bytes += kNumber * product_of(element, "size");
  if (element.name == "mesh" && element.find("params") != nullptr) {
    const double points = product_of(element, "params");
    bytes += 100 * kNumber * points * points;
  }
  return bytes;
}

// Points of a flexible thing.
double points_of(const XmlElement& element, const std::map<std::string, double>& of_files) {
  constexpr double kUsual = 10 * 10 * 10;  // MuJoCo's
  double points = 0;
  if (element.find("count") != nullptr) {
    points = product_of(element, "count");
  } else if (!has_value(element, "type", "direct") && !has_value(element, "type", "mesh") &&
             !has_value(element, "type", "gmsh")) {
    points = kUsual;
  }
  if (const std::string* const given = element.find("point")) points += length_of(*given) / 3;
  if (const std::string* const file = element.find("file")) {
    const auto found = of_files.find(*file);
    if (found != of_files.end()) points += found->second;
  }
  return points;
}

double freedoms_of_flexcomp(const XmlElement& element, double points) {
  if (has_value(element, "rigid", "true")) return 0;
  // Only the corners of cells move, and what is half way between them.
  constexpr double kLinear = 2 * 2 * 2;
  constexpr double kQuadratic = 3 * 3 * 3;
  const double cells = product_of(element, "cellcount");
  if (has_value(element, "dof", "trilinear")) return 3 * kLinear * cells;
  if (has_value(element, "dof", "quadratic")) return 3 * kQuadratic * cells;
  if (has_value(element, "dof", "radial")) return points;
  return (has_value(element, "dof", "2d") ? 2 : 3) * points;
}

// MuJoCo simulates muscles to find how long they get.
void require_short_simulation(const XmlElement& element, const std::string& source) {
  if (element.name != "lengthrange") return;
  constexpr double kMaxSteps = 100'000;
  const double steps = number_of(element, "inttotal", 10) / number_of(element, "timestep", 0.01);
  require(steps >= 0 && steps <= kMaxSteps,
          text_of(source, ":", element.line, ": <lengthrange> asks for ", steps,
                  " steps (inttotal / timestep), may ask for ", kMaxSteps));
}

}  // namespace

std::vector<double> numbers_of(std::string_view text) {
  constexpr std::size_t kMost = 8;
  std::vector<double> numbers;
  const char* at = text.data();
  const char* const last = at + text.size();
  while (numbers.size() < kMost) {
    while (at != last && (is_space(*at) || *at == '+')) ++at;
    const bool is_hex = last - at > 2 && at[0] == '0' && (at[1] == 'x' || at[1] == 'X');
    if (is_hex) at += 2;
    double number = 0;
    const auto [end, problem] = std::from_chars(
        at, last, number, is_hex ? std::chars_format::hex : std::chars_format::general);
    if (problem == std::errc::invalid_argument) break;
    if (problem == std::errc::result_out_of_range) number = std::numeric_limits<double>::infinity();
    numbers.push_back(number);
    at = end;
  }
  return numbers;
}

Amount& Amount::operator+=(const Amount& other) {
  elements += other.elements;
  copies += other.copies;
  freedoms += other.freedoms;
  bytes += other.bytes;
  keys += other.keys;
  user = std::max(user, other.user);
  rays += other.rays;
  pixels = std::max(pixels, other.pixels);
  depth = std::max(depth, other.depth);
  return *this;
}

Counter::Counter(const XmlElement& root, std::string source, const Outside& outside)
    : root_(root), source_(std::move(source)), outside_(outside) {
  std::vector<std::pair<const XmlElement*, bool>> left{{&root_, false}};
  while (!left.empty()) {
    const auto [element, is_in_default] = left.back();
    left.pop_back();
    if (is_in_default) add_default(*element);
    const bool is_default = is_in_default || element->name == "default";
    for (const XmlElement& child : element->children) left.emplace_back(&child, is_default);
  }
}

void Counter::add_default(const XmlElement& element) {
  default_freedoms_ = std::max(default_freedoms_, freedoms_of(element, 1));
  for (const std::string_view attribute : kOfDefaults) {
    if (element.find(attribute) == nullptr) continue;
    double& largest = defaults_.try_emplace(attribute, 0).first->second;
    largest = std::max(largest, product_of(element, attribute));
  }
}

double Counter::size_of(const XmlElement& element, std::string_view attribute,
                        double missing) const {
  if (element.find(attribute) != nullptr) return product_of(element, attribute);
  const auto found = defaults_.find(attribute);
  return found == defaults_.end() ? missing : found->second;
}

double Counter::bytes_of(const XmlElement& element) const {
  // Buffers of delayed actuators and sensors, and what sensors of users measure.
  double bytes = sizeof(double) * size_of(element, "nsample", 1) * size_of(element, "dim", 1) *
                 size_of(element, "num", 1);
  if (element.name == "texture") {
    bytes += bytes_of_texture(element, size_of(element, "width", 0), size_of(element, "height", 0));
  }
  return bytes + own_bytes_of(element);
}

Amount Counter::count() { return count(root_); }

void Counter::require_bounds(const XmlElement& element) const {
  for (const auto& [name, value] : element.attributes) {
    for (const Bound& bound : kBounds) {
      if (bound.attribute != name) continue;
      if (!bound.element.empty() && bound.element != element.name) continue;
      for (const double number : numbers_of(value)) {
        require(!(number > bound.most),
                text_of(source_, ":", element.line, ": '", name, "' of <", element.name, "> is ",
                        number, ", may be at most ", bound.most));
      }
    }
  }
  require_short_simulation(element, source_);
}

Amount Counter::count(const XmlElement& element) {
  require_bounds(element);
  add_name(element);
  if (element.name == "replicate") ++replicates_;
  // What is attached counts as a level too, and each of them takes some of our stack.
  ++levels_;
  require(levels_ <= kMaxDepth,
          text_of(source_, ":", element.line, ": elements are inside each other more than ",
                  kMaxDepth, " deep, with what is attached"));
  Amount amount{.elements = 1,
                .freedoms = freedoms_of(element, default_freedoms_),
                .bytes = bytes_of(element)};
  for (const XmlElement& child : element.children) amount += count(child);
  if (element.name == "attach") amount += count_attached(element);
  if (element.name == "key") amount.keys += 1;
  if (element.name == "size") {
    amount.keys += std::max(0.0, number_of(element, "nkey", 0));
    for (const auto& [name, value] : element.attributes) {
      if (name.starts_with("nuser_")) {
        amount.user = std::max(amount.user, number_of(element, name, 0));
      }
    }
  }
  if (const std::string* const user = element.find("user")) {
    amount.user = std::max(amount.user, length_of(*user));
  }
  if (element.name == "camera") {
    amount.pixels = std::max(amount.pixels, product_of(element, "resolution"));
  }
  if (element.name == "rangefinder" && element.find("camera") != nullptr) amount.rays += 1;
  if (element.name == "flexcomp") {
    const double points = points_of(element, outside_.points);
    amount.freedoms += freedoms_of_flexcomp(element, points);
    amount.copies += points + product_of(element, "cellcount");
    amount.bytes += 1'000 * points;
  }
  if (element.name == "replicate") {
    --replicates_;
    const double times = product_of(element, "count");
    amount.copies = times * amount.copies + (times - 1) * amount.elements;
    amount.elements *= times;
    amount.freedoms *= times;
    amount.bytes *= times;
    amount.keys *= times;
    amount.rays *= times;
  }
  amount.depth += 1;
  --levels_;
  return amount;
}

// In <replicate>, names become others.
void Counter::add_name(const XmlElement& element) {
  const std::string* const name = element.find("name");
  const bool is_named =
      name != nullptr && !name->empty() && (element.name == "body" || element.name == "frame");
  if (!is_named || replicates_ > 0) return;
  const auto [known, is_new] = named_.try_emplace({element.name, *name}, &element);
  require(is_new || known->second == &element,
          text_of(source_, ":", element.line, ": a second <", element.name, "> has the name '",
                  *name, "'"));
}

// A subtree of another model, or of this one. Names that attaching and <replicate> make cannot be
// counted, nor can "world". MuJoCo finds only what it has read, so an element further down must not
// stand for one that was made.
Amount Counter::count_attached(const XmlElement& element) {
  const auto place = [&] { return text_of(source_, ":", element.line, ": "); };
  Amount amount;
  if (const std::string* const model = element.find("model")) {
    const auto found = outside_.models.find(*model);
    require(found != outside_.models.end(),
            place() + "<attach> names the model '" + *model + "', which no <model> has");
    amount = found->second;
  } else {
    for (const std::string attribute : {"body", "frame"}) {
      const std::string* const name = element.find(attribute);
      if (name == nullptr) continue;
      const auto found = named_.find({attribute, *name});
      require(found != named_.end(), place() + "<attach> names the " + attribute + " '" + *name +
                                         "', which is not above it in this file");
      const auto [counted, is_new] = counted_.try_emplace(found->second);
      // Texts that attach doubles of doubles are counted once each.
      if (is_new) counted->second = count(*found->second);
      require(counted->second.elements > 0, place() + "'" + *name + "' is attached to itself");
      amount += counted->second;
    }
  }
  amount.copies += amount.elements;
  return amount;
}

void require_size(const Amount& amount, const std::string& source) {
  const auto limit = [&](double found, double most, const char* what) {
    require(found <= most, text_of(source, ": the model asks for ", found, " ", what,
                                   ", may ask for at most ", most));
  };
  limit(amount.copies, kMaxCopies, "copies of elements (replicate, attach, flexcomp)");
  limit(amount.elements, kMaxElements + kMaxCopies, "elements");
  limit(amount.freedoms, kMaxFreedoms, "degrees of freedom");
  limit(amount.depth, kMaxDepth, "levels of elements inside each other");
  constexpr double kNumber = sizeof(double);
  // Positions, velocities and what actuators want, as far as elements can have them.
  constexpr double kOfKey = 7;
  limit(amount.bytes + kNumber * amount.elements * (amount.user + kOfKey * amount.keys) +
            kNumber * kOfKey * amount.rays * amount.pixels,
        kMaxBytes, "bytes of memory (textures, height fields, files, buffers, key frames)");
}

}  // namespace trifinger::detail
