// SPDX-License-Identifier: BSD-3-Clause
// foreign_backend odd|aiming NAME: a back-end with robots that Python has never heard of. Runs
// until its input ends.
#include <array>
#include <cmath>
#include <cstdio>
#include <exception>
#include <limits>
#include <memory>
#include <string_view>
#include <thread>

#include "core/odd_robot.hpp"
#include "trifinger/core/backend.hpp"
#include "trifinger/core/errors.hpp"
#include "trifinger/core/session.hpp"

namespace {

using namespace trifinger;

constexpr double kNotGiven = std::numeric_limits<double>::quiet_NaN();

// NaN means "not given" in its target, and nothing anywhere else.
struct AimingAction {
  std::array<double, 3> target{kNotGiven, kNotGiven, 0.0};
  std::array<float, 2> force{};

  static constexpr auto fields() {
    return std::tuple{field("target", &AimingAction::target, "m"),
                      field("force", &AimingAction::force, "N")};
  }
};

struct AimingRobot {
  static constexpr std::string_view kType = "aiming";
  using Action = AimingAction;
  using Observation = AimingAction;
};

class Aiming {
 public:
  [[nodiscard]] AimingAction get_latest_observation() const { return state_; }
  AimingAction apply_action(const AimingAction& desired) { return state_ = desired; }

 private:
  AimingAction state_;
};

}  // namespace

int main(int argc, char** argv) {
  try {
    if (argc != 3) throw InvalidArgument("usage: foreign_backend odd|aiming NAME");
    std::unique_ptr<UntypedDriver> driver;
    if (argv[1] == std::string_view("odd")) {
      driver = std::make_unique<test::OddDriver>();
    } else {
      driver = std::make_unique<SimpleDriver<AimingRobot, Aiming>>();
    }
    SessionHost host = SessionHost::named(argv[2]);
    Backend backend(*driver, host);
    const BackendThread thread(backend);
    // The parent connects after this line, and connecting needs a session.
    bool is_ready = false;
    while (!is_ready) {
      try {
        static_cast<void>(host.open());
        is_ready = true;
      } catch (const SessionNotFound&) {
        std::this_thread::yield();
      }
    }
    std::puts("ready");
    std::fflush(stdout);
    while (std::getchar() != EOF) {
    }
    return 0;
  } catch (const std::exception& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return 1;
  }
}
