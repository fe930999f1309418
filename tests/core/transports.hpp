// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <fcntl.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <chrono>
#include <cstdint>
#include <memory>
#include <string>
#include <string_view>
#include <thread>
#include <utility>

#include "core/driver_under_test.hpp"
#include "core/session_place.hpp"
#include "support/child_process.hpp"
#include "support/session_folder.hpp"
#include "support/shared_value.hpp"
#include "trifinger/base/error.hpp"
#include "trifinger/core/backend.hpp"
#include "trifinger/core/frontend.hpp"
#include "trifinger/realtime/clock.hpp"

namespace trifinger::test {

/// Settings of a back-end to be tested.
struct Plan {
  BackendOptions backend{};
  SessionOptions session{.history = 256, .queue = 64};
  Injection injection{};
  TimeIndex first_index{0};  ///< Index of step 0, as for a robot that has run for ages.
};

inline constexpr Nanoseconds kPeriod = std::chrono::milliseconds(1);

/// Returns a plan with deadlines.
[[nodiscard]] inline Plan with_deadlines(std::uint32_t max_action_repeats = 0,
                                         const Injection& injection = {}) {
  return {.backend = {.mode = BackendOptions::Mode::kRealTime,
                      .period = kPeriod,
                      .max_action_repeats = max_action_repeats},
          .injection = injection};
}

/// Deadlines that end no session, however late the user and the back-end are.
inline constexpr BackendOptions kTolerantDeadlines{.mode = BackendOptions::Mode::kRealTime,
                                                   .period = kPeriod,
                                                   .max_action_repeats = 1'000'000'000,
                                                   .max_skipped_ticks = 1'000'000'000};

/// A timeout so long that only a fault of ours can use it up.
inline constexpr Timeout kLong = std::chrono::seconds(120);

// Three ways to connect a back-end and a user. Each is a class template over the traits of a
// driver,
//
//     struct FakeDriverTraits {
//       static constexpr std::string_view kName = "FakeDriver";
//       using Robot = FakeRobot;
//       static std::unique_ptr<UntypedDriver> make_driver();
//       static FakeAction action(TimeIndex k);  // fit to apply; another one for every k
//     };
//
// with the functions connect, observe, request_stop, clock and log. All run on a manual clock.

/// What the three ways have in common.
template <class Traits>
class Rig {
 public:
  using Robot = typename Traits::Robot;

  explicit Rig(Plan plan) : plan_(std::move(plan)) {}

  [[nodiscard]] ManualClock& clock() noexcept { return clock_; }
  [[nodiscard]] const CallLog& log() const noexcept { return *log_; }

  /// Real-time mode: lets `count` periods pass, with everything that is due in them.
  void tick(int count = 1) { clock_.tick(kPeriod, count); }
  /// Real-time mode: lets one period pass, after which the back-end does not sleep any more.
  void last_tick() {
    clock_.wait_for_sleeper();
    clock_.advance(kPeriod);
  }

 protected:
  [[nodiscard]] std::unique_ptr<UntypedDriver> make_driver() {
    return std::make_unique<DriverUnderTest>(Traits::make_driver(), plan_.injection, *log_,
                                             plan_.first_index);
  }
  [[nodiscard]] SessionHost prepared(SessionHost host) const {
    host.place().begin_at(plan_.first_index);
    return host;
  }
  [[nodiscard]] static FrontendOptions with_long_timeout(FrontendOptions options) {
    options.timeout = kLong;
    return options;
  }

  Plan plan_;
  ManualClock clock_;

 private:
  SharedValue<CallLog> log_;
};

/// A rig whose back-end is in the user's process.
template <class Traits>
class RigWithBackend : public Rig<Traits> {
 public:
  explicit RigWithBackend(const Plan& plan)
      : Rig<Traits>(plan),
        driver_(this->make_driver()),
        host_(this->prepared(SessionHost::anonymous(plan.session))),
        backend_(*driver_, host_, plan.backend, this->clock_) {}

  void request_stop() { backend_.request_stop(); }

 private:
  std::unique_ptr<UntypedDriver> driver_;

 protected:
  SessionHost host_;
  Backend backend_;
};

/// The user's waits run the back-end.
struct Inline {
  static constexpr std::string_view kName = "Inline";
  static constexpr bool kIsInline = true;

  template <class Traits>
  class Rig : public RigWithBackend<Traits> {
   public:
    using Robot = typename Traits::Robot;

    explicit Rig(const Plan& plan = {}) : RigWithBackend<Traits>(plan) {}

    [[nodiscard]] Frontend<Robot> connect(FrontendOptions options = {.strict = true}) {
      return Frontend<Robot>(this->backend_, this->with_long_timeout(options));
    }
    [[nodiscard]] Frontend<Robot> observe() { return connect({.control = false}); }
  };
};

/// The back-end is a thread of the user's process, and the session is anonymous.
struct InProcess {
  static constexpr std::string_view kName = "InProcess";
  static constexpr bool kIsInline = false;

  template <class Traits>
  class Rig : public RigWithBackend<Traits> {
   public:
    using Robot = typename Traits::Robot;

    explicit Rig(const Plan& plan = {}) : RigWithBackend<Traits>(plan), thread_(this->backend_) {}
    Rig(const Rig&) = delete;
    Rig& operator=(const Rig&) = delete;
    ~Rig() { this->clock_.run_free(); }

    [[nodiscard]] Frontend<Robot> connect(FrontendOptions options = {.strict = true}) {
      return Frontend<Robot>(this->host_, this->with_long_timeout(options));
    }
    [[nodiscard]] Frontend<Robot> observe() { return connect({.control = false}); }

   private:
    BackendThread thread_;
  };
};

/// The back-end is a process of its own, and the session has a name.
struct AcrossProcesses {
  static constexpr std::string_view kName = "AcrossProcesses";
  static constexpr bool kIsInline = false;

  template <class Traits>
  class Rig : public test::Rig<Traits> {
   public:
    using Robot = typename Traits::Robot;

    explicit Rig(const Plan& plan = {}) : test::Rig<Traits>(plan), process_(start()) {}
    Rig(const Rig&) = delete;
    Rig& operator=(const Rig&) = delete;
    ~Rig() {
      if (was_killed_) return;
      request_stop();
      this->clock_.run_free();
      EXPECT_EQ(process_.wait(), 0) << "exit of the back-end's process";
    }

    [[nodiscard]] Frontend<Robot> connect(FrontendOptions options = {.strict = true}) {
      const Deadline deadline(kLong);
      while (true) {
        try {
          return Frontend<Robot>("robot", this->with_long_timeout(options));
        } catch (const SessionNotFound&) {
          if (deadline.passed()) throw;
        }
        std::this_thread::yield();
      }
    }
    [[nodiscard]] Frontend<Robot> observe() { return connect({.control = false}); }
    void request_stop() {
      const char any = 0;
      static_cast<void>(::write(stop_.write_end(), &any, 1));
    }
    [[nodiscard]] const ChildProcess& process() const noexcept { return process_; }
    /// Kills the process with SIGKILL.
    void kill() noexcept {
      was_killed_ = true;
      process_.kill();
    }

   private:
    // A byte through the pipe asks the child to stop. A signal would not do, because a sanitizer
    // defers handlers and may lose one. Tests of the program cover signals.
    class Pipe {
     public:
      Pipe() {
        if (::pipe2(ends_.data(), O_CLOEXEC) != 0) throw SystemError("make a pipe", errno);
      }
      Pipe(const Pipe&) = delete;
      Pipe& operator=(const Pipe&) = delete;
      ~Pipe() {
        for (const int end : ends_) ::close(end);
      }

      [[nodiscard]] int write_end() const noexcept { return ends_[1]; }
      void wait_for_a_byte() const noexcept {
        char any = 0;
        while (::read(ends_[0], &any, 1) < 0 && errno == EINTR) {
        }
      }

     private:
      std::array<int, 2> ends_{};
    };

    [[nodiscard]] ChildProcess start() {
      return ChildProcess([this] { return run(); });
    }

    int run() {
      const auto driver = this->make_driver();
      SessionHost host = this->prepared(SessionHost::named("robot", this->plan_.session));
      Backend backend(*driver, host, this->plan_.backend, this->clock_);
      std::thread stopper([&] {
        stop_.wait_for_a_byte();
        backend.request_stop();
      });
      backend.run();
      stopper.join();
      return 0;
    }

    Pipe stop_;
    SessionFolder folder_;
    ChildProcess process_;
    bool was_killed_{false};
  };
};

/// The ways with a back-end that has a thread of its own, and so deadlines.
using TransportsWithDeadlines = ::testing::Types<InProcess, AcrossProcesses>;

/// Calls tests that have a transport as their type by its name.
struct TransportName {
  template <class T>
  static std::string GetName(int) {  // NOLINT(readability-identifier-naming): GoogleTest's
    return std::string(T::kName);
  }
};

}  // namespace trifinger::test
