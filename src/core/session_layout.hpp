// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>

#include "ipc/ring.hpp"
#include "trifinger/base/time.hpp"
#include "trifinger/core/session.hpp"
#include "trifinger/ipc/process.hpp"

// The bytes of a session, shared by all processes. Both files begin with a header; rings and texts
// follow at the offsets that the header gives. A change of anything here is a new kLayoutVersion.
namespace trifinger::detail {

inline constexpr std::uint64_t kStateMagic = 0x3154532d52474654;   // "TFGR-ST1"
inline constexpr std::uint64_t kActionMagic = 0x3143412d52474654;  // "TFGR-AC1"
inline constexpr std::uint32_t kLayoutVersion = 6;

inline constexpr std::size_t kNumSeries = 6;
inline constexpr std::size_t kNumWaitSlots = 8;

[[nodiscard]] constexpr std::size_t index_of(Series series) noexcept {
  return static_cast<std::size_t>(series);
}
// True for the series of a robot that have one element per step, at the step's index.
[[nodiscard]] constexpr bool is_indexed_by_step(Series series) noexcept {
  return series != Series::kHolding && series != Series::kStopping;
}

enum class Phase : std::uint32_t {
  kPreparing,  // the driver is not ready to hold
  kHolding,    // before step 0
  kRunning,
  kEnded,
};

struct RingPlace {
  std::uint64_t offset;
  ipc::RingShape shape;  // capacity 0: the session has no such series
};

struct TextPlace {
  std::uint64_t offset;
  std::uint64_t size;
};

struct DocumentPlace {
  TextPlace name;
  TextPlace media_type;
  TextPlace text;
};

// The hash of a session's type and of the fields of its series and payload, FNV-1a with 64 bits. It
// shows a mismatch in one comparison.
[[nodiscard]] inline std::uint64_t description_hash(
    std::string_view type, const std::array<std::string, kNumSeries>& fields,
    std::string_view payload) noexcept {
  std::uint64_t hash = 0xcbf29ce484222325;
  const auto add = [&hash](std::string_view text) {
    for (const char character : text) {
      hash = (hash ^ static_cast<unsigned char>(character)) * 0x100000001b3;
    }
  };
  add(type);
  for (const std::string& text : fields) add(text);
  add(payload);
  return hash;
}

// The part of a state file's header that is constant once the file is published.
struct StateConstants {
  std::uint64_t magic;
  std::uint32_t layout_version;
  std::uint32_t is_real_time;
  std::uint64_t file_size;
  std::uint64_t session_id;
  std::uint64_t robot_session_id;  // for a companion: its robot's session; for a robot: its own
  std::uint64_t description_hash;
  std::int64_t period;        // [ns]
  std::int64_t created_time;  // since 1970 [ns]
  std::int64_t backend_pid;
  std::uint64_t backend_start_time;
  std::uint64_t backend_number_space;
  std::int64_t first_index;                 // index of a robot's first step, here called step 0
  std::array<RingPlace, kNumSeries> rings;  // by Series
  RingPlace queue;                          // in the action file
  RingPlace timing;                         // TimingRecords; only for robots in real-time mode
  TextPlace name;
  TextPlace type;
  TextPlace host;
  std::array<TextPlace, kNumSeries> descriptions;
  TextPlace payload;            // fields of a companion's payload; empty if it has none
  TextPlace default_action;     // bytes
  TextPlace companions;         // names, each followed by a newline
  TextPlace documents;          // DocumentPlaces
  TextPlace realtime_warnings;  // sentences, each followed by a newline

  [[nodiscard]] ipc::ProcessIdentity backend() const noexcept {
    return {
        .pid = backend_pid, .start_time = backend_start_time, .number_space = backend_number_space};
  }
};

// Written by the back-end alone; everybody else maps it read-only.
struct StateHeader : StateConstants {
  // The word on which readers sleep, and the ends of the series.
  alignas(64) std::atomic<std::uint32_t> event;
  std::atomic<std::uint32_t> phase;
  std::array<std::atomic<std::int64_t>, kNumSeries> ends;  // first index not yet written
  // For companions: everything that arrives at or before this step is in the series. It is -2 at
  // first.
  std::atomic<std::int64_t> complete_through;

  // The words that append reads: the first index that has been neither taken nor closed, and
  // whether the back-end sleeps.
  alignas(64) std::atomic<std::int64_t> next_action;
  std::atomic<std::uint32_t> backend_waits;

  alignas(64) std::atomic<std::int64_t> heartbeat;  // monotonic [ns]
  std::atomic<std::int64_t> timing_end;             // records written so far; the newest counts
  // Valid once the phase is kEnded.
  std::atomic<std::int32_t> fault_code;
  std::atomic<std::int32_t> fault_detail;
  std::atomic<std::int64_t> fault_time_index;
  std::array<char, 256> fault_text;
  std::atomic<std::uint32_t> is_at_rest;  // set after the end, when the orderly stop is complete
};

enum Request : std::uint32_t {
  kFinish = 1,   // end when the queue is empty
  kDetach = 2,   // end now
  kRecover = 4,  // clear the fault of the ended session
};
inline constexpr std::uint32_t kEndRequests = kFinish | kDetach;

// The controlling front-end writes this file. The back-end does not trust its content. The process
// with the owner's lock of the file is in control. The process identity in the header is only a
// claim, and can only harm whoever makes it: a lock no longer counts if its holder claims to be a
// process that is dead.
struct ActionHeader {
  std::uint64_t magic;
  std::uint64_t session_id;
  std::atomic<std::int64_t> controller_pid;  // 0: nobody has control
  std::atomic<std::uint64_t> controller_start_time;
  std::atomic<std::uint64_t> controller_number_space;

  alignas(64) std::atomic<std::uint32_t> event;  // the word on which the back-end sleeps
  std::atomic<std::uint32_t> requests;           // set of Request

  // Steps for which threads of the controller wait: `Wanted` words, 0 if nobody uses the slot.
  alignas(64) std::array<std::atomic<std::uint64_t>, kNumWaitSlots> wait_slots;

  [[nodiscard]] ipc::ProcessIdentity controller() const noexcept {
    // acquire: what was stored before the number belongs to it.
    const std::int64_t pid = controller_pid.load(std::memory_order_acquire);
    return {.pid = pid,
            .start_time = controller_start_time.load(std::memory_order_relaxed),
            .number_space = controller_number_space.load(std::memory_order_relaxed)};
  }
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

// Flags of an entry of the queue. An entry is a word of flags, then the action.
struct QueueFlags {
  static constexpr std::uint64_t kAcausal = 1;
};

}  // namespace trifinger::detail
