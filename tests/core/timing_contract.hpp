// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <gtest/gtest.h>

#include <cstddef>
#include <memory>
#include <ostream>
#include <string>
#include <vector>

#include "core/steps.hpp"
#include "core/transports.hpp"

// The timing contract as tests that every driver passes on every transport. A layer with a driver
// of its own writes the traits that transports.hpp asks for, lists them, and has its driver tested.
// Its test program is linked with `timing_contract`:
//
//     using namespace trifinger::test;
//     INSTANTIATE_TEST_SUITE_P(Sim, TimingContract, on_all_transports<SimDriverTraits>(),
//                              case_name);
//     INSTANTIATE_TEST_SUITE_P(Sim, RealTimeContract, on_threaded_transports<SimDriverTraits>(),
//                              case_name);
//
// The tests know no types, so they are compiled once (timing_contract.cpp). This file has what is
// compiled for every driver: a Frontend<Robot>, whose functions the tests call through AnyUser.

namespace trifinger::test {

/// A front-end of a driver under test. Its actions have numbers, and elements are bytes.
class AnyUser : public AnyObserver {
 public:
  /// Returns the bytes of the driver's action `k`.
  [[nodiscard]] virtual Bytes action(TimeIndex k) const = 0;
  /// Appends the driver's action `k`.
  virtual TimeIndex append_desired_action(TimeIndex k, Timeout timeout = kForever) = 0;
  /// Appends the driver's actions `first` to `last` in one call.
  virtual TimeIndex append_desired_actions(TimeIndex first, TimeIndex last) = 0;

  [[nodiscard]] virtual std::vector<Bytes> get_observations(TimeIndex first, std::size_t count,
                                                            Timeout timeout = kForever) const = 0;
  [[nodiscard]] virtual std::vector<Bytes> get_desired_actions(TimeIndex first,
                                                               std::size_t count) const = 0;
  [[nodiscard]] virtual std::vector<Bytes> get_applied_actions(TimeIndex first,
                                                               std::size_t count) const = 0;
  [[nodiscard]] virtual std::vector<Status> get_statuses(TimeIndex first, std::size_t count,
                                                         Timeout timeout = kForever) const = 0;
  [[nodiscard]] virtual Bytes latest_observation(Timeout timeout = kForever) const = 0;

  virtual void finish(Timeout timeout = kForever) = 0;
  virtual void recover() = 0;
  [[nodiscard]] virtual UntypedFrontend companion(const std::string& name) const = 0;
  [[nodiscard]] virtual const Session& session() const = 0;
};

/// A rig of transports.hpp, for any driver and transport.
class AnyRig {
 public:
  virtual ~AnyRig() = default;

  [[nodiscard]] virtual std::unique_ptr<AnyUser> connect(FrontendOptions options = {
                                                             .strict = true}) = 0;
  [[nodiscard]] virtual std::unique_ptr<const AnyUser> observe() = 0;
  virtual void request_stop() = 0;
  [[nodiscard]] virtual ManualClock& clock() noexcept = 0;
  [[nodiscard]] virtual const CallLog& log() const noexcept = 0;
  virtual void tick(int count = 1) = 0;
  virtual void last_tick() = 0;
};

template <class Traits>
class UserOf final : public ErasedObserver<AnyUser, Frontend<typename Traits::Robot>> {
  using Robot = typename Traits::Robot;
  using Base = ErasedObserver<AnyUser, Frontend<Robot>>;

 public:
  using Base::Base;

  [[nodiscard]] Bytes action(TimeIndex k) const override { return bytes_of(Traits::action(k)); }
  TimeIndex append_desired_action(TimeIndex k, Timeout timeout) override {
    return this->robot_.append_desired_action(Traits::action(k), timeout);
  }
  TimeIndex append_desired_actions(TimeIndex first, TimeIndex last) override {
    std::vector<typename Robot::Action> burst;
    burst.reserve(static_cast<std::size_t>(last - first + 1));
    for (TimeIndex k = first; k <= last; ++k) burst.push_back(Traits::action(k));
    return this->robot_.append_desired_actions(burst);
  }

