// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>

#include "trifinger/core/description.hpp"

namespace trifinger {

/// What the back-end reports about one step; the same struct for every robot.
struct Status {
  /// What happened in a step: bits of the field `flags` of its status.
  enum Flag : std::uint32_t {
    /// The action for this step was missing; the previous one was applied again.
    kActionRepeated = 1,
    kAcausal = 2,         ///< The action was appended by someone who had already read y_t.
    kActionRejected = 4,  ///< The action could not be applied; a safe one was applied instead.
    kEnd = 8,             ///< The last status of the session: no action was applied at this step.
    kSchedulerLate = 16,  ///< The tick began late: the back-end did not get the processor in time.
    kDriverLate = 32,     ///< The tick began late: calls of the driver used up the tick before.
  };

  std::int64_t time{0};  ///< Time of the measurement of y_t, monotonic clock [ns].
  std::int64_t tick{0};  ///< Number of periods since step 0, including periods without a step.
  std::int64_t lateness{
      0};  ///< How long after its deadline the tick began [ns]; 0 without deadlines.
  std::int64_t measurement_age{0};  ///< Age of the oldest measurement in y_t [ns].
  std::uint32_t flags{0};           ///< Set of `Flag`.
  std::uint32_t skipped_ticks{
      0};  ///< Number of ticks left out just before this step because the back-end was late.
  std::uint32_t action_repeats{0};  ///< Number of repetitions of the action in a row.
  std::uint32_t discarded_actions{
      0};  ///< Number of actions since step 0 that came for a step already closed.
  std::uint32_t rejected_actions{0};  ///< Number of actions rejected in a row.
  std::uint32_t lost_frames{0};  ///< Messages that the driver has lost since the session began.
  std::int32_t fault_code{0};    ///< Fault::Code of the end; 0 before the end.
  std::int32_t fault_detail{0};  ///< Fault::detail of the end; 0 before the end.

  static constexpr auto fields() {
    return std::tuple{field("time", &Status::time, "ns"),
                      field("tick", &Status::tick),
                      field("lateness", &Status::lateness, "ns"),
                      field("measurement_age", &Status::measurement_age, "ns"),
                      field("flags", &Status::flags),
                      field("skipped_ticks", &Status::skipped_ticks),
                      field("action_repeats", &Status::action_repeats),
                      field("discarded_actions", &Status::discarded_actions),
                      field("rejected_actions", &Status::rejected_actions),
                      field("lost_frames", &Status::lost_frames),
                      field("fault_code", &Status::fault_code),
                      field("fault_detail", &Status::fault_detail)};
  }
};

}  // namespace trifinger
