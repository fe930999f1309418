// SPDX-License-Identifier: BSD-3-Clause
#include "session_mapping.hpp"

#include <algorithm>
#include <cerrno>
#include <cstddef>
#include <cstring>
#include <span>
#include <sstream>
#include <string_view>
#include <utility>

#include "ipc/file_lock.hpp"
#include "trifinger/core/driver.hpp"
#include "trifinger/core/errors.hpp"
#include "trifinger/core/payload.hpp"

namespace trifinger::detail {
namespace {

std::vector<std::string> lines_of(const std::string& text) {
  std::vector<std::string> lines;
  std::istringstream stream(text);
  for (std::string line; std::getline(stream, line);) lines.push_back(line);
  return lines;
}

}  // namespace

SessionMapping::SessionMapping(std::shared_ptr<Directory> directory, const std::string& name)
    : directory_(std::move(directory)),
      memory_(directory_->open(state_file(name), ipc::Access::kReadOnly)),
      header_(reinterpret_cast<const StateHeader*>(memory_.data())),
      name_(name) {
  try {
    check_header();
    check_counters();
    map_rings();
    read_texts();
    read_elements();
    if (is_companion()) {
      check_companion();
    } else {
      check_robot();
    }
  } catch (const InvalidArgument& error) {
    throw_unreadable(error);
  }
  try {
    lock_.emplace(directory_->open(lock_file(name), ipc::Access::kReadOnly));
  } catch (const SystemError& error) {
    // Somebody has removed the lock file. The lock of the session itself must suffice.
    if (error.error_number() != ENOENT) throw;
  }
}

void SessionMapping::check_header() const {
  require(memory_.size() >= sizeof(StateHeader) && header_->magic == kStateMagic,
          "its file is not a session file");
  require(header_->layout_version == kLayoutVersion,
          "its layout is version " + std::to_string(header_->layout_version) +
              ", this program reads version " + std::to_string(kLayoutVersion) +
              "; install the same version on both sides and start the back-end again");
  require(header_->file_size == memory_.size(), "its file has " + std::to_string(memory_.size()) +
                                                    " bytes instead of " +
                                                    std::to_string(header_->file_size));
}

void SessionMapping::check_counters() const {
  constexpr std::int64_t kEndless = std::int64_t{1} << 62U;
  const auto is_sound = [](const std::atomic<std::int64_t>& value, std::int64_t smallest = 0) {
    // relaxed: these values are valid at any time unless the file is damaged.
    const std::int64_t found = value.load(std::memory_order_relaxed);
    return found >= smallest && found < kEndless;
  };
  require(std::ranges::all_of(header_->ends, [&](const auto& end) { return is_sound(end); }) &&
              header_->first_index >= 0 && header_->first_index < kEndless &&
              is_sound(header_->next_action) && is_sound(header_->complete_through, -2) &&
              is_sound(header_->heartbeat) && is_sound(header_->timing_end),
          "a counter in its header is out of range");
}

void SessionMapping::map_rings() {
  for (std::size_t i = 0; i < kNumSeries; ++i) {
    rings_[i] = ring_at(header_->rings[i],
                        "the series '" + std::string(name_of(static_cast<Series>(i))) + "'");
  }
  timing_ = ring_at(header_->timing, "the record of its timing");
  const ipc::RingShape& timing = timing_.shape();
  require(timing.capacity == 0 || timing.element_size == sizeof(TimingRecord),
          "the record of its timing has a wrong size");
}

void SessionMapping::read_texts() {
  host_ = text(header_->host);
  description_.type = text(header_->type);
  companion_names_ = lines_of(text(header_->companions));
  for (const std::string& companion : companion_names_) require_valid_name(companion);
  realtime_warnings_ = lines_of(text(header_->realtime_warnings));
  const std::string action = text(header_->default_action);
  const auto bytes = std::as_bytes(std::span(action));
  description_.default_action.assign(bytes.begin(), bytes.end());
}

void SessionMapping::read_elements() {
  std::array<std::string, kNumSeries> fields;
  for (std::size_t i = 0; i < kNumSeries; ++i) {
    if (has(static_cast<Series>(i))) fields[i] = text(header_->descriptions[i]);
  }
  const std::string payload = text(header_->payload);
  require(description_hash(description_.type, fields, payload) == header_->description_hash,
          "its type and fields do not have the hash that its header gives");
  const auto parse = [&](Series series) {
    ElementDescription element = ElementDescription::parse(fields[index_of(series)]);
    require(element.size() > 0 && element.size() == ring(series).shape().element_size,
            "the fields of '" + std::string(name_of(series)) + "' do not fill its elements");
    return element;
  };
  description_.observation = parse(Series::kObservation);
  payload_ = ElementDescription::parse(payload);
  if (is_companion()) return;
  description_.action = parse(Series::kDesiredAction);
  description_.applied_action = parse(Series::kAppliedAction);
  status_ = parse(Series::kStatus);
  for (const Series series : {Series::kHolding, Series::kStopping}) {
    require(
        parse(series) == description_.observation,
        "its series '" + std::string(name_of(series)) + "' has other fields than its observations");
  }
}

void SessionMapping::check_companion() const {
  const ElementDescription& element = description_.observation;
  const FieldDescription* const first = element.find("stamp.arrival_index");
  require(first != nullptr && first->offset == 0 && element.size() >= sizeof(Stamp),
          "its elements do not begin with a stamp");
  require(companion_names_.empty() && description_.default_action.empty(),
          "it is a companion and has companions or a default action");
  if (payload_.size() > 0) require_payload_reference(element);
}

void SessionMapping::check_robot() const {
  require(payload_.size() == 0, "it is a robot and has payloads");
  const std::size_t action_size = description_.action.size();
  require(description_.default_action.size() == action_size, "its default action has a wrong size");
  // Larger than any header, and far from overflow.
  constexpr std::uint64_t kMaxQueueOffset = 1U << 20U;
  const RingPlace& queue = header_->queue;
  require(queue.shape.is_valid() && queue.offset % 8 == 0 && queue.offset <= kMaxQueueOffset &&
              queue.shape.element_size == sizeof(std::uint64_t) + action_size,
          "its queue has a wrong size");
}

bool SessionMapping::is_inside(std::uint64_t offset, std::uint64_t size) const noexcept {
  return offset <= memory_.size() && size <= memory_.size() - offset;
}

ipc::Ring SessionMapping::ring_at(const RingPlace& place, const std::string& what) const {
  if (place.shape.capacity == 0) return {};
  require(place.shape.is_valid() && place.offset % 8 == 0 &&
              is_inside(place.offset, place.shape.size()),
          what + " lies outside of its file");
  return {memory_.data() + place.offset, place.shape};
}

std::string SessionMapping::text(const TextPlace& place) const {
  require(is_inside(place.offset, place.size), "a text lies outside of its file");
  return {reinterpret_cast<const char*>(memory_.data() + place.offset), place.size};
}

void SessionMapping::throw_unreadable(const InvalidArgument& error) const {
  throw IncompatibleSession("session '" + name_ + "' cannot be read: " + error.what());
}

std::vector<Document> SessionMapping::documents() const {
  try {
    const std::string places = text(header_->documents);
    require(places.size() % sizeof(DocumentPlace) == 0,
            "the list of its documents has a wrong size");
    std::vector<Document> documents(places.size() / sizeof(DocumentPlace));
    // The limit for all documents together. It also holds for places that overlap.
    std::uint64_t room = memory_.size();
    for (std::size_t i = 0; i < documents.size(); ++i) {
      DocumentPlace place{};
      std::memcpy(&place, places.data() + i * sizeof(place), sizeof(place));
      for (const auto& [part, target] : {std::pair(place.name, &documents[i].name),
                                         std::pair(place.media_type, &documents[i].media_type),
                                         std::pair(place.text, &documents[i].text)}) {
        require(part.size <= room, "its documents are larger than the file");
        room -= part.size;
        *target = text(part);
      }
    }
    return documents;
  } catch (const InvalidArgument& error) {
    throw_unreadable(error);
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
  require(has(series),
          "session '" + name_ + "' has no series '" + std::string(name_of(series)) + "'");
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
  return is_held && !header_->backend().is_known_dead();
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

}  // namespace trifinger::detail
