// SPDX-License-Identifier: BSD-3-Clause
// A robot of your own, here a cart on two wheels, needs no more than this. While it runs, the
// command line can read it, and Python can drive it without changes. In C++, use
// trifinger::connect<Cart>("cart").
#include <algorithm>
#include <cmath>
#include <iostream>

#include "trifinger/core/backend.hpp"
#include "trifinger/core/frontend.hpp"

namespace {

struct Cart {
  static constexpr std::string_view kType = "cart";
  struct Action {
    std::array<double, 2> speed{};  // left and right wheel [rad/s]
    static constexpr auto fields() {
      return std::tuple{trifinger::field("speed", &Action::speed, "rad/s")};
    }
  };
  struct Observation {
    double distance{0.0};  // [m]
    double heading{0.0};   // [rad]
    static constexpr auto fields() {
      return std::tuple{trifinger::field("distance", &Observation::distance, "m"),
                        trifinger::field("heading", &Observation::heading, "rad")};
    }
  };
};

// The driver is called once per step. It neither waits nor looks at a clock. An exception is a
// fault.
class CartDriver {
 public:
  Cart::Observation get_latest_observation() { return state_; }

  Cart::Action apply_action(Cart::Action action) {
    for (double& speed : action.speed) {
      speed = std::isnan(speed) ? 0.0 : std::clamp(speed, -20.0, 20.0);
    }
    const auto [left, right] = action.speed;  // wheels of 3 cm, 20 cm apart; a step is 1 ms
    state_.distance += 0.03 * (left + right) / 2 * 0.001;
    state_.heading += 0.03 * (right - left) / 0.2 * 0.001;
    return action;  // what was applied
  }

 private:
  Cart::Observation state_;
};

}  // namespace

int main() {
  trifinger::SimpleDriver<Cart, CartDriver> driver;
  auto host = trifinger::SessionHost::named("cart");
  trifinger::Backend backend(driver, host);
  const trifinger::BackendThread thread(backend);
  const trifinger::Frontend<Cart> observer(host, {.control = false});  // waits for the session
  std::cout << "the cart runs; Enter stops it\n" << std::flush;
  std::cin.get();
}
