// SPDX-License-Identifier: BSD-3-Clause
#include "trifinger/core/fault.hpp"

#include <array>
#include <cstdint>

#include "trifinger/base/text.hpp"
#include "trifinger/core/errors.hpp"

namespace trifinger {

std::string_view name_of(Fault::Code code) noexcept {
  // Clean ends are numbered from 0, faults from 16.
  static constexpr std::array<std::string_view, 6> kEnds{
      "none", "finished", "detached", "controller_died", "stopped", "exhausted"};
  static constexpr std::array<std::string_view, 10> kFaults{
      "first_action_late", "action_late",      "backend_late", "actions_rejected",
      "memory_damaged",    "driver",           "driver_hangs", "backend_died",
      "measurement_stale", "machine_suspended"};
  constexpr auto kFirstFault = static_cast<std::int32_t>(Fault::Code::kFirstActionLate);
  const auto number = static_cast<std::int32_t>(code);
  return number < kFirstFault ? name_in(kEnds, number) : name_in(kFaults, number - kFirstFault);
}

std::string describe(const Fault& fault, std::string_view driver_text) {
  const std::string step = std::to_string(fault.time_index);
  const std::string at_step = fault.time_index < 0 ? " before step 0" : " at step " + step;
  const std::string detail = std::to_string(fault.detail);
  switch (fault.code) {
    case Fault::Code::kNone:
      return "the session goes on";
    case Fault::Code::kFinished:
      return "the controller finished" + at_step;
    case Fault::Code::kDetached:
      return "the controller let go" + at_step + " without finish()";
    case Fault::Code::kControllerDied:
      return "the controlling process died" + at_step;
    case Fault::Code::kStopped:
      return "the back-end was asked to stop" + at_step;
    case Fault::Code::kExhausted:
      return "there are no further steps" + at_step + ": the log that is replayed is over";
    case Fault::Code::kFirstActionLate:
      return "no first action arrived within the first-action timeout";
    case Fault::Code::kActionLate:
      return "the action for step " + step + " was not there in time" +
             (fault.detail > 0 ? ", after " + detail + " repeats of the one before" : "") +
             "; append it earlier, or let the back-end repeat actions (late_action in its "
             "configuration)";
    case Fault::Code::kBackendLate:
      return (fault.detail < 0 ? "the back-end was late in " +
                                     std::to_string(-std::int64_t{fault.detail}) + " steps in a row"
                               : "the back-end was late by " + detail + " periods") +
             at_step + "; 'trifinger doctor' says what this machine needs for real time";
    case Fault::Code::kActionsRejected:
      return detail + " actions in a row up to step " + step + " were not fit to apply" +
             (driver_text.empty() ? "" : "; the last: " + std::string(driver_text));
    case Fault::Code::kMemoryDamaged:
      return "the queue of actions was damaged, or shared memory was cut off" + at_step;
    case Fault::Code::kDriver:
      return "the driver gave up" + at_step + ": " +
             (driver_text.empty() ? "its code is " + detail : std::string(driver_text));
    case Fault::Code::kDriverHangs:
      return "a call of the driver did not return" + at_step + "; the robot's power was cut";
    case Fault::Code::kBackendDied:
      return fault.time_index < 0 ? "the back-end died before the first whole step"
                                  : "the back-end died; the last whole step is " + step;
    case Fault::Code::kMeasurementStale:
      return "a measurement was " + detail + " ms old" + at_step +
             ", more than the back-end allows (max_measurement_age)";
    case Fault::Code::kMachineSuspended:
      return "the machine was suspended for " + detail + " ms" + at_step +
             "; keep it awake while a robot is in use";
  }
  return "unknown fault " + std::to_string(static_cast<int>(fault.code));
}

HistoryLost::HistoryLost(TimeIndex time_index, TimeIndex oldest)
    : Error("step " + std::to_string(time_index) +
            " has been overwritten; the oldest step still kept is " + std::to_string(oldest)),
      oldest_(oldest) {}

AcausalAction::AcausalAction(TimeIndex time_index)
    : Error("the action for step " + std::to_string(time_index) + " comes after observation " +
            std::to_string(time_index) +
            " was read: on a real robot it would be late; compute a[t+1] from y[t]") {}

}  // namespace trifinger
