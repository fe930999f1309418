// SPDX-License-Identifier: BSD-3-Clause
// Robots of the repository, changed at random. Whatever a model says: it loads, or it is an error
// with a sentence; it never crashes, hangs or takes all memory.
#include <gtest/gtest.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <random>
#include <string>
#include <string_view>
#include <vector>

#include "model/export.hpp"
#include "model/file_robots.hpp"
#include "model/model_text.hpp"
#include "support/folder.hpp"
#include "support/soak.hpp"
#include "trifinger/base/error.hpp"
#include "trifinger/model/model_file.hpp"

namespace trifinger::test {
namespace {

// Changes a text: values of attributes, whole elements, and bytes.
class Mutator {
 public:
  explicit Mutator(std::uint64_t seed) : random_(seed) {}

  std::string mutated(std::string text) {
    for (std::size_t changes = 1 + below(3); changes > 0; --changes) change(text);
    return text;
  }

 private:
  std::size_t below(std::size_t end) {
    return std::uniform_int_distribution<std::size_t>(0, end - 1)(random_);
  }

  template <class Values>
  auto one_of(const Values& values) {
    return values[below(std::size(values))];
  }

  void change(std::string& text) {
    switch (below(6)) {
      case 0:
      case 1:
        change_value(text);
        break;
      case 2:
        insert(text, one_of(kElements));
        break;
      case 3:
        insert_attribute(text);
        break;
      case 4:
        repeat_or_remove(text);
        break;
      default:
        text[below(text.size())] = static_cast<char>(below(256));
    }
  }

  // Position of a random `letter`.
  std::size_t place_of(const std::string& text, char letter) {
    const std::size_t found = text.find(letter, below(text.size()));
    return found == text.npos ? text.find(letter) : found;
  }

  void change_value(std::string& text) {
    const std::size_t begin = place_of(text, '=');
    if (begin == text.npos || begin + 2 >= text.size()) return;
    const std::size_t end = text.find(text[begin + 1], begin + 2);
    if (end == text.npos) return;
    std::string value = text.substr(begin + 2, end - begin - 2);
    if (below(2) == 0) {
      value = one_of(kValues);
    } else {
      // One of several numbers.
      const std::size_t space = value.find(' ', value.empty() ? 0 : below(value.size()));
      value = value.substr(0, space) + " " + one_of(kValues);
    }
    text.replace(begin + 2, end - begin - 2, value);
  }

  void insert(std::string& text, std::string_view element) {
    const std::size_t place = place_of(text, '>');
    if (place != text.npos) text.insert(place + 1, element);
  }

  void insert_attribute(std::string& text) {
    const std::size_t place = text.find_first_of(" />", place_of(text, '<') + 1);
    if (place == text.npos || text[place] != ' ') return;
    text.insert(place, std::string(" ") + one_of(kAttributes) + "=\"" + one_of(kValues) + "\"");
  }

  void repeat_or_remove(std::string& text) {
    const std::size_t begin = place_of(text, '<');
    const std::size_t end = begin == text.npos ? begin : text.find("/>", begin);
    if (end == text.npos || end - begin > 2000) return;
    const std::string element = text.substr(begin, end + 2 - begin);
    if (below(3) == 0) {
      text.erase(begin, element.size());
      return;
    }
    const std::size_t times = one_of(std::array<std::size_t, 4>{1, 2, 10, 300});
    std::string all;
    for (std::size_t i = 0; i < times; ++i) all += element;
    text.insert(end + 2, all);
  }

