// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <condition_variable>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "session_layout.hpp"
#include "trifinger/core/driver.hpp"
#include "trifinger/core/session.hpp"
#include "trifinger/ipc/fork.hpp"
#include "trifinger/ipc/ring.hpp"
#include "trifinger/ipc/shared_memory.hpp"

namespace trifinger::detail {

// The place where the files of sessions lie, by name. This is the only difference between sessions
// inside a process and sessions across processes.
class Directory {
 public:
  Directory() = default;
  Directory(const Directory&) = delete;
  Directory& operator=(const Directory&) = delete;
  virtual ~Directory() = default;

  [[nodiscard]] virtual ipc::SharedMemory create(const std::string& file, std::size_t size,
                                                 unsigned mode) = 0;
  // After this call `open` finds the file. Returns the mapping to keep.
  [[nodiscard]] virtual ipc::SharedMemory publish(const std::string& file,
                                                  ipc::SharedMemory memory) = 0;
  // Keeps the memory of a file that was made here, for later files of the same size.
  virtual void give_back(ipc::SharedMemory memory) noexcept = 0;
  // Reserves memory for another file like this one.
  virtual void reserve(const std::string& file, std::size_t size) = 0;
  // Opens the existing file, or makes a new one.
  [[nodiscard]] virtual ipc::SharedMemory open_or_create(const std::string& file,
                                                         unsigned mode) = 0;
  // Throws SystemError with ENOENT if there is no such file.
  [[nodiscard]] virtual ipc::SharedMemory open(const std::string& file, ipc::Access access) = 0;
  virtual void remove(const std::string& file) noexcept = 0;
  // Removes the files whose names begin with `prefix`, except `kept`.
  virtual void remove_all(const std::string& prefix, const std::string& kept) noexcept = 0;
  // The other processes that own a file of this name, oldest first. The file may have been removed.
  [[nodiscard]] virtual std::vector<ipc::ProcessIdentity> other_owners(
      const std::string& file) const = 0;
};

// Session files in `folder`.
class FolderDirectory final : public Directory {
 public:
  explicit FolderDirectory(std::filesystem::path folder) : folder_(std::move(folder)) {}

  ipc::SharedMemory create(const std::string& file, std::size_t size, unsigned mode) override;
  ipc::SharedMemory publish(const std::string& file, ipc::SharedMemory memory) override;
  ipc::SharedMemory open_or_create(const std::string& file, unsigned mode) override;
  ipc::SharedMemory open(const std::string& file, ipc::Access access) override;
  void remove(const std::string& file) noexcept override;
  void remove_all(const std::string& prefix, const std::string& kept) noexcept override;
  void give_back(ipc::SharedMemory memory) noexcept override;
  void reserve(const std::string& file, std::size_t size) override;
  [[nodiscard]] std::vector<ipc::ProcessIdentity> other_owners(
      const std::string& file) const override;

 private:
  std::filesystem::path folder_;
  std::vector<ipc::SharedMemory> spares_;  // used only by the back-end's thread
};

// Session "files" of this process. Their memory is returned to the system, because no other process
// can fill it.
class ProcessDirectory final : public Directory {
 public:
  ipc::SharedMemory create(const std::string& file, std::size_t size, unsigned mode) override;
  ipc::SharedMemory publish(const std::string& file, ipc::SharedMemory memory) override;
  ipc::SharedMemory open_or_create(const std::string& file, unsigned mode) override;
  ipc::SharedMemory open(const std::string& file, ipc::Access access) override;
  void remove(const std::string& file) noexcept override;
  void remove_all(const std::string& prefix, const std::string& kept) noexcept override;
  void give_back(ipc::SharedMemory memory) noexcept override;
  void reserve(const std::string& file, std::size_t size) override;
  [[nodiscard]] std::vector<ipc::ProcessIdentity> other_owners(
      const std::string& file) const override;

