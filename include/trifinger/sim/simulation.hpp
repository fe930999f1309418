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
#include "trifinger/joint/types.hpp"
#include "trifinger/sim/simulated_robot.hpp"

namespace trifinger {

/// A simulated robot in this process, with an inline back-end: no threads, no waits, as fast as the
/// physics.
///
///     trifinger::Simulation simulation;
///     auto robot = simulation.connect();
///     auto t = robot.append_desired_action(trifinger::hold_position(robot.latest_observation()));
///     auto y = robot.get_observation(t);
///
/// Copies refer to the same simulation. It lives as long as one of the copies or one of its
/// front-ends.
class Simulation {
 public:
  /// Returns a driver that uses the robot, with more sensors, and that the back-end then uses
  /// instead of it; nullptr for the robot itself.
  using Around = std::function<std::unique_ptr<UntypedDriver>(SimulatedRobot&)>;

  /// Adds the documents of the model to those of `session`. The simulation sets mode and period of
  /// `backend`: it waits for every action. `name` is what errors and logs call the robot, like the
  /// name in a `RobotConfig`; default: `default_name`.
  /// @throws InvalidArgument
  explicit Simulation(SimulationOptions options = {}, SessionOptions session = {},
                      BackendOptions backend = {}, const std::string& name = {},
                      const Around& around = {})
      : parts_(std::make_shared<Parts>(std::move(options), around, std::move(session), backend,
                                       name)) {}

  /// The robot itself: reset it, place objects, save and restore its state.
  [[nodiscard]] SimulatedRobot& robot() const noexcept { return parts_->robot; }

  /// Lets `follower` see every session from the next one on. A recorder uses this to record without
  /// loss. The simulation keeps the follower as long as it lives.
  void follow(std::shared_ptr<Follower> follower) const {
    parts_->followers.push_back(std::move(follower));
    parts_->backend.follow(*parts_->followers.back());
  }

  /// Controls the robot, of type R, in a new session.
  /// @throws ControlHeld while another front-end controls it, Error if its type is another
  template <class R = TriFinger>
  [[nodiscard]] Frontend<R> connect(FrontendOptions options = {.strict = true}) const {
    return Frontend<R>(parts_->backend, options, parts_);
  }
  /// Controls the robot in programs that do not know its type.
  [[nodiscard]] UntypedFrontend connect_untyped(FrontendOptions options = {.strict = true}) const {
    return UntypedFrontend(parts_->backend, options, parts_);
  }

 private:
  struct Parts {
    Parts(SimulationOptions options, const Around& around, SessionOptions session,
          const BackendOptions& backend_options, const std::string& name)
        : robot(std::move(options)),
          outer(around ? around(robot) : nullptr),
          host(SessionHost::anonymous(with_model(std::move(session), robot.options()),
                                      name.empty() ? default_name(robot.options()) : name)),
          backend(outer ? *outer : static_cast<UntypedDriver&>(robot), host,
                  without_deadlines(backend_options, robot.options().period)) {}

    static SessionOptions with_model(SessionOptions session, const SimulationOptions& options) {
      std::ranges::move(model_documents(options), std::back_inserter(session.documents));
      return session;
    }
    static BackendOptions without_deadlines(BackendOptions options, Nanoseconds period) noexcept {
      options.mode = BackendOptions::Mode::kNonRealTime;
      options.period = period;
      return options;
    }

    SimulatedRobot robot;
    std::unique_ptr<UntypedDriver> outer;
    SessionHost host;
    std::vector<std::shared_ptr<Follower>> followers;
    Backend backend;
  };

  std::shared_ptr<Parts> parts_;
};

/// Starts a simulated robot in this process and controls it strictly: an action that would be late
/// on a real robot throws. For a robot that runs elsewhere, use `connect`.
template <class R = TriFinger>
[[nodiscard]] Frontend<R> simulate(SimulationOptions options = {},
                                   FrontendOptions frontend = {.strict = true}) {
  return Simulation(std::move(options)).connect<R>(frontend);
}

}  // namespace trifinger
