// SPDX-License-Identifier: BSD-3-Clause
#include "trifinger/joint/counted_chain.hpp"

#include <algorithm>
#include <utility>

#include "base/text_of.hpp"
#include "trifinger/base/error.hpp"

namespace trifinger {

CountedChain::CountedChain(RobotTypes types, std::vector<std::string> names,
                           const std::vector<JointLimit>& limits)
    : types_(std::move(types)),
      names_(std::move(names)),
      safety_(limits),
      memory_{.joints = std::vector<JointMemory>(names_.size())},
      applied_(names_.size()),
      check_observation_(types_.observation.size()),
      check_action_(types_.action.size()) {
  detail::require(safety_.limits().size() == names_.size(),
                  detail::text_of("there are limits for ", safety_.limits().size(),
                                  " joints, but the robot has ", names_.size()));
}

void CountedChain::add_check(Check check, std::function<void(void* element)> write_observation) {
  safety_.add_check([this, check = std::move(check), write = std::move(write_observation)](
                        const CountedObservation&, CountedAction& action) {
    write(check_observation_.data());
    write_element(action, check_action_.data());
    check(check_observation_.data(), check_action_.data());
    read_element(check_action_.data(), action);
  });
}

DriverReport CountedChain::apply(const CountedAction& desired,
                                 const CountedObservation& observation,
                                 Nanoseconds elapsed) noexcept {
  const SafetyReport report =
      safety_.apply(desired, observation, elapsed, memory_, applied_, &thrown_);
  if (report.fault == SafetyFault::kInterrupted) return DriverReport::interrupted();
  if (report.fault != SafetyFault::kNone) {
    const std::string_view joint =
        report.joint < 0 ? std::string_view() : names_[static_cast<std::size_t>(report.joint)];
    fault_text_ = report.fault == SafetyFault::kOwnCheck ? thrown_ : describe(report, joint);
    return DriverReport::fault(fault_code_of(report));
  }
  if (report.action_rejected) {
    const RejectedCommand rejected = safety_.find_rejected(desired, applied_);
    rejection_text_ = describe(rejected, names_[rejected.joint], limits()[rejected.joint]);
  }
  return {.action_rejected = report.action_rejected};
}

void CountedChain::forget(double heat) noexcept {
  std::ranges::fill(memory_.joints, JointMemory{.heat = heat});
}

}  // namespace trifinger
