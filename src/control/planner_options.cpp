// SPDX-License-Identifier: BSD-3-Clause
#include <cmath>
#include <string>

#include "trifinger/base/error.hpp"
#include "trifinger/control/predictive_planner.hpp"

namespace trifinger::control {
namespace {

using detail::require;

bool is_share(double value) noexcept { return value >= 0.0 && value <= 1.0; }

}  // namespace

void validate(const PlannerOptions& options) {
  const auto at_least_one = [](const char* name, int value) {
    require(value >= 1,
            std::string(name) + " is " + std::to_string(value) + ", must be at least 1");
  };
  at_least_one("samples", options.samples);
  at_least_one("rounds", options.rounds);
  at_least_one("knots", options.knots);
  at_least_one("elites", options.elites);
  require(options.num_threads >= 0,
          "num_threads is " + std::to_string(options.num_threads) + ", must be at least 0");
  detail::require_positive("horizon", options.horizon.count());
  detail::require_not_negative("kp", options.kp);
  detail::require_not_negative("kd", options.kd);
  detail::require_positive("least_sigma", options.least_sigma);
  require(std::isfinite(options.most_sigma) && options.most_sigma >= options.least_sigma,
          "most_sigma is " + std::to_string(options.most_sigma) +
              ", must be at least least_sigma, " + std::to_string(options.least_sigma));
  require(is_share(options.one_finger_share),
          "one_finger_share is " + std::to_string(options.one_finger_share) + ", must be 0 to 1");
  require(is_share(options.constant_share),
          "constant_share is " + std::to_string(options.constant_share) + ", must be 0 to 1");
  detail::require_positive("temperature", options.temperature);
}

}  // namespace trifinger::control
