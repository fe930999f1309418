// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <atomic>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "endurance/drive.hpp"
#include "trifinger/base/random.hpp"
#include "trifinger/core/backend.hpp"
#include "trifinger/core/driver.hpp"
#include "trifinger/core/session.hpp"
#include "trifinger/realtime/clock.hpp"

namespace trifinger::apps {

struct SimulatedOptions {
  std::string robot;                     // a configuration, by name or file
  std::vector<std::string> overrides{};  // settings such as "fingers.height=0.3"
  // Steps from one injected fault to the next; 0: none.
  std::uint64_t faults_every{0};
  std::uint64_t seed{0};
};

// Something that goes wrong on purpose. All of them take turns.
struct InjectedFault {
  enum class Kind : std::uint8_t {
    kBoards,   // `text` is for `boards::parse_fault`.
    kRestart,  // The back-end ends, and everything is made anew.
    kUnfit,    // A part of the actions is unfit.
  };

  Kind kind{Kind::kBoards};
  std::string text;
};

// The fault number `number` of a robot with so many boards and joints. All of them are over by
// themselves, so none needs an operator: an interface that was removed for ever is not among them.
[[nodiscard]] InjectedFault fault_to_inject(std::uint64_t number, std::uint64_t seed,
                                            std::size_t boards, std::size_t joints);
// After so many faults each kind had its turn.
[[nodiscard]] std::size_t num_faults_to_inject(bool has_boards) noexcept;

// A robot in this process, in simulated time and as fast as it goes: a simulation, or emulated
// motor boards with a simulation behind them. One thread does everything, so equal options give
// equal series.
class SimulatedPlace final : public Place {
 public:
  // Throws InvalidArgument, config::ConfigError, SystemError.
  SimulatedPlace(SimulatedOptions options, const std::atomic<bool>& stop);
  ~SimulatedPlace() override;

  [[nodiscard]] Session session() const;
  // Number of faults that were injected.
  [[nodiscard]] std::uint64_t num_injected() const noexcept { return injected_; }

  // Lets something go wrong with emulated boards, see `boards::parse_fault`.
  // Throws InvalidArgument.
  void add(const std::string& fault);

  [[nodiscard]] UntypedFrontend connect() override;
  void recover() override;
  void pause(Nanoseconds time) override;
  [[nodiscard]] Nanoseconds now() const noexcept override;
  bool expect(std::uint64_t steps) override;

 private:
  class World;
  class BoardWorld;
  class OtherWorld;

  void begin();
  void inject();

  SimulatedOptions options_;
  const std::atomic<bool>& stop_;
  ManualClock clock_;
  std::string name_;
  SessionOptions session_options_;
  BackendOptions backend_options_;
  std::unique_ptr<World> world_;
  std::unique_ptr<SessionHost> host_;
  std::unique_ptr<Backend> backend_;
  std::uint64_t steps_{0};
  std::atomic<std::uint64_t> injected_{0};
  bool is_restart_due_{false};
  bool is_unfit_due_{false};
};

}  // namespace trifinger::apps