  static constexpr std::array kValues{"0",     "-1",         "1",          "2",
                                      "1e9",   "2147483647", "4294967296", "-1e308",
                                      "1e308", "1e400",      "nan",        "inf",
                                      "-inf",  "1e-300",     "0 0 0",      "1 1 1 1 1 1 1",
                                      "",      " ",          "/dev/zero",  "../../../..",
                                      "a b",   "true",       "mesh",       "free",
                                      "world", "\xff",       "&lt;",       "0x7fffffff",
                                      "16384", "10000",      "ball",       "%s%n"};
  static constexpr std::array kAttributes{
      "size",     "pos",   "quat",       "type",    "name",     "file",   "mesh",
      "mass",     "range", "axis",       "fromto",  "class",    "group",  "user",
      "condim",   "gear",  "joint",      "count",   "armature", "solref", "density",
      "friction", "euler", "childclass", "limited", "material"};
  static constexpr std::array kElements{
      R"(<replicate count="100"><geom size="0.1"/></replicate>)",
      R"(<replicate count="9999"><geom size="0.1"/></replicate>)",
      R"(<replicate count="50"><replicate count="90"><body><joint/><geom size="1"/></body></replicate></replicate>)",
      R"(<body><freejoint/><geom size="0.1"/></body>)",
      R"(<frame euler="1 2 3"><geom size="0.1" type="box"/></frame>)",
      R"(<geom type="mesh" mesh="none"/>)",
      R"(<asset><texture name="t" type="cube" builtin="gradient" width="3000" height="3000"/></asset>)",
      R"(<asset><mesh name="s" builtin="supersphere" params="60 1 1"/></asset>)",
      R"(<asset><mesh name="v" vertex="0 0 0 1 0 0 0 1 0 0 0 1e-30"/></asset>)",
      R"(<asset><hfield name="h" nrow="1000" ncol="1000" size="1 1 1 1"/></asset>)",
      R"(<flexcomp name="f" type="grid" count="9 9 9" dim="3" mass="1"/>)",
      R"(<flexcomp name="g" type="grid" count="60 60 1" dim="2" mass="1"><contact selfcollide="auto"/></flexcomp>)",
      R"(<size memory="1000G" nkey="5000" nuser_geom="900"/>)",
      R"(<option iterations="10000" timestep="1e-5" integrator="RK4"/>)",
      R"(<compiler inertiafromgeom="true" balanceinertia="true" fusestatic="true" discardvisual="true"/>)",
      R"(<compiler><lengthrange mode="all" inttotal="100" timestep="0.001"/></compiler>)",
      R"(<attach body="finger_base_link_0" prefix="x"/>)",
      R"(<include file="arm.xml"/>)",
      R"(<include file="/dev/zero"/>)",
      R"(<include file="/proc/self/mem"/>)",
      R"(<default class="d"><default class="e"><geom size="nan"/></default></default>)",
      R"(<tendon><fixed name="q"><joint joint="a" coef="0"/></fixed></tendon>)",
      R"(<equality><weld body1="world" body2="b"/></equality>)",
      R"(<sensor><rangefinder camera="c"/><contact num="50"/></sensor>)",
      R"(<keyframe><key qpos="1 2 3"/></keyframe>)",
      R"(<extension><plugin plugin="mujoco.sdf.bolt"><instance name="i"/></plugin></extension>)",
      "<!-- ",
      "]]>",
      "</body>",
      "<![CDATA[",
      "<mujoco>",
      "<?",
      "&#0;"};

  std::mt19937_64 random_;
};

std::string content_of(const std::filesystem::path& path) {
  std::ifstream file(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(file), {}};
}

// Tries a model in a child with limits. Returns what is wrong with its end; empty if nothing is.
std::string tried(const std::filesystem::path& file) {
  const pid_t child = ::fork();
  if (child == 0) {
    // A watchdog, far above what a model may take.
    constexpr rlimit kProcessor{.rlim_cur = 120, .rlim_max = 120};
    ::setrlimit(RLIMIT_CPU, &kProcessor);
    int status = 0;
    try {
      const ModelFile model({.path = file});
      static_cast<void>(model.make_data());
    } catch (const Error& error) {
      if (std::string_view(error.what()).empty()) status = 3;
    } catch (...) {
      status = 4;
    }
    try {
      static_cast<void>(checked_model_text(content_of(file)));
    } catch (const InvalidArgument&) {
    } catch (...) {
      status = 5;
    }
    ::_exit(status);
  }
  int status = 0;
  rusage usage{};
  if (::wait4(child, &status, 0, &usage) != child) return "it cannot be waited for";
  if (WIFSIGNALED(status)) return "it ended with signal " + std::to_string(WTERMSIG(status));
  if (WEXITSTATUS(status) != 0) return "it ended with " + std::to_string(WEXITSTATUS(status));
  constexpr std::int64_t kMaxKilobytes = 4 * 1024 * 1024;
  if (usage.ru_maxrss > kMaxKilobytes) return "it took " + std::to_string(usage.ru_maxrss) + " kB";
  return "";
}

TEST(RandomModels, fault_77_LoadOrAreAnErrorWithASentence) {
  const std::filesystem::path root = TRIFINGER_ROOT;
  std::vector<std::string> models{kArm, content_of(root / "config/dclaw/dclaw.xml"),
                                  content_of(root / "tests/robots/jaco.xml"),
                                  export_mjcf(RobotDescription{}), export_urdf(RobotDescription{})};
  const Folder folder;
  for (const char* const part : {"claw.xml", "valve.xml"}) {
    std::filesystem::copy_file(root / "config/dclaw" / part, folder / part);
  }
  const auto repeats = static_cast<std::uint64_t>(repetitions(60, 20'000));
  for (std::uint64_t seed = 0; seed < repeats; ++seed) {
    const std::string& model = models[seed % models.size()];
    const std::filesystem::path file =
        folder / (model.find("<robot") != model.npos ? "arm.urdf" : "arm.xml");
    write(file, Mutator(seed).mutated(model));
    const std::string problem = tried(file);
    if (problem.empty()) continue;
    const std::filesystem::path kept =
        std::filesystem::temp_directory_path() / ("model_" + std::to_string(seed) + ".xml");
    std::filesystem::copy_file(file, kept, std::filesystem::copy_options::overwrite_existing);
    ADD_FAILURE() << "seed " << seed << ": " << problem << "; the model is in " << kept;
  }
}

}  // namespace
}  // namespace trifinger::test