  [[nodiscard]] std::vector<Bytes> get_observations(TimeIndex first, std::size_t count,
                                                    Timeout timeout) const override {
    std::vector<typename Robot::Observation> elements(count);
    this->robot_.get_observations(first, elements, timeout);
    return bytes_of_each(elements);
  }
  [[nodiscard]] std::vector<Bytes> get_desired_actions(TimeIndex first,
                                                       std::size_t count) const override {
    std::vector<typename Robot::Action> elements(count);
    this->robot_.get_desired_actions(first, elements);
    return bytes_of_each(elements);
  }
  [[nodiscard]] std::vector<Bytes> get_applied_actions(TimeIndex first,
                                                       std::size_t count) const override {
    std::vector<AppliedActionOf<Robot>> elements(count);
    this->robot_.get_applied_actions(first, elements);
    return bytes_of_each(elements);
  }
  [[nodiscard]] std::vector<Status> get_statuses(TimeIndex first, std::size_t count,
                                                 Timeout timeout) const override {
    std::vector<Status> elements(count);
    this->robot_.get_statuses(first, elements, timeout);
    return elements;
  }
  [[nodiscard]] Bytes latest_observation(Timeout timeout) const override {
    return bytes_of(this->robot_.latest_observation(timeout));
  }

  void finish(Timeout timeout) override { this->robot_.finish(timeout); }
  void recover() override { this->robot_.recover(); }
  [[nodiscard]] UntypedFrontend companion(const std::string& name) const override {
    return this->robot_.companion(name);
  }
  [[nodiscard]] const Session& session() const override { return this->robot_.session(); }

 private:
  template <class T>
  [[nodiscard]] static std::vector<Bytes> bytes_of_each(const std::vector<T>& elements) {
    std::vector<Bytes> bytes;
    bytes.reserve(elements.size());
    for (const T& element : elements) bytes.push_back(bytes_of(element));
    return bytes;
  }
};

template <class Traits, class Transport>
class RigOf final : public AnyRig {
 public:
  explicit RigOf(const Plan& plan) : rig_(plan) {}

  [[nodiscard]] std::unique_ptr<AnyUser> connect(FrontendOptions options) override {
    return std::make_unique<UserOf<Traits>>(rig_.connect(options));
  }
  [[nodiscard]] std::unique_ptr<const AnyUser> observe() override {
    return std::make_unique<UserOf<Traits>>(rig_.observe());
  }
  void request_stop() override { rig_.request_stop(); }
  [[nodiscard]] ManualClock& clock() noexcept override { return rig_.clock(); }
  [[nodiscard]] const CallLog& log() const noexcept override { return rig_.log(); }
  void tick(int count) override { rig_.tick(count); }
  void last_tick() override { rig_.last_tick(); }

 private:
  typename Transport::template Rig<Traits> rig_;
};

/// A driver on a transport.
struct ContractCase {
  std::string name;
  bool is_inline;
  std::unique_ptr<UntypedDriver> (*make_driver)();
  std::unique_ptr<AnyRig> (*make_rig)(const Plan& plan);

  friend std::ostream& operator<<(std::ostream& out, const ContractCase& contract_case) {
    return out << contract_case.name;
  }
};

template <class Traits, class Transport>
[[nodiscard]] ContractCase contract_case() {
  return {.name = std::string(Traits::kName).append(Transport::kName),
          .is_inline = Transport::kIsInline,
          .make_driver = &Traits::make_driver,
          .make_rig = [](const Plan& plan) -> std::unique_ptr<AnyRig> {
            return std::make_unique<RigOf<Traits, Transport>>(plan);
          }};
}

template <class... Traits>
[[nodiscard]] auto on_all_transports() {
  return ::testing::ValuesIn(std::vector{contract_case<Traits, Inline>()...,
                                         contract_case<Traits, InProcess>()...,
                                         contract_case<Traits, AcrossProcesses>()...});
}
template <class... Traits>
[[nodiscard]] auto on_threaded_transports() {
  return ::testing::ValuesIn(std::vector{contract_case<Traits, InProcess>()...,
                                         contract_case<Traits, AcrossProcesses>()...});
}

[[nodiscard]] inline std::string case_name(const ::testing::TestParamInfo<ContractCase>& test) {
  return test.param.name;
}

class ContractTest : public ::testing::TestWithParam<ContractCase> {
 protected:
  [[nodiscard]] static std::unique_ptr<AnyRig> make_rig(const Plan& plan = {}) {
    return GetParam().make_rig(plan);
  }
};

/// Rules that hold with and without deadlines are tested without: the back-end waits for every
/// action.
class TimingContract : public ContractTest {};

/// Rules that hold with deadlines. Time is the manual clock's, one period after the other.
class RealTimeContract : public ContractTest {};

}  // namespace trifinger::test
