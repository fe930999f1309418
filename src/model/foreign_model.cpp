// SPDX-License-Identifier: BSD-3-Clause
#include "foreign_model.hpp"

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstdint>
#include <cstring>
#include <functional>
#include <map>
#include <mutex>
#include <set>
#include <system_error>
#include <utility>
#include <vector>

#include "base/regular_file.hpp"
#include "base/text_of.hpp"
#include "mesh_conversion.hpp"
#include "model/model_text.hpp"
#include "model/mujoco_messages.hpp"
#include "model_limits.hpp"
#include "trifinger/base/error.hpp"
#include "xml.hpp"

namespace trifinger::detail {
namespace {

namespace fs = std::filesystem;

// All files of a model seem to be below this folder. MuJoCo asks us for what is in it and does not
// ask for anything else, because every path of the text begins with it.
constexpr std::string_view kMount = "/trifinger-model";

constexpr std::string_view kGmsh = "$MeshFormat";  // begins a file of Gmsh

constexpr std::uint64_t kMaxFileBytes = std::uint64_t{1} << 29U;  // of one file

std::string virtual_name(const fs::path& path) {
  return std::string(kMount) + fs::absolute(path.empty() ? "." : path).lexically_normal().string();
}

// The longest end of `path` that is a file in `folder`; empty if there is none.
fs::path find_end(const fs::path& path, const fs::path& folder) {
  std::error_code ignored;
  for (auto first = path.begin(); first != path.end(); ++first) {
    fs::path found = folder;
    for (auto part = first; part != path.end(); ++part) found /= *part;
    if (fs::is_regular_file(found, ignored)) return found;
  }
  return {};
}

// Integers at the beginning of a binary file.
template <class Integer, std::size_t N>
std::array<Integer, N> integers_at(std::string_view bytes, std::size_t offset) {
  std::array<Integer, N> integers{};
  if (bytes.size() >= offset + sizeof(integers)) {
    std::memcpy(integers.data(), bytes.data() + offset, sizeof(integers));
  }
  return integers;
}

// Bytes that a file takes once it is read: a picture of one colour is small only as a file.
double unpacked_size(std::string_view head, std::uint64_t size) {
  constexpr std::string_view kPng = "\x89PNG\r\n\x1a\n";
  constexpr std::size_t kWidth = 16;  // where it is
  constexpr double kChannels = 4;
  if (!head.starts_with(kPng)) return static_cast<double>(size);
  const auto bytes = integers_at<unsigned char, 8>(head, kWidth);
  const auto number = [&bytes](std::size_t first) {
    double value = 0;
    for (std::size_t i = first; i < first + 4; ++i) value = 256 * value + bytes[i];
    return value;
  };
  return static_cast<double>(size) + kChannels * number(0) * number(4);
}

// Throws Error if a file of Gmsh, which is a text or not, says that it has more nodes or elements
// than fit into it.
void require_honest_gmsh(std::string_view bytes) {
  constexpr double kLeast = 4;  // bytes of a node or an element
  const auto promised = [&](double number) {
    if (number >= 0 && kLeast * number <= static_cast<double>(bytes.size())) return;
    throw Error(text_of("it has ", bytes.size(), " bytes, but its first numbers say ", number,
                        " nodes or elements"));
  };
  // "4.1 1 8": of a binary file
  const std::vector<double> format = numbers_of(bytes.substr(kGmsh.size()));
  const bool is_new = !format.empty() && format[0] >= 4;
  const bool is_binary = format.size() > 1 && format[1] != 0;
  for (const std::string_view section : {"$Nodes", "$Elements"}) {
    for (std::size_t at = bytes.find(section); at != kNowhere; at = bytes.find(section, at + 1)) {
      const std::string_view rest = bytes.substr(at + section.size());
      if (is_new && is_binary) {
        for (const std::uint64_t number : integers_at<std::uint64_t, 4>(rest, 1)) {
          promised(static_cast<double>(number));
        }
        continue;
      }
      std::vector<double> numbers = numbers_of(rest);
      numbers.resize(is_new ? 4 : 1);
      std::ranges::for_each(numbers, promised);
    }
  }
}

// Throws Error if the numbers at the beginning of a binary file promise more than there is:
// MuJoCo believes them.
void require_honest(const std::string& format, std::string_view bytes) {
  const auto promised = [&](double size) {
    if (size == static_cast<double>(bytes.size())) return;
    throw Error(text_of("it has ", bytes.size(), " bytes, but its first numbers say ", size));
  };
  constexpr double kSize = 4;  // of a number
  const std::size_t gmsh = bytes.starts_with(kGmsh)              ? 0
                           : format.find("flexcomp") != kNowhere ? bytes.find(kGmsh)
                                                                 : kNowhere;
  if (gmsh != kNowhere) require_honest_gmsh(bytes.substr(gmsh));
  if (format.find("msh") != kNowhere && gmsh == kNowhere) {
    const auto n = integers_at<std::int32_t, 4>(bytes, 0);
    if (std::ranges::min(n) < 0) throw Error("its first numbers are negative");
    promised(kSize * (4 + 3.0 * n[0] + 3.0 * n[1] + 2.0 * n[2] + 3.0 * n[3]));
  }
  if (format.find("skn") != kNowhere) {
    const auto n = integers_at<std::int32_t, 4>(bytes, 0);
    const double least = kSize * (4 + 3.0 * n[0] + 2.0 * n[1] + 3.0 * n[2] + 18.0 * n[3]);
    if (std::ranges::min(n) < 0 || least > static_cast<double>(bytes.size())) promised(least);
  }
  if (format.find("hfield") != kNowhere && !bytes.starts_with("\x89PNG")) {
    const auto n = integers_at<std::int32_t, 2>(bytes, 0);
    if (std::ranges::min(n) < 1) throw Error("it has no rows or no columns");
    promised(kSize * (2 + static_cast<double>(n[0]) * n[1]));
  }
}

std::string lower(std::string text) {
  for (char& letter : text) {
    if (letter >= 'A' && letter <= 'Z') letter = static_cast<char>(letter - 'A' + 'a');
  }
  return text;
}

// Takes out of a text where its files are, because their paths become whole, how much memory a
// simulation gets, because MuJoCo knows it better, and what only old versions of MuJoCo had.
void forget_settings(XmlElement& element) {
  using Setting = std::pair<std::string_view, std::string_view>;
  constexpr std::array<Setting, 11> kForgotten{{{"compiler", "assetdir"},
                                                {"compiler", "meshdir"},
                                                {"compiler", "texturedir"},
                                                {"compiler", "strippath"},
                                                {"size", "memory"},
                                                {"size", "njmax"},
                                                {"size", "nconmax"},
                                                {"size", "nstack"},
                                                {"option", "apirate"},
                                                {"option", "mpr_iterations"},
                                                {"option", "mpr_tolerance"}}};
  std::erase_if(element.attributes, [&](const auto& attribute) {
    const Setting setting(element.name, attribute.first);
    return std::ranges::find(kForgotten, setting) != kForgotten.end();
  });
  for (XmlElement& child : element.children) forget_settings(child);
}

// Makes radians the unit of angles, if the model names none.
void take_radians(XmlElement& root) {
  const bool is_named = std::ranges::any_of(root.children, [](const XmlElement& element) {
    return element.name == "compiler" && element.find("angle") != nullptr;
  });
  if (is_named) return;
  root.children.insert(
      root.children.begin(),
      {.name = "compiler", .line = root.line, .attributes = {{"angle", "radian"}}});
}

// A file that MuJoCo may ask for.
struct File {
  fs::path path;
  std::string format;                 // what its name and the model say of it, for `require_honest`
  std::uint64_t size{0};              // when it was judged
  double unpacked{0};                 // `unpacked_size` then
  std::optional<std::string> text{};  // once it was read
  std::string version{};              // of the text
};

// MuJoCo keeps what it has made of a file, and asks by its name and this version whether it may use
// it again. So a version must not depend on clocks.
void set_text(File& file, std::string text) {
  file.version = text_of(text.size(), " ", std::hash<std::string>()(text));
  file.text = std::move(text);
}

// The bytes of a file, of which nothing is copied: meshes are large. Throws Error if the file is
// not the one that was judged.
std::string read_whole(const File& file) {
  FileReader reader(file.path);
  std::string bytes(file.size, '\0');
  std::array<char, 1> more{};
  const bool is_whole = reader.read(bytes) == bytes.size() && reader.read(more) == 0;
  if (!is_whole || unpacked_size(bytes, bytes.size()) != file.unpacked) {
    throw Error("it has changed while it was read");
  }
  return bytes;
}

// Points that MuJoCo may find in the mesh of a flexible thing, at most.
double points_in(File& file) {
  constexpr double kLeast = 8;  // bytes of "0 0 0 0\n"
  if (file.format.find("obj") == kNowhere) return static_cast<double>(file.size) / kLeast;
  if (file.size == 0) return 0;
  std::string text = read_whole(file);
  double points = 0;
  for (std::size_t at = text.find('v'); at != kNowhere; at = text.find('v', at + 1)) {
    if (at + 1 < text.size() && is_space(text[at + 1])) ++points;
  }
  set_text(file, std::move(text));
  return points;
}

}  // namespace

// Which files there are, and the provider that hands them to MuJoCo.
class ForeignModel::Files {
 public:
  Files(const fs::path& main, const std::optional<fs::path>& mesh_folder, bool repairs,
        bool radians)
      : main_(virtual_name(main)),
        repairs_(repairs),
        radians_(radians),
        mesh_folder_(mesh_folder ? std::optional(fs::absolute(*mesh_folder)) : std::nullopt) {
    const Amount amount = add_model(main);
    require_size(amount, main.string());
    mj_defaultVFS(&vfs_);
    provider_.prefix = "";
    provider_.open = [](mjResource* resource) { return of(resource).open(*resource) ? 1 : 0; };
    provider_.read = [](mjResource* resource, const void** bytes) {
      const auto& text = *static_cast<const std::string*>(resource->data);
      *bytes = text.data();
      return static_cast<int>(text.size());
    };
    provider_.close = [](mjResource*) {};
    provider_.modified = [](const mjResource* resource, const char* timestamp) {
      return std::strncmp(resource->timestamp, timestamp, sizeof(resource->timestamp));
    };
    provider_.data = this;
    if (mj_mountVFS(&vfs_, std::string(kMount).c_str(), &provider_) != 0) {
      mj_deleteVFS(&vfs_);
      throw Error("MuJoCo takes no files from us");
    }
  }
  ~Files() { mj_deleteVFS(&vfs_); }

