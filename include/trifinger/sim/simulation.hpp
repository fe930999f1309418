// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <functional>
#include <iterator>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "trifinger/core/backend.hpp"
#include "trifinger/core/follower.hpp"
#include "trifinger/core/frontend.hpp"
#include "trifinger/core/session.hpp"
#include "trifinger/sim/simulated_robot.hpp"

namespace trifinger {

/// A simulated robot in this process, with an inline back-end: no threads, no waits, as fast as the
/// physics.
///
///     trifinger::Simulation<trifinger::TriFinger> simulation;
///     auto robot = simulation.connect();
///     auto t = robot.append_desired_action(trifinger::hold_position(robot.latest_observation()));
///     auto y = robot.get_observation(t);
///
/// Copies refer to the same simulation. It lives as long as one of the copies or one of its
/// front-ends.
template <class R>
class Simulation {
 public:
  /// Adds the model and the description of the scene to the documents of `session`. The simulation
  /// sets mode and period of `backend`: it waits for every action. `name` is what errors and logs
  /// call the robot, like the name in a `RobotConfig`. The default is its type and variant, for
  /// example "trifinger-pro".
  /// @throws InvalidArgument
  explicit Simulation(SimulationOptions<R> options = {}, SessionOptions session = {},
                      BackendOptions backend = {}, const std::string& name = {})
      : Simulation(
            std::move(options), [](SimulatedRobot<R>&) { return nullptr; }, std::move(session),
            backend, name) {}
  /// The simulated robot with more sensors: `around` returns a driver that uses the robot, and that
  /// the back-end then uses instead of it; nullptr for the robot itself.
  /// @throws InvalidArgument
  Simulation(SimulationOptions<R> options,
             const std::function<std::unique_ptr<UntypedDriver>(SimulatedRobot<R>&)>& around,
             SessionOptions session = {}, BackendOptions backend = {}, const std::string& name = {})
      : parts_(std::make_shared<Parts>(std::move(options), around, std::move(session), backend,
                                       name)) {}

  /// The robot itself: reset it, place objects, save and restore its state.
  [[nodiscard]] SimulatedRobot<R>& robot() const noexcept { return parts_->robot; }

  /// Lets `follower` see every session from the next one on. `log::Recorder` uses this to record
  /// without loss. The simulation keeps the follower as long as it lives.
  void follow(std::shared_ptr<Follower> follower) const {
    parts_->followers.push_back(std::move(follower));
    parts_->backend.follow(*parts_->followers.back());
  }

  /// Controls the robot in a new session.
  /// @throws ControlHeld while another front-end controls it
  [[nodiscard]] Frontend<R> connect(FrontendOptions options = {.strict = true}) const {
    return Frontend<R>(parts_->backend, options, parts_);
  }
  /// Controls the robot in programs that do not know R.
  [[nodiscard]] UntypedFrontend connect_untyped(FrontendOptions options = {.strict = true}) const {
    return UntypedFrontend(parts_->backend, options, parts_);
  }

 private:
  struct Parts {
    Parts(SimulationOptions<R> options,
          const std::function<std::unique_ptr<UntypedDriver>(SimulatedRobot<R>&)>& around,
          SessionOptions session, const BackendOptions& backend_options, const std::string& name)
        : robot(std::move(options)),
          outer(around(robot)),
          host(SessionHost::anonymous(with_model(std::move(session), robot.options().description),
                                      name.empty() ? default_name() : name)),
          backend(outer ? *outer : static_cast<UntypedDriver&>(robot), host,
                  without_deadlines(backend_options, robot.options().period)) {}

    [[nodiscard]] std::string default_name() const {
      const Variant variant = robot.options().description.variant;
      return std::string(R::kType) + "-" + std::string(variant_figures(variant).name);
    }

    static SessionOptions with_model(SessionOptions session, const RobotDescription& description) {
      std::ranges::move(model_documents(description), std::back_inserter(session.documents));
      return session;
    }
    static BackendOptions without_deadlines(BackendOptions options, Nanoseconds period) noexcept {
      options.mode = BackendOptions::Mode::kNonRealTime;
      options.period = period;
      return options;
    }

    SimulatedRobot<R> robot;
    std::unique_ptr<UntypedDriver> outer;
    SessionHost host;
    std::vector<std::shared_ptr<Follower>> followers;
    Backend backend;
  };

  std::shared_ptr<Parts> parts_;
};

/// Starts a simulated robot in this process and controls it strictly: an action that would be late
/// on a real robot throws. For a robot that runs elsewhere, use `connect`.
template <class R>
[[nodiscard]] Frontend<R> simulate(SimulationOptions<R> options = {},
                                   FrontendOptions frontend = {.strict = true}) {
  return Simulation<R>(std::move(options)).connect(frontend);
}

}  // namespace trifinger
