// SPDX-License-Identifier: BSD-3-Clause
#include "session_memory.hpp"

#include <grp.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cerrno>
#include <cstdio>
#include <cstring>
#include <random>
#include <sstream>
#include <thread>
#include <utility>

#include "trifinger/base/regular_file.hpp"
#include "trifinger/core/errors.hpp"
#include "trifinger/core/status.hpp"
#include "trifinger/ipc/file_lock.hpp"
#include "trifinger/ipc/futex.hpp"

namespace trifinger::detail {
namespace {

constexpr std::string_view kPrefix = "trifinger.";

std::size_t index_of(Series series) noexcept { return static_cast<std::size_t>(series); }

std::vector<std::string> lines_of(const std::string& text) {
  std::vector<std::string> lines;
  std::istringstream stream(text);
  for (std::string line; std::getline(stream, line);) lines.push_back(line);
  return lines;
}

constexpr std::uint64_t round_up(std::uint64_t size, std::uint64_t step) noexcept {
  return (size + step - 1) / step * step;
}

std::uint64_t random_id() {
  std::random_device device;
  const std::uint64_t id = (std::uint64_t{device()} << 32U) | device();
  return id == 0 ? 1 : id;
}

// FNV-1a, 64 bits. The hash of a session's type and fields shows a mismatch in one comparison.
std::uint64_t hash_of(std::string_view text, std::uint64_t hash = 0xcbf29ce484222325) noexcept {
  for (const char character : text) {
    hash = (hash ^ static_cast<unsigned char>(character)) * 0x100000001b3;
  }
  return hash;
}

std::string host_name() {
  std::array<char, 256> name{};
  ::gethostname(name.data(), name.size() - 1);
  return name.data();
}

std::string group_name(gid_t group) {
  struct group entry{};
  struct group* found = nullptr;
  std::array<char, 4096> text{};
  ::getgrgid_r(group, &entry, text.data(), text.size(), &found);
  return found != nullptr ? found->gr_name : std::to_string(group);
}

// Owner and mode of the file, as the rest of a sentence. Empty if its folder cannot be searched.
std::string owner_text(const std::filesystem::path& path) {
  struct stat status{};
  if (::stat(path.c_str(), &status) != 0) return "";
  std::array<char, 8> mode{};
  std::snprintf(mode.data(), mode.size(), "%04o", status.st_mode & 07777U);
  return ", which belongs to user " + user_name(status.st_uid) + " and group " +
         group_name(status.st_gid) + " with mode " + mode.data();
}

// Larger than any header, and far from overflow.
constexpr std::uint64_t kMaxQueueOffset = 1U << 20U;

// Assigns places in a file, one after the other.
class FilePlan {
 public:
  explicit FilePlan(std::uint64_t header_size) : size_(round_up(header_size, 64)) {}

  std::uint64_t add(std::uint64_t size) {
    const std::uint64_t offset = size_;
    size_ = round_up(size_ + size, 64);
    return offset;
  }
  [[nodiscard]] std::uint64_t size() const noexcept { return size_; }

