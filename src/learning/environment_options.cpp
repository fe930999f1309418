// SPDX-License-Identifier: BSD-3-Clause
#include "trifinger/learning/environment_options.hpp"

#include <algorithm>
#include <array>
#include <limits>
#include <map>
#include <nlohmann/json.hpp>
#include <numbers>
#include <span>
#include <utility>

#include "base/suggestion.hpp"
#include "base/text_of.hpp"
#include "trifinger/base/error.hpp"
#include "trifinger/sim/variation.hpp"

namespace trifinger::learning {
namespace {

using trifinger::detail::text_of;

using Json = nlohmann::ordered_json;
using PairRanges = OfSurfacePairs<std::optional<Range<double>>>;
using Names = std::vector<std::string>;

constexpr double kInfinity = std::numeric_limits<double>::infinity();

// Says what an option means and which values it may have.
struct About {
  const char* meaning;
  // Bounds of numbers and ranges. None: the configuration of the robot says what is allowed.
  double least{-kInfinity};
  double most{kInfinity};
  std::span<const std::string_view> words{};  // for enumerators, in their order
  bool varies{false};  // a part of `Variation`: simulations differ from their configuration
};

constexpr std::array<std::string_view, 2> kMappings{"state_augmentation", "approximation"};
constexpr std::array<std::string_view, 4> kActions{"position", "position_change",
                                                   "relative_position", "torque"};
constexpr std::array<std::string_view, 4> kLayouts{"flat", "dictionary", "goal", "images"};
constexpr std::array<std::string_view, 2> kObjectPoses{"exact", "tracked"};

constexpr About factor(const char* meaning, double least, double most) {
  return {.meaning = meaning, .least = least, .most = most, .varies = true};
}

// The one table of options: reading, writing, checking and Python's class loop over it.
template <class Options, class Visitor>
void visit(Options& options, const Visitor& field) {
  field("steps_per_action", options.steps_per_action,
        About{"Number of steps of the robot for which an action acts.", 1, 1000});
  field(
      "mapping", options.mapping,
      About{.meaning =
                "How steps of the robot become states and actions; docs/learning.md compares both.",
            .words = kMappings});
  field("action", options.action,
        About{.meaning = "What numbers from -1 to 1 mean: positions in their range, changes of the "
                         "desired positions, desired positions relative to the measured ones, or "
                         "shares of the largest torque.",
              .words = kActions});
  field("position_change", options.position_change,
        About{"Largest change of a desired position by one action, or largest distance from the "
              "measured one [rad].",
              1e-6, std::numbers::pi});
  field(
      "leash", options.leash,
      About{"Largest distance of a desired position from the measured one, if actions are changes "
            "of it [rad]. It is observed as `tracking_error`.",
            1e-6, std::numbers::pi});
  field(
      "position_kp", options.position_kp,
      About{"Stiffness with which joints go to desired positions [Nm/rad]; 0: that of the robot. A "
            "robot whose torques or measurements are late trembles if it is stiff.",
            0, 1e6});
  field("observation", options.layout,
        About{.meaning = "One vector scaled to -1 to 1, its parts in SI units, the vector with a "
                         "separate goal, or the parts with images of the cameras instead of poses "
                         "of objects.",
              .words = kLayouts});
  field("duration", options.duration, About{"Duration of an episode [s].", 1e-3, 3600});
  field("per_finger", options.per_finger,
        About{"Whether observations are ordered finger by finger, with goals in the frame of each "
              "finger. A policy that the fingers share needs this."});
  field("symmetric_view", options.symmetric_view,
        About{"Whether positions are shown turned about the middle by thirds of a circle, and "
              "fingers in another order, so that the goal of an object is on the side of finger 0. "
              "The fingers are turned copies of one, so a policy has a third of the goals to "
              "learn."});
  field("symmetric_object", options.symmetric_object,
        About{"Whether it is observed how a cube lies, whatever the colours of its faces, in place "
              "of its orientation: nine numbers, the same for the 24 orientations that differ in "
              "colours only. For goals that are positions."});
  field(
      "object_offsets", options.object_offsets,
      About{
          "Whether the offsets from the object, and from where a tip would push it to its goal, to "
          "the tips are observed, too, and how far and in which direction the goal is. They "
          "follow from the rest, but 2 cm are little among its numbers."});
  field("keypoints", options.keypoints,
        About{"Whether the corners of a cube of 65 mm at the object, and at its goal if that has "
              "an orientation, are observed in place of quaternions."});
  field("frames", options.frames,
        About{"Names of sites, bodies or geoms of a robot from a file, which take the place of "
              "tips: tasks such as reach have a goal for each."});
  field("position_noise", options.position_noise,
        About{"Standard deviation of measured joint positions [rad].", 0, 1});
  field("velocity_noise", options.velocity_noise,
        About{"Standard deviation of measured joint velocities [rad/s].", 0, 10});
  field("object_poses", options.object_poses,
        About{.meaning = "How poses of objects are known: exactly, apart from the delay, noise and "
                         "losses below; or from a tracker, in images of the cameras.",
              .words = kObjectPoses});
  field("object_period", options.object_period,
        About{"Time between two measured poses of a simulated object [s]."});
  field("object_delay", options.object_delay,
        About{"Delay from measuring a pose of a simulated object to its arrival [s]. Tracked poses "
              "arrive with their images if these are later."});
  field("object_position_noise", options.object_position_noise,
        About{"Standard deviation of measured object positions, per axis [m]."});
  field("object_orientation_noise", options.object_orientation_noise,
        About{"Standard deviation of measured object orientations, per axis [rad]."});
  field("object_loss", options.object_loss,
        About{"Probability that a pose of a simulated object never arrives."});
  field("camera_rate", options.camera_rate,
        About{"Images of each simulated camera per second [Hz]. Tracked poses come at this rate."});
  field("camera_delay", options.camera_delay,
        About{"Delay from the middle of the exposure of a simulated image to its arrival [s]."});
  field("camera_size", options.camera_size,
        About{"Width and height of simulated images [pixel], up to 540: the middle of the image, "
              "scaled by a whole number."});
  field("camera_varies", options.camera_varies,
        About{"Whether light, colours, dust and noise of simulated images differ in each episode. "
              "docs/simulated_cameras.md says how much."});
  field(
      "condition", options.condition,
      About{.meaning = "State of the simulated robot: with perfect joints, with errors of homing, "
                       "friction, play, delays and noise of a robot that was built with care, or "
                       "with twice as much. Each episode has another robot. Options below that "
                       "are not at their defaults take the place of what this says.",
            .words = kConditionNames,
            .varies = true});
  field("object_mass", options.object_mass,
        factor("Factor on the mass of simulated objects.", 0.01, 100));
  field("friction", options.friction,
        factor("Factor on the friction of all simulated surfaces.", 0, 100));
  field("motor_gain", options.motor_gain,
        factor("Share of the applied torque that simulated motors deliver.", 0.01, 10));
  field("torque_delay", options.torque_delay,
        factor("Delay until simulated motors deliver a torque, up to 10 [steps].", 0,
               static_cast<double>(Variation::kMaxDelay)));
  field("pair_friction", options.pair_friction,
        factor("Factors on the friction of pairs of simulated surfaces, in addition to `friction`: "
               "{\"tip_object\": (0.7, 1.2)}. docs/simulation.md names the pairs.",
               0, 100));
  field("contact_time", options.contact_time,
        factor("Factor on the time constants of simulated contacts: larger is softer.", 0.01, 100));
  field("rotor_inertia", options.rotor_inertia,
        factor("Factor on the rotor inertia of simulated motors.", 0, 100));
  field("joint_damping", options.joint_damping,
        factor("Factor on the damping of simulated joints; the damping of the safety checks stays.",
               0, 1000));
  field("joint_friction", options.joint_friction,
        factor("Dry friction that is added to that of simulated joints [Nm].", 0, 1));
  field("stop_margin", options.stop_margin,
        factor("Factor on the distance from hard limits to mechanical stops.", 0, 10));
  field("homing_error", options.homing_error,
        factor("Largest error of the zero of simulated encoders [rad], [m].", 0, 1));
  field("motor_spread", options.motor_spread,
        factor("Share by which `motor_gain` of a simulated motor differs at most.", 0, 0.99));
  field("torque_ripple", options.torque_ripple,
        factor("Share of the torque that comes and goes as a simulated motor turns.", 0, 0.99));
  field("backlash", options.backlash,
        factor("Play between simulated motors and their joints [rad], [m].", 0, 1));
  field("measurement_delay", options.measurement_delay,
        factor("Age of measured positions and velocities of simulated joints [steps].", 0,
               static_cast<double>(Variation::kMaxDelay)));
  field("motor_heat", options.motor_heat,
        factor("Heat of simulated motors at the start of an episode, as a share of their limit.", 0,
               0.99));
  field("tip_radius", options.tip_radius,
        factor("Factor on the radius of simulated tips.", 0.1, 10));
  field(
      "object_speed", options.object_speed,
      About{"Speed of a simulated object at the start of an episode, in a random direction [m/s].",
            0, 10});
}

template <class T>
void check(std::string_view name, const T& value, const About& about) {
  if constexpr (std::is_arithmetic_v<T> && !std::is_same_v<T, bool>) {
    // Written so that NaN fails where there are bounds.
    if (about.least == -kInfinity) return;
    const auto number = static_cast<double>(value);
    if (number >= about.least && number <= about.most) return;
    throw InvalidArgument(
        text_of(name, " is ", value, ", must be ", about.least, " to ", about.most));
  }
}
template <class T>
void check(std::string_view name, const Range<T>& range, const About& about) {
  const auto low = static_cast<double>(range.low);
  const auto high = static_cast<double>(range.high);
  // Written so that NaN fails.
  if (low >= about.least && low <= high && high <= about.most) return;
  throw InvalidArgument(text_of(name, " is ", range.low, " to ", range.high, ", must lie within ",
                                about.least, " to ", about.most, ", the smaller one first"));
}
void check(std::string_view name, const PairRanges& ranges, const About& about) {
  for (const SurfacePair pair : all_surface_pairs()) {
    if (ranges[pair]) check(text_of(name, " of ", name_of(pair)), *ranges[pair], about);
  }
}

template <class T>
Json written(const T& value, const About& about) {
  if constexpr (std::is_enum_v<T>) {
    return about.words[static_cast<std::size_t>(value)];
  } else {
    return value;
  }
}
template <class T>
Json written(const Range<T>& range, const About& /*about*/) {
  return Json{range.low, range.high};
}
Json written(const PairRanges& ranges, const About& /*about*/) {
  Json object = Json::object();
  for (const SurfacePair pair : all_surface_pairs()) {
    if (const auto& range = ranges[pair]) object[name_of(pair)] = {range->low, range->high};
  }
  return object;
}

template <class T>
void read(std::string_view name, const Json& json, const About& about, T& value) {
  if constexpr (std::is_enum_v<T>) {
    const auto word = json.get<std::string>();
    const auto place = std::ranges::find(about.words, std::string_view(word));
    if (place == about.words.end()) {
      throw InvalidArgument(text_of(name, " is '", word, "', must be ",
                                    quoted_list({about.words.begin(), about.words.end()}, "or")));
    }
    value = static_cast<T>(place - about.words.begin());
  } else {
    value = json.get<T>();
  }
}
template <class T>
void read(std::string_view /*name*/, const Json& json, const About& /*about*/, Range<T>& range) {
  const auto [low, high] = json.get<std::pair<T, T>>();
  range = {low, high};
}
void read(std::string_view /*name*/, const Json& json, const About& /*about*/, PairRanges& ranges) {
  ranges = {};
  using Limits = std::pair<double, double>;
  for (const auto& [pair, limits] : json.get<std::map<std::string, Limits>>()) {
    ranges[surface_pair_from_name(pair)] = Range<double>{limits.first, limits.second};
  }
}

// Names the type of an option in Python.
template <class T>
std::string type_of(const T& /*value*/, const About& about) {
  if constexpr (std::is_enum_v<T>) {
    std::string words;
    for (const std::string_view word : about.words) {
      words += text_of(words.empty() ? "\"" : ", \"", word, "\"");
    }
    return "Literal[" + words + "]";
  } else if constexpr (std::is_same_v<T, bool>) {
    return "bool";
  } else if constexpr (std::is_integral_v<T>) {
    return "int";
  } else {
    return "float";
  }
}
template <class T>
std::string type_of(const Range<T>& range, const About& about) {
  const std::string type = type_of(range.low, about);
  return text_of("tuple[", type, ", ", type, "]");
}
std::string type_of(const Names& /*names*/, const About& /*about*/) { return "tuple[str, ...]"; }
std::string type_of(const PairRanges& /*ranges*/, const About& /*about*/) {
  return "Mapping[str, tuple[float, float]]";
}

}  // namespace

void EnvironmentOptions::validate() const {
  visit(*this,
        [](const char* name, const auto& value, const About& about) { check(name, value, about); });
  if (mapping == Mapping::kApproximation && steps_per_action == 1) {
    throw InvalidArgument(
        "steps_per_action is 1, must be 2 or more for the mapping 'approximation': an observation "
        "would not depend on the action that leads to it");
  }
  if (object_poses == ObjectPoses::kTracked && layout == Layout::kImages) {
    throw InvalidArgument(
        "object_poses is 'tracked', but poses of objects are no part of the observation 'images'");
  }
  if (object_poses == ObjectPoses::kTracked &&
      (object_position_noise != 0 || object_orientation_noise != 0 || object_loss != 0)) {
    throw InvalidArgument(
        "object_position_noise, object_orientation_noise and object_loss must be 0 if "
        "object_poses is 'tracked': tracked poses have the noise of their images");
  }
}

bool EnvironmentOptions::varies() const {
  const auto varied = [](const EnvironmentOptions& options) {
    Json json;
    visit(options, [&json](const char* name, const auto& value, const About& about) {
      if (about.varies) json[name] = written(value, about);
    });
    return json;
  };
  return varied(*this) != varied({});
}

std::vector<OptionDescription> describe_options() {
  std::vector<OptionDescription> all;
  const EnvironmentOptions defaults;
  visit(defaults, [&all](const char* name, const auto& value, const About& about) {
    all.push_back({.name = name,
                   .type = type_of(value, about),
                   .value = written(value, about).dump(),
                   .meaning = about.meaning});
  });
  return all;
}

std::string write_options(const EnvironmentOptions& options) {
  Json json = Json::object();
  visit(options, [&json](const char* name, const auto& value, const About& about) {
    json[name] = written(value, about);
  });
  return json.dump();
}

EnvironmentOptions read_options(std::string_view json) {
  Json object = Json::parse(json, nullptr, /*allow_exceptions=*/false);
  if (!object.is_object()) throw InvalidArgument("the options are no JSON object");
  EnvironmentOptions options;
  std::vector<std::string_view> names;
  visit(options, [&](const char* name, auto& value, const About& about) {
    names.emplace_back(name);
    const auto found = object.find(name);
    if (found == object.end()) return;
    try {
      read(name, *found, about, value);
    } catch (const Json::exception&) {
      throw InvalidArgument(text_of(name, " is ", found->dump(), ", which is of another type"));
    }
    object.erase(found);
  });
  if (object.empty()) return options;
  throw InvalidArgument(text_of("there is no option '", object.items().begin().key(),
                                "'; there are ", quoted_list(names, "and")));
}

}  // namespace trifinger::learning