  [[nodiscard]] const std::string& main() const noexcept { return main_; }
  [[nodiscard]] const mjVFS* vfs() const noexcept { return &vfs_; }
  [[nodiscard]] std::string failure() const {
    const std::lock_guard lock(mutex_);
    return failure_;
  }
  [[nodiscard]] bool is_missing_file() const {
    const std::lock_guard lock(mutex_);
    return is_missing_file_;
  }
  [[nodiscard]] const auto& urdf_joints() const noexcept { return urdf_joints_; }
  [[nodiscard]] const auto& colours() const noexcept { return colours_; }

 private:
  static Files& of(const mjResource* resource) {
    return *static_cast<Files*>(resource->provider->data);
  }

  // Called by MuJoCo, in any thread.
  bool open(mjResource& resource) noexcept {
    const std::lock_guard lock(mutex_);
    std::string name;
    try {
      const auto found = files_.find(resource.name);
      name = std::string_view(resource.name).substr(kMount.size());
      if (found == files_.end()) throw Error("the model does not name it");
      File& file = found->second;
      if (!file.text) {
        std::string bytes = read_whole(file);
        require_honest(file.format, bytes);
        const bool is_text = file.format.find("stl") != kNowhere && is_text_stl(bytes);
        set_text(file, is_text ? binary_stl_of(bytes) : std::move(bytes));
      }
      std::memset(resource.timestamp, 0, sizeof(resource.timestamp));
      file.version.copy(resource.timestamp, sizeof(resource.timestamp) - 1);
      resource.data = &*file.text;
      return true;
    } catch (const SystemError& error) {
      is_missing_file_ = is_missing_file_ || error.error_number() == ENOENT;
      failure_ = error.what();
    } catch (const std::exception& error) {
      failure_ = name + ": " + error.what();
    }
    return false;
  }

