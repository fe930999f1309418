// SPDX-License-Identifier: BSD-3-Clause
// A robot of your own, here a cart on two wheels. `05_own_robot NAME` runs it for other processes:
// Python drives it and the command line reads it, as it is.
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>
#include <iostream>
#include <stdexcept>

#include "trifinger/core/backend.hpp"
#include "trifinger/core/frontend.hpp"

namespace {

// What it can be told and what it measures, each with the list of its fields, and a name for the
// two.
struct CartAction {
  std::array<double, 2> speed{};  // of the left and the right wheel [rad/s]

  static constexpr auto fields() {
    return std::tuple{trifinger::field("speed", &CartAction::speed, "rad/s")};
  }
};

struct CartObservation {
  std::array<double, 2> place{};  // [m]
  double heading{0.0};            // [rad]

  static constexpr auto fields() {
    return std::tuple{trifinger::field("place", &CartObservation::place, "m"),
                      trifinger::field("heading", &CartObservation::heading, "rad")};
  }
};

struct Cart {
  static constexpr std::string_view kType = "cart";
  using Action = CartAction;
  using Observation = CartObservation;
};

// What a real one would do with its hardware. A driver neither waits nor looks at a clock: the
// back-end calls it once per step. An exception is a fault, which ends the session.
class CartDriver {
 public:
  CartObservation get_latest_observation() { return state_; }

  CartAction apply_action(CartAction action) {
    for (double& speed : action.speed) {
      if (std::isnan(speed)) throw std::invalid_argument("std::clamp would let NaN pass");
      speed = std::clamp(speed, -20.0, 20.0);
    }
    // Wheels of 3 cm, 20 cm apart; a step is 1 ms.
    const auto [left, right] = action.speed;
    const double distance = 0.03 * (left + right) / 2 * 0.001;
    state_.place[0] += distance * std::cos(state_.heading);
    state_.place[1] += distance * std::sin(state_.heading);
    state_.heading += 0.03 * (right - left) / 0.2 * 0.001;
    return action;  // what was applied
  }

 private:
  CartObservation state_;
};

}  // namespace

int main(int argc, char** argv) {
  trifinger::SimpleDriver<Cart, CartDriver> driver;
  auto host =
      argc == 2 ? trifinger::SessionHost::named(argv[1]) : trifinger::SessionHost::anonymous();
  trifinger::Backend backend(driver, host);
  if (argc == 2) {
    const trifinger::BackendThread thread(backend);
    const trifinger::Frontend<Cart> observer(host, {.control = false});  // waits for the session
    std::cout << "robot '" << argv[1] << "' runs; Enter stops it\n" << std::flush;
    std::cin.get();
    return EXIT_SUCCESS;
  }

  // Inside this process: two seconds of a curve. The right wheel is asked for more than it can do.
  trifinger::Frontend<Cart> robot(backend);
  trifinger::TimeIndex t = 0;
  for (int i = 0; i < 2000; ++i) t = robot.append_desired_action({.speed = {10.0, 25.0}});
  const auto applied = robot.get_applied_action(t);
  const auto y = robot.get_observation(t);
  std::cout << "after " << t << " steps at (" << y.place[0] << ", " << y.place[1] << ") m\n";
  return applied.speed[1] == 20.0 && std::abs(y.heading - 3.0) < 0.01 ? EXIT_SUCCESS : EXIT_FAILURE;
}
