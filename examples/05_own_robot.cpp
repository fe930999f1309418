// SPDX-License-Identifier: BSD-3-Clause
// A robot of your own: two structs, their fields, and a driver with the paper's two functions. This
// one is a cart on two wheels. With `--serve NAME` it runs for other processes: the command line
// and Python can use it as it is.
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>
#include <iostream>
#include <stdexcept>
#include <string>
#include <string_view>
#include <tuple>

#include "trifinger/core/backend.hpp"
#include "trifinger/core/frontend.hpp"

namespace {

using trifinger::field;

struct CartAction {
  std::array<double, 2> wheel_speed{};  // left, right [rad/s]

  static constexpr auto fields() {
    return std::tuple{field("wheel_speed", &CartAction::wheel_speed, "rad/s")};
  }
};

struct CartObservation {
  std::array<double, 2> place{};  // [m]
  double heading{0.0};            // [rad]

  static constexpr auto fields() {
    return std::tuple{field("place", &CartObservation::place, "m"),
                      field("heading", &CartObservation::heading, "rad")};
  }
};

struct Cart {
  static constexpr std::string_view kType = "cart";
  using Action = CartAction;
  using Observation = CartObservation;
};

// Here hardware would be read and written. A driver neither waits nor looks at a clock: the
// back-end calls it once per step.
class CartDriver {
 public:
  CartObservation get_latest_observation() { return state_; }

  CartAction apply_action(const CartAction& desired) {
    constexpr double kMaxSpeed = 20.0, kRadius = 0.03, kTrack = 0.2, kStep = 0.001;
    CartAction applied;
    for (std::size_t i = 0; i < 2; ++i) {
      // NaN would pass through std::clamp.
      if (std::isnan(desired.wheel_speed[i])) throw std::invalid_argument("speed is NaN");
      applied.wheel_speed[i] = std::clamp(desired.wheel_speed[i], -kMaxSpeed, kMaxSpeed);
    }
    const auto [left, right] = applied.wheel_speed;
    const double distance = kRadius * (left + right) / 2 * kStep;
    state_.place[0] += distance * std::cos(state_.heading);
    state_.place[1] += distance * std::sin(state_.heading);
    state_.heading += kRadius * (right - left) / kTrack * kStep;
    return applied;
  }

 private:
  CartObservation state_;
};

using Driver = trifinger::SimpleDriver<Cart, CartDriver>;

void serve(const std::string& name) {
  Driver driver;
  auto host = trifinger::SessionHost::named(name);
  trifinger::Backend backend(driver, host);
  const trifinger::BackendThread thread(backend);
  const trifinger::Frontend<Cart> observer(host, {.control = false});  // waits for the session
  std::cout << "cart '" << name << "' runs; Enter stops it\n" << std::flush;
  std::cin.get();
}

}  // namespace

int main(int argc, char** argv) {
  if (argc == 3 && std::string(argv[1]) == "--serve") {
    serve(argv[2]);
    return EXIT_SUCCESS;
  }

  Driver driver;
  auto host = trifinger::SessionHost::anonymous();
  trifinger::Backend backend(driver, host);
  trifinger::Frontend<Cart> robot(backend);

  // Two seconds of a curve; the right wheel is asked for more than it can do.
  trifinger::TimeIndex t = 0;
  for (int i = 0; i < 2000; ++i) t = robot.append_desired_action({.wheel_speed = {10.0, 25.0}});
  const auto applied = robot.get_applied_action(t);
  const auto y = robot.get_observation(t);
  std::cout << "after " << t << " steps at (" << y.place[0] << ", " << y.place[1] << ") m, heading "
            << y.heading << " rad\n";
  return applied.wheel_speed[1] == 20.0 && std::abs(y.heading - 3.0) < 0.01 ? EXIT_SUCCESS
                                                                            : EXIT_FAILURE;
}
