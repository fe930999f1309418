// SPDX-License-Identifier: BSD-3-Clause
#include "mesh_conversion.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <map>
#include <numbers>
#include <span>
#include <system_error>
#include <vector>

#include "base/text_of.hpp"
#include "trifinger/base/error.hpp"
#include "xml.hpp"

namespace trifinger::detail {
namespace {

constexpr double kMaxCoordinate = 1e6;  // [m]
constexpr std::size_t kMaxPoints = 6'000'000;
constexpr std::size_t kMaxTriangles = 2'000'000;
constexpr std::size_t kMaxNumbers = 20'000'000;  // of one list
constexpr std::size_t kMaxMeshElements = 1'000'000;
constexpr std::size_t kMaxNodes = 100'000;
constexpr int kMaxNodeDepth = 100;
// Letters and elements that are looked at, however often the file refers to them: some seconds.
constexpr std::size_t kMaxWork = 500'000'000;

// Takes the next number of a text of numbers and spaces. Returns nothing at its end. One that is
// too small for its type is 0.
template <class Number>
std::optional<Number> next_number(std::string_view& text) {
  while (!text.empty() && is_space(text.front())) text.remove_prefix(1);
  if (text.starts_with('+')) text.remove_prefix(1);
  Number number{};
  const auto [end, problem] = std::from_chars(text.data(), text.data() + text.size(), number);
  const auto length = static_cast<std::size_t>(end - text.data());
  const std::string_view word = text.substr(0, length);
  const bool is_tiny = problem == std::errc::result_out_of_range &&
                       (word.find("e-") != kNowhere || word.find("E-") != kNowhere);
  if (problem != std::errc() && !is_tiny) return std::nullopt;
  text.remove_prefix(length);
  return number;
}

class ColladaReader {
 public:
  ColladaReader(std::string_view text, const std::string& source) : source_(source) {
    std::size_t elements_left = kMaxMeshElements;
    root_ = parse_xml(text, source, elements_left);
    require(root_.name == "COLLADA", source + ": it is no file of COLLADA");
    find_ids(root_);
  }

  ConvertedMesh convert() {
    double unit = 1.0;
    if (const XmlElement* const said = find_path(root_, {"asset", "unit"})) {
      if (const std::string* const meter = said->find("meter")) {
        std::string_view text = *meter;
        unit = next_number<double>(text).value_or(0.0);
        require(std::isfinite(unit) && unit > 0.0, place(*said) + "its unit is no length");
      }
    }
    const Eigen::Affine3d scale(Eigen::Scaling(unit));
    if (const XmlElement* const scene = main_scene()) {
      add_nodes(*scene, scale, 0);
    } else {
      for_each_geometry([&](const XmlElement& geometry) { add_geometry(geometry, scale, {}); });
    }
    require(!faces_.empty(), source_ + ": it has no triangles");
    return {.obj = as_obj(), .colour = mean_colour()};
  }

 private:
  // Counts what was looked at: a few elements may refer to many others again and again.
  void spend(std::size_t work) const {
    work_ += work;
    if (work_ > kMaxWork) {
      throw InvalidArgument(source_ + ": it refers to its parts too often; make an OBJ of it");
    }
  }

  template <class Number>
  [[nodiscard]] std::vector<Number> numbers_in(const XmlElement& element) const {
    constexpr std::size_t kShown = 20;  // letters
    spend(element.text.size());
    std::vector<Number> numbers;
    std::string_view text = element.text;
    while (const auto number = next_number<Number>(text)) {
      if (numbers.size() >= kMaxNumbers) fail(element, "it has too many numbers");
      numbers.push_back(*number);
    }
    if (!text.empty()) {
      fail(element,
           text_of("<", element.name, "> has '", text.substr(0, kShown), "' in its numbers"));
    }
    return numbers;
  }

  // Calls `visit` with each child of this name.
  template <class Visit>
  void for_each_child(const XmlElement& parent, std::string_view name, const Visit& visit) const {
    spend(parent.children.size());
    for (const XmlElement& child : parent.children) {
      if (child.name == name) visit(child);
    }
  }