  std::string read_xml(const fs::path& path) {
    try {
      std::string text = read_file(path, kMaxText - text_size_);
      text_size_ += text.size();
      return text;
    } catch (const SystemError& error) {
      throw InvalidArgument(path.string() + ": " + error.what());
    }
  }

  // Reads a model and all models that it attaches. MuJoCo gets what is written here.
  Amount add_model(const fs::path& path) {
    const std::string name = virtual_name(path);
    require(std::ranges::find(open_, name) == open_.end(),
            path.string() + ": the model attaches itself");
    if (const auto known = amounts_.find(name); known != amounts_.end()) return known->second;
    constexpr std::size_t kMaxNested = 20;
    require(open_.size() < kMaxNested,
            text_of(path.string(), ": models attach each other more than ", kMaxNested, " deep"));
    open_.push_back(name);
    XmlElement root = parse_xml(read_xml(path), path.string(), elements_left_);
    const fs::path folder = path.parent_path();
    std::set<std::string> included;
    include(root, folder, folder, included, 1, path);
    // Not one that a model attaches: shapes and joints of that are those of the model.
    const bool is_main = open_.size() == 1;
    if (is_main && root.name == "robot") {
      urdf_joints_ = prepare_urdf(root, path.string(), repairs_);
    } else if (is_main && radians_) {
      take_radians(root);
    }
    Folders folders{.model = folder};
    find_folders(root, folders);
    forget_settings(root);
    Outside outside;
    double bytes = 0;
    find_files(root, folders, outside, bytes);
    Amount amount = Counter(root, path.string(), outside).count();
    amount.bytes += bytes;
    const std::string* const own_name = root.find(root.name == "robot" ? "name" : "model");
    names_[name] = own_name != nullptr ? *own_name : "MuJoCo Model";
    File& file = files_[name];
    file.path = path;
    set_text(file, write_xml(root));
    open_.pop_back();
    return amounts_[name] = amount;
  }

