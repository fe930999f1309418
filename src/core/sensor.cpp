// SPDX-License-Identifier: BSD-3-Clause
#include "trifinger/core/sensor.hpp"

#include <fcntl.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <bit>
#include <cerrno>
#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <cstring>
#include <filesystem>
#include <mutex>
#include <new>
#include <optional>
#include <stop_token>
#include <string_view>
#include <thread>
#include <utility>

#include "base/moved.hpp"
#include "base/regular_file.hpp"
#include "base/text_of.hpp"
#include "ipc/file_lock.hpp"
#include "ipc/ring.hpp"
#include "ipc/shared_memory.hpp"
#include "sensor_file.hpp"
#include "session_directory.hpp"
#include "trifinger/base/error.hpp"
#include "trifinger/core/payload.hpp"
#include "trifinger/core/session.hpp"
#include "trifinger/ipc/file_descriptor.hpp"

// docs/decisions/sensors_in_other_processes.md says why this is as it is.
namespace trifinger {
namespace {

constexpr std::uint64_t kSensorMagic = 0x3153532d52474654;  // "TFGR-SS1"

// The beginning of a sensor's file. The text of its element and its ring follow.
struct SensorHeader {
  std::uint64_t magic;
  std::uint64_t text_size;
  ipc::RingShape ring;
  std::int64_t pid;
  std::atomic<std::int64_t> end;  // number of elements written
};
static_assert(sizeof(SensorHeader) % 8 == 0);

constexpr std::size_t ring_offset(std::size_t text_size) {
  return sizeof(SensorHeader) + (text_size + 7) / 8 * 8;
}

// The text in a sensor's file: the fields of its elements, and those of their payload if they have
// one.
std::string text_of_fields(const ElementDescription& element, const ElementDescription& payload) {
  return payload.size() == 0 ? element.text() : element.text() + "payload:\n" + payload.text();
}

void require_stamp(const ElementDescription& element, const std::string& sensor) {
  const FieldDescription* const first = element.find("stamp.arrival_index");
  detail::require(first != nullptr && first->offset == 0 && element.size() >= sizeof(Stamp),
                  "the elements of sensor '" + sensor + "' do not begin with a stamp");
}

}  // namespace

// ---- the sensor's process ----

struct UntypedSensorWriter::State {
  ipc::SharedMemory lock;
  ipc::SharedMemory memory;
  ipc::Ring ring;
  std::int64_t end{0};
  std::vector<std::byte> element;  // with its stamp
  ipc::ForkGuard fork;

  [[nodiscard]] SensorHeader& header() const noexcept {
    return *reinterpret_cast<SensorHeader*>(memory.data());
  }
};

UntypedSensorWriter::UntypedSensorWriter(const std::string& robot, const std::string& sensor,
                                         const ElementDescription& element, std::size_t history,
                                         const ElementDescription& payload) {
  require_stamp(element, sensor);
  if (payload.size() > 0) require_payload_reference(element);
  detail::require(
      history > 0 && history <= (std::size_t{1} << 20U),
      "the history of a sensor is " + std::to_string(history) + " elements, must be 1 to 1048576");
  const std::string file = detail::sensor_file(robot, sensor);
  const std::string text = text_of_fields(element, payload);
  const ipc::RingShape shape{.capacity = std::bit_ceil(history), .element_size = element.size()};
  ipc::SharedMemory lock =
      detail::own_sensor_file(file, "sensor '" + sensor + "' of robot '" + robot + "'");
  ipc::SharedMemory memory = ipc::SharedMemory::create_file(
      session_folder(), file, ring_offset(text.size()) + shape.size(), detail::kOwnerAlone);
  static_cast<void>(ipc::try_lock(memory.file()));
  new (memory.data()) SensorHeader{
      .magic = kSensorMagic, .text_size = text.size(), .ring = shape, .pid = ::getpid(), .end = 0};
  std::memcpy(memory.data() + sizeof(SensorHeader), text.data(), text.size());
  memory.publish();
  std::byte* const ring = memory.data() + ring_offset(text.size());
  state_ = std::make_unique<State>(State{.lock = std::move(lock),
                                         .memory = std::move(memory),
                                         .ring = ipc::Ring(ring, shape),
                                         .end = 0,
                                         .element = std::vector<std::byte>(element.size()),
                                         .fork = {}});
}

UntypedSensorWriter::~UntypedSensorWriter() {
  if (state_->fork.is_inherited()) return;
  // The lock is still ours, so the file is, too.
  ::unlink(state_->memory.path().c_str());
  detail::leave(state_->lock);
}

void UntypedSensorWriter::write(Instant captured, const void* element) noexcept {
  if (state_->fork.is_inherited()) return;
  const Stamp stamp{.arrival_index = -1,
                    .capture_index = Stamp::kFromTime,
                    .arrival_time = 0,
                    .capture_time = captured.time_since_epoch().count()};
  std::memcpy(state_->element.data(), element, state_->element.size());
  std::memcpy(state_->element.data(), &stamp, sizeof(stamp));
  state_->ring.write(state_->end, state_->element.data());
  // release: whoever sees the number also finds the element.
  state_->header().end.store(++state_->end, std::memory_order_release);
}

// ---- the robot's process ----

namespace {

// The memory of a sensor's process, as the robot sees it.
class Mapping {
 public:
  // `expected` is the text of the fields. Throws InvalidArgument for a file of another kind or with
  // other elements, SystemError.
  Mapping(const std::string& file, const std::string& expected, std::size_t element_size)
      : memory_(ipc::SharedMemory::open(session_folder() / file, ipc::Access::kReadOnly)) {
    detail::require_own_file(memory_.file(), file);
    detail::require(memory_.size() >= sizeof(SensorHeader) && header().magic == kSensorMagic,
                    "its file is none of a sensor of this version");
    // Copied, because the other process may change it.
    const std::uint64_t text_size = header().text_size;
    const ipc::RingShape shape = header().ring;
    detail::require(shape.is_valid() && text_size <= memory_.size() &&
                        memory_.size() == ring_offset(text_size) + shape.size(),
                    "its file has a wrong size");
    const std::string text(reinterpret_cast<const char*>(memory_.data()) + sizeof(SensorHeader),
                           text_size);
    detail::require(text == expected && shape.element_size == element_size,
                    "its elements have the fields\n" + text + "but the robot expects\n" + expected);
    ring_ = ipc::Ring(memory_.data() + ring_offset(text_size), shape);
  }

