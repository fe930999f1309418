// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <optional>
#include <string>

#include "core/fake_robot.hpp"
#include "trifinger/core/backend.hpp"
#include "trifinger/core/follower.hpp"
#include "trifinger/core/frontend.hpp"
#include "trifinger/core/session.hpp"

namespace trifinger::test {

/// A fake robot with a name and a sensor. Its back-end runs in a thread of this process.
class NamedRobot {
 public:
  explicit NamedRobot(const std::string& name = "robot",
                      const SessionOptions& session = {.history = 64, .queue = 64},
                      const BackendOptions& options = {}, Follower* follower = nullptr)
      : host_(SessionHost::named(name, session)), backend_(driver_, host_, options) {
    if (follower != nullptr) backend_.follow(*follower);
    thread_.emplace(backend_);
    // The session exists when this returns.
    const Frontend<FakeRobot> looker(host_, {.control = false});
    static_cast<void>(looker.latest_observation());
  }

  [[nodiscard]] const SessionHost& host() const noexcept { return host_; }

 private:
  FakeDriver driver_{{.sensor_period = 4, .sensor_delay = 2}};
  SessionHost host_;
  Backend backend_;
  std::optional<BackendThread> thread_;
};

}  // namespace trifinger::test
