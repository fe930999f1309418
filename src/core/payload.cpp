// SPDX-License-Identifier: BSD-3-Clause
#include "trifinger/core/payload.hpp"

#include <fcntl.h>
#include <unistd.h>

#include <atomic>
#include <cerrno>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <map>
#include <mutex>
#include <new>
#include <optional>

#include "base/regular_file.hpp"
#include "base/text_of.hpp"
#include "ipc/shared_memory.hpp"
#include "sensor_file.hpp"
#include "session_directory.hpp"
#include "trifinger/base/error.hpp"
#include "trifinger/core/driver.hpp"
#include "trifinger/core/errors.hpp"
#include "trifinger/core/session.hpp"
#include "trifinger/ipc/file_descriptor.hpp"
#include "trifinger/ipc/fork.hpp"

// docs/decisions/large_elements.md says why this is as it is.
namespace trifinger {

using detail::text_of;

namespace {

constexpr std::uint64_t kPayloadMagic = 0x3144502d52474654;  // "TFGR-PD1"
constexpr std::uint64_t kLine = 64;                          // [bytes]
constexpr std::uint64_t kMaxSlots = 4096;
constexpr std::uint64_t kLargest = std::uint64_t{1} << 30U;  // of one payload [bytes]

constexpr std::uint64_t rounded_up(std::uint64_t size) {
  return (size + kLine - 1) / kLine * kLine;
}

// A memory begins with this. The text of the payload's fields, the sequence numbers of the slots
// and the slots follow, each at a multiple of kLine.
struct PayloadHeader {
  std::uint64_t magic;
  std::uint64_t id;
  std::uint64_t text_size;
  std::uint64_t slots;
  std::uint64_t size;  // of one payload
  std::int64_t pid;

  [[nodiscard]] std::uint64_t sequences() const noexcept {
    return rounded_up(sizeof(PayloadHeader)) + rounded_up(text_size);
  }
  [[nodiscard]] std::uint64_t data() const noexcept { return sequences() + slots * kLine; }
  [[nodiscard]] std::uint64_t total() const noexcept { return data() + slots * rounded_up(size); }
  [[nodiscard]] bool is_valid() const noexcept {
    // The bounds keep the sums above far from overflow.
    return magic == kPayloadMagic && id != 0 && text_size < kLargest && slots > 0 &&
           slots <= kMaxSlots && size > 0 && size <= kLargest;
  }
};

}  // namespace

namespace detail {

// ThreadSanitizer knows no fences. It would take the bytes of a payload for a race between threads
// that it sees; g++ warns of that.
#if defined(__SANITIZE_THREAD__) && !defined(__clang__)
#pragma GCC diagnostic ignored "-Wtsan"
#endif

// The memory of a writer, as everybody sees it.
//
// Slot i % slots holds payload i when its sequence number is 2 i + 2; it is 2 i + 1 while the
// writer is at work. A reader that sees the same even number before and after has read the whole
// payload. The bytes themselves are no atomics, since they are read in place by code that knows
// nothing of this. The fences below order them as they order the words of any sequence lock: a
// reader that has seen a byte of the next payload cannot see the old number afterwards.
class PayloadMemory {
 public:
  PayloadMemory(ipc::SharedMemory memory, const ElementDescription& payload, std::size_t slots)
      : memory_(std::move(memory)), header_(header_for(payload, slots)), fields_(payload.text()) {
    new (memory_.data()) PayloadHeader(header_);
    std::memcpy(memory_.data() + rounded_up(sizeof(PayloadHeader)), fields_.data(), fields_.size());
    for (std::uint64_t i = 0; i < slots; ++i)
      new (&sequence(static_cast<std::int64_t>(i))) Sequence(0);
    // Every page is there before the first payload is written.
    std::memset(memory_.data() + header_.data(), 0, header_.total() - header_.data());
  }
  // Throws IncompatibleSession for a file of another kind or another user, SystemError.
  explicit PayloadMemory(ipc::SharedMemory memory) : memory_(std::move(memory)), header_{} {
    const std::string name = memory_.path().string();
    try {
      require_own_file(memory_.file(), name);
      require(memory_.size() >= sizeof(PayloadHeader), "it is too small");
      // Copied, because the other process may change it.
      std::memcpy(&header_, memory_.data(), sizeof(header_));
      require(header_.is_valid(), "its header is none of this version");
      require(header_.total() == memory_.size(), "it has a wrong size");
    } catch (const InvalidArgument& error) {
      throw IncompatibleSession("'" + name + "' cannot be read: " + error.what());
    }
    fields_.assign(
        reinterpret_cast<const char*>(memory_.data() + rounded_up(sizeof(PayloadHeader))),
        header_.text_size);
  }
  PayloadMemory(const PayloadMemory&) = delete;
  PayloadMemory& operator=(const PayloadMemory&) = delete;
  ~PayloadMemory() = default;

