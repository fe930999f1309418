// SPDX-License-Identifier: BSD-3-Clause
#include "session_writer.hpp"

#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <bit>
#include <chrono>
#include <new>
#include <span>
#include <string>
#include <utility>

#include "ipc/file_lock.hpp"
#include "ipc/futex.hpp"
#include "trifinger/base/error.hpp"
#include "trifinger/core/driver.hpp"
#include "trifinger/ipc/process.hpp"

namespace trifinger::detail {
namespace {

// Lays out a file: gives each part its place, one after the other, and remembers contents.
class FilePlan {
 public:
  explicit FilePlan(std::uint64_t header_size) : size_(rounded_up(header_size)) {}

  [[nodiscard]] RingPlace add(const ipc::RingShape& shape) {
    return {.offset = add_bytes(shape.size()), .shape = shape};
  }
  // The plan refers to `content` until it is written. `room`: what may be needed in other files
  // that are to have the same size.
  [[nodiscard]] TextPlace add(std::span<const std::byte> content, std::size_t room = 0) {
    const TextPlace place{.offset = add_bytes(std::max(content.size(), room)),
                          .size = content.size()};
    contents_.emplace_back(place.offset, content);
    return place;
  }
  [[nodiscard]] TextPlace add(const std::string& text, std::size_t room = 0) {
    return add(std::as_bytes(std::span(text)), room);
  }
  // Writes the contents; rings remain as they are.
  void write(std::byte* file) const {
    for (const auto& [offset, content] : contents_) {
      std::ranges::copy(content, file + offset);
    }
  }
  [[nodiscard]] std::uint64_t size() const noexcept { return size_; }

 private:
  [[nodiscard]] static std::uint64_t rounded_up(std::uint64_t size) noexcept {
    return (size + 63) / 64 * 64;
  }
  [[nodiscard]] std::uint64_t add_bytes(std::uint64_t size) noexcept {
    return std::exchange(size_, rounded_up(size_ + size));
  }