  [[nodiscard]] std::int64_t pid() const noexcept { return header().pid; }
  [[nodiscard]] const ipc::Ring& ring() const noexcept { return ring_; }
  // For a sensor that is a record: the loop is done with so many elements.
  void take(std::int64_t count) const noexcept {
    // relaxed: nothing is freed for that.
    taken_.store(count, std::memory_order_relaxed);
  }
  // Whether the loop must still take something.
  [[nodiscard]] bool has_more() const noexcept {
    return !memory_.is_damaged() && taken_.load(std::memory_order_relaxed) < end();
  }
  [[nodiscard]] std::int64_t end() const noexcept {
    // acquire: the elements before it have been written.
    return header().end.load(std::memory_order_acquire);
  }
  // True while its process lives, its file is whole, and no other one has taken its place.
  [[nodiscard]] bool is_in_use() const noexcept { return problem().empty(); }
  // Why it can be used no more.
  [[nodiscard]] std::string_view problem() const noexcept {
    if (!ipc::is_locked_by_other(memory_.file())) return "its process has ended";
    if (!memory_.has_name()) return "its file was removed";
    if (memory_.is_damaged()) return "its file was cut off";
    return "";
  }

 private:
  [[nodiscard]] const SensorHeader& header() const noexcept {
    return *reinterpret_cast<const SensorHeader*>(memory_.data());
  }

  ipc::SharedMemory memory_;
  ipc::Ring ring_;
  mutable std::atomic<std::int64_t> taken_{0};
};

}  // namespace

namespace {

// Looks at a sensor's file before anything of it is mapped: a file may be large. False if its
// process was killed. Throws InvalidArgument for a file of somebody else, SystemError.
bool is_worth_mapping(const std::filesystem::path& path) {
  const ipc::FileDescriptor file(
      [&path] { return open_regular_file(path, O_RDONLY, NamedBy::kProgram); });
  detail::require_own_file(file, path.string());
  return ipc::is_locked_by_other(file);
}

}  // namespace

// ---- a reader without a robot ----

struct UntypedSensorReader::State {
  std::string file;
  std::string fields;
  std::size_t element_size;
  std::unique_ptr<Mapping> mapping{};
  std::int64_t seen{0};  // elements of this process
  Instant looked{};