 private:
  std::uint64_t size_;
};

}  // namespace

ipc::SharedMemory FolderDirectory::create(const std::string& file, std::size_t size,
                                          unsigned mode) {
  for (ipc::SharedMemory& spare : spares_) {
    if (spare.size() != size || !spare.make_anew(file, mode)) continue;
    ipc::SharedMemory memory = std::move(spare);
    std::erase_if(spares_, [](const ipc::SharedMemory& one) { return !one.file(); });
    return memory;
  }
  ipc::SharedMemory memory = ipc::SharedMemory::create_file(folder_, file, size, mode);
  // The other spare files of this size are still in use elsewhere. Their last user releases them.
  std::erase_if(spares_, [size](const ipc::SharedMemory& one) { return one.size() == size; });
  return memory;
}

void FolderDirectory::give_back(ipc::SharedMemory memory) noexcept {
  memory.retire();
  spares_.push_back(std::move(memory));
}

void FolderDirectory::reserve(const std::string& file, std::size_t size) {
  constexpr unsigned kOwnerAlone = 0600;
  give_back(ipc::SharedMemory::create_file(folder_, file, size, kOwnerAlone));
}

std::vector<ipc::ProcessIdentity> FolderDirectory::other_owners(const std::string& file) const {
  std::vector<ipc::ProcessIdentity> owners = ipc::owners_of(folder_ / file);
  std::erase(owners, ipc::ProcessIdentity::of_this_process());
  return owners;
}

ipc::SharedMemory FolderDirectory::publish(const std::string&, ipc::SharedMemory memory) {
  memory.publish();
  return memory;
}

ipc::SharedMemory FolderDirectory::open_or_create(const std::string& file, unsigned mode) {
  while (true) {
    try {
      return ipc::SharedMemory::open(folder_ / file, ipc::Access::kReadWrite);
    } catch (const SystemError& error) {
      if (error.error_number() != ENOENT) throw;
    }
    ipc::SharedMemory memory = create(file, 1, mode);
    if (memory.publish_if_absent()) return memory;
  }
}

ipc::SharedMemory FolderDirectory::open(const std::string& file, ipc::Access access) {
  const std::filesystem::path path = folder_ / file;
  try {
    return ipc::SharedMemory::open(path, access);
  } catch (const SystemError& error) {
    if (error.error_number() != EACCES) throw;
    throw SystemError("open " + path.string() + owner_text(path) +
                          "; a back-end shares its sessions with its group if its configuration "
                          "says 'backend.access: group'",
                      EACCES);
  }
}

void FolderDirectory::remove(const std::string& file) noexcept {
  ::unlink((folder_ / file).c_str());
}

void FolderDirectory::remove_all(const std::string& prefix, const std::string& kept) noexcept {
  std::error_code ignored;
  for (const auto& entry : std::filesystem::directory_iterator(folder_, ignored)) {
    const std::string file = entry.path().filename().string();
    // Unpublished files of killed processes begin with a dot.
    const bool is_ours = file.starts_with(prefix) || file.starts_with("." + prefix);
    if (is_ours && file != kept) remove(file);
  }
}

ipc::SharedMemory ProcessDirectory::create(const std::string&, std::size_t size, unsigned) {
  return ipc::SharedMemory::create_anonymous(size);
}

ipc::SharedMemory ProcessDirectory::publish(const std::string& file, ipc::SharedMemory memory) {
  const std::lock_guard lock(mutex_);
  files_.insert_or_assign(file, memory.reopen(ipc::Access::kReadOnly));
  return memory;
}

ipc::SharedMemory ProcessDirectory::open_or_create(const std::string& file, unsigned mode) {
  return publish(file, create(file, 1, mode));
}

ipc::SharedMemory ProcessDirectory::open(const std::string& file, ipc::Access access) {
  const std::lock_guard lock(mutex_);
  const auto found = files_.find(file);
  if (found == files_.end()) throw SystemError("open " + file + " of this process", ENOENT);
  return found->second.reopen(access);
}

void ProcessDirectory::remove(const std::string& file) noexcept {
  const std::lock_guard lock(mutex_);
  files_.erase(file);
}

void ProcessDirectory::remove_all(const std::string& prefix, const std::string& kept) noexcept {
  const std::lock_guard lock(mutex_);
  std::erase_if(files_, [&](const auto& entry) {
    return entry.first.starts_with(prefix) && entry.first != kept;
  });
}

void ProcessDirectory::give_back(ipc::SharedMemory) noexcept {}

void ProcessDirectory::reserve(const std::string&, std::size_t) {}

std::vector<ipc::ProcessIdentity> ProcessDirectory::other_owners(const std::string&) const {
  return {};
}

std::string state_file(const std::string& name) { return std::string(kPrefix) + name + ".state"; }

std::string action_file(const std::string& name, std::uint64_t session_id) {
  return std::string(kPrefix) + name + "." + std::to_string(session_id) + ".action";
}

std::string robot_of(const std::string& name) { return name.substr(0, name.find('.')); }

std::string lock_file(const std::string& name) {
  return std::string(kPrefix) + robot_of(name) + ".lock";
}

ipc::ProcessIdentity backend_of(const layout::StateHeader& header) noexcept {
  return {.pid = header.backend_pid,
          .start_time = header.backend_start_time,
          .number_space = header.backend_number_space};
}

ipc::ProcessIdentity controller_of(const layout::ActionHeader& header) noexcept {
  // acquire: what was stored before the number belongs to it.
  const std::int64_t pid = header.controller_pid.load(std::memory_order_acquire);
  return {.pid = pid,
          .start_time = header.controller_start_time.load(std::memory_order_relaxed),
          .number_space = header.controller_number_space.load(std::memory_order_relaxed)};
}

void require_valid_name(const std::string& name) {
  const auto is_allowed = [](char c) {
    return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '_' ||
           c == '-';
  };
  // A name that begins with '-' would be an option to every command.
  if (name.empty() || name.size() > 64 || name.front() == '-' ||
      !std::ranges::all_of(name, is_allowed)) {
    throw InvalidArgument("'" + name +
                          "' cannot name a robot: use 1 to 64 letters, digits, '_' and '-', and "
                          "begin with one of the first three");
  }
}

// --- SessionMapping ---

SessionMapping::SessionMapping(std::shared_ptr<Directory> directory, const std::string& name)
    : directory_(std::move(directory)),
      memory_(directory_->open(state_file(name), ipc::Access::kReadOnly)),
      header_(reinterpret_cast<const layout::StateHeader*>(memory_.data())),
      name_(name) {
  check();
  try {
    lock_.emplace(directory_->open(lock_file(name), ipc::Access::kReadOnly));
  } catch (const SystemError& error) {
    // Somebody has removed the lock file. The lock of the session itself must suffice.
    if (error.error_number() != ENOENT) throw;
  }
}

void SessionMapping::check() {
  const auto incompatible = [this](const std::string& why) {
    return IncompatibleSession("session '" + name_ + "' cannot be read: " + why);
  };
  if (memory_.size() < sizeof(layout::StateHeader) || header_->magic != layout::kStateMagic) {
    throw incompatible("its file is not a session file");
  }
  if (header_->layout_version != layout::kLayoutVersion) {
    throw incompatible("its layout is version " + std::to_string(header_->layout_version) +
                       ", this program reads version " + std::to_string(layout::kLayoutVersion) +
                       "; install the same version on both sides and start the back-end again");
  }
  if (header_->file_size != memory_.size()) {
    throw incompatible("its file has " + std::to_string(memory_.size()) + " bytes instead of " +
                       std::to_string(header_->file_size));
  }
  const auto is_inside = [this](std::uint64_t offset, std::uint64_t size) {
    return offset <= memory_.size() && size <= memory_.size() - offset;
  };
  for (std::size_t i = 0; i < layout::kNumSeries; ++i) {
    const layout::RingPlace& place = header_->rings[i];
    if (place.shape.capacity == 0) continue;
    if (!place.shape.is_valid() || place.offset % 8 != 0 ||
        !is_inside(place.offset, place.shape.size())) {
      throw incompatible("the series '" + std::string(trifinger::name_of(static_cast<Series>(i))) +
                         "' lies outside of its file");
    }
    rings_[i] = ipc::Ring(memory_.data() + place.offset, place.shape);
  }
  // relaxed: these values are valid at any time unless the file is damaged.
  constexpr std::int64_t kEndless = std::int64_t{1} << 62U;
  const auto is_sound = [](const std::atomic<std::int64_t>& value, std::int64_t smallest) {
    const std::int64_t found = value.load(std::memory_order_relaxed);
    return found >= smallest && found < kEndless;
  };
  const auto& ends = header_->ends;
  if (!std::ranges::all_of(ends, [&](const auto& end) { return is_sound(end, 0); }) ||
      header_->first_index < 0 || header_->first_index >= kEndless ||
      !is_sound(header_->next_action, 0) || !is_sound(header_->complete_through, -2) ||
      !is_sound(header_->heartbeat, 0) || !is_sound(header_->timing_end, 0)) {
    throw incompatible("a counter in its header is out of range");
  }

  try {
    host_ = text(header_->host);
    description_.type = text(header_->type);
    std::uint64_t hash = hash_of(description_.type);
    for (std::size_t i = 0; i < layout::kNumSeries; ++i) {
      if (rings_[i].shape().capacity > 0) hash = hash_of(text(header_->descriptions[i]), hash);
    }
    if (hash != header_->description_hash) {
      throw InvalidArgument("its type and fields do not have the hash that its header gives");
    }
    const auto parse = [this](Series series) {
      const std::size_t i = index_of(series);
      ElementDescription element = ElementDescription::parse(text(header_->descriptions[i]));
      if (element.size() == 0 || element.size() != rings_[i].shape().element_size) {
        throw InvalidArgument("the fields of '" + std::string(trifinger::name_of(series)) +
                              "' do not fill its elements");
      }
      return element;
    };
    description_.observation = parse(Series::kObservation);
    if (is_companion()) {
      const FieldDescription* const first = description_.observation.find("stamp.arrival_index");
      if (first == nullptr || first->offset != 0 ||
          description_.observation.size() < sizeof(Stamp)) {
        throw InvalidArgument("its elements do not begin with a stamp");
      }
    } else {
      description_.action = parse(Series::kDesiredAction);
      description_.applied_action = parse(Series::kAppliedAction);
      status_ = parse(Series::kStatus);
      for (const Series series : {Series::kHolding, Series::kStopping}) {
        if (parse(series) != description_.observation) {
          throw InvalidArgument("its series '" + std::string(trifinger::name_of(series)) +
                                "' has other fields than its observations");
        }
      }
      if (const layout::RingPlace& timing = header_->timing; timing.shape.capacity > 0) {
        if (!timing.shape.is_valid() || timing.offset % 8 != 0 ||
            timing.shape.element_size != sizeof(TimingRecord) ||
            !is_inside(timing.offset, timing.shape.size())) {
          throw InvalidArgument("its record of the timing has a wrong size");
        }
        timing_ = ipc::Ring(memory_.data() + timing.offset, timing.shape);
      }
      const layout::RingPlace& queue = header_->queue;
      if (!queue.shape.is_valid() || queue.offset % 8 != 0 || queue.offset > kMaxQueueOffset ||
          queue.shape.element_size != sizeof(std::uint64_t) + description_.action.size()) {
        throw InvalidArgument("its queue has a wrong size");
      }
    }
    companion_names_ = lines_of(text(header_->companions));
    for (const std::string& companion : companion_names_) require_valid_name(companion);
    realtime_lacks_ = lines_of(text(header_->realtime_lacks));
    if (is_companion() && !companion_names_.empty()) {
      throw InvalidArgument("it is a companion and has companions");
    }
    const std::string action = text(header_->default_action);
    const auto* bytes = reinterpret_cast<const std::byte*>(action.data());
    description_.default_action.assign(bytes, bytes + action.size());
    if (action.size() != description_.action.size()) {
      throw InvalidArgument("its default action has a wrong size");
    }
  } catch (const InvalidArgument& error) {
    throw incompatible(error.what());
  }
}

std::string SessionMapping::text(const layout::TextPlace& place) const {
  if (place.offset > memory_.size() || place.size > memory_.size() - place.offset) {
    throw InvalidArgument("a text lies outside of its file");
  }
  return {reinterpret_cast<const char*>(memory_.data() + place.offset), place.size};
}

std::vector<Document> SessionMapping::documents() const {
  try {
    const std::string places = text(header_->documents);
    if (places.size() % sizeof(layout::DocumentPlace) != 0) {
      throw InvalidArgument("the list of its documents has a wrong size");
    }
    std::vector<Document> documents(places.size() / sizeof(layout::DocumentPlace));
    // The limit for all documents together. It also holds for places that overlap.
    std::uint64_t room = memory_.size();
    for (std::size_t i = 0; i < documents.size(); ++i) {
      layout::DocumentPlace place{};
      std::memcpy(&place, places.data() + i * sizeof(place), sizeof(place));
      for (const auto& [part, target] : {std::pair(place.name, &documents[i].name),
                                         std::pair(place.media_type, &documents[i].media_type),
                                         std::pair(place.text, &documents[i].text)}) {
        if (part.size > room) throw InvalidArgument("its documents are larger than the file");
        room -= part.size;
        *target = text(part);
      }
    }
    return documents;
  } catch (const InvalidArgument& error) {
    throw IncompatibleSession("session '" + name_ + "' cannot be read: " + error.what());
  }
}

std::shared_ptr<const SessionMapping> SessionMapping::companion(const std::string& name) const {
  if (std::ranges::find(companion_names_, name) == companion_names_.end()) {
    std::string known;
    for (const std::string& other : companion_names_) known += (known.empty() ? "" : ", ") + other;
    throw SessionNotFound("robot '" + name_ + "' has no companion '" + name + "'; it has " +
                          (known.empty() ? "none" : known));
  }
  std::shared_ptr<const SessionMapping> companion;
  try {
    companion = std::make_shared<SessionMapping>(directory_, name_ + "." + name);
  } catch (const SystemError& error) {
    // The companion was removed with its session.
    if (error.error_number() == ENOENT) throw_stopped();
    throw;
  }
  if (companion->header().robot_session_id != header_->session_id) throw_stopped();
  return companion;
}

const ElementDescription& SessionMapping::element(Series series) const {
  if (!has(series)) {
    throw InvalidArgument("session '" + name_ + "' has no series '" +
                          std::string(trifinger::name_of(series)) + "'");
  }
  switch (series) {
    case Series::kDesiredAction:
      return description_.action;
    case Series::kAppliedAction:
      return description_.applied_action;
    case Series::kStatus:
      return status_;
    case Series::kObservation:
    case Series::kHolding:
    case Series::kStopping:
      break;
  }
  return description_.observation;
}

void SessionMapping::require_own() const {
  if (!fork_.is_inherited()) return;
  throw InheritedHandle("session '" + name_ +
                        "' was opened before fork(); open it again in the child process");
}

bool SessionMapping::backend_is_alive() const noexcept {
  // A truncated file says nothing any more: for us the back-end is gone.
  if (memory_.is_damaged()) return false;
  // A back-end holds the lock of its session until the next one begins, and the lock of its name
  // always.
  const bool is_held = ipc::is_locked_by_other(memory_.file()) ||
                       (has_ended() && lock_ && ipc::is_locked_by_other(lock_->file()));
  // A child that a bare fork(2) made keeps the locks of its dead parent.
  return is_held && !backend_of(*header_).is_known_dead();
}

Fault SessionMapping::fault() const noexcept {
  if (!has_ended()) {
    const TimeIndex end = end_of(Series::kStatus);
    return {.code = Fault::Code::kBackendDied,
            .detail = 0,
            .time_index = end > begin_of(Series::kStatus) ? end - 1 : -1};
  }
  // relaxed: these were written before the phase, which has_ended() acquired.
  return {
      .code = static_cast<Fault::Code>(header_->fault_code.load(std::memory_order_relaxed)),
      .detail = header_->fault_detail.load(std::memory_order_relaxed),
      .time_index = header_->fault_time_index.load(std::memory_order_relaxed),
  };
}

std::optional<TimingRecord> SessionMapping::timing() const noexcept {
  if (timing_.shape().capacity == 0) return std::nullopt;
  TimingRecord record;
  while (true) {
    // acquire: the record was written before its count.
    const std::int64_t newest = header_->timing_end.load(std::memory_order_acquire) - 1;
    if (newest < 0) return std::nullopt;
    if (timing_.read(newest, &record) == ipc::ReadResult::kDone) return record;
    // The writer has overtaken us, so there is a newer record, unless the file is damaged.
    if (header_->timing_end.load(std::memory_order_acquire) - 1 == newest) return std::nullopt;
  }
}

std::string SessionMapping::fault_text() const {
  const auto& text = header_->fault_text;
  const auto* end = static_cast<const char*>(std::memchr(text.data(), 0, text.size()));
  const auto size = end == nullptr ? text.size() : static_cast<std::size_t>(end - text.data());
  const Fault fault = this->fault();
  std::string sentence =
      describe(fault, has_ended() ? std::string_view(text.data(), size) : std::string_view());
  if (fault.code == Fault::Code::kActionLate || fault.code == Fault::Code::kBackendLate) {
    if (const auto record = timing()) sentence += "; " + describe(*record);
  }
  return sentence;
}

void SessionMapping::throw_stopped() const {
  throw RobotStopped(fault(), "robot '" + robot_of(name_) + "' has stopped: " + fault_text());
}

// --- SessionWriter ---

SessionWriter::SessionWriter(std::shared_ptr<Directory> directory, std::string state_file,
                             TimeIndex first_index)
    : directory_(std::move(directory)),
      state_file_(std::move(state_file)),
      first_index_(first_index) {}

SessionWriter::SessionWriter(std::shared_ptr<Directory> directory, const SessionPlan& plan)
    : SessionWriter(std::move(directory), state_file(plan.name), plan.first_index) {
  std::uint64_t hash = hash_of(plan.type);
  std::array<std::string, layout::kNumSeries> descriptions;
  std::array<layout::RingPlace, layout::kNumSeries> rings{};
  std::array<layout::TextPlace, layout::kNumSeries> texts{};
  FilePlan file(sizeof(layout::StateHeader));
  for (std::size_t i = 0; i < layout::kNumSeries; ++i) {
    if (plan.elements[i] == nullptr) continue;
    descriptions[i] = plan.elements[i]->text();
    hash = hash_of(descriptions[i], hash);
    const ipc::RingShape shape{.capacity = std::bit_ceil(plan.capacities[i]),
                               .element_size = plan.elements[i]->size()};
    if (!shape.is_valid()) {
      throw InvalidArgument("a history of " + std::to_string(plan.capacities[i]) +
                            " elements is not possible; allowed are 1 to " +
                            std::to_string(1U << 30U));
    }
    rings[i] = {.offset = file.add(shape.size()), .shape = shape};
    texts[i] = {.offset = file.add(descriptions[i].size()), .size = descriptions[i].size()};
  }
  layout::RingPlace timing{};
  if (plan.is_real_time && plan.queue > 0) {
    // A reader that the back-end overtakes finds the next record.
    constexpr std::uint64_t kTimingHistory = 4;
    timing.shape = {.capacity = kTimingHistory, .element_size = sizeof(TimingRecord)};
    timing.offset = file.add(timing.shape.size());
  }
  const std::string host = host_name();
  const layout::TextPlace name_place{file.add(plan.name.size()), plan.name.size()};
  const layout::TextPlace type_place{file.add(plan.type.size()), plan.type.size()};
  const layout::TextPlace host_place{file.add(host.size()), host.size()};
  const layout::TextPlace default_place{file.add(plan.default_action.size()),
                                        plan.default_action.size()};
  const layout::TextPlace companions_place{file.add(plan.companions.size()),
                                           plan.companions.size()};
  // All sessions of a back-end have the same size, so that one can reuse the memory of another.
  const std::size_t lacks_room = std::max(plan.realtime_lacks.size(), std::size_t{4096});
  const layout::TextPlace lacks_place{file.add(lacks_room), plan.realtime_lacks.size()};
  const auto add_text = [&file](const std::string& text) {
    return layout::TextPlace{file.add(text.size()), text.size()};
  };
  std::vector<layout::DocumentPlace> documents;
  for (const Document& document : plan.documents) {
    documents.push_back(
        {add_text(document.name), add_text(document.media_type), add_text(document.text)});
  }
  const std::uint64_t documents_size = documents.size() * sizeof(layout::DocumentPlace);
  const layout::TextPlace documents_place{file.add(documents_size), documents_size};

  // Only the back-end ever writes to the state file.
  const unsigned state_mode = plan.mode & ~static_cast<unsigned>(S_IWGRP | S_IWOTH);
  state_.emplace(directory_->create(state_file_, file.size(), state_mode));
  std::byte* const data = state_->data();
  const auto write_text = [data](const layout::TextPlace& place, const void* text) {
    // A companion has no default action: no bytes, and no address.
    if (place.size > 0) std::memcpy(data + place.offset, text, place.size);
  };
  header_ = new (data) layout::StateHeader{};
  header_->magic = layout::kStateMagic;
  header_->layout_version = layout::kLayoutVersion;
  header_->is_real_time = plan.is_real_time ? 1 : 0;
  header_->file_size = file.size();
  header_->session_id = plan.session_id;
  header_->robot_session_id = plan.robot_session_id;
  header_->description_hash = hash;
  header_->period = plan.period.count();
  header_->created_time =
      std::chrono::duration_cast<Nanoseconds>(std::chrono::system_clock::now().time_since_epoch())
          .count();
  const auto backend = ipc::ProcessIdentity::of_this_process();
  header_->backend_pid = backend.pid;
  header_->backend_start_time = backend.start_time;
  header_->backend_number_space = backend.number_space;
  header_->first_index = plan.first_index;
  header_->rings = rings;
  header_->timing = timing;
  timing_ = ipc::Ring(data + timing.offset, timing.shape);
  header_->name = name_place;
  header_->type = type_place;
  header_->host = host_place;
  header_->descriptions = texts;
  header_->default_action = default_place;
  header_->companions = companions_place;
  header_->documents = documents_place;
  header_->realtime_lacks = lacks_place;
  write_text(name_place, plan.name.data());
  write_text(type_place, plan.type.data());
  write_text(host_place, host.data());
  write_text(default_place, plan.default_action.data());
  write_text(companions_place, plan.companions.data());
  write_text(documents_place, documents.data());
  write_text(lacks_place, plan.realtime_lacks.data());
  for (std::size_t i = 0; i < documents.size(); ++i) {
    write_text(documents[i].name, plan.documents[i].name.data());
    write_text(documents[i].media_type, plan.documents[i].media_type.data());
    write_text(documents[i].text, plan.documents[i].text.data());
  }
  for (std::size_t i = 0; i < layout::kNumSeries; ++i) {
    write_text(texts[i], descriptions[i].data());
    rings_[i] = ipc::Ring(data + rings[i].offset, rings[i].shape);
    ends_[i] = is_indexed_by_step(static_cast<Series>(i)) ? plan.first_index : 0;
    // relaxed, here and below: nobody sees the file before it is published.
    header_->ends[i].store(ends_[i], std::memory_order_relaxed);
  }
  header_->next_action.store(plan.first_index, std::memory_order_relaxed);
  header_->complete_through.store(-2, std::memory_order_relaxed);

  if (plan.queue > 0) {
    const ipc::RingShape shape{.capacity = std::bit_ceil(plan.queue),
                               .element_size = 8 + plan.elements[0]->size()};
    if (!shape.is_valid()) throw InvalidArgument("a queue of this length is not possible");
    FilePlan action_plan(sizeof(layout::ActionHeader));
    header_->queue = {.offset = action_plan.add(shape.size()), .shape = shape};
    action_file_ = action_file(plan.name, plan.session_id);
    // The queue is published first: whoever finds the state file also finds the queue.
    make_queue(plan.mode);
  }
  if (!ipc::try_lock(state_->file())) throw Error("a new session is locked by somebody else");
  state_ = directory_->publish(state_file_, std::move(*state_));
}

void SessionWriter::reserve_another() const {
  directory_->reserve(state_file_, state_->size());
  if (action_) directory_->reserve(action_file_, action_->size());
}

void SessionWriter::make_queue(unsigned mode) {
  const layout::RingPlace& place = header_->queue;
  action_.emplace(directory_->create(action_file_, place.offset + place.shape.size(), mode));
  auto* const header = new (action_->data()) layout::ActionHeader{};
  header->magic = layout::kActionMagic;
  header->session_id = header_->session_id;
  action_ = directory_->publish(action_file_, std::move(*action_));
  action_header_ = header;
  queue_ = ipc::Ring(action_->data() + place.offset, place.shape);
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
      static_cast<std::uint32_t>(layout::Phase::kRunning)) {
    return false;
  }
  const std::uint32_t requests = action_header_->requests.load(std::memory_order_acquire);
  if ((requests & layout::kDetach) != 0) return false;
  // A child that a bare fork(2) made keeps the lock of its dead parent.
  return !ipc::is_locked_by_other(action_->file()) ||
         controller_of(*action_header_).is_known_dead();
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

void SessionWriter::set_phase(layout::Phase phase) noexcept {
  // A session that has ended stays ended, whoever ended it.
  std::uint32_t found = header_->phase.load(std::memory_order_relaxed);
  while (found != static_cast<std::uint32_t>(layout::Phase::kEnded) &&
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
  set_phase(layout::Phase::kEnded);
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

// --- SessionPlace ---

SessionPlace::SessionPlace(std::shared_ptr<Directory> directory, std::string name,
                           SessionOptions options)
    : directory_(std::move(directory)),
      name_((require_valid_name(name), std::move(name))),
      options_(std::move(options)) {
  if (options_.history == 0 || options_.queue == 0) {
    throw InvalidArgument("history and queue need room for at least one element each");
  }
  take_name(false);
}

void SessionPlace::take_name(bool is_ours) {
  // One process at a time may do this, so that nobody looks at files that are about to be removed.
  std::optional<ipc::SharedMemory> lock;
  const Deadline deadline(std::chrono::seconds(2));
  while (true) {
    lock.emplace(directory_->open_or_create(lock_file(name_), options_.mode));
    if (ipc::try_lock(lock->file(), ipc::Lock::kClaim) && lock->has_name()) break;
    if (deadline.passed()) throw_owned("another process that is just starting");
    std::this_thread::sleep_for(std::chrono::milliseconds(1));
  }
  // A back-end that was just killed releases its locks a little later.
  const ipc::LockPatience patience;
  bool is_taken = ipc::try_lock(lock->file());
  while (!is_taken && !is_left_by_the_dead() && patience.wait(is_left_by_the_dying())) {
    is_taken = ipc::try_lock(lock->file());
  }
  if (!is_taken) {
    if (!is_left_by_the_dead()) throw_owned(find_owner().value_or("another process"));
    // That lock cannot be taken, so a new file replaces it. Others who arrive wait for our claim.
    ipc::SharedMemory fresh = directory_->create(lock_file(name_), 1, options_.mode);
    if (!ipc::try_lock(fresh.file(), ipc::Lock::kClaim) || !ipc::try_lock(fresh.file())) {
      throw_owned("another process");
    }
    lock = directory_->publish(lock_file(name_), std::move(fresh));
  }
  // The lock file may be new because somebody has removed the file of a living back-end.
  if (!is_ours) {
    std::optional<std::string> owner = find_owner();
    while (owner && patience.wait(is_left_by_the_dying())) owner = find_owner();
    if (owner) throw_owned(*owner);
  }
  // The existing file may be older than the permission for the group.
  if (!lock->path().empty()) ::fchmod(lock->file().get(), options_.mode);
  if (!is_ours) directory_->remove_all(std::string(kPrefix) + name_ + ".", lock_file(name_));
  // Our old lock, if any, is released last: it shows others at any time that we live.
  lock_ = std::move(lock);
  ipc::unlock(lock_->file(), ipc::Lock::kClaim);
}

std::optional<std::string> SessionPlace::find_owner() const {
  std::optional<std::string> owner;
  try {
    const ipc::SharedMemory state = directory_->open(state_file(name_), ipc::Access::kReadOnly);
    if (ipc::is_locked_by_other(state.file())) owner = "another process";
    const SessionMapping session(directory_, name_);
    const ipc::ProcessIdentity backend = backend_of(session.header());
    if (owner && backend.is_known_dead()) owner.reset();
    if (owner) owner = ipc::describe(backend) + " on " + session.host();
  } catch (const Error&) {
    // The session has just begun, or its file is gone or damaged. Only its lock counts, if there is
    // one.
  }
  if (const auto owners = directory_->other_owners(lock_file(name_)); !owners.empty()) {
    // A child that a bare fork(2) made keeps what its dead parent owned.
    if (owner || !is_left_by_the_dead()) owner = ipc::describe(owners.front());
  }
  return owner;
}

bool SessionPlace::is_left_by_the_dead() const {
  try {
    return backend_of(SessionMapping(directory_, name_).header()).is_known_dead();
  } catch (const Error&) {
    return false;
  }
}

bool SessionPlace::is_left_by_the_dying() const {
  try {
    return backend_of(SessionMapping(directory_, name_).header()).is_ending();
  } catch (const Error&) {
    return false;
  }
}

void SessionPlace::throw_owned(const std::string& owner) const {
  throw RobotOwned("robot '" + name_ + "' is run by " + owner + "; stop it with 'trifinger stop " +
                   name_ + "', or choose another name");
}

SessionPlace::~SessionPlace() {
  if (fork_.is_inherited()) return;
  directory_->remove_all(std::string(kPrefix) + name_ + ".", lock_file(name_));
}

SessionPlace::Writers SessionPlace::begin(const UntypedDriver& driver, bool is_real_time,
                                          Nanoseconds period,
                                          const std::vector<std::string>& realtime_lacks) {
  if (fork_.is_inherited()) {
    throw InheritedHandle("the host of '" + name_ +
                          "' was made before fork(), and the name belongs to the parent process");
  }
  // Somebody has removed the lock file: processes that arrive from now on look at another file.
  if (!lock_->has_name()) take_name(true);
  const RobotTypes& robot = driver.description();
  SessionPlan plan{
      .name = name_,
      .type = robot.type,
      .session_id = random_id(),
      .is_real_time = is_real_time,
      .period = period,
      .first_index = first_index_,
      .elements = {&robot.action, &robot.applied_action, &robot.observation, &describe<Status>(),
                   &robot.observation, &robot.observation},
      .default_action = robot.default_action,
      .documents = options_.documents,
      .queue = options_.queue,
      .mode = options_.mode,
  };
  plan.robot_session_id = plan.session_id;
  plan.capacities.fill(options_.history);
  if (is_real_time) {
    for (const std::string& sentence : realtime_lacks) plan.realtime_lacks += sentence + "\n";
  }
  constexpr std::size_t kHoldingHistory = 16;
  plan.capacities[index_of(Series::kHolding)] = kHoldingHistory;
  // One second at 1 kHz, which is longer than a damped stop takes.
  constexpr std::size_t kStoppingHistory = 1024;
  plan.capacities[index_of(Series::kStopping)] = std::min(options_.history, kStoppingHistory);

  Writers writers;
  // Companions come first: whoever finds the robot's session also finds its companions.
  for (const CompanionDescription& companion : driver.companions()) {
    SessionPlan companion_plan{
        .name = name_ + "." + companion.name,
        .type = companion.type,
        .session_id = random_id(),
        .robot_session_id = plan.session_id,
        .is_real_time = is_real_time,
        .period = period,
        .mode = options_.mode,
    };
    companion_plan.elements[index_of(Series::kObservation)] = &companion.element;
    companion_plan.capacities[index_of(Series::kObservation)] = companion.history;
    plan.companions += companion.name + "\n";
    writers.companions.push_back(std::make_unique<SessionWriter>(directory_, companion_plan));
  }
  writers.robot = std::make_unique<SessionWriter>(directory_, plan);
  if (!has_reserve_) {
    writers.robot->reserve_another();
    for (const auto& companion : writers.companions) companion->reserve_another();
    has_reserve_ = true;
  }
  return writers;
}

}  // namespace trifinger::detail
