// SPDX-License-Identifier: BSD-3-Clause
#include "trifinger/learning/environment_options.hpp"

#include <algorithm>
#include <array>
#include <map>
#include <nlohmann/json.hpp>
#include <numbers>
#include <utility>

#include "text.hpp"
#include "trifinger/base/error.hpp"
#include "trifinger/base/suggestion.hpp"
#include "trifinger/sim/variation.hpp"

namespace trifinger::learning {
namespace {

using Json = nlohmann::ordered_json;

template <class T>
void require_range(const char* name, const Range<T>& range, T lowest, T highest) {
  // Written so that NaN fails.
  if (range.low >= lowest && range.low <= range.high && range.high <= highest) return;
  throw InvalidArgument(text(name, " is ", range.low, " to ", range.high, ", must lie within ",
                             lowest, " to ", highest, ", the smaller one first"));
}

void require_within(const char* name, double value, double lowest, double highest) {
  if (value >= lowest && value <= highest) return;
  throw InvalidArgument(text(name, " is ", value, ", must be ", lowest, " to ", highest));
}

// The words for enumerators, in their order.
constexpr std::array<std::string_view, 2> kMappings{"state_augmentation", "approximation"};
constexpr std::array<std::string_view, 3> kActions{"position", "position_change", "torque"};
constexpr std::array<std::string_view, 3> kLayouts{"flat", "dictionary", "goal"};

// Visits all options by name. One visitor writes them, another one reads them, so this is the only
// list of their names.
template <class Options, class Visitor>
void visit(Options& options, const Visitor& field) {
  field("steps_per_action", options.steps_per_action);
  field("mapping", options.mapping, kMappings);
  field("action", options.action, kActions);
  field("position_change", options.position_change);
  field("observation", options.layout, kLayouts);
  field("duration", options.duration);
  field("per_finger", options.per_finger);
  field("position_noise", options.position_noise);
  field("velocity_noise", options.velocity_noise);
  field("object_period", options.object_period);
  field("object_delay", options.object_delay);
  field("object_position_noise", options.object_position_noise);
  field("object_orientation_noise", options.object_orientation_noise);
  field("object_mass", options.object_mass);
  field("friction", options.friction);
  field("motor_gain", options.motor_gain);
  field("torque_delay", options.torque_delay);
  field("pair_friction", options.pair_friction);
  field("contact_time", options.contact_time);
  field("rotor_inertia", options.rotor_inertia);
  field("joint_damping", options.joint_damping);
  field("joint_friction", options.joint_friction);
  field("stop_margin", options.stop_margin);
  field("object_speed", options.object_speed);
}

struct Writer {
  Json* json;

  template <class T>
  void operator()(const char* name, const T& value) const {
    (*json)[name] = value;
  }
  template <class T>
  void operator()(const char* name, const Range<T>& range) const {
    (*json)[name] = {range.low, range.high};
  }
  void operator()(const char* name,
                  const OfSurfacePairs<std::optional<Range<double>>>& ranges) const {
    Json& object = (*json)[name] = Json::object();
    for (const SurfacePair pair : all_surface_pairs()) {
      if (const auto& range = ranges[pair]) object[name_of(pair)] = {range->low, range->high};
    }
  }
  template <class T, std::size_t kCount>
  void operator()(const char* name, T value,
                  const std::array<std::string_view, kCount>& words) const {
    (*json)[name] = words.at(static_cast<std::size_t>(value));
  }
};

// Takes each option that it reads out of the JSON object.
struct Reader {
  Json* json;