  // The first element on this path of names below `parent`; null if there is none.
  [[nodiscard]] const XmlElement* find_path(const XmlElement& parent,
                                            std::initializer_list<std::string_view> names) const {
    const XmlElement* element = &parent;
    for (const std::string_view name : names) {
      spend(element->children.size());
      const auto found = std::ranges::find(element->children, name, &XmlElement::name);
      if (found == element->children.end()) return nullptr;
      element = &*found;
    }
    return element;
  }

  // Where a face is in the file, and which of the numbers of a corner is its vertex.
  struct Corners {
    std::size_t offset{0};
    std::size_t stride{1};
  };

  [[nodiscard]] std::string place(const XmlElement& element) const {
    return text_of(source_, ":", element.line, ": ");
  }

  // For loops, in which `require` would make its text each time.
  [[noreturn]] void fail(const XmlElement& element, const std::string& problem) const {
    throw InvalidArgument(place(element) + problem);
  }

  void find_ids(const XmlElement& element) {
    if (const std::string* const id = element.find("id")) ids_.emplace(*id, &element);
    for (const XmlElement& child : element.children) find_ids(child);
  }

  // What an attribute such as url="#cube" refers to: in `scope`, if it is there. Some programs give
  // each mesh the same names.
  [[nodiscard]] const XmlElement& referred(const XmlElement& from, std::string_view attribute,
                                           const XmlElement* scope = nullptr) const {
    const std::string* const url = from.find(attribute);
    const bool is_local = url != nullptr && url->starts_with('#');
    const std::string_view id = is_local ? std::string_view(*url).substr(1) : std::string_view();
    if (scope != nullptr && is_local) {
      spend(scope->children.size());
      for (const XmlElement& child : scope->children) {
        const std::string* const own = child.find("id");
        if (own != nullptr && *own == id) return child;
      }
    }
    const auto found = is_local ? ids_.find(id) : ids_.end();
    if (found == ids_.end()) {
      fail(from, text_of("<", from.name, "> refers to '", url != nullptr ? *url : "",
                         "', which is not in this file"));
    }
    return *found->second;
  }

  [[nodiscard]] const XmlElement* main_scene() const {
    if (const XmlElement* const instance = find_path(root_, {"scene", "instance_visual_scene"})) {
      return &referred(*instance, "url");
    }
    return find_path(root_, {"library_visual_scenes", "visual_scene"});
  }

  template <class Visit>
  void for_each_geometry(const Visit& visit) const {
    for_each_child(root_, "library_geometries",
                   [&](const XmlElement& library) { for_each_child(library, "geometry", visit); });
  }

  [[nodiscard]] Eigen::Affine3d transform_of(const XmlElement& node) const {
    Eigen::Affine3d transform = Eigen::Affine3d::Identity();
    spend(node.children.size());
    for (const XmlElement& step : node.children) {
      if (step.name == "matrix") {
        const std::array n = finite_numbers<16>(step);
        transform.matrix() *=
            Eigen::Map<const Eigen::Matrix<double, 4, 4, Eigen::RowMajor>>(n.data());
      } else if (step.name == "translate") {
        const std::array n = finite_numbers<3>(step);
        transform.translate(Eigen::Vector3d(n[0], n[1], n[2]));
      } else if (step.name == "scale") {
        const std::array n = finite_numbers<3>(step);
        transform.scale(Eigen::Vector3d(n[0], n[1], n[2]));
      } else if (step.name == "rotate") {
        const std::array n = finite_numbers<4>(step);
        const Eigen::Vector3d axis(n[0], n[1], n[2]);
        if (axis.norm() == 0.0) continue;
        transform.rotate(Eigen::AngleAxisd(n[3] * std::numbers::pi / 180.0, axis.normalized()));
      }
    }
    return transform;
  }

  // So many numbers, which must be finite.
  template <std::size_t N>
  [[nodiscard]] std::array<double, N> finite_numbers(const XmlElement& element) const {
    const std::vector<double> numbers = numbers_in<double>(element);
    require(numbers.size() == N &&
                std::ranges::all_of(numbers, [](double number) { return std::isfinite(number); }),
            text_of(place(element), "<", element.name, "> must have ", N, " numbers"));
    std::array<double, N> result{};
    std::ranges::copy(numbers, result.begin());
    return result;
  }