  // The header for a new memory. Throws InvalidArgument.
  static PayloadHeader header_for(const ElementDescription& payload, std::size_t slots) {
    require(payload.size() > 0 && payload.size() <= kLargest,
            text_of("a payload of ", payload.size(), " bytes is not possible; allowed are 1 to ",
                    kLargest));
    require(slots > 0 && slots <= kMaxSlots,
            text_of("the history of payloads is ", slots, ", must be 1 to ", kMaxSlots));
    return {.magic = kPayloadMagic,
            .id = random_id(),
            .text_size = payload.text().size(),
            .slots = slots,
            .size = payload.size(),
            .pid = ::getpid()};
  }

  void publish() { memory_.publish(); }
  [[nodiscard]] const ipc::SharedMemory& memory() const noexcept { return memory_; }
  [[nodiscard]] std::uint64_t id() const noexcept { return header_.id; }
  // Throws IncompatibleSession.
  void require_fields(const ElementDescription& expected) const {
    if (fields_ == expected.text() && header_.size == expected.size()) return;
    throw IncompatibleSession(text_of("process ", header_.pid, " writes payloads with the fields\n",
                                      fields_, "but the session says\n", expected.text()));
  }

  [[nodiscard]] std::span<std::byte> begin(std::int64_t number) noexcept {
    // relaxed, and a fence: no byte of the new payload is seen before the odd number. The old
    // number of another payload may be seen as long as its bytes are.
    sequence(number).store(2 * static_cast<std::uint64_t>(number) + 1, std::memory_order_relaxed);
    std::atomic_thread_fence(std::memory_order_release);
    return {slot(number), header_.size};
  }
  void commit(std::int64_t number) noexcept {
    // release: whoever sees the even number sees the whole payload.
    sequence(number).store(even(number), std::memory_order_release);
  }

  [[nodiscard]] bool has(std::int64_t number) const noexcept {
    // acquire: the bytes read after this are at least as new as the number.
    return sequence(number).load(std::memory_order_acquire) == even(number);
  }
  [[nodiscard]] bool still_has(std::int64_t number) const noexcept {
    // The fence: if a byte read before it belongs to a later payload, the number does, too.
    std::atomic_thread_fence(std::memory_order_acquire);
    return sequence(number).load(std::memory_order_relaxed) == even(number) &&
           !memory_.is_damaged();
  }
  [[nodiscard]] std::span<const std::byte> bytes(std::int64_t number) const noexcept {
    return {slot(number), header_.size};
  }
  // The oldest payload that is still whole; -1 if there is none.
  [[nodiscard]] std::int64_t oldest() const noexcept {
    std::int64_t oldest = -1;
    for (std::uint64_t i = 0; i < header_.slots; ++i) {
      // relaxed: only for the text of an error.
      const std::uint64_t found =
          sequence(static_cast<std::int64_t>(i)).load(std::memory_order_relaxed);
      if (found == 0 || found % 2 != 0) continue;
      const auto number = static_cast<std::int64_t>(found / 2) - 1;
      if (oldest < 0 || number < oldest) oldest = number;
    }
    return oldest;
  }

 private:
  using Sequence = std::atomic<std::uint64_t>;
  static_assert(Sequence::is_always_lock_free && sizeof(Sequence) == 8);

  [[nodiscard]] static std::uint64_t even(std::int64_t number) noexcept {
    return 2 * static_cast<std::uint64_t>(number) + 2;
  }
  [[nodiscard]] std::uint64_t place(std::int64_t number) const noexcept {
    return static_cast<std::uint64_t>(number) % header_.slots;
  }
  [[nodiscard]] Sequence& sequence(std::int64_t number) const noexcept {
    return *reinterpret_cast<Sequence*>(memory_.data() + header_.sequences() +
                                        place(number) * kLine);
  }
  [[nodiscard]] std::byte* slot(std::int64_t number) const noexcept {
    return memory_.data() + header_.data() + place(number) * rounded_up(header_.size);
  }