 private:
  std::mutex mutex_;
  std::map<std::string, ipc::SharedMemory> files_;
};

// True for the series of a robot that have one element per step, at the step's index.
[[nodiscard]] constexpr bool is_indexed_by_step(Series series) noexcept {
  return series != Series::kHolding && series != Series::kStopping;
}

[[nodiscard]] std::string state_file(const std::string& name);
[[nodiscard]] std::string action_file(const std::string& name, std::uint64_t session_id);
[[nodiscard]] std::string lock_file(const std::string& name);
// The robot's name in the name of a session: "sim" of "sim.object".
[[nodiscard]] std::string robot_of(const std::string& name);
// The back-end that wrote the header, and the controller that the header names.
[[nodiscard]] ipc::ProcessIdentity backend_of(const layout::StateHeader& header) noexcept;
[[nodiscard]] ipc::ProcessIdentity controller_of(const layout::ActionHeader& header) noexcept;
// Throws InvalidArgument unless `name` can be the name of a robot.
void require_valid_name(const std::string& name);

// A session as all processes see it: its state file, read-only. The descriptions have been checked
// and parsed.
class SessionMapping {
 public:
  // Throws SystemError (ENOENT), IncompatibleSession.
  SessionMapping(std::shared_ptr<Directory> directory, const std::string& name);

  [[nodiscard]] const layout::StateHeader& header() const noexcept { return *header_; }
  [[nodiscard]] const ipc::Ring& ring(Series series) const noexcept {
    return rings_[static_cast<std::size_t>(series)];
  }
  [[nodiscard]] bool has(Series series) const noexcept { return ring(series).shape().capacity > 0; }
  [[nodiscard]] const std::string& name() const noexcept { return name_; }
  [[nodiscard]] const std::string& host() const noexcept { return host_; }
  [[nodiscard]] const RobotTypes& description() const noexcept { return description_; }
  [[nodiscard]] const ElementDescription& element(Series series) const;
  [[nodiscard]] const std::vector<std::string>& companion_names() const noexcept {
    return companion_names_;
  }
  [[nodiscard]] const std::vector<std::string>& realtime_lacks() const noexcept {
    return realtime_lacks_;
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
           static_cast<std::uint32_t>(layout::Phase::kEnded);
  }
  [[nodiscard]] std::int64_t end_of(Series series) const noexcept {
    return header_->ends[static_cast<std::size_t>(series)].load(std::memory_order_acquire);
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
  [[nodiscard]] std::string text(const layout::TextPlace& place) const;
  void check();

  std::shared_ptr<Directory> directory_;
  ipc::SharedMemory memory_;
  std::optional<ipc::SharedMemory> lock_;
  const layout::StateHeader* header_;
  std::array<ipc::Ring, layout::kNumSeries> rings_;
  std::string name_;
  std::string host_;
  RobotTypes description_;
  ElementDescription status_;
  ipc::Ring timing_;
  std::vector<std::string> companion_names_;
  std::vector<std::string> realtime_lacks_;
  ipc::ForkGuard fork_;
};

// The contents of a session.
struct SessionPlan {
  std::string name;
  std::string type;
  std::uint64_t session_id{0};
  std::uint64_t robot_session_id{0};
  bool is_real_time{false};
  Nanoseconds period{0};
  TimeIndex first_index{0};
  std::array<const ElementDescription*, layout::kNumSeries> elements{};  // nullptr: no such series
  std::array<std::size_t, layout::kNumSeries> capacities{};
  std::vector<std::byte> default_action{};
  std::string companions{};  // names, each followed by a newline
  std::span<const Document> documents{};
  std::string realtime_lacks{};  // sentences, each followed by a newline
  std::size_t queue{0};          // capacity; 0: no action file
  unsigned mode{0600};
};

// A session as its back-end sees it. It is made and destroyed outside the loop. Its functions run
// in the loop.
class SessionWriter {
 public:
  SessionWriter(std::shared_ptr<Directory> directory, const SessionPlan& plan);
  SessionWriter(const SessionWriter&) = delete;
  SessionWriter& operator=(const SessionWriter&) = delete;
  ~SessionWriter();

  [[nodiscard]] layout::StateHeader& header() const noexcept { return *header_; }
  // The controller's file; only for robots.
  [[nodiscard]] const layout::ActionHeader& action_header() const noexcept {
    return *action_header_;
  }
  [[nodiscard]] const ipc::Ring& queue() const noexcept { return queue_; }
  // True if one of the files was truncated while it was in use.
  [[nodiscard]] bool is_cut_off() const noexcept {
    return state_->is_damaged() || action_->is_damaged();
  }
  [[nodiscard]] bool is_damaged() const noexcept {
    return is_cut_off() || action_header_->magic != layout::kActionMagic;
  }
  // True if the controlling process ended without giving control back. Needs some system calls.
  [[nodiscard]] bool controller_died() const noexcept;
  [[nodiscard]] std::uint64_t session_id() const noexcept { return header_->session_id; }
  [[nodiscard]] TimeIndex first_index() const noexcept { return first_index_; }