  void add_nodes(const XmlElement& parent, const Eigen::Affine3d& transform, int depth) {
    if (depth > kMaxNodeDepth) {
      fail(parent, text_of("nodes are inside each other more than ", kMaxNodeDepth, " deep"));
    }
    spend(parent.children.size());
    for (const XmlElement& child : parent.children) {
      if (child.name == "node") {
        add_node(child, transform, depth);
      } else if (child.name == "instance_node") {
        add_node(referred(child, "url"), transform, depth);
      } else if (child.name == "instance_geometry") {
        add_geometry(referred(child, "url"), transform, colours_of(child));
      } else if (child.name == "instance_controller") {
        throw InvalidArgument(place(child) +
                              "a skin that bends cannot be a mesh of a link; make an OBJ of it");
      }
    }
  }

  void add_node(const XmlElement& node, const Eigen::Affine3d& transform, int depth) {
    // Nodes that refer to nodes could double themselves again and again.
    if (++nodes_ > kMaxNodes) fail(node, "the scene has too many nodes");
    add_nodes(node, transform * transform_of(node), depth + 1);
  }

  using Colours = std::map<std::string, std::array<float, 4>>;

  // The diffuse colour of each material, by the symbol that the triangles call it by.
  [[nodiscard]] Colours colours_of(const XmlElement& instance) const {
    Colours colours;
    const XmlElement* const bound = find_path(instance, {"bind_material", "technique_common"});
    if (bound == nullptr) return colours;
    for_each_child(*bound, "instance_material", [&](const XmlElement& binding) {
      const std::string* const symbol = binding.find("symbol");
      const XmlElement* const effect = find_path(referred(binding, "target"), {"instance_effect"});
      if (symbol == nullptr || effect == nullptr) return;
      const XmlElement* const technique =
          find_path(referred(*effect, "url"), {"profile_COMMON", "technique"});
      if (technique == nullptr) return;
      for (const XmlElement& shader : technique->children) {
        const XmlElement* const colour = find_path(shader, {"diffuse", "color"});
        const auto n = colour != nullptr ? numbers_in<float>(*colour) : std::vector<float>{};
        if (n.size() == 4) colours[*symbol] = {n[0], n[1], n[2], 1.0F};
      }
    });
    return colours;
  }

  // The points that a <vertices> or <source> stands for, as they are in the file.
  [[nodiscard]] std::vector<Eigen::Vector3d> points_of(const XmlElement& vertices,
                                                       const XmlElement& mesh) const {
    const XmlElement* source = &vertices;
    for_each_child(vertices, "input", [&](const XmlElement& input) {
      const std::string* const semantic = input.find("semantic");
      if (semantic != nullptr && *semantic == "POSITION")
        source = &referred(input, "source", &mesh);
    });
    const XmlElement* const numbers = find_path(*source, {"float_array"});
    require(numbers != nullptr, place(*source) + "its points are missing");
    std::size_t stride = 3;
    std::size_t first = 0;
    if (const XmlElement* const accessor = find_path(*source, {"technique_common", "accessor"})) {
      stride = count_of(*accessor, "stride", stride);
      first = count_of(*accessor, "offset", first);
    }
    require(stride >= 3, place(*source) + "its points have fewer than three numbers");
    const std::vector<double> n = numbers_in<double>(*numbers);
    std::vector<Eigen::Vector3d> points;
    for (std::size_t at = first; at < n.size() && n.size() - at >= 3; at += stride) {
      points.emplace_back(n[at], n[at + 1], n[at + 2]);
    }
    return points;
  }

  [[nodiscard]] std::size_t count_of(const XmlElement& element, std::string_view attribute,
                                     std::size_t missing) const {
    const std::string* const value = element.find(attribute);
    if (value == nullptr) return missing;
    std::string_view text = *value;
    const auto number = next_number<std::uint16_t>(text);
    require(number.has_value(), text_of(place(element), "'", attribute, "' is no small number"));
    return *number;
  }

