// SPDX-License-Identifier: BSD-3-Clause
// foreign_backend odd|aiming|probe NAME [clocked]: runs a back-end whose robot type Python does not
// know, until its input ends. With `clocked` it runs in real time by its own clock. Each line of
// input moves that clock by an eighth of a period; the answer comes when all due work is done.
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <exception>
#include <iterator>
#include <limits>
#include <memory>
#include <string_view>
#include <thread>

#include "core/odd_robot.hpp"
#include "trifinger/core/backend.hpp"
#include "trifinger/core/errors.hpp"
#include "trifinger/core/session.hpp"
#include "trifinger/realtime/clock.hpp"

namespace {

using namespace trifinger;

constexpr double kNotGiven = std::numeric_limits<double>::quiet_NaN();

// In `target`, NaN means "not given"; in other fields it has no meaning.
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

struct ProbeAction {
  std::int64_t label{0};

  static constexpr auto fields() { return std::tuple{field("label", &ProbeAction::label)}; }
};

struct ProbeObservation {
  std::int64_t applied_actions{0};        // since step 0
  std::array<std::int64_t, 64> labels{};  // of the newest of them, the newest first

  static constexpr auto fields() {
    return std::tuple{field("applied_actions", &ProbeObservation::applied_actions),
                      field("labels", &ProbeObservation::labels)};
  }
};

struct ProbeRobot {
  static constexpr std::string_view kType = "probe";
  using Action = ProbeAction;
  using Observation = ProbeObservation;
};

// A driver whose observations list the actions that they depend on, in their order.
class ProbeDriver final : public Driver<ProbeRobot> {
 public:
  using Driver::apply_action;
  using Driver::get_latest_observation;
  using Driver::hold;

  [[nodiscard]] DriverReport prepare(TimeIndex) noexcept override {
    state_ = {};
    return DriverReport::ready();
  }
  [[nodiscard]] DriverReport get_latest_observation(
      ProbeObservation& observation) noexcept override {
    observation = state_;
    return DriverReport::ready();
  }
  [[nodiscard]] DriverReport apply_action(const ProbeAction& desired,
                                          ProbeAction& applied) noexcept override {
    applied = desired;
    if (desired.label == kBeforeStep0) return DriverReport::ready();
    const auto labels = state_.labels;
    std::ranges::copy(labels.begin(), std::prev(labels.end()), std::next(state_.labels.begin()));
    state_.labels[0] = desired.label;
    ++state_.applied_actions;
    return DriverReport::ready();
  }
  [[nodiscard]] DriverReport hold(const ProbeObservation&, ProbeAction& action) noexcept override {
    action.label = kBeforeStep0;
    return DriverReport::ready();
  }

 private:
  static constexpr std::int64_t kBeforeStep0 = -1;

  ProbeObservation state_;
};

std::unique_ptr<UntypedDriver> make_driver(std::string_view robot) {
  if (robot == "odd") return std::make_unique<test::OddDriver>();
  if (robot == "probe") return std::make_unique<ProbeDriver>();
  return std::make_unique<SimpleDriver<AimingRobot, Aiming>>();
}

}  // namespace

int main(int argc, char** argv) {
  try {
    const bool is_clocked = argc == 4 && argv[3] == std::string_view("clocked");
    if (argc != 3 && !is_clocked) {
      throw InvalidArgument("usage: foreign_backend odd|aiming|probe NAME [clocked]");
    }
    const std::unique_ptr<UntypedDriver> driver = make_driver(argv[1]);
    SessionHost host = SessionHost::named(argv[2]);
    BackendOptions options;
    if (is_clocked) {
      options.mode = BackendOptions::Mode::kRealTime;
      options.max_action_repeats = BackendOptions::kUnlimited;
    }
    ManualClock clock;
    Backend backend(*driver, host, options,
                    is_clocked ? static_cast<Clock&>(clock) : MonotonicClock::instance());
    const BackendThread thread(backend);
    // The parent connects after this line, and connecting needs a session. The robot holds then.
    bool is_ready = false;
    while (!is_ready) {
      try {
        is_ready = host.open().info().phase != SessionInfo::Phase::kPreparing;
      } catch (const SessionNotFound&) {
        std::this_thread::yield();
      }
    }
    // From here on, only the input moves the clock.
    if (is_clocked) clock.wait_for_sleeper();
    std::puts("ready");
    std::fflush(stdout);
    while (std::getchar() != EOF) {
      if (!is_clocked) continue;
      clock.wait_for_sleeper();
      clock.advance(options.period / 8);
      clock.wait_for_sleeper();
      std::puts("done");
      std::fflush(stdout);
    }
    clock.run_free();
    return 0;
  } catch (const std::exception& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return 1;
  }
}
