// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <atomic>
#include <cstddef>
#include <optional>
#include <utility>

#include "session_handle.hpp"
#include "trifinger/base/time.hpp"
#include "trifinger/core/fault.hpp"
#include "trifinger/core/session.hpp"

namespace trifinger::detail {

// Reads the series of a session and waits for what is still to come. UntypedFrontend documents the
// functions. Any number of threads may call them.
class SessionReader {
 public:
  // `handle` must outlive the reader.
  explicit SessionReader(const SessionHandle& handle)
      : handle_(handle), mapping_(*handle.mapping()) {}

  [[nodiscard]] bool try_get(Series series, TimeIndex t, void* element) const;
  void get(Series series, TimeIndex t, void* element, Timeout timeout) const;
  void get(Series series, TimeIndex first, std::size_t count, void* elements,
           Timeout timeout) const;
  void wait_for(Series series, TimeIndex t, Timeout timeout) const;
  void latest_observation(void* observation, Timeout timeout) const;
  [[nodiscard]] bool get_latest_at(TimeIndex t, void* element, Timeout timeout) const;
  [[nodiscard]] TimeIndex current_time_index() const;
  [[nodiscard]] std::pair<TimeIndex, TimeIndex> range(Series series) const;
  [[nodiscard]] std::optional<Fault> fault() const;

  // The newest step whose observation the user knows; -1 if there is none.
  [[nodiscard]] TimeIndex handed_out() const noexcept {
    // relaxed: the calling thread set it, or a thread whose read has no fixed order with the call.
    return handed_out_.load(std::memory_order_relaxed);
  }

 private:
  [[nodiscard]] bool read_latest_observation(void* observation) const;
  void hand_out(TimeIndex t) const noexcept;
  [[noreturn]] void throw_lost(Series series, TimeIndex t) const;

  const SessionHandle& handle_;
  const SessionMapping& mapping_;
  mutable std::atomic<TimeIndex> handed_out_{-1};
};

}  // namespace trifinger::detail
