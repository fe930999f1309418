// SPDX-License-Identifier: BSD-3-Clause
#include "running_backend.hpp"

#include <nanobind/nanobind.h>

#include <chrono>
#include <new>
#include <set>
#include <utility>

#include "conversion/gil.hpp"
#include "conversion/timeout.hpp"
#include "trifinger/core/errors.hpp"

namespace trifinger::bindings {
namespace {

constexpr Nanoseconds kPollPeriod = std::chrono::milliseconds(1);

// A driver and what runs it.
struct Robot {
  Robot(std::unique_ptr<UntypedDriver> robot_driver, SessionHost session_host,
        const BackendOptions& options)
      : driver(std::move(robot_driver)),
        host(std::move(session_host)),
        backend(*driver, host, options) {}

  std::unique_ptr<UntypedDriver> driver;
  SessionHost host;
  Backend backend;
};

// All back-ends of this process; changed under the GIL only.
std::set<RunningBackend*> backends;

}  // namespace

UntypedFrontend start_inline(const std::string& name, std::unique_ptr<UntypedDriver> driver,
                             const BackendOptions& backend_options,
                             const SessionOptions& session_options,
                             const FrontendOptions& frontend_options) {
  auto robot = std::make_shared<Robot>(
      std::move(driver), SessionHost::anonymous(session_options, name), backend_options);
  Backend& backend = robot->backend;
  return UntypedFrontend(backend, frontend_options, std::move(robot));
}

struct RunningBackend::Parts {
  Parts(const std::string& name, std::unique_ptr<UntypedDriver> driver,
        const BackendOptions& backend_options, const SessionOptions& session_options)
      : robot(std::move(driver), SessionHost::named(name, session_options), backend_options),
        thread(robot.backend) {}

  [[nodiscard]] bool has_session() const {
    try {
      static_cast<void>(robot.host.open());
      return true;
    } catch (const SessionNotFound&) {
      return false;
    }
  }

  Robot robot;
  BackendThread thread;
};

RunningBackend::RunningBackend(const std::string& name, std::unique_ptr<UntypedDriver> driver,
                               const BackendOptions& backend_options,
                               const SessionOptions& session_options)
    : name_(name) {
  {
    const GilRelease release;
    auto parts = std::make_shared<Parts>(name, std::move(driver), backend_options, session_options);
    while (!parts->has_session()) {
      if (parts->thread.wait_for_end(kPollPeriod)) parts->thread.stop();  // throws what ended it
    }
    parts_ = std::move(parts);
  }
  backends.insert(this);
}

RunningBackend::~RunningBackend() {
  backends.erase(this);
  if (parts_ == nullptr) return;
  if (fork_.is_inherited()) {
    // A forked child has no thread to wait for, and the session belongs to its parent: the parts
    // stay as they are.
    static_cast<void>(new (std::nothrow) std::shared_ptr<Parts>(std::move(parts_)));
    return;
  }
  const GilRelease release;
  parts_.reset();
}

std::shared_ptr<RunningBackend::Parts> RunningBackend::own_parts() const {
  if (fork_.is_inherited()) {
    throw InheritedHandle("the back-end of '" + name_ + "' runs in the process that was forked");
  }
  return parts_;
}

void RunningBackend::wait(Timeout timeout) const {
  const std::shared_ptr<Parts> parts = own_parts();
  if (parts == nullptr) return;
  in_slices(timeout, [&](Timeout slice) {
    if (!parts->thread.wait_for_end(slice)) {
      throw TimedOut("the back-end of '" + name_ + "' still runs");
    }
    parts->thread.stop();  // throws what ended it
  });
}

void RunningBackend::stop() {
  if (own_parts() == nullptr) return;
  std::shared_ptr<Parts> stopping = std::exchange(parts_, nullptr);
  const GilRelease release;
  const std::shared_ptr<Parts> parts = std::move(stopping);  // its end gives the name back
  parts->thread.stop();
}

void stop_backends_at_exit() {
  nanobind::module_::import_("atexit").attr("register")(nanobind::cpp_function([] {
    while (!backends.empty()) {
      RunningBackend* const backend = *backends.begin();
      backends.erase(backends.begin());
      if (!backend->fork_.is_inherited()) backend->stop();
    }
  }));
}

}  // namespace trifinger::bindings