  ipc::SharedMemory memory_;
  PayloadHeader header_;  // a copy: nobody else can change it
  std::string fields_;
};

namespace {

// The memories of the writers in this process, by id: their readers need no file.
class OwnMemories {
 public:
  static OwnMemories& instance() {
    static OwnMemories memories;
    return memories;
  }
  void add(const std::shared_ptr<PayloadMemory>& memory) {
    const std::lock_guard lock(mutex_);
    std::erase_if(memories_, [](const auto& entry) { return entry.second.expired(); });
    memories_[memory->id()] = memory;
  }
  std::shared_ptr<const PayloadMemory> find(std::uint64_t id) {
    const std::lock_guard lock(mutex_);
    const auto found = memories_.find(id);
    return found == memories_.end() ? nullptr : found->second.lock();
  }

 private:
  std::mutex mutex_;
  std::map<std::uint64_t, std::weak_ptr<PayloadMemory>> memories_;
};

}  // namespace
}  // namespace detail

using detail::OwnMemories;
using detail::PayloadMemory;

void require_payload_reference(const ElementDescription& element) {
  const FieldDescription* const memory = element.find("payload.memory");
  const FieldDescription* const number = element.find("payload.number");
  const FieldDescription* const stamp = element.find("stamp.arrival_index");
  detail::require(stamp != nullptr && stamp->offset == 0 && memory != nullptr &&
                      number != nullptr && memory->offset == sizeof(Stamp) &&
                      memory->type == ScalarType::kUint64 && memory->shape.empty() &&
                      number->offset == sizeof(Stamp) + 8 && number->type == ScalarType::kInt64 &&
                      number->shape.empty(),
                  "elements with a payload must begin with a Stamp 'stamp' and a "
                  "PayloadReference 'payload'");
}

// ---- the writer ----

struct PayloadWriter::State {
  State(std::optional<ipc::SharedMemory> its_lock, std::shared_ptr<PayloadMemory> its_memory)
      : lock(std::move(its_lock)), memory(std::move(its_memory)) {}
  ~State() {
    if (!lock || fork.is_inherited()) return;
    // The lock is still ours, so the file is, too. Readers in this process keep the memory itself.
    ::unlink(memory->memory().path().c_str());
    detail::leave(*lock);
  }