  std::uint64_t size_;
  std::vector<std::pair<std::uint64_t, std::span<const std::byte>>> contents_;  // by offset
};

ipc::RingShape ring_shape(std::size_t capacity, std::size_t element_size, const std::string& what) {
  const ipc::RingShape shape{.capacity = std::bit_ceil(capacity), .element_size = element_size};
  require(shape.is_valid(), "a " + what + " of " + std::to_string(capacity) +
                                " elements is not possible; allowed are 1 to " +
                                std::to_string(1U << 30U));
  return shape;
}

std::string host_name() {
  std::array<char, 256> name{};
  ::gethostname(name.data(), name.size() - 1);
  return name.data();
}

// The constants of a session that do not depend on the places in its file.
StateConstants constants_of(const SessionPlan& plan) {
  StateConstants constants{};
  constants.magic = kStateMagic;
  constants.layout_version = kLayoutVersion;
  constants.is_real_time = plan.is_real_time ? 1 : 0;
  constants.session_id = plan.session_id;
  constants.robot_session_id = plan.robot_session_id;
  constants.period = plan.period.count();
  constants.created_time =
      std::chrono::duration_cast<Nanoseconds>(std::chrono::system_clock::now().time_since_epoch())
          .count();
  const auto backend = ipc::ProcessIdentity::of_this_process();
  constants.backend_pid = backend.pid;
  constants.backend_start_time = backend.start_time;
  constants.backend_number_space = backend.number_space;
  constants.first_index = plan.first_index;
  return constants;
}

}  // namespace

SessionWriter::SessionWriter(std::shared_ptr<Directory> directory, std::string state_file,
                             TimeIndex first_index)
    : directory_(std::move(directory)),
      state_file_(std::move(state_file)),
      first_index_(first_index) {}

SessionWriter::SessionWriter(std::shared_ptr<Directory> directory, const SessionPlan& plan)
    : SessionWriter(std::move(directory), state_file(plan.name), plan.first_index) {
  make_state_file(plan);
  // The queue is published first: whoever finds the state file also finds the queue.
  if (plan.queue > 0) make_action_file(plan);
  if (!ipc::try_lock(state_->file())) throw Error("a new session is locked by somebody else");
  state_ = directory_->publish(state_file_, std::move(*state_));
}

void SessionWriter::make_state_file(const SessionPlan& plan) {
  StateConstants constants = constants_of(plan);
  FilePlan file(sizeof(StateHeader));
  std::array<std::string, kNumSeries> fields;
  for (std::size_t i = 0; i < kNumSeries; ++i) {
    if (plan.elements[i] == nullptr) continue;
    fields[i] = plan.elements[i]->text();
    constants.rings[i] =
        file.add(ring_shape(plan.capacities[i], plan.elements[i]->size(), "history"));
    constants.descriptions[i] = file.add(fields[i]);
  }
  constants.description_hash = description_hash(plan.type, fields, plan.payload);
  if (plan.is_real_time && plan.queue > 0) {
    // A reader that the back-end overtakes finds the next record.
    constexpr std::size_t kTimingHistory = 4;
    constants.timing =
        file.add(ipc::RingShape{.capacity = kTimingHistory, .element_size = sizeof(TimingRecord)});
  }
  const std::string host = host_name();
  constants.name = file.add(plan.name);
  constants.type = file.add(plan.type);
  constants.host = file.add(host);
  constants.payload = file.add(plan.payload);
  constants.default_action = file.add(plan.default_action);
  constants.companions = file.add(plan.companions);
  // All sessions of a back-end have the same size, so that one can reuse the memory of another.
  constexpr std::size_t kRoomForWarnings = 4096;
  constants.realtime_warnings = file.add(plan.realtime_warnings, kRoomForWarnings);
  std::vector<DocumentPlace> documents;
  for (const Document& document : plan.documents) {
    documents.push_back(
        {file.add(document.name), file.add(document.media_type), file.add(document.text)});
  }
  constants.documents = file.add(std::as_bytes(std::span(documents)));
  constants.file_size = file.size();

  // Only the back-end ever writes to the state file.
  const unsigned mode = plan.mode & ~static_cast<unsigned>(S_IWGRP | S_IWOTH);
  state_.emplace(directory_->create(state_file_, file.size(), mode));
  header_ = new (state_->data()) StateHeader{};
  static_cast<StateConstants&>(*header_) = constants;
  file.write(state_->data());
  for (std::size_t i = 0; i < kNumSeries; ++i) {
    rings_[i] = ipc::Ring(state_->data() + constants.rings[i].offset, constants.rings[i].shape);
    ends_[i] = is_indexed_by_step(static_cast<Series>(i)) ? plan.first_index : 0;
    // relaxed, here and below: nobody sees the file before it is published.
    header_->ends[i].store(ends_[i], std::memory_order_relaxed);
  }
  timing_ = ipc::Ring(state_->data() + constants.timing.offset, constants.timing.shape);
  header_->next_action.store(plan.first_index, std::memory_order_relaxed);
  header_->complete_through.store(-2, std::memory_order_relaxed);
}

void SessionWriter::make_action_file(const SessionPlan& plan) {
  FilePlan file(sizeof(ActionHeader));
  const std::size_t entry_size = sizeof(std::uint64_t) + plan.elements[0]->size();
  const RingPlace place = file.add(ring_shape(plan.queue, entry_size, "queue"));
  header_->queue = place;
  action_file_ = action_file(plan.name, plan.session_id);
  action_.emplace(directory_->create(action_file_, file.size(), plan.mode));
  action_header_ = new (action_->data()) ActionHeader{};
  action_header_->magic = kActionMagic;
  action_header_->session_id = plan.session_id;
  action_ = directory_->publish(action_file_, std::move(*action_));
  queue_ = ipc::Ring(action_->data() + place.offset, place.shape);
}

void SessionWriter::reserve_another() const {
  directory_->reserve(state_file_, state_->size());
  if (action_) directory_->reserve(action_file_, action_->size());
}

SessionWriter::~SessionWriter() {
  if (fork_.is_inherited()) return;
  // The state file stays for readers until the next session takes its name.
  if (!action_file_.empty()) directory_->remove(action_file_);
  if (action_) directory_->give_back(std::move(*action_));
  if (state_) directory_->give_back(std::move(*state_));
}

bool SessionWriter::controller_died() const noexcept {
  // acquire, before the look at the lock: until the first action another controller may replace a
  // dead one, and the session should continue. Later nobody can replace it.
  if (header_->phase.load(std::memory_order_acquire) <
      static_cast<std::uint32_t>(Phase::kRunning)) {
    return false;
  }
  const std::uint32_t requests = action_header_->requests.load(std::memory_order_acquire);
  if ((requests & kDetach) != 0) return false;
  // A child that a bare fork(2) made keeps the lock of its dead parent.
  return !ipc::is_locked_by_other(action_->file()) || action_header_->controller().is_known_dead();
}

void SessionWriter::append(Series series, const void* element) noexcept {
  // relaxed: if the session was ended from outside during a call of the driver, the loop adds
  // nothing more to it.
  if (!ended_.test(std::memory_order_relaxed)) write(series, element);
}

void SessionWriter::write_timing(const TimingRecord& timing) noexcept {
  // relaxed: see append; only this writer changes the count.
  if (ended_.test(std::memory_order_relaxed)) return;
  const std::int64_t index = header_->timing_end.load(std::memory_order_relaxed);
  timing_.write(index, &timing);
  // release: whoever sees the new end finds the record.
  header_->timing_end.store(index + 1, std::memory_order_release);
}

void SessionWriter::write(Series series, const void* element) noexcept {
  const std::size_t i = index_of(series);
  rings_[i].write(ends_[i], element);
  ++ends_[i];
  // release: whoever sees the new end finds the element.
  header_->ends[i].store(ends_[i], std::memory_order_release);
}

TimeIndex SessionWriter::arrival_index(std::int64_t index) const noexcept {
  static_assert(offsetof(Stamp, arrival_index) == 0 && sizeof(Stamp::arrival_index) == 8);
  return static_cast<TimeIndex>(rings_[index_of(Series::kObservation)].first_word(index));
}

void SessionWriter::announce(Wake wake) noexcept {
  // seq_cst, because the loads of the wait slots come after it: either a sleeper sees this store,
  // or we see the sleeper. Until `end`, only the loop's thread changes this count.
  header_->event.store(header_->event.load(std::memory_order_relaxed) + 1,
                       std::memory_order_seq_cst);
  if (wake == Wake::kAlways || somebody_has_what_they_want()) ipc::futex_wake_all(header_->event);
}

bool SessionWriter::somebody_has_what_they_want() const noexcept {
  if (action_header_ == nullptr) return false;
  for (const auto& slot : action_header_->wait_slots) {
    // seq_cst: see announce.
    const std::uint64_t word = slot.load(std::memory_order_seq_cst);
    if (word == 0) continue;
    const Wanted wanted = Wanted::from(word);
    switch (wanted.kind) {
      case Wanted::kObservation:
        if (end_of(Series::kObservation) > wanted.time_index) return true;
        break;
      case Wanted::kStep:
        if (end_of(Series::kStatus) > wanted.time_index) return true;
        break;
      case Wanted::kQueueSpace:
        // relaxed: this process stored it.
        if (header_->next_action.load(std::memory_order_relaxed) > wanted.time_index) return true;
        break;
      case Wanted::kAnything:
        return true;
    }
  }
  return false;
}

void SessionWriter::set_phase(Phase phase) noexcept {
  // A session that has ended stays ended, whoever ended it.
  std::uint32_t found = header_->phase.load(std::memory_order_relaxed);
  while (found != static_cast<std::uint32_t>(Phase::kEnded) &&
         !header_->phase.compare_exchange_weak(found, static_cast<std::uint32_t>(phase),
                                               std::memory_order_release,
                                               std::memory_order_relaxed)) {
  }
}

bool SessionWriter::end(const Fault& fault, std::string_view text) noexcept {
  // relaxed: this only decides whether the loop or its watchdog ends the session.
  if (ended_.test_and_set(std::memory_order_relaxed)) return false;
  header_->fault_code.store(static_cast<std::int32_t>(fault.code), std::memory_order_relaxed);
  header_->fault_detail.store(fault.detail, std::memory_order_relaxed);
  header_->fault_time_index.store(fault.time_index, std::memory_order_relaxed);
  text.copy(header_->fault_text.data(), header_->fault_text.size() - 1);
  set_phase(Phase::kEnded);
  header_->event.fetch_add(1, std::memory_order_seq_cst);
  ipc::futex_wake_all(header_->event);
  return true;
}

void SessionWriter::append_stopping(const void* observation) noexcept {
  write(Series::kStopping, observation);
}

void SessionWriter::come_to_rest() noexcept {
  // release: whoever sees this also finds all earlier measurements.
  if (header_->is_at_rest.exchange(1, std::memory_order_release) != 0) return;
  header_->event.fetch_add(1, std::memory_order_seq_cst);
  ipc::futex_wake_all(header_->event);
}

}  // namespace trifinger::detail