  // Looks for a process, at most a few times per second while there is none.
  void find_process() {
    constexpr auto kPeriod = std::chrono::milliseconds(50);
    const Instant now = std::chrono::steady_clock::now();
    if (now - looked < kPeriod) return;
    looked = now;
    if (mapping != nullptr && mapping->is_in_use()) return;
    mapping.reset();
    try {
      if (!is_worth_mapping(session_folder() / file)) return;
      auto found = std::make_unique<Mapping>(file, fields, element_size);
      if (!found->is_in_use()) return;
      mapping = std::move(found);
      seen = 0;
    } catch (const SystemError& error) {
      if (error.error_number() != ENOENT) throw;
    }
  }
  bool read(void* element) {
    if (mapping == nullptr) return false;
    const std::int64_t end = mapping->end();
    if (end <= 0 || end == seen) return false;
    if (mapping->ring().read(end - 1, element) != ipc::ReadResult::kDone) return false;
    seen = end;
    return true;
  }
};

UntypedSensorReader::UntypedSensorReader(const std::string& robot, const std::string& sensor,
                                         const ElementDescription& element,
                                         const ElementDescription& payload)
    : state_(new State{.file = detail::sensor_file(robot, sensor),
                       .fields = text_of_fields(element, payload),
                       .element_size = element.size()}) {
  require_stamp(element, sensor);
}

UntypedSensorReader::UntypedSensorReader(UntypedSensorReader&&) noexcept = default;
UntypedSensorReader& UntypedSensorReader::operator=(UntypedSensorReader&&) noexcept = default;
UntypedSensorReader::~UntypedSensorReader() = default;

bool UntypedSensorReader::next(void* element, Timeout timeout) {
  State& state = *checked(state_);
  const Deadline deadline(timeout);
  while (true) {
    state.find_process();
    if (state.read(element)) return true;
    if (deadline.passed() || timeout == Timeout::zero()) return false;
    // The writer wakes nobody: it must not know who reads.
    constexpr auto kPause = std::chrono::microseconds(500);
    std::this_thread::sleep_for(deadline.remaining(kPause));
  }
}

// ---- the sensors of a robot ----

// One sensor: the watcher finds its memory, the loop reads it.
class detail::SensorOfLoop {
 public:
  SensorOfLoop(const std::string& robot, const std::string& sensor,
               const ElementDescription& element, const ElementDescription& payload,
               Timeout timeout = kForever, bool is_record = false)
      : name_(sensor),
        file_(detail::sensor_file(robot, sensor)),
        fields_(text_of_fields(element, payload)),
        element_size_(element.size()),
        timeout_(timeout),
        is_record_(is_record) {}

  // ---- for the watcher ----

  // Looks whether a process has come or gone. Returns what has happened in a sentence, or nothing.
  std::string look() {
    release_unused();
    if (newest_ != nullptr && (newest_->is_in_use() || (is_record_ && newest_->has_more())))
      return look_for_progress();
    std::string message;
    if (newest_ != nullptr) {
      message =
          text_of("sensor '", name_, "': ", newest_->problem(), "; the robot goes on without it");
      show(nullptr);
    }
    try {
      if (!is_worth_mapping(session_folder() / file_)) return message;
      auto found = std::make_unique<Mapping>(file_, fields_, element_size_);
      // A process that was killed leaves its file.
      if (!found->is_in_use()) return message;
      message = text_of("sensor '", name_, "': process ", found->pid(), " delivers");
      show(std::move(found));
      refusal_.clear();
    } catch (const Error& error) {
      const auto* const system = dynamic_cast<const SystemError*>(&error);
      if (system != nullptr && system->error_number() == ENOENT) {
        refusal_.clear();
      } else if (refusal_ != error.what()) {
        refusal_ = error.what();
        message = "sensor '" + name_ + "' is refused: " + refusal_;
      }
    }
    return message;
  }

  // ---- for the loop ----

  // Copies the newest element, however old. False if no process writes.
  bool read_newest(void* element) noexcept {
    hold_newest();
    // relaxed: no other data depends on this flag.
    if (reading_ == nullptr || is_silent_.load(std::memory_order_relaxed)) return false;
    // A writer may overwrite what is being read, but not often in a row.
    for (int attempt = 0; attempt < 4; ++attempt) {
      const std::int64_t end = reading_->end();
      if (end <= 0) return false;
      if (reading_->ring().read(end - 1, element) == ipc::ReadResult::kDone) return true;
    }
    return false;
  }

  void begin_session() noexcept {
    polled_.reset();
    is_polling_ = false;
    polls_ = 0;
  }