  // Puts what is included in its place.
  void include(XmlElement& parent, const fs::path& main, const fs::path& folder,
               std::set<std::string>& included, int depth, const fs::path& source) {
    const auto place = [&](const XmlElement& element) {
      return text_of(source.string(), ":", element.line, ": ");
    };
    if (depth > kMaxDepth) {
      throw InvalidArgument(
          text_of(place(parent), "elements are inside each other more than ", kMaxDepth, " deep"));
    }
    std::vector<XmlElement> children;
    for (XmlElement& child : parent.children) {
      if (child.name != "include") {
        include(child, main, folder, included, depth + 1, source);
        children.push_back(std::move(child));
        continue;
      }
      const std::string* const file = child.find("file");
      if (file == nullptr || file->empty() || !child.children.empty()) {
        throw InvalidArgument(place(child) + "<include> must have a file and nothing in it");
      }
      const fs::path named(with_slashes(*file));
      std::error_code ignored;
      fs::path path = main / named;
      if (!fs::exists(path, ignored) && fs::exists(folder / named, ignored)) path = folder / named;
      require(included.insert(virtual_name(path)).second,
              place(child) + "'" + *file + "' is included already");
      XmlElement root = parse_xml(read_xml(path), path.string(), elements_left_);
      require(!root.children.empty(), place(child) + "'" + *file + "' has nothing to include");
      include(root, main, path.parent_path(), included, depth + 1, path);
      for (XmlElement& inner : root.children) {
        set_line(inner, child.line);
        children.push_back(std::move(inner));
      }
    }
    parent.children = std::move(children);
  }