  template <class T>
  void operator()(const char* name, T& value) const {
    take(name, [&](const Json& found) { value = found.get<T>(); });
  }
  template <class T>
  void operator()(const char* name, Range<T>& range) const {
    take(name, [&](const Json& found) {
      const auto [low, high] = found.get<std::pair<T, T>>();
      range = {low, high};
    });
  }
  void operator()(const char* name, OfSurfacePairs<std::optional<Range<double>>>& ranges) const {
    take(name, [&](const Json& found) {
      ranges = {};
      using Limits = std::pair<double, double>;
      for (const auto& [pair, limits] : found.get<std::map<std::string, Limits>>()) {
        ranges[surface_pair_from_name(pair)] = Range<double>{limits.first, limits.second};
      }
    });
  }
  template <class T, std::size_t kCount>
  void operator()(const char* name, T& value,
                  const std::array<std::string_view, kCount>& words) const {
    take(name, [&](const Json& found) {
      const auto word = found.get<std::string>();
      const auto place = std::ranges::find(words, std::string_view(word));
      if (place == words.end()) {
        throw InvalidArgument(text(name, " is '", word, "', must be ",
                                   quoted_list({words.begin(), words.end()}, "or")));
      }
      value = static_cast<T>(place - words.begin());
    });
  }

  template <class Read>
  void take(const char* name, const Read& read) const {
    const auto found = json->find(name);
    if (found == json->end()) return;
    try {
      read(*found);
    } catch (const Json::exception&) {
      throw InvalidArgument(text(name, " is ", found->dump(), ", which is of another type"));
    }
    json->erase(found);
  }
};

}  // namespace

void EnvironmentOptions::validate() const {
  require_within("steps_per_action", steps_per_action, 1, 1000);
  require_within("position_change", position_change, 1e-6, std::numbers::pi);
  require_within("duration", duration, 1e-3, 3600);
  require_within("position_noise", position_noise, 0, 1);
  require_within("velocity_noise", velocity_noise, 0, 10);
  // The allowed values of the options for poses depend on the robot's configuration.
  require_range("object_mass", object_mass, 0.01, 100.0);
  require_range("friction", friction, 0.0, 100.0);
  require_range("motor_gain", motor_gain, 0.01, 10.0);
  require_range("torque_delay", torque_delay, TimeIndex{0}, Variation::kMaxTorqueDelay);
  for (const SurfacePair pair : all_surface_pairs()) {
    if (!pair_friction[pair]) continue;
    const std::string name = text("pair_friction of ", name_of(pair));
    require_range(name.c_str(), *pair_friction[pair], 0.0, 100.0);
  }
  require_range("contact_time", contact_time, 0.01, 100.0);
  require_range("rotor_inertia", rotor_inertia, 0.0, 100.0);
  require_range("joint_damping", joint_damping, 0.0, 1000.0);
  require_range("joint_friction", joint_friction, 0.0, 1.0);
  require_range("stop_margin", stop_margin, 0.0, 10.0);
  require_range("object_speed", object_speed, 0.0, 10.0);
  if (mapping == Mapping::kApproximation && steps_per_action == 1) {
    throw InvalidArgument(
        "steps_per_action is 1, must be 2 or more for the mapping 'approximation': an observation "
        "would not depend on the action that leads to it");
  }
}

bool EnvironmentOptions::varies() const noexcept {
  const auto is_one = [](const Range<double>& range) {
    return range.low == 1.0 && range.high == 1.0;
  };
  return !is_one(object_mass) || !is_one(friction) || !is_one(motor_gain) ||
         torque_delay.high > 0 || pair_friction != decltype(pair_friction){} ||
         !is_one(contact_time) || !is_one(rotor_inertia) || !is_one(joint_damping) ||
         joint_friction.high > 0.0 || !is_one(stop_margin);
}

std::string write_options(const EnvironmentOptions& options) {
  Json json = Json::object();
  visit(options, Writer{&json});
  return json.dump();
}

EnvironmentOptions read_options(std::string_view json) {
  Json object = Json::parse(json, nullptr, /*allow_exceptions=*/false);
  if (!object.is_object()) throw InvalidArgument("the options are no JSON object");
  EnvironmentOptions options;
  visit(options, Reader{&object});
  if (object.empty()) return options;
  std::vector<std::string> names;
  visit(options, [&names](const char* name, const auto&...) { names.emplace_back(name); });
  throw InvalidArgument(text("there is no option '", object.items().begin().key(), "'; there are ",
                             quoted_list({names.begin(), names.end()}, "and")));
}

}  // namespace trifinger::learning
