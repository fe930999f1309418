// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <string_view>

#include "manipulation/parts/phase_clock.hpp"
#include "trifinger/manipulation/skill.hpp"

namespace trifinger::manipulation {

// A phase of `S`, as a row of its table.
template <class S, class Phase>
struct PhaseRow {
  std::string_view name;
  // What `S` does when it is stopped. Nothing: it has ended.
  void (S::*stop)(std::string_view failure) noexcept {nullptr};
  // Whether `next` begins, which `entry` prepares. Nothing: only `during` ends the phase.
  bool (S::*done)() const noexcept {nullptr};
  Phase next{};
  void (S::*entry)() noexcept {nullptr};
  // Is called in every step of the phase, and may enter another one.
  void (S::*during)(Seconds elapsed) noexcept {nullptr};
};

template <class S, class Phase>
class TipsSkill;

// The base of what goes through phases and is no skill.
struct NoSkill {};

// A `Base` that goes through phases. The table `kPhases` of `S`, which it is, has a row for each
// `Phase`, in their order.
template <class S, class Phase, class Base = Skill>
class Phased : public Base {
  friend S;
  friend TipsSkill<S, Phase>;

  explicit Phased(Seconds period) noexcept : clock_(period) {}

 protected:
  using Row = PhaseRow<S, Phase>;

  void enter(Phase phase) noexcept {
    phase_ = phase;
    clock_.begin_phase();
  }
  [[nodiscard]] static const Row& row_of(Phase phase) noexcept {
    return S::kPhases[static_cast<std::size_t>(phase)];
  }
  void follow_phases(Seconds elapsed) noexcept {
    S& self = static_cast<S&>(*this);
    const Phase before = phase_;
    const Row& row = row_of(before);
    if (row.during != nullptr) (self.*row.during)(elapsed);
    if (phase_ != before || row.done == nullptr || !(self.*row.done)()) return;
    if (row.entry != nullptr) (self.*row.entry)();
    self.enter(row.next);
  }
  // `stopped` is the failure to report.
  void stop_phase(std::string_view stopped) noexcept {
    if (const auto stop = row_of(phase_).stop) (static_cast<S&>(*this).*stop)(stopped);
  }

  PhaseClock clock_;
  Phase phase_{};
};

}  // namespace trifinger::manipulation