  void add_geometry(const XmlElement& geometry, const Eigen::Affine3d& transform,
                    const Colours& colours) {
    constexpr std::array<std::string_view, 5> kFaces{"triangles", "polylist", "polygons",
                                                     "tristrips", "trifans"};
    const XmlElement* const mesh = find_path(geometry, {"mesh"});
    if (mesh == nullptr) return;  // A curve has nothing to touch.
    spend(mesh->children.size());
    for (const XmlElement& faces : mesh->children) {
      if (std::ranges::find(kFaces, faces.name) == kFaces.end()) continue;
      const std::size_t known = faces_.size();
      add_part(faces, *mesh, transform);
      const std::string* const symbol = faces.find("material");
      const auto colour = symbol != nullptr ? colours.find(*symbol) : colours.end();
      if (colour != colours.end()) add_colour(colour->second, faces_.size() - known);
    }
  }

  // Adds the points and the faces of an element of a mesh.
  void add_part(const XmlElement& faces, const XmlElement& mesh, const Eigen::Affine3d& transform) {
    Corners corners;
    const XmlElement* vertices = nullptr;
    for_each_child(faces, "input", [&](const XmlElement& input) {
      const std::size_t offset = count_of(input, "offset", 0);
      corners.stride = std::max(corners.stride, offset + 1);
      const std::string* const semantic = input.find("semantic");
      if (semantic == nullptr || *semantic != "VERTEX") return;
      corners.offset = offset;
      vertices = &referred(input, "source", &mesh);
    });
    require(vertices != nullptr, place(faces) + "its vertices are missing");
    const std::size_t first = points_.size();
    const std::vector<Eigen::Vector3d> points = points_of(*vertices, mesh);
    require(first + points.size() <= kMaxPoints, place(faces) + "the mesh has too many points");
    for (const Eigen::Vector3d& point : points) {
      const Eigen::Vector3d placed = transform * point;
      // Written so that NaN fails.
      if (!(placed.cwiseAbs().maxCoeff<Eigen::PropagateNaN>() <= kMaxCoordinate)) {
        fail(faces, "a point is too far away");
      }
      points_.push_back(placed);
    }
    // A mirror turns triangles inside out.
    add_faces(faces, corners, first, transform.linear().determinant() < 0.0);
  }

  void add_colour(const std::array<float, 4>& colour, std::size_t num_faces) {
    const auto weight = static_cast<double>(num_faces);
    for (std::size_t i = 0; i < colour.size(); ++i) {
      colour_[i] += weight * static_cast<double>(colour[i]);
    }
    coloured_ += weight;
  }

  // Adds the polygons of an element; each <p> of one that has no <vcount> is one polygon or strip.
  void add_faces(const XmlElement& faces, const Corners& corners, std::size_t first,
                 bool is_mirrored) {
    const XmlElement* const counts = find_path(faces, {"vcount"});
    const bool is_strip = faces.name == "tristrips";
    for_each_child(faces, "p", [&](const XmlElement& list) {
      const std::vector<std::size_t> all = corners_in(list, corners, first);
      std::span<const std::size_t> left = all;
      const auto take = [&](std::size_t size) {
        if (size > left.size()) fail(list, "corners of a face are missing");
        add_polygon(left.first(size), is_strip, is_mirrored);
        left = left.subspan(size);
      };
      if (faces.name == "triangles") {
        while (!left.empty()) take(3);
      } else if (counts != nullptr) {
        for (const std::uint32_t size : numbers_in<std::uint32_t>(*counts)) take(size);
      } else {
        take(left.size());
      }
    });
  }

  // The points of a list of corners.
  [[nodiscard]] std::vector<std::size_t> corners_in(const XmlElement& list, const Corners& corners,
                                                    std::size_t first) const {
    const auto numbers = numbers_in<std::uint32_t>(list);
    std::vector<std::size_t> found;
    for (std::size_t at = corners.offset; at < numbers.size(); at += corners.stride) {
      if (numbers[at] >= points_.size() - first) fail(list, "a corner is no point");
      found.push_back(first + numbers[at]);
    }
    return found;
  }

  // Adds the triangles of a polygon, around its first corner, or of a strip.
  void add_polygon(std::span<const std::size_t> corners, bool is_strip, bool is_mirrored) {
    for (std::size_t i = 2; i < corners.size(); ++i) {
      const std::size_t before = is_strip ? corners[i - 2] : corners[0];
      const bool turns = is_mirrored != (is_strip && i % 2 == 1);
      faces_.push_back(turns ? std::array{before, corners[i], corners[i - 1]}
                             : std::array{before, corners[i - 1], corners[i]});
    }
    if (faces_.size() > kMaxTriangles) {
      throw InvalidArgument(source_ + ": it has too many triangles");
    }
  }