  // Writes the next element. Readers find it at once; sleepers wake in `announce`.
  void append(Series series, const void* element) noexcept;
  void write_timing(const TimingRecord& timing) noexcept;
  [[nodiscard]] std::int64_t end_of(Series series) const noexcept {
    return ends_[static_cast<std::size_t>(series)];
  }

  [[nodiscard]] std::int64_t capacity_of(Series series) const noexcept {
    return static_cast<std::int64_t>(rings_[static_cast<std::size_t>(series)].shape().capacity);
  }
  // For companions: when element `index` arrived. The element must be in the ring.
  [[nodiscard]] TimeIndex arrival_index(std::int64_t index) const noexcept;

  enum class Wake : std::uint8_t {
    kAlways,    // wakes everybody who sleeps
    kIfWanted,  // wakes sleepers if something that the controller waits for is there now
  };
  // Tells sleepers that there is something new.
  void announce(Wake wake) noexcept;
  void set_phase(layout::Phase phase) noexcept;
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
  void make_queue(unsigned mode);

  std::shared_ptr<Directory> directory_;
  std::string state_file_;
  std::string action_file_;
  std::optional<ipc::SharedMemory> state_;
  std::optional<ipc::SharedMemory> action_;
  layout::StateHeader* header_{nullptr};
  layout::ActionHeader* action_header_{nullptr};
  TimeIndex first_index_;
  std::array<ipc::Ring, layout::kNumSeries> rings_;
  std::array<std::int64_t, layout::kNumSeries> ends_{};
  ipc::Ring queue_;
  ipc::Ring timing_;
  std::atomic_flag ended_;
  ipc::ForkGuard fork_;
};

// A step or event for which a thread of the controller waits, as a word in the action file.
struct Wanted {
  enum Kind : std::uint64_t { kObservation = 0, kStep = 1, kQueueSpace = 2, kAnything = 3 };

  Kind kind;
  TimeIndex time_index;

  [[nodiscard]] constexpr std::uint64_t word() const noexcept {
    return (static_cast<std::uint64_t>(time_index + 2) << 2U) | kind;
  }
  [[nodiscard]] static constexpr Wanted from(std::uint64_t word) noexcept {
    return {static_cast<Kind>(word & 3U), static_cast<TimeIndex>(word >> 2U) - 2};
  }
};

// The right to make sessions under one name.
class SessionPlace {
 public:
  // Throws RobotOwned, InvalidArgument.
  SessionPlace(std::shared_ptr<Directory> directory, std::string name, SessionOptions options);
  SessionPlace(const SessionPlace&) = delete;
  SessionPlace& operator=(const SessionPlace&) = delete;
  ~SessionPlace();

  struct Writers {
    std::unique_ptr<SessionWriter> robot;
    std::vector<std::unique_ptr<SessionWriter>> companions;
  };
  // Begins the next session and its companions. `realtime_lacks`, see SessionInfo, counts only in
  // real-time mode. The first call takes the memory of two sessions. Each later session reuses the
  // memory of the last but one, unless others still use it. Throws SystemError, or RobotOwned if
  // the name was lost meanwhile.
  [[nodiscard]] Writers begin(const UntypedDriver& driver, bool is_real_time, Nanoseconds period,
                              const std::vector<std::string>& realtime_lacks = {});
  // Later sessions begin as if they had run for ages: their step 0 has this index.
  void begin_at(TimeIndex first_index) noexcept { first_index_ = first_index; }

  [[nodiscard]] const std::shared_ptr<Directory>& directory() const noexcept { return directory_; }
  [[nodiscard]] const std::string& name() const noexcept { return name_; }

 private:
  // Throws RobotOwned. `is_ours`: we had the name before, and the state file is our session's.
  void take_name(bool is_ours);
  // The process that runs a robot of this name, even if its lock was removed. Nothing if none is
  // found.
  [[nodiscard]] std::optional<std::string> find_owner() const;
  // True if a child of a dead back-end keeps the lock.
  [[nodiscard]] bool is_left_by_the_dead() const;
  // True if the back-end that has the name is being killed.
  [[nodiscard]] bool is_left_by_the_dying() const;
  [[noreturn]] void throw_owned(const std::string& owner) const;

  std::shared_ptr<Directory> directory_;
  std::string name_;
  SessionOptions options_;
  TimeIndex first_index_{0};
  std::optional<ipc::SharedMemory> lock_;
  bool has_reserve_{false};
  ipc::ForkGuard fork_;
};

}  // namespace trifinger::detail