  // Copies the next element that is there at this step. False if there is none.
  bool get(TimeIndex time_index, void* element) noexcept {
    if (!is_polling_) {
      // Each step is complete once it was polled.
      if (polled_ == time_index) return false;
      begin_poll(time_index);
    }
    while (next_ < end_) {
      if (reading_->ring().read(next_++, element) != ipc::ReadResult::kDone) continue;
      Stamp stamp;
      std::memcpy(&stamp, element, sizeof(stamp));
      stamp.arrival_index = time_index;
      stamp.capture_index = Stamp::kFromTime;
      std::memcpy(element, &stamp, sizeof(stamp));
      return true;
    }
    is_polling_ = false;
    if (is_record_ && reading_ != nullptr) reading_->take(next_);
    return false;
  }

 private:
  static constexpr std::int64_t kMaxPerStep = 16;

  // Notices that the process lives and writes nothing. Returns a sentence if that has changed.
  std::string look_for_progress() {
    if (timeout_ == kForever) return {};
    const Instant now = std::chrono::steady_clock::now();
    const std::int64_t end = newest_->end();
    const bool was_silent = is_silent_.load(std::memory_order_relaxed);
    if (end != seen_end_) {
      seen_end_ = end;
      last_progress_ = now;
      is_silent_.store(false, std::memory_order_relaxed);
      return was_silent
                 ? text_of("sensor '", name_, "': process ", newest_->pid(), " delivers again")
                 : std::string();
    }
    if (was_silent || now - last_progress_ < timeout_) return {};
    is_silent_.store(true, std::memory_order_relaxed);
    return text_of("sensor '", name_, "': process ", newest_->pid(),
                   " lives but writes nothing; the robot goes on without it");
  }

  void begin_poll(TimeIndex time_index) noexcept {
    is_polling_ = true;
    polled_ = time_index;
    const Mapping* const before = reading_;
    hold_newest();
    const std::int64_t end = reading_ != nullptr ? std::max<std::int64_t>(reading_->end(), 0) : 0;
    if (is_record_) {
      if (reading_ != before || end < next_) next_ = 0;
      const auto kept =
          static_cast<std::int64_t>(reading_ != nullptr ? reading_->ring().shape().capacity : 0);
      next_ = std::max(next_, end - kept);
      end_ = next_ + std::min(end - next_, kMaxPerStep);
      return;
    }
    // A number that went back is none of a sensor's.
    if (reading_ != before || end < end_) next_ = std::max<std::int64_t>(end - 1, 0);
    end_ = end;
    if (polls_ < 3) ++polls_;
    if (polls_ == 1) next_ = end_ - 1;  // also if an earlier session had it
    // Nobody polls while the robot holds its pose.
    const std::int64_t most = polls_ <= 2 ? 1 : kMaxPerStep;
    next_ = std::max({next_, end_ - most, std::int64_t{0}});
  }

  // Takes the memory that the watcher shows now. From here on the watcher keeps it.
  void hold_newest() noexcept {
    do {
      // The order of all four accesses to these two pointers matters, here and in `show` and
      // `release_unused`, so each is seq_cst: either the watcher sees what is read here, or this
      // loop sees that something else is shown.
      reading_ = shown_.load(std::memory_order_seq_cst);
      in_loop_.store(reading_, std::memory_order_seq_cst);
    } while (shown_.load(std::memory_order_seq_cst) != reading_);
  }

  void show(std::unique_ptr<Mapping> mapping) {
    if (newest_ != nullptr) old_.push_back(std::move(newest_));
    newest_ = std::move(mapping);
    seen_end_ = newest_ != nullptr ? newest_->end() : 0;
    last_progress_ = std::chrono::steady_clock::now();
    is_silent_.store(false, std::memory_order_relaxed);
    shown_.store(newest_.get(), std::memory_order_seq_cst);
  }
  void release_unused() {
    const Mapping* const used = in_loop_.load(std::memory_order_seq_cst);
    std::erase_if(old_, [used](const auto& mapping) { return mapping.get() != used; });
  }

  std::string name_;
  std::string file_;
  std::string fields_;
  std::size_t element_size_;
  Timeout timeout_;
  bool is_record_;

  // Of the watcher.
  std::int64_t seen_end_{0};
  Instant last_progress_{};
  std::unique_ptr<Mapping> newest_;
  std::vector<std::unique_ptr<Mapping>> old_;  // the loop may still use one of them
  std::string refusal_;

  std::atomic<const Mapping*> shown_{nullptr};
  std::atomic<const Mapping*> in_loop_{nullptr};
  std::atomic<bool> is_silent_{false};

