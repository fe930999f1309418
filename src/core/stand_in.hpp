// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <condition_variable>
#include <cstddef>
#include <mutex>
#include <stop_token>
#include <thread>
#include <vector>

#include "frontend_state.hpp"
#include "trifinger/base/time.hpp"
#include "trifinger/core/frontend.hpp"

namespace trifinger::detail {

// Appends the actions of a program that is late, in a thread that needs nothing of the program: see
// UntypedFrontend::set_on_late. It writes the action file of a front-end that has real time.
class StandIn {
 public:
  // `state` must outlive this object.
  explicit StandIn(FrontendState& state);
  StandIn(const StandIn&) = delete;
  StandIn& operator=(const StandIn&) = delete;
  ~StandIn() = default;

  void set(OnLate on_late, HoldAction hold);
  [[nodiscard]] bool is_late() const;

  // As long as it is kept, only the program appends.
  [[nodiscard]] static std::unique_lock<std::mutex> turn_of(const FrontendState& state) {
    return state.stand_in ? state.stand_in->turn() : std::unique_lock<std::mutex>();
  }

 private:
  [[nodiscard]] std::unique_lock<std::mutex> turn();
  void work(const std::stop_token& stop);
  // Waits until y_t is there. False if the session or this object has ended.
  [[nodiscard]] bool wait_for_observation(TimeIndex t, const std::stop_token& stop) const;
  // Appends until so many actions are in the queue, and at least one.
  void append(TimeIndex ahead);
  // Makes the action that holds the robot where it was at this step. False if it cannot.
  [[nodiscard]] bool make_hold_action(TimeIndex newest);
  // When step t began; the end of time if nobody knows.
  [[nodiscard]] Instant begin_of(TimeIndex t) const;

  FrontendState& state_;
  TimeIndex capacity_;  // of the queue
  TimeIndex grace_;     // Steps for which the last action acts on.

  mutable std::mutex mutex_;
  std::condition_variable_any changed_;
  // The mutex guards these, and the queue of the front-end.
  OnLate on_late_{OnLate::kNothing};
  HoldAction hold_;
  std::vector<std::byte> observation_;
  TimeIndex appended_{0};  // Actions since the program's last one.
  bool is_held_{false};    // True if the newest of them holds the robot.

  std::jthread thread_;  // Last member, because the thread uses the others.
};

}  // namespace trifinger::detail
