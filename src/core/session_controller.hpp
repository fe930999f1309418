// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <vector>

#include "session_handle.hpp"
#include "session_layout.hpp"
#include "session_mapping.hpp"
#include "session_reader.hpp"
#include "trifinger/base/time.hpp"
#include "trifinger/ipc/ring.hpp"
#include "trifinger/ipc/shared_memory.hpp"

namespace trifinger::detail {

// Locks the action file of `mapping` for this process and returns it. Nothing if the session is
// about to end or has just ended: then look for the next one. Throws ControlHeld.
[[nodiscard]] std::optional<ipc::SharedMemory> take_control(const SessionMapping& mapping);

void send_request(ActionHeader& header, Request what) noexcept;

// Controls a session: appends actions to its queue and ends it. UntypedFrontend documents the
// functions. One thread at a time may call them.
class SessionController {
 public:
  // `handle`, which must have an action file, and `reader` must outlive the controller.
  SessionController(const SessionHandle& handle, const SessionReader& reader, bool is_strict);
  SessionController(const SessionController&) = delete;
  SessionController& operator=(const SessionController&) = delete;
  // Gives control back.
  ~SessionController();

  TimeIndex append(const void* action, Timeout timeout);
  TimeIndex append(const void* actions, std::size_t count, Timeout timeout);
  void finish(Timeout timeout);

 private:
  [[nodiscard]] bool was_taken(TimeIndex t) const;
  void wait_for_queue_space(TimeIndex taken, Timeout timeout) const;

  const SessionHandle& handle_;
  const SessionReader& reader_;
  ActionHeader& action_header_;
  bool is_strict_;
  ipc::Ring queue_;
  std::vector<std::uint64_t> queue_entry_;
  TimeIndex last_appended_{-1};
};

}  // namespace trifinger::detail