  // Of the loop.
  const Mapping* reading_{nullptr};
  std::int64_t next_{0};
  std::int64_t end_{0};
  bool is_polling_{false};
  int polls_{0};                     // in this session, up to 3
  std::optional<TimeIndex> polled_;  // the newest step that was polled
};

// Looks for the processes of the sensors.
class detail::SensorWatcher {
 public:
  explicit SensorWatcher(const std::vector<std::unique_ptr<SensorOfLoop>>& sensors)
      : sensors_(sensors) {
    look();  // Sensors that run already are there from the first session on.
    thread_ = std::jthread([this](const std::stop_token& stop) {
      std::mutex mutex;
      std::unique_lock lock(mutex);
      std::condition_variable_any sleep;
      while (!sleep.wait_for(lock, stop, kPeriod, [] { return false; }) && !stop.stop_requested()) {
        look();
      }
    });
  }

  std::vector<std::string> take_messages() {
    const std::lock_guard lock(mutex_);
    return std::exchange(messages_, {});
  }

 private:
  static constexpr auto kPeriod = std::chrono::milliseconds(100);

  void look() {
    for (const auto& sensor : sensors_) {
      std::string message = sensor->look();
      if (message.empty()) continue;
      const std::lock_guard lock(mutex_);
      messages_.push_back(std::move(message));
    }
  }

  const std::vector<std::unique_ptr<SensorOfLoop>>& sensors_;
  std::mutex mutex_;
  std::vector<std::string> messages_;
  std::jthread thread_;  // last member, because the thread uses the others
};

// ---- a sensor that a driver reads ----

LoopSensorReader::LoopSensorReader(const std::string& robot, const std::string& sensor,
                                   const ElementDescription& element, Timeout timeout) {
  require_stamp(element, sensor);
  sensors_.push_back(std::make_unique<detail::SensorOfLoop>(robot, sensor, element,
                                                            ElementDescription(), timeout));
  watcher_ = std::make_unique<detail::SensorWatcher>(sensors_);
}

LoopSensorReader::~LoopSensorReader() = default;

bool LoopSensorReader::read_newest(void* element) noexcept {
  return sensors_.front()->read_newest(element);
}

std::vector<std::string> LoopSensorReader::take_messages() { return watcher_->take_messages(); }

// ---- a driver whose sensors are published ----

DriverWithSensors::DriverWithSensors(std::unique_ptr<UntypedDriver> driver,
                                     const std::string& robot,
                                     std::vector<CompanionDescription> sensors)
    : driver_(std::move(driver)),
      companions_(driver_->companions().begin(), driver_->companions().end()) {
  for (CompanionDescription& sensor : sensors) {
    require_stamp(sensor.element, sensor.name);
    detail::require(std::ranges::find(companions_, sensor.name, &CompanionDescription::name) ==
                        companions_.end(),
                    "the robot has two companions '" + sensor.name + "'");
    sensors_.push_back(std::make_unique<detail::SensorOfLoop>(
        robot, sensor.name, sensor.element, sensor.payload, kForever, sensor.is_record));
    companions_.push_back(std::move(sensor));
  }
  watcher_ = std::make_unique<detail::SensorWatcher>(sensors_);
}

DriverWithSensors::~DriverWithSensors() = default;

std::vector<std::string> DriverWithSensors::take_messages() { return watcher_->take_messages(); }

const RobotTypes& DriverWithSensors::description() const noexcept { return driver_->description(); }

std::span<const CompanionDescription> DriverWithSensors::companions() const noexcept {
  return companions_;
}

DriverReport DriverWithSensors::prepare(TimeIndex step) noexcept {
  if (step == 0) {
    for (const auto& sensor : sensors_) sensor->begin_session();
  }
  return driver_->prepare(step);
}

DriverReport DriverWithSensors::get_latest_observation(void* observation) noexcept {
  return driver_->get_latest_observation(observation);
}

DriverReport DriverWithSensors::apply_action(const void* desired, void* applied) noexcept {
  return driver_->apply_action(desired, applied);
}

DriverReport DriverWithSensors::hold(const void* observation, void* action) noexcept {
  return driver_->hold(observation, action);
}

DriverReport DriverWithSensors::stop(TimeIndex step) noexcept { return driver_->stop(step); }

void DriverWithSensors::cut() noexcept { driver_->cut(); }

bool DriverWithSensors::get_companion_element(std::size_t index, TimeIndex time_index,
                                              void* element) noexcept {
  const std::size_t own = companions_.size() - sensors_.size();
  return index < own ? driver_->get_companion_element(index, time_index, element)
                     : sensors_[index - own]->get(time_index, element);
}

std::string_view DriverWithSensors::fault_text(std::int32_t fault_code) const noexcept {
  return driver_->fault_text(fault_code);
}

std::string_view DriverWithSensors::rejection_text() const noexcept {
  return driver_->rejection_text();
}

}  // namespace trifinger