  static void set_line(XmlElement& element, int line) {
    element.line = line;
    for (XmlElement& child : element.children) set_line(child, line);
  }

  static std::string with_slashes(std::string path) {
    std::ranges::replace(path, '\\', '/');
    return path;
  }

  // Where the files of a model are.
  struct Folders {
    fs::path model;
    fs::path meshes{};
    fs::path textures{};
    bool strips{false};  // file names lose their folders
  };

  static void find_folders(const XmlElement& element, Folders& folders) {
    if (element.name == "compiler") {
      if (const auto* folder = element.find("assetdir")) {
        folders.meshes = folders.textures = with_slashes(*folder);
      }
      if (const auto* folder = element.find("meshdir")) folders.meshes = with_slashes(*folder);
      if (const auto* folder = element.find("texturedir")) {
        folders.textures = with_slashes(*folder);
      }
      if (const auto* strip = element.find("strippath")) folders.strips = *strip == "true";
    }
    for (const XmlElement& child : element.children) find_folders(child, folders);
  }

  // Makes all paths whole, and adds their files. `bytes` are what the files take.
  void find_files(XmlElement& element, const Folders& folders, Outside& outside, double& bytes) {
    const std::string* const content = element.find("content_type");
    const std::string type = content != nullptr ? lower(*content) : "";
    for (auto& [attribute, value] : element.attributes) {
      if (!attribute.starts_with("file") || value.empty()) continue;
      fs::path path(with_slashes(value));
      if (element.name == "model") {
        path = folders.model / path;
        const Amount amount = add_model(path);
        const std::string* const name = element.find("name");
        outside.models[name != nullptr ? *name : names_[virtual_name(path)]] += amount;
      } else {
        path = place_of(element, path, folders);
        if (lower(path.extension().string()) == ".dae") {
          value = add_collada(path, bytes);
          continue;
        }
        bytes += add_file(path, lower(path.extension().string()) + " " + type + " " + element.name);
        if (element.name == "flexcomp") {
          outside.points[virtual_name(path)] = points_in(files_[virtual_name(path)]);
        }
      }
      value = virtual_name(path);
    }
    for (XmlElement& child : element.children) find_files(child, folders, outside, bytes);
  }

  [[nodiscard]] fs::path place_of(const XmlElement& element, fs::path path,
                                  const Folders& folders) const {
    const bool is_texture = element.name == "texture";
    if (mesh_folder_ && element.name == "mesh") {
      const fs::path found = find_end(path, *mesh_folder_);
      // Messages about a mesh that is not there name the folder.
      return found.empty() ? *mesh_folder_ / path : found;
    }
    if (folders.strips) path = path.filename();
    if (mesh_folder_ && !is_texture) return *mesh_folder_ / path;
    return folders.model / (is_texture ? folders.textures : folders.meshes) / path;
  }

  // Adds a mesh of COLLADA as what MuJoCo can read, and returns the name of that.
  std::string add_collada(const fs::path& path, double& bytes) {
    const std::string name = virtual_name(path / "converted.obj");
    File& file = files_[name];
    if (file.text) return name;
    file.path = path;
    std::string text;
    try {
      text = read_file(path, kMaxText);
    } catch (const SystemError&) {
      return name;  // An error if MuJoCo asks for it.
    }
    ConvertedMesh mesh = convert_collada(text, path.string());
    if (mesh.colour) colours_[name] = *mesh.colour;
    bytes += static_cast<double>(mesh.obj.size());
    set_text(file, std::move(mesh.obj));
    return name;
  }

  // Returns how many bytes it takes. One that cannot be read is an error only if MuJoCo asks for
  // it.
  double add_file(const fs::path& path, const std::string& format) {
    File& file = files_[virtual_name(path)];
    file.path = path;
    file.format += format;
    try {
      FileReader reader(path);
      file.size = reader.size();
      require(file.size <= kMaxFileBytes, text_of(path.string(), ": the file has ", file.size,
                                                  " bytes, may have at most ", kMaxFileBytes));
      std::array<char, 64> head{};
      const std::size_t count = reader.read(head);
      return file.unpacked = unpacked_size({head.data(), count}, file.size);
    } catch (const SystemError&) {
      return 0;
    }
  }

