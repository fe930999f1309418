// SPDX-License-Identifier: BSD-3-Clause
#include "trifinger/sim/condition.hpp"

#include <algorithm>
#include <cmath>
#include <string>
#include <tuple>
#include <type_traits>

#include "trifinger/base/error.hpp"

namespace trifinger {

Condition condition_from_name(std::string_view name) {
  const auto* const found = std::ranges::find(kConditionNames, name);
  if (found == kConditionNames.end()) {
    throw InvalidArgument("'" + std::string(name) +
                          "' is no condition of a robot: 'as documented', 'as built' or 'worn'");
  }
  return static_cast<Condition>(found - kConditionNames.begin());
}

Variation draw(Condition condition, Random& random) noexcept {
  Variation robot;
  if (condition == Condition::kAsDocumented) return robot;
  const bool is_worn = condition == Condition::kWorn;
  const double bad = is_worn ? 2.0 : 1.0;
  robot.homing_error = 0.005 * bad;
  robot.backlash = bad * random.uniform(0.002, 0.005);
  robot.joint_friction = bad * random.uniform(0.005, 0.015);
  robot.joint_damping = bad * random.uniform(0.5, 2.0);
  robot.motor_spread = 0.05 * bad;
  robot.torque_ripple = 0.05 * bad;
  robot.torque_delay = random.integer(1, 3) * (is_worn ? 2 : 1);
  robot.measurement_delay = is_worn ? 2 : 1;
  robot.velocity_noise = bad * random.uniform(0.02, 0.05);
  robot.motor_heat = bad * random.uniform(0.0, 0.25);
  robot.tip_radius = 1.0 + bad * random.uniform(-0.05, 0.05);
  robot.seed = static_cast<std::uint64_t>(random.integer(0, 1'000'000'000));
  if (!is_worn) return robot;
  for (const SurfacePair pair :
       {SurfacePair::kTipObject, SurfacePair::kTipTable, SurfacePair::kTipTip}) {
    robot.pair_friction[pair] = random.uniform(0.7, 1.0);
  }
  robot.contact_time = random.uniform(0.7, 1.5);
  return robot;
}

void set_value(Variation& robot, std::string_view name, double value) {
  std::string names;
  bool is_set = false;
  const auto try_field = [&]<class T>(const VariationField<T>& field) {
    if constexpr (std::is_arithmetic_v<T>) {
      names += std::string(names.empty() ? "" : ", ") + field.name;
      if (name != field.name) return;
      robot.*field.value = static_cast<T>(std::is_integral_v<T> ? std::round(value) : value);
      is_set = true;
    }
  };
  std::apply([&](const auto&... field) { (try_field(field), ...); }, Variation::fields());
  if (is_set) return;
  throw InvalidArgument("robots do not vary in '" + std::string(name) + "'; they do in " + names);
}

}  // namespace trifinger
