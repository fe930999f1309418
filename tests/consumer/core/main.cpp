// SPDX-License-Identifier: BSD-3-Clause
// Defines a robot of its own, on the core alone.
#include <cstdio>
#include <string_view>
#include <tuple>

#include "trifinger/core/backend.hpp"
#include "trifinger/core/driver.hpp"
#include "trifinger/core/frontend.hpp"
#include "trifinger/core/session.hpp"

struct WheelAction {
  double speed{0.0};

  static constexpr auto fields() {
    return std::tuple{trifinger::field("speed", &WheelAction::speed, "rad/s")};
  }
};

struct WheelObservation {
  double angle{0.0};

  static constexpr auto fields() {
    return std::tuple{trifinger::field("angle", &WheelObservation::angle, "rad")};
  }
};

struct Wheel {
  static constexpr std::string_view kType = "wheel";
  using Action = WheelAction;
  using Observation = WheelObservation;
};

class WheelDriver {
 public:
  WheelObservation get_latest_observation() { return {.angle = angle_}; }
  WheelAction apply_action(const WheelAction& desired) {
    angle_ += desired.speed * 0.001;
    return desired;
  }

 private:
  double angle_{0.0};
};

int main() {
  trifinger::SimpleDriver<Wheel, WheelDriver> driver;
  auto host = trifinger::SessionHost::anonymous();
  trifinger::Backend backend(driver, host);
  trifinger::Frontend<Wheel> robot(backend);

  trifinger::TimeIndex t = 0;
  while (t < 100) t = robot.append_desired_action({.speed = 2.0});
  std::printf("at step %d the wheel is at %.3f rad\n", static_cast<int>(t),
              robot.get_observation(t).angle);
}
