// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
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

/// A simulated robot in this process, with its back-end inline: no threads, no waits, as fast as
/// the physics.
///
///     trifinger::Simulation<trifinger::TriFinger> simulation;
///     auto robot = simulation.connect();
///     auto t = robot.append_desired_action(trifinger::hold_position(robot.latest_observation()));
///     auto y = robot.get_observation(t);
///
/// Copies refer to the same simulation; it lives as long as one of them or one of its front-ends.
template <class R>
class Simulation {
 public:
  /// Model and description of the scene are added to the documents of `session`.
  /// Of `backend`, the mode and the period are set by the simulation: it waits for every action.
  /// `name` is what errors and logs call the robot, as that of a `RobotConfig`; by default its type
  /// and variant, as in "trifinger-pro".
  /// @throws InvalidArgument
  explicit Simulation(SimulationOptions<R> options = {}, SessionOptions session = {},
                      BackendOptions backend = {}, const std::string& name = {})
      : parts_(std::make_shared<Parts>(std::move(options), std::move(session), backend, name)) {}

  /// The robot itself: reset it, place objects, save and restore its state.
  [[nodiscard]] SimulatedRobot<R>& robot() const noexcept { return parts_->robot; }

  /// Lets `follower` see every session from the next one on, as `log::Recorder` does to record
  /// without loss. It is kept as long as the simulation.
  void follow(std::shared_ptr<Follower> follower) const {
    parts_->followers.push_back(std::move(follower));
    parts_->backend.follow(*parts_->followers.back());
  }

  /// Controls the robot in a new session.
  /// @throws ControlHeld while another front-end does
  [[nodiscard]] Frontend<R> connect(FrontendOptions options = {.strict = true}) const {
    return Frontend<R>(parts_->backend, options, parts_);
  }
  /// For programs that do not know R.
  [[nodiscard]] UntypedFrontend connect_untyped(FrontendOptions options = {.strict = true}) const {
    return UntypedFrontend(parts_->backend, options, parts_);
  }

 private:
  struct Parts {
    Parts(SimulationOptions<R> options, SessionOptions session,
          const BackendOptions& backend_options, const std::string& name)
        : robot(std::move(options)),
          host(SessionHost::anonymous(with_model(std::move(session), robot.options().description),
                                      name.empty() ? default_name() : name)),
          backend(robot, host, without_deadlines(backend_options, robot.options().period)) {}

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
    SessionHost host;
    std::vector<std::shared_ptr<Follower>> followers;
    Backend backend;
  };

  std::shared_ptr<Parts> parts_;
};

/// Starts a simulated robot in this process and controls it, strictly: an action that could not be
/// in time on a real robot throws. `connect` is for one that runs elsewhere.
template <class R>
[[nodiscard]] Frontend<R> simulate(SimulationOptions<R> options = {},
                                   FrontendOptions frontend = {.strict = true}) {
  return Simulation<R>(std::move(options)).connect(frontend);
}

}  // namespace trifinger
