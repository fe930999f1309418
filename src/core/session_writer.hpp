// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "ipc/ring.hpp"
#include "ipc/shared_memory.hpp"
#include "session_directory.hpp"
#include "session_layout.hpp"
#include "trifinger/base/time.hpp"
#include "trifinger/core/description.hpp"
#include "trifinger/core/document.hpp"
#include "trifinger/core/fault.hpp"
#include "trifinger/core/session.hpp"
#include "trifinger/core/timing.hpp"
#include "trifinger/ipc/fork.hpp"

namespace trifinger::detail {

// The contents of a session.
struct SessionPlan {
  std::string name;
  std::string type;
  std::uint64_t session_id{0};
  std::uint64_t robot_session_id{0};
  bool is_real_time{false};
  Nanoseconds period{0};
  TimeIndex first_index{0};
  std::array<const ElementDescription*, kNumSeries> elements{};  // nullptr: no such series
  std::array<std::size_t, kNumSeries> capacities{};
  std::string payload{};  // fields
  std::vector<std::byte> default_action{};
  std::string companions{};  // names, each followed by a newline
  std::span<const Document> documents{};
  std::string realtime_warnings{};  // sentences, each followed by a newline
  std::size_t queue{0};             // capacity; 0: no action file
  unsigned mode{0600};
};

// A session as its back-end sees it. It is made and destroyed outside the loop. Its functions run
// in the loop.
class SessionWriter {
 public:
  SessionWriter(std::shared_ptr<Directory> directory, const SessionPlan& plan);
  ~SessionWriter();

  [[nodiscard]] StateHeader& header() const noexcept { return *header_; }
  // The controller's file; only for robots.
  [[nodiscard]] const ActionHeader& action_header() const noexcept { return *action_header_; }
  [[nodiscard]] const ipc::Ring& queue() const noexcept { return queue_; }
  // True if one of the files was truncated while it was in use.
  [[nodiscard]] bool is_cut_off() const noexcept {
    return state_->is_damaged() || action_->is_damaged();
  }
  [[nodiscard]] bool is_damaged() const noexcept {
    return is_cut_off() || action_header_->magic != kActionMagic;
  }
  // True if the controlling process ended without giving control back. Needs some system calls.
  [[nodiscard]] bool controller_died() const noexcept;
  [[nodiscard]] std::uint64_t session_id() const noexcept { return header_->session_id; }
  [[nodiscard]] TimeIndex first_index() const noexcept { return first_index_; }

  // Writes the next element. Readers find it at once; sleepers wake in `announce`.
  void append(Series series, const void* element) noexcept;
  void write_timing(const TimingRecord& timing) noexcept;
  [[nodiscard]] std::int64_t end_of(Series series) const noexcept {
    return ends_[index_of(series)];
  }

  [[nodiscard]] std::int64_t capacity_of(Series series) const noexcept {
    return static_cast<std::int64_t>(rings_[index_of(series)].shape().capacity);
  }
  // For companions: when element `index` arrived. The element must be in the ring.
  [[nodiscard]] TimeIndex arrival_index(std::int64_t index) const noexcept;

  enum class Wake : std::uint8_t {
    kAlways,    // wakes everybody who sleeps
    kIfWanted,  // wakes sleepers if something that the controller waits for is there now
  };
  // Tells sleepers that there is something new.
  void announce(Wake wake) noexcept;
  void set_phase(Phase phase) noexcept;
  // Ends the session: writes the fault, then the phase kEnded, and wakes everybody. False if the
  // session had ended before.
  bool end(const Fault& fault, std::string_view text) noexcept;
  // After the end: append what the orderly stop has measured, and tell that it is complete.
  void append_stopping(const void* observation) noexcept;
  void come_to_rest() noexcept;

  // Reserves the memory of another session like this one. Throws SystemError.
  void reserve_another() const;

 private:
  // If the public constructor throws after this one, the destructor cleans up.
  SessionWriter(std::shared_ptr<Directory> directory, std::string state_file,
                TimeIndex first_index);
  void write(Series series, const void* element) noexcept;
  [[nodiscard]] bool somebody_has_what_they_want() const noexcept;
  void make_state_file(const SessionPlan& plan);
  void make_action_file(const SessionPlan& plan);

  std::shared_ptr<Directory> directory_;
  std::string state_file_;
  std::string action_file_;
  std::optional<ipc::SharedMemory> state_;
  std::optional<ipc::SharedMemory> action_;
  StateHeader* header_{nullptr};
  ActionHeader* action_header_{nullptr};
  TimeIndex first_index_;
  std::array<ipc::Ring, kNumSeries> rings_;
  std::array<std::int64_t, kNumSeries> ends_{};
  ipc::Ring queue_;
  ipc::Ring timing_;
  std::atomic_flag ended_;
  ipc::ForkGuard fork_;
};

}  // namespace trifinger::detail
