// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "ipc/ring.hpp"
#include "ipc/shared_memory.hpp"
#include "session_directory.hpp"
#include "session_layout.hpp"
#include "trifinger/base/error.hpp"
#include "trifinger/core/description.hpp"
#include "trifinger/core/document.hpp"
#include "trifinger/core/fault.hpp"
#include "trifinger/core/robot.hpp"
#include "trifinger/core/session.hpp"
#include "trifinger/core/timing.hpp"
#include "trifinger/ipc/fork.hpp"

namespace trifinger::detail {

// A session as all processes see it: its state file, read-only. The descriptions have been checked
// and parsed.
class SessionMapping {
 public:
  // Throws SystemError (ENOENT), IncompatibleSession.
  SessionMapping(std::shared_ptr<Directory> directory, const std::string& name);

  [[nodiscard]] const StateHeader& header() const noexcept { return *header_; }
  [[nodiscard]] const ipc::Ring& ring(Series series) const noexcept {
    return rings_[index_of(series)];
  }
  [[nodiscard]] bool has(Series series) const noexcept { return ring(series).shape().capacity > 0; }
  [[nodiscard]] const std::string& name() const noexcept { return name_; }
  [[nodiscard]] const std::string& host() const noexcept { return host_; }
  [[nodiscard]] const RobotTypes& description() const noexcept { return description_; }
  [[nodiscard]] const ElementDescription& element(Series series) const;
  [[nodiscard]] const ElementDescription& payload() const noexcept { return payload_; }
  [[nodiscard]] const std::vector<std::string>& companion_names() const noexcept {
    return companion_names_;
  }
  [[nodiscard]] const std::vector<std::string>& realtime_warnings() const noexcept {
    return realtime_warnings_;
  }
  // Throws IncompatibleSession.
  [[nodiscard]] std::vector<Document> documents() const;
  // The companion `name` of this session. Throws SessionNotFound, RobotStopped.
  [[nodiscard]] std::shared_ptr<const SessionMapping> companion(const std::string& name) const;
  // For a robot in real-time mode, after its first whole step.
  [[nodiscard]] std::optional<TimingRecord> timing() const noexcept;
  [[nodiscard]] bool is_companion() const noexcept { return !has(Series::kStatus); }
  [[nodiscard]] const std::shared_ptr<Directory>& directory() const noexcept { return directory_; }

  [[nodiscard]] bool has_ended() const noexcept {
    // acquire: all elements and the fault were written before the phase.
    return header_->phase.load(std::memory_order_acquire) ==
           static_cast<std::uint32_t>(Phase::kEnded);
  }
  [[nodiscard]] std::int64_t end_of(Series series) const noexcept {
    return header_->ends[index_of(series)].load(std::memory_order_acquire);
  }
  // The index of the first element that was ever written.
  [[nodiscard]] std::int64_t begin_of(Series series) const noexcept {
    return is_indexed_by_step(series) ? header_->first_index : 0;
  }
  // Needs some system calls.
  [[nodiscard]] bool backend_is_alive() const noexcept;
  // Throws InheritedHandle in a forked child, which cannot ask for the lock.
  void require_own() const;
  // Valid after the session has ended or its back-end died.
  [[nodiscard]] Fault fault() const noexcept;
  [[nodiscard]] std::string fault_text() const;
  [[noreturn]] void throw_stopped() const;

 private:
  // The parts of the constructor. All throw InvalidArgument.
  void check_header() const;
  void check_counters() const;
  void map_rings();
  void read_texts();
  void read_elements();
  void check_companion() const;
  void check_robot() const;
  [[nodiscard]] bool is_inside(std::uint64_t offset, std::uint64_t size) const noexcept;
  [[nodiscard]] ipc::Ring ring_at(const RingPlace& place, const std::string& what) const;
  [[nodiscard]] std::string text(const TextPlace& place) const;
  [[noreturn]] void throw_unreadable(const InvalidArgument& error) const;

  std::shared_ptr<Directory> directory_;
  ipc::SharedMemory memory_;
  std::optional<ipc::SharedMemory> lock_;
  const StateHeader* header_;
  std::array<ipc::Ring, kNumSeries> rings_;
  std::string name_;
  std::string host_;
  RobotTypes description_;
  ElementDescription status_;
  ElementDescription payload_;
  ipc::Ring timing_;
  std::vector<std::string> companion_names_;
  std::vector<std::string> realtime_warnings_;
  ipc::ForkGuard fork_;
};

}  // namespace trifinger::detail