  [[nodiscard]] std::string as_obj() const {
    std::string text;
    const auto append = [&text](auto number) {
      std::array<char, 40> digits{};
      const auto [end, problem] =
          std::to_chars(digits.data(), digits.data() + digits.size(), number);
      text += ' ';
      text.append(digits.data(), end);
    };
    // Points without a face are no part of the shape, but would be part of its hull.
    constexpr std::size_t kUnused = 0;
    std::vector<std::size_t> numbers(points_.size(), kUnused);
    std::size_t last = 0;
    for (const auto& face : faces_) {
      for (const std::size_t corner : face) {
        if (numbers[corner] != kUnused) continue;
        numbers[corner] = ++last;
        text += 'v';
        for (const double number : points_[corner]) append(static_cast<float>(number));
        text += '\n';
      }
    }
    for (const auto& face : faces_) {
      text += 'f';
      for (const std::size_t corner : face) append(numbers[corner]);
      text += '\n';
    }
    return text;
  }

  [[nodiscard]] std::optional<std::array<float, 4>> mean_colour() const {
    if (coloured_ == 0.0) return std::nullopt;
    std::array<float, 4> mean{};
    std::ranges::transform(colour_, mean.begin(),
                           [&](double sum) { return static_cast<float>(sum / coloured_); });
    return mean;
  }

  const std::string& source_;
  XmlElement root_;
  std::map<std::string_view, const XmlElement*> ids_;
  std::vector<Eigen::Vector3d> points_;
  std::vector<std::array<std::size_t, 3>> faces_;
  std::array<double, 4> colour_{};  // sum over triangles that have one
  double coloured_{0.0};            // number of these
  std::size_t nodes_{0};
  mutable std::size_t work_{0};
};

constexpr std::size_t kStlHeader = 80;    // bytes before the number of triangles
constexpr std::size_t kStlTriangle = 50;  // bytes of one

template <class Value>
void append_bytes(std::string& bytes, Value value) {
  std::array<char, sizeof(Value)> raw{};
  std::memcpy(raw.data(), &value, sizeof(Value));
  bytes.append(raw.data(), raw.size());
}

}  // namespace

ConvertedMesh convert_collada(std::string_view text, const std::string& source) {
  return ColladaReader(text, source).convert();
}

bool is_text_stl(std::string_view bytes) noexcept {
  if (!bytes.starts_with("solid")) return false;
  std::uint32_t triangles = 0;
  if (bytes.size() < kStlHeader + sizeof(triangles)) return true;
  std::memcpy(&triangles, bytes.data() + kStlHeader, sizeof(triangles));
  return bytes.size() != kStlHeader + sizeof(triangles) + kStlTriangle * triangles;
}

std::string binary_stl_of(std::string_view text) {
  constexpr std::string_view kVertex = "vertex";
  std::vector<float> numbers;
  // The first line is a name, which may have any words.
  text.remove_prefix(std::min(text.find('\n'), text.size()));
  for (std::size_t at = text.find(kVertex); at != kNowhere; at = text.find(kVertex, at)) {
    at += kVertex.size();
    std::string_view rest = text.substr(at);
    for (int i = 0; i < 3; ++i) {
      const auto number = next_number<float>(rest);
      if (!number) throw Error("a vertex of it has fewer than three numbers");
      numbers.push_back(*number);
    }
  }
  constexpr std::size_t kNumbers = 9;  // of a triangle
  if (numbers.size() < kNumbers || numbers.size() % kNumbers != 0) {
    throw Error("it is no STL: its vertices make no triangles");
  }
  std::string bytes(kStlHeader, ' ');
  append_bytes(bytes, static_cast<std::uint32_t>(numbers.size() / kNumbers));
  for (std::size_t i = 0; i < numbers.size(); i += kNumbers) {
    for (int k = 0; k < 3; ++k) append_bytes(bytes, 0.0F);  // Nobody reads the normal.
    for (std::size_t k = 0; k < kNumbers; ++k) append_bytes(bytes, numbers[i + k]);
    append_bytes(bytes, std::uint16_t{0});
  }
  return bytes;
}

}  // namespace trifinger::detail
