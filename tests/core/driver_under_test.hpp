// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <atomic>
#include <chrono>
#include <cstdint>
#include <cstring>
#include <memory>
#include <random>
#include <thread>
#include <utility>

#include "trifinger/core/driver.hpp"

namespace trifinger::test {

/// What should go wrong in a driver. The counts start over in every session. The faults only happen
/// in the first one.
struct Injection {
  TimeIndex prepare_periods{0};  ///< Periods until the driver is ready.
  bool prepare_faults{false};
  TimeIndex stop_periods{0};           ///< Periods that the orderly stop takes.
  TimeIndex observation_fault_at{-1};  ///< The call with this number faults; -1: none.
  TimeIndex action_fault_at{-1};       ///< The call with this number faults; -1: none.
  TimeIndex reject_from{-1};           ///< Calls from this number on reject their action; -1: none.
  void (*on_observation)(){nullptr};   ///< The loop's thread calls it at every observation.
  std::uint32_t delay_seed{0};         ///< Seed of random delays in the calls; 0: no delays.
};

/// What the back-end asked of a driver. Other threads and processes can read it.
struct CallLog {
  static constexpr std::size_t kSize = 4096;

  std::atomic<std::int64_t> sessions{0};
  std::atomic<std::int64_t> prepares{0};
  std::atomic<std::int64_t> observations{0};
  std::atomic<std::int64_t> actions{0};
  std::atomic<std::int64_t> holds{0};
  std::atomic<std::int64_t> stops{0};
  std::atomic<std::int64_t> cuts{0};
  /// Number of actions applied before the observation with this number was measured.
  std::array<std::atomic<std::int64_t>, kSize> actions_before_observation{};
};

/// Adds faults, delays and a log of the calls to any driver. So the timing contract can be tested
/// with every robot, without its help.
class DriverUnderTest final : public UntypedDriver {
 public:
  static constexpr std::int32_t kFaultCode = 4711;

  /// `first_index` is the index of step 0; the driver itself sees 0.
  DriverUnderTest(std::unique_ptr<UntypedDriver> driver, const Injection& injection, CallLog& log,
                  TimeIndex first_index = 0)
      : driver_(std::move(driver)),
        injection_(injection),
        log_(log),
        first_index_(first_index),
        random_(injection.delay_seed) {}

  [[nodiscard]] const RobotTypes& description() const noexcept override {
    return driver_->description();
  }
  [[nodiscard]] std::span<const CompanionDescription> companions() const noexcept override {
    return driver_->companions();
  }

  [[nodiscard]] DriverReport prepare(TimeIndex step) noexcept override {
    delay();
    ++log_.prepares;
    if (step == 0) {
      ++log_.sessions;
      log_.observations = 0;
      log_.actions = 0;
    }
    if (injection_.prepare_faults && is_first_session()) return DriverReport::fault(kFaultCode);
    if (step < injection_.prepare_periods) return DriverReport::busy();
    return driver_->prepare(step - injection_.prepare_periods);
  }

  [[nodiscard]] DriverReport get_latest_observation(void* observation) noexcept override {
    delay();
    if (injection_.on_observation != nullptr) injection_.on_observation();
    const std::int64_t number = log_.observations++;
    log_.actions_before_observation.at(static_cast<std::size_t>(number) % CallLog::kSize) =
        log_.actions.load();
    if (number == injection_.observation_fault_at && is_first_session()) {
      return DriverReport::fault(kFaultCode);
    }
    return driver_->get_latest_observation(observation);
  }

  [[nodiscard]] DriverReport apply_action(const void* desired, void* applied) noexcept override {
    delay();
    const std::int64_t number = log_.actions++;
    if (number == injection_.action_fault_at && is_first_session()) {
      return DriverReport::fault(kFaultCode);
    }
    DriverReport report = driver_->apply_action(desired, applied);
    if (injection_.reject_from >= 0 && number >= injection_.reject_from && is_first_session()) {
      report.action_rejected = true;
    }
    return report;
  }

  [[nodiscard]] DriverReport hold(const void* observation, void* action) noexcept override {
    ++log_.holds;
    return driver_->hold(observation, action);
  }
  [[nodiscard]] DriverReport stop(TimeIndex step) noexcept override {
    ++log_.stops;
    if (step < injection_.stop_periods) return DriverReport::busy();
    return driver_->stop(step - injection_.stop_periods);
  }
  void cut() noexcept override {
    ++log_.cuts;
    driver_->cut();
  }
  [[nodiscard]] bool get_companion_element(std::size_t index, TimeIndex time_index,
                                           void* element) noexcept override {
    if (!driver_->get_companion_element(index, time_index - first_index_, element)) return false;
    Stamp stamp;
    std::memcpy(&stamp, element, sizeof(stamp));
    stamp.arrival_index += first_index_;
    stamp.capture_index += first_index_;
    std::memcpy(element, &stamp, sizeof(stamp));
    return true;
  }
  [[nodiscard]] std::string_view fault_text(std::int32_t fault_code) const noexcept override {
    return fault_code == kFaultCode ? "a test injected this" : driver_->fault_text(fault_code);
  }
  [[nodiscard]] std::string_view rejection_text() const noexcept override {
    return injection_.reject_from >= 0 ? "a test rejected it" : driver_->rejection_text();
  }

 private:
  [[nodiscard]] bool is_first_session() const noexcept { return log_.sessions == 1; }

  void delay() noexcept {
    if (injection_.delay_seed == 0 || random_() % 4 != 0) return;
    std::this_thread::sleep_for(std::chrono::microseconds(random_() % 200));
  }

  std::unique_ptr<UntypedDriver> driver_;
  Injection injection_;
  CallLog& log_;
  TimeIndex first_index_;
  std::minstd_rand random_;
};

}  // namespace trifinger::test
