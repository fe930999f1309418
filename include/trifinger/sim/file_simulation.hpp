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
#include "trifinger/sim/file_robot.hpp"

namespace trifinger {

/// A simulated robot from a file in this process, with an inline back-end, like `Simulation`.
///
/// Copies refer to the same simulation. It lives as long as one of the copies or one of its
/// front-ends.
class FileSimulation {
 public:
  /// Adds the model to the documents of `session`. The simulation sets mode and period of
  /// `backend`: it waits for every action. `name` is what errors and logs call the robot; default:
  /// its type.
  /// @throws InvalidArgument
  explicit FileSimulation(FileRobotOptions options, SessionOptions session = {},
                          BackendOptions backend = {}, const std::string& name = {})
      : parts_(std::make_shared<Parts>(std::move(options), std::move(session), backend, name)) {}

  /// The robot itself: reset it, place objects, save and restore its state.
  [[nodiscard]] FileRobot& robot() const noexcept { return parts_->robot; }

  /// Lets `follower` see every session from the next one on. The simulation keeps the follower as
  /// long as it lives.
  void follow(std::shared_ptr<Follower> follower) const {
    parts_->followers.push_back(std::move(follower));
    parts_->backend.follow(*parts_->followers.back());
  }

  /// Controls the robot in a new session.
  /// @throws ControlHeld while another front-end controls it
  [[nodiscard]] UntypedFrontend connect_untyped(FrontendOptions options = {.strict = true}) const {
    return UntypedFrontend(parts_->backend, options, parts_);
  }

 private:
  struct Parts {
    Parts(FileRobotOptions options, SessionOptions session, const BackendOptions& backend_options,
          const std::string& name)
        : robot(std::move(options)),
          host(SessionHost::anonymous(with_model(std::move(session), robot.model()),
                                      name.empty() ? robot.description().type : name)),
          backend(robot, host, without_deadlines(backend_options, robot.model().period())) {}

    static SessionOptions with_model(SessionOptions session, const ModelFile& model) {
      std::ranges::move(model_documents(model), std::back_inserter(session.documents));
      return session;
    }
    static BackendOptions without_deadlines(BackendOptions options, Nanoseconds period) noexcept {
      options.mode = BackendOptions::Mode::kNonRealTime;
      options.period = period;
      return options;
    }

    FileRobot robot;
    SessionHost host;
    std::vector<std::shared_ptr<Follower>> followers;
    Backend backend;
  };

  std::shared_ptr<Parts> parts_;
};

}  // namespace trifinger