  std::string main_;
  bool repairs_;
  bool radians_;
  std::optional<fs::path> mesh_folder_;
  std::optional<std::map<std::string, UrdfJoint>> urdf_joints_;  // of a URDF
  std::map<std::string, std::array<float, 4>> colours_;          // of files of meshes
  std::map<std::string, File> files_;
  std::map<std::string, Amount> amounts_;     // amounts of models
  std::map<std::string, std::string> names_;  // names that models give themselves
  std::vector<std::string> open_;             // models that are being read
  std::size_t text_size_{0};
  std::size_t elements_left_{kMaxElements};
  mjVFS vfs_{};
  mjpResourceProvider provider_{};
  mutable std::mutex mutex_;  // guards what follows, and the texts of files
  std::string failure_;
  bool is_missing_file_{false};
};

ForeignModel::ForeignModel(const fs::path& file, const std::optional<fs::path>& mesh_folder,
                           bool repairs, bool radians)
    : files_(std::make_unique<Files>(file, mesh_folder, repairs, radians)) {}

ForeignModel::~ForeignModel() = default;

const mjVFS* ForeignModel::files() const noexcept { return files_->vfs(); }

bool ForeignModel::is_missing_file() const { return files_->is_missing_file(); }

bool ForeignModel::is_urdf() const noexcept { return files_->urdf_joints().has_value(); }

UrdfJoint ForeignModel::urdf_joint(const std::string& name) const {
  if (!is_urdf()) return {};
  const auto found = files_->urdf_joints()->find(name);
  return found == files_->urdf_joints()->end() ? UrdfJoint{} : found->second;
}

std::optional<std::array<float, 4>> ForeignModel::colour_of(const std::string& mesh_file) const {
  const auto found = files_->colours().find(mesh_file);
  return found == files_->colours().end() ? std::nullopt : std::optional(found->second);
}

Spec ForeignModel::parse() const {
  std::array<char, 1000> error{};
  Spec spec(mj_parseXML(files_->main().c_str(), files_->vfs(), error.data(),
                        static_cast<int>(error.size())));
  if (spec == nullptr) throw InvalidArgument(explained(error.data()));
  return spec;
}

std::string ForeignModel::explained(const std::string& problem) const {
  std::string text = problem;
  for (std::size_t at = text.find(kMount); at != kNowhere; at = text.find(kMount, at)) {
    text.erase(at, kMount.size());
  }
  const std::string failure = files_->failure();
  return failure.empty() ? text : text + " (" + failure + ")";
}

}  // namespace trifinger::detail

namespace trifinger {

std::string checked_model_text(std::string_view text) {
  using namespace detail;
  const std::string source = "model.xml";
  silence_mujoco();
  require(text.size() <= kMaxText,
          text_of(source, ": it has ", text.size(), " bytes, may have at most ", kMaxText));
  std::size_t elements_left = kMaxElements;
  XmlElement root = parse_xml(text, source, elements_left);
  std::vector<const XmlElement*> left{&root};
  while (!left.empty()) {
    const XmlElement* const element = left.back();
    left.pop_back();
    for (const auto& [name, value] : element->attributes) {
      require(!name.starts_with("file") || value.empty(),
              text_of(source, ":", element->line, ": <", element->name, "> names the file '", value,
                      "', but a text on its own has no files"));
    }
    require(element->name != "include" && element->name != "plugin",
            text_of(source, ":", element->line, ": <", element->name,
                    "> asks for more than this text, which has to do on its own"));
    for (const XmlElement& child : element->children) left.push_back(&child);
  }
  require_size(Counter(root, source, {}).count(), source);
  forget_settings(root);
  return write_xml(root);
}

}  // namespace trifinger