  std::optional<ipc::SharedMemory> lock;
  std::shared_ptr<PayloadMemory> memory;
  std::int64_t next{0};
  ipc::ForkGuard fork{};
};

PayloadWriter::PayloadWriter(std::unique_ptr<State> state) : state_(std::move(state)) {
  OwnMemories::instance().add(state_->memory);
}

PayloadWriter::PayloadWriter(const std::string& robot, const std::string& sensor,
                             const ElementDescription& payload, std::size_t history)
    : PayloadWriter([&] {
        const PayloadHeader header = PayloadMemory::header_for(payload, history);
        const std::string file = detail::payload_file(robot, sensor);
        ipc::SharedMemory lock = detail::own_sensor_file(
            file, "the writer of the payloads of sensor '" + sensor + "' of robot '" + robot + "'");
        auto memory = std::make_shared<PayloadMemory>(
            ipc::SharedMemory::create_file(session_folder(), file, header.total(),
                                           detail::kOwnerAlone),
            payload, history);
        memory->publish();
        return std::make_unique<State>(std::move(lock), std::move(memory));
      }()) {}

PayloadWriter PayloadWriter::anonymous(const ElementDescription& payload, std::size_t history) {
  const PayloadHeader header = PayloadMemory::header_for(payload, history);
  auto memory = std::make_shared<PayloadMemory>(ipc::SharedMemory::create_anonymous(header.total()),
                                                payload, history);
  return PayloadWriter(std::make_unique<State>(std::nullopt, std::move(memory)));
}

PayloadWriter::PayloadWriter(PayloadWriter&&) noexcept = default;
PayloadWriter& PayloadWriter::operator=(PayloadWriter&&) noexcept = default;
PayloadWriter::~PayloadWriter() = default;

namespace {

// `checked` for what neither throws nor allocates.
template <class State>
State& checked_in_loop(const std::unique_ptr<State>& state) noexcept {
  if (state == nullptr) {
    std::fputs(
        "a PayloadWriter was used after it had been moved: use the object that it was moved to\n",
        stderr);
    std::abort();
  }
  return *state;
}

}  // namespace

std::span<std::byte> PayloadWriter::begin() noexcept {
  const State& state = checked_in_loop(state_);
  return state.memory->begin(state.next);
}

PayloadReference PayloadWriter::commit() noexcept {
  State& state = checked_in_loop(state_);
  state.memory->commit(state.next);
  return {.memory = state.memory->id(), .number = state.next++};
}

// ---- the readers ----

PayloadView::PayloadView(std::shared_ptr<const PayloadMemory> memory, std::int64_t number)
    : memory_(std::move(memory)), number_(number), bytes_(memory_->bytes(number)) {}

bool PayloadView::is_valid() const noexcept { return memory_->still_has(number_); }

void PayloadView::require_valid() const {
  if (is_valid()) return;
  const std::int64_t oldest = memory_->oldest();
  throw HistoryLost(oldest, text_of("payload ", number_,
                                    " was overwritten while it was read or before; the "
                                    "oldest one still kept is ",
                                    oldest));
}

void PayloadView::copy_to(void* target) const {
  std::memcpy(target, bytes_.data(), bytes_.size());
  require_valid();
}

namespace {

// The number of the memory in a file, or 0 if it has none. Throws SystemError.
std::uint64_t id_of(const std::filesystem::path& path) {
  const ipc::FileDescriptor file(
      [&path] { return open_regular_file(path, O_RDONLY, NamedBy::kProgram); });
  PayloadHeader header{};
  const ssize_t size = ::pread(file.get(), &header, sizeof(header), 0);
  if (size != sizeof(header) || header.magic != kPayloadMagic) return 0;
  return header.id;
}

}  // namespace

struct PayloadReader::State {
  std::string robot;
  std::string sensor;
  ElementDescription payload;
  std::mutex mutex{};
  std::shared_ptr<const PayloadMemory> memory{};  // the one that was used last

  [[nodiscard]] std::shared_ptr<const PayloadMemory> find(std::uint64_t id) {
    const std::lock_guard lock(mutex);
    if (memory != nullptr && memory->id() == id) return memory;
    auto found = OwnMemories::instance().find(id);
    if (found == nullptr) found = open(id);
    found->require_fields(payload);
    return memory = std::move(found);
  }

 private:
  [[nodiscard]] std::shared_ptr<const PayloadMemory> open(std::uint64_t id) const {
    const auto path = session_folder() / detail::payload_file(robot, sensor);
    const auto gone = [this](const std::string& why) {
      return HistoryLost(
          -1, "the payloads of sensor '" + sensor + "' of robot '" + robot + "' are gone: " + why);
    };
    try {
      // Elements of an earlier process may be asked for again and again: nothing is mapped for
      // them.
      const std::uint64_t newest = id_of(path);
      if (newest != 0 && newest != id) throw gone("its process was started again");
      auto found = std::make_shared<const PayloadMemory>(
          ipc::SharedMemory::open(path, ipc::Access::kReadOnly));
      if (found->id() != id) throw gone("its process was started again");
      return found;
    } catch (const SystemError& error) {
      if (error.error_number() == ENOENT) throw gone("its process has ended");
      throw;
    }
  }
};

PayloadReader::PayloadReader(std::string robot, std::string sensor, ElementDescription payload)
    : state_(new State{
          .robot = std::move(robot), .sensor = std::move(sensor), .payload = std::move(payload)}) {}

PayloadReader::~PayloadReader() = default;

PayloadView PayloadReader::view(const PayloadReference& reference) const {
  if (reference.memory == 0 || reference.number < 0) {
    throw InvalidArgument("an element of sensor '" + state_->sensor + "' has no payload");
  }
  PayloadView view(state_->find(reference.memory), reference.number);
  // Not `is_valid`: this look comes before the bytes are read, not after.
  if (!view.memory_->has(reference.number)) view.require_valid();
  return view;
}

}  // namespace trifinger
