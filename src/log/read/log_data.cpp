// SPDX-License-Identifier: BSD-3-Clause
#include "read/log_data.hpp"

#include <algorithm>
#include <charconv>
#include <cstring>
#include <iterator>
#include <sstream>
#include <string_view>
#include <utility>

#include "format/cdr_reader.hpp"
#include "format/format.hpp"
#include "trifinger/base/error.hpp"
#include "trifinger/base/regular_file.hpp"

namespace trifinger::log::detail {
namespace {

// Other programs may write levels that we do not have.
Level level_of(std::uint8_t number) {
  if (number >= static_cast<std::uint8_t>(Level::kError)) return Level::kError;
  return number >= static_cast<std::uint8_t>(Level::kWarning) ? Level::kWarning : Level::kInfo;
}

std::optional<std::int64_t> to_integer(std::string_view text) {
  std::int64_t number = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), number);
  if (error != std::errc{} || end != text.data() + text.size()) return std::nullopt;
  return number;
}

std::optional<std::uint64_t> to_id(std::string_view text) {
  std::uint64_t number = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), number);
  if (error != std::errc{} || end != text.data() + text.size()) return std::nullopt;
  return number;
}

std::string entry_of(const std::map<std::string, std::string>& entries, const std::string& key) {
  const auto entry = entries.find(key);
  return entry == entries.end() ? std::string() : entry->second;
}

// Inverse of the writer's hexadecimal digits. Other characters read as 0.
std::vector<std::byte> bytes_of(std::string_view digits) {
  std::vector<std::byte> bytes(digits.size() / 2);
  for (std::size_t i = 0; i < bytes.size(); ++i) {
    unsigned value = 0;
    std::from_chars(digits.data() + 2 * i, digits.data() + 2 * i + 2, value, 16);
    bytes[i] = static_cast<std::byte>(value);
  }
  return bytes;
}

// Returns how to read the messages of `channel`. If the channel is not one of ours, the result says
// that they cannot be read. Throws InvalidArgument if the channel contradicts itself.
ChannelReader reader_of(const mcap::Channel& channel) {
  using Role = ChannelReader::Role;
  ChannelReader reader;
  reader.topic = channel.topic;
  reader.session = entry_of(channel.metadata, "session");
  if (channel.message_encoding != "cdr") return reader;
  if (channel.topic == "/events" && reader.session.empty()) reader.role = Role::kEvent;
  const std::string role = entry_of(channel.metadata, "role");
  if (reader.session.empty() || (role != "step" && role != "end" && role != "companion")) {
    return reader;
  }

  const Precision precision =
      entry_of(channel.metadata, "precision") == "single" ? Precision::kSingle : Precision::kDouble;
  const auto element = [&channel](const std::string& key) {
    return ElementDescription::parse(entry_of(channel.metadata, key));
  };
  reader.types.type = entry_of(channel.metadata, "type");
  reader.types.observation = element("observation");
  if (role == "companion") {
    reader.role = Role::kCompanion;
    const FieldDescription* const arrival = reader.types.observation.find("stamp.arrival_index");
    if (arrival == nullptr || arrival->offset != 0 || arrival->type != ScalarType::kInt64 ||
        !arrival->shape.empty()) {
      throw InvalidArgument("its elements do not begin with a stamp");
    }
    reader.layout = companion_layout(reader.types.type, reader.types.observation, precision);
    return reader;
  }
  reader.status = element("status");
  if (role == "end") {
    reader.role = Role::kEnd;
    reader.layout = end_layout(reader.types, reader.status, precision);
    return reader;
  }
  reader.role = Role::kStep;
  reader.types.action = element("action");
  reader.types.applied_action = element("applied_action");
  reader.types.default_action = bytes_of(entry_of(channel.metadata, "default_action"));
  // Another writer may have given another size.
  reader.types.default_action.resize(reader.types.action.size());
  reader.layout = step_layout(reader.types, reader.status, precision);
  return reader;
}

// True if the parts that both channels have consist of the same fields.
bool is_compatible(const ChannelReader& one, const ChannelReader& other) {
  using Role = ChannelReader::Role;
  const bool has_end = one.role == Role::kEnd || other.role == Role::kEnd;
  return one.types.type == other.types.type && one.types.observation == other.types.observation &&
         one.status == other.status &&
         (has_end || (one.types.action == other.types.action &&
                      one.types.applied_action == other.types.applied_action));
}

}  // namespace

// The entries of a metadata record, converted to their types. Throws InvalidArgument if an entry
// cannot be converted.
class LogData::Entries {
 public:
  explicit Entries(const mcap::Metadata& record) : record_(record) {}

  [[nodiscard]] bool has(const std::string& key) const { return record_.entries.contains(key); }
  [[nodiscard]] std::string text(const std::string& key) const {
    return entry_of(record_.entries, key);
  }
  [[nodiscard]] std::int64_t integer(const std::string& key) const {
    if (const auto number = to_integer(text(key))) return *number;
    throw InvalidArgument(wrong(key));
  }
  [[nodiscard]] std::uint64_t session_id() const {
    if (const auto number = to_id(text("session_id"))) return *number;
    throw InvalidArgument(wrong("session_id"));
  }
  [[nodiscard]] std::string name() const {
    std::string name = text("name");
    if (name.empty()) throw InvalidArgument(wrong("name"));
    return name;
  }

 private:
  [[nodiscard]] std::string wrong(const std::string& key) const {
    return "The record '" + record_.name + "' says '" + text(key) + "' for '" + key + "'";
  }

  const mcap::Metadata& record_;
};

TimeIndex arrival_of(const mcap::Message& message) noexcept {
  // The arrival comes after CDR's header and our own.
  constexpr std::size_t kOffset = 4 + sizeof(MessageHead);
  TimeIndex arrival = 0;
  std::memcpy(&arrival, message.data.data() + kOffset, sizeof(arrival));
  return arrival;
}

LogData::LogData(const std::vector<std::filesystem::path>& parts, Several several) {
  open(parts, several);
  bool is_certain = true;
  for (File& file : files_) {
    for (const auto& [id, channel] : file.reader.contents().channels) {
      is_certain = add_channel(file, channel) && is_certain;
    }
    for (const mcap::Metadata& record : file.reader.contents().metadata) read_record(file, record);
    is_certain = is_certain && file.reader.contents().damage.empty();
  }
  for (File& file : files_) find_documents(file);
  is_certain = guess_channels() && is_ordered_ && is_certain;
  // The records about the sessions may be incomplete, so the messages are read as well.
  if (!is_certain) read_all();
}

std::vector<Damage> damage_of(const std::filesystem::path& file, std::uint64_t size,
                              const mcap::Contents& contents) {
  std::vector<Damage> all;
  std::uint64_t behind = contents.complete_size;
  for (const mcap::Damage& damage : contents.damage) {
    all.push_back({file, damage.offset, damage.size, damage.reason});
    behind = std::max(behind, damage.offset + damage.size);
  }
  if (behind < size) all.push_back({file, behind, size - behind, "The file ends inside a record"});
  return all;
}

std::uint64_t lost_bytes_of(const std::vector<Damage>& damage, std::uint64_t size) {
  std::vector<std::pair<std::uint64_t, std::uint64_t>> intervals;
  for (const Damage& one : damage) {
    const std::uint64_t first = std::min(one.offset, size);
    intervals.emplace_back(first, first + std::min(one.size, size - first));
  }
  std::ranges::sort(intervals);
  std::uint64_t sum = 0;
  std::uint64_t behind = 0;
  for (const auto& [first, last] : intervals) {
    if (last <= behind) continue;
    sum += last - std::max(first, behind);
    behind = last;
  }
  return sum;
}

// ---- opening ----

void LogData::open(const std::vector<std::filesystem::path>& parts, Several several) {
  for (const std::filesystem::path& path : parts) {
    try {
      files_.emplace_back(path);
    } catch (const mcap::FormatError& error) {
      if (parts.size() == 1) throw;
      // A recorder that was killed while it began a part leaves such a file.
      damage_.push_back({path, 0, FileReader(path).size(), error.what()});
    }
  }
  if (files_.empty()) {
    throw mcap::FormatError("none of the files is a log: " + parts.front().string() +
                            " and others");
  }
  if (several == Several::kTakeNewest) leave_newest_recording();

  std::ranges::stable_sort(files_, {}, &File::part);
  const File* before = nullptr;
  for (const File& file : files_) {
    if (before != nullptr && file.recording() != before->recording()) {
      throw InvalidArgument(before->path.string() + " and " + file.path.string() +
                            " are of two recordings; name the files of one");
    }
    if (before != nullptr && file.part() == before->part()) {
      throw InvalidArgument(before->path.string() + " and " + file.path.string() +
                            " are the same part of a recording");
    }
    if (before != nullptr && file.part() != before->part() + 1) {
      damage_.push_back({file.path, 0, 0,
                         "Part " + std::to_string(before->part() + 1) +
                             " of the recording and what follows it is missing"});
    }
    before = &file;
  }
  for (std::size_t i = 0; i < files_.size(); ++i) {
    paths_.push_back(files_[i].path);
    size_ += files_[i].size;
    if (origin_.empty()) origin_ = files_[i].origin;
    const std::size_t count = files_[i].reader.contents().chunks.size();
    for (std::size_t index = 0; index < count; ++index) chunks_.push_back({i, index, false, {}});
  }
}

void LogData::leave_newest_recording() {
  // If two recordings began in the same second, their names decide: the recorder's names have a
  // date.
  const auto age = [](const File& file) { return std::pair(file.created(), file.path); };
  const std::string newest = std::ranges::max_element(files_, {}, age)->recording();
  std::erase_if(files_, [&](const File& file) { return file.recording() != newest; });
  // A file that is not a log counts as a part of this recording if its name fits.
  const auto stem = [](const std::filesystem::path& path) {
    const std::string name = path.filename().string();
    return name.substr(0, name.rfind('_'));
  };
  std::erase_if(damage_, [&](const Damage& damage) {
    return std::ranges::none_of(
        files_, [&](const File& file) { return stem(file.path) == stem(damage.file); });
  });
}

LogData::File::File(const std::filesystem::path& its_path)
    : path(its_path), size(FileReader(its_path).size()), reader(its_path) {
  const mcap::Contents& contents = reader.contents();
  for (const mcap::Metadata& record : contents.metadata) {
    if (record.name == "trifinger.log") origin = record.entries;
  }
  const bool is_ours = !origin.empty() || contents.library.starts_with("trifinger") ||
                       std::ranges::any_of(contents.channels, [](const auto& channel) {
                         return channel.second.metadata.contains("role") &&
                                channel.second.metadata.contains("session");
                       });
  if (!is_ours) {
    throw mcap::FormatError(path.string() +
                            " is an MCAP file but no log of robots: it has no record " +
                            "'trifinger.log'");
  }
  const std::int64_t version = to_integer(entry_of(origin, "format_version")).value_or(1);
  if (version > kFormatVersion) {
    throw mcap::FormatError(
        path.string() + " has log format " + std::to_string(version) +
        ", known are formats up to " + std::to_string(kFormatVersion) +
        ": reading it needs trifinger >= " + entry_of(origin, "trifinger_version"));
  }
}

std::int64_t LogData::File::part() const {
  return to_integer(entry_of(origin, "part")).value_or(0);
}

std::string LogData::File::recording() const { return entry_of(origin, "recording"); }

std::string LogData::File::created() const { return entry_of(origin, "created"); }

bool LogData::add_channel(File& file, const mcap::Channel& channel) {
  ChannelReader& reader = file.channels[channel.id];
  if (file.channels_by_id.size() <= channel.id) file.channels_by_id.resize(channel.id + 1U);
  file.channels_by_id[channel.id] = &reader;
  try {
    reader = reader_of(channel);
    return true;
  } catch (const InvalidArgument& error) {
    reader.topic = channel.topic;
    ignore(file, "The messages of " + channel.topic + " cannot be read: " + error.what());
    return false;
  }
}

void LogData::read_record(const File& file, const mcap::Metadata& record) {
  try {
    if (record.name == "trifinger.session") read_session(Entries(record));
    if (record.name == "trifinger.end") read_end(Entries(record));
    if (record.name == "trifinger.gap") read_gap(Entries(record));
  } catch (const InvalidArgument& error) {
    ignore(file, error.what());
  }
}

void LogData::read_session(const Entries& entries) {
  const std::string name = entries.name();
  const TimeIndex first_index = entries.integer("first_index");
  if (SessionRecord* const known = find_session(name, entries.session_id())) {
    // The session is announced again at the beginning of each further part.
    known->header.first_index = std::min(known->header.first_index, first_index);
    return;
  }
  SessionHeader header;
  header.name = name;
  header.session_id = entries.session_id();
  header.is_real_time = entries.integer("is_real_time") != 0;
  if (entries.has("realtime_lacks")) {
    std::istringstream lacks(entries.text("realtime_lacks"));
    header.realtime_lacks.emplace();
    for (std::string sentence; std::getline(lacks, sentence);) {
      header.realtime_lacks->push_back(sentence);
    }
  }
  header.period = Nanoseconds(entries.integer("period"));
  header.created = entries.integer("created");
  header.time_offset = entries.integer("time_offset");
  header.host = entries.text("host");
  header.backend_pid = entries.integer("backend_pid");
  header.first_index = first_index;
  header.types.type = entries.text("type");

  SessionRecord& session = add_session(std::move(header));
  std::istringstream companions(entries.text("companions"));
  for (std::string companion; companions >> companion;) add_companion(session, companion);
}

void LogData::read_end(const Entries& entries) {
  SessionRecord& session = session_of(entries.name(), entries.session_id());
  session.fault = {.code = static_cast<Fault::Code>(entries.integer("fault_code")),
                   .detail = static_cast<std::int32_t>(entries.integer("fault_detail")),
                   .time_index = entries.integer("fault_time_index")};
  session.fault_text = entries.text("fault_text");
  session.observations = entries.integer("observations");
  session.steps = entries.integer("steps");
}

void LogData::read_gap(const Entries& entries) {
  const std::string name = entries.name();
  const Gap gap{entries.integer("first"), entries.integer("last"), entries.text("reason")};
  if (gap.last < gap.first) return;
  // The name is that of a robot or of a companion.
  for (SessionRecord& session : sessions_) {
    if (session.header.session_id != entries.session_id()) continue;
    if (session.robot.name == name) session.robot.gaps.push_back(gap);
    for (Stream& companion : session.companions) {
      if (companion.name == name) companion.gaps.push_back(gap);
    }
  }
}

void LogData::find_documents(const File& file) {
  const mcap::Contents& contents = file.reader.contents();
  // The documents of a session stand before its record; only changed ones are written again.
  std::map<std::string, std::size_t> newest;
  std::size_t next = 0;
  for (std::size_t i = 0; i < contents.metadata.size(); ++i) {
    const mcap::Metadata& record = contents.metadata[i];
    if (record.name != "trifinger.session") continue;
    while (next < contents.attachments.size() &&
           contents.attachment_places[next].offset < contents.metadata_places[i].offset) {
      newest[contents.attachments[next].name] = next;
      ++next;
    }
    const auto id = to_id(entry_of(record.entries, "session_id"));
    SessionRecord* const session =
        id ? find_session(entry_of(record.entries, "name"), *id) : nullptr;
    if (session == nullptr || !session->header.documents.empty()) continue;
    const std::string prefix = session->header.name + ".";
    for (const auto& [name, index] : newest) {
      const mcap::Attachment& attachment = contents.attachments[index];
      if (!name.starts_with(prefix)) continue;
      session->header.documents.push_back(
          {name.substr(prefix.size()), attachment.media_type, attachment.data});
    }
  }
}

bool LogData::guess_channels() {
  bool is_certain = true;
  for (const File& file : files_) {
    for (const auto& [id, channel] : file.channels) {
      if (!channel.is_of_stream()) continue;
      bool is_known = false;
      for (SessionRecord& session : sessions_) {
        Stream* const stream = find_stream(session, channel.session);
        if (stream == nullptr) continue;
        is_known = true;
        if (!accepts(*stream, channel)) {
          is_certain = false;
        } else {
          bind(*stream, channel);
        }
      }
      is_certain = is_certain && is_known;
    }
  }
  return is_certain;
}

void LogData::ignore(const File& file, const std::string& reason) {
  damage_.push_back({file.path, 0, 0, reason});
}

// ---- sessions ----

SessionRecord* LogData::find_session(const std::string& name, std::uint64_t session_id) {
  for (SessionRecord& session : sessions_) {
    if (session.header.session_id == session_id && session.header.name == name) return &session;
  }
  return nullptr;
}

SessionRecord& LogData::add_session(SessionHeader header) {
  SessionRecord& session = sessions_.emplace_back();
  session.header = std::move(header);
  session.robot.name = session.header.name;
  session.robot.session = &session;
  session.order = sessions_.size();
  return session;
}

SessionRecord& LogData::session_of(const std::string& name, std::uint64_t session_id) {
  if (SessionRecord* const session = find_session(name, session_id)) return *session;
  // The session's own record is lost.
  is_ordered_ = false;
  SessionHeader header;
  header.name = name;
  header.session_id = session_id;
  return add_session(std::move(header));
}

Stream& LogData::add_companion(SessionRecord& session, const std::string& name) {
  Stream& stream = session.companions.emplace_back();
  stream.name = name;
  stream.is_companion = true;
  stream.session = &session;
  return stream;
}

Stream* LogData::find_stream(SessionRecord& session, const std::string& name) {
  if (session.robot.name == name) return &session.robot;
  for (Stream& companion : session.companions) {
    if (companion.name == name) return &companion;
  }
  return nullptr;
}

Stream& LogData::stream_of(const ChannelReader& channel, std::uint64_t session_id) {
  const bool is_companion = channel.role == ChannelReader::Role::kCompanion;
  const std::string robot =
      is_companion ? channel.session.substr(0, channel.session.find('.')) : channel.session;
  SessionRecord& session = session_of(robot, session_id);
  if (Stream* const stream = find_stream(session, channel.session)) return *stream;
  return add_companion(session, channel.session);
}

bool LogData::accepts(const Stream& stream, const ChannelReader& channel) {
  return stream.channel == nullptr || is_compatible(*stream.channel, channel);
}

void LogData::bind(Stream& stream, const ChannelReader& channel) {
  // The channel of the steps knows more than the channel of the end.
  if (stream.channel != nullptr && stream.channel->role != ChannelReader::Role::kEnd) return;
  stream.channel = &channel;
  SessionHeader& header = stream.session->header;
  if (!stream.is_companion) {
    header.types = channel.types;
    return;
  }
  const bool is_listed = std::ranges::any_of(
      header.companions, [&](const auto& companion) { return companion.name == stream.name; });
  if (is_listed) return;
  header.companions.push_back({stream.name, channel.types.type, channel.types.observation});
}

// ---- chunks ----

std::span<const mcap::Message> LogData::load(std::size_t n) {
  Chunk& chunk = chunks_[n];
  File& file = files_[chunk.file];
  if (file.loaded != chunk.index) {
    file.loaded.reset();
    file.messages = file.reader.read_chunk(chunk.index).value_or(std::span<const mcap::Message>());
    file.loaded = chunk.index;
  }
  if (!chunk.is_known) {
    chunk.is_known = true;
    ++num_known_;
    look_into(n, file.messages);
  }
  return file.messages;
}

std::span<const Run> LogData::runs(std::size_t n) {
  if (!chunks_[n].is_known) (void)load(n);
  return chunks_[n].runs;
}

void LogData::read_all() {
  for (std::size_t n = 0; num_known_ < chunks_.size() && n < chunks_.size(); ++n) (void)runs(n);
}

void LogData::look_into(std::size_t n, std::span<const mcap::Message> messages) {
  std::vector<Run>& runs = chunks_[n].runs;
  File& file = files_[chunks_[n].file];
  for (const mcap::Message& message : messages) {
    ChannelReader* const channel = channel_of(file, message.channel_id);
    if (channel == nullptr) continue;
    if (channel->role == ChannelReader::Role::kEvent) add_event(n, message);
    const std::optional<StreamMessage> found = identify(file, *channel, message);
    if (!found) continue;

    // Messages of several streams may alternate in a chunk.
    const auto newest = std::ranges::find_if(runs.rbegin(), runs.rend(), [&found](const Run& run) {
      return run.stream == &found->stream && run.is_end == found->is_end();
    });
    Run* run = newest == runs.rend() ? nullptr : &*newest;
    if (run != nullptr && found->index <= run->last) continue;  // this index was already there
    if (run == nullptr || found->index != run->last + 1) {
      run = &runs.emplace_back();
      run->stream = &found->stream;
      run->is_end = found->is_end();
      run->first = found->index;
    }
    run->last = found->index;
    run->last_time = found->time();
    if (found->stream.is_companion) run->last_arrival = arrival_of(message);
  }
}

void LogData::add_event(std::size_t n, const mcap::Message& message) {
  CdrReader reader(message.data);
  Event event;
  event.time = std::int64_t{reader.number<std::int32_t>()} * 1'000'000'000;
  event.time += reader.number<std::uint32_t>();
  event.level = level_of(reader.number<std::uint8_t>());
  event.source = reader.text();
  event.text = reader.text();
  if (reader.is_whole()) events_by_chunk_[n].push_back(std::move(event));
}

ChannelReader* LogData::channel_of(File& file, std::uint16_t id) {
  if (id < file.channels_by_id.size() && file.channels_by_id[id] != nullptr) {
    return file.channels_by_id[id];
  }
  // The channel's description was damaged in the chunk where it first stood.
  const auto channel = file.reader.contents().channels.find(id);
  if (channel == file.reader.contents().channels.end()) return nullptr;
  add_channel(file, channel->second);
  return file.channels_by_id[id];
}

std::optional<StreamMessage> LogData::identify(File& file, ChannelReader& channel,
                                               const mcap::Message& message) {
  if (!channel.is_of_stream()) return std::nullopt;
  if (message.data.size() != channel.layout->size()) {
    if (!channel.has_wrong_message) {
      ignore(file, "Messages of " + channel.topic + " have " + std::to_string(message.data.size()) +
                       " bytes, expected were " + std::to_string(channel.layout->size()));
    }
    channel.has_wrong_message = true;
    return std::nullopt;
  }
  MessageHead head;
  channel.layout->decode(message.data, StepPart::kHead, &head);
  if (head.index < 0) return std::nullopt;
  if (channel.stream == nullptr || channel.session_id != head.session_id) {
    Stream& stream = stream_of(channel, head.session_id);
    if (!accepts(stream, channel)) {
      ignore(file, "Messages of " + channel.topic + " have other fields than those before");
      return std::nullopt;
    }
    bind(stream, channel);
    channel.session_id = head.session_id;
    channel.stream = &stream;
  }
  return StreamMessage{*channel.stream, channel, head.index, message};
}

const Run* LogData::last_run(const Stream& stream) {
  for (std::size_t n = find_chunk(stream, [](const Run&) { return false; }); n-- > 0;) {
    const std::span<const Run> found = runs(n);
    for (std::size_t i = found.size(); i-- > 0;) {
      if (found[i].stream == &stream && !found[i].is_end) return &found[i];
    }
    if (is_ordered_ && std::ranges::any_of(found, [&](const Run& run) {
          return run.stream->session->header.name == stream.session->header.name &&
                 run.stream->session->order < stream.session->order;
        })) {
      break;
    }
  }
  return nullptr;
}

bool LogData::is_behind(const Stream& stream, std::size_t n) {
  return is_ordered_ && std::ranges::any_of(runs(n), [&](const Run& run) {
           return run.stream->session->header.name == stream.session->header.name &&
                  run.stream->session->order > stream.session->order;
         });
}

// ---- what is to be said about it ----

bool LogData::is_finished() const noexcept {
  return std::ranges::all_of(files_,
                             [](const File& file) { return file.reader.contents().is_finished; });
}

std::vector<Event> LogData::events() {
  read_all();
  std::vector<Event> all;
  for (const auto& [n, events] : events_by_chunk_) {
    all.insert(all.end(), events.begin(), events.end());
  }
  return all;
}

std::vector<Damage> LogData::damage() {
  read_all();
  std::vector<Damage> all = damage_;
  for (const File& file : files_) {
    std::ranges::move(damage_of(file.path, file.size, file.reader.contents()),
                      std::back_inserter(all));
  }
  return all;
}

std::uint64_t LogData::lost_bytes() {
  read_all();
  std::uint64_t sum = 0;
  for (const File& file : files_) {
    sum += lost_bytes_of(damage_of(file.path, file.size, file.reader.contents()), file.size);
  }
  for (const Damage& damage : damage_) sum += damage.size;
  return sum;
}

std::pair<TimeIndex, TimeIndex> LogData::range(const Stream& stream) {
  const SessionRecord& session = *stream.session;
  if (!stream.is_companion && session.steps) {
    return {session.header.first_index, std::max(*session.steps, session.header.first_index)};
  }
  const Run* const last = last_run(stream);
  TimeIndex first = session.header.first_index;
  if (stream.is_companion) first = last == nullptr ? 0 : first_index(stream);
  return {first, last == nullptr ? first : std::max(last->last + 1, first)};
}

TimeIndex LogData::first_index(const Stream& stream) {
  for (std::size_t n = find_chunk(stream, [](const Run&) { return true; }); n < chunks_.size();
       ++n) {
    for (const Run& run : runs(n)) {
      if (run.stream == &stream && !run.is_end) return run.first;
    }
  }
  return 0;
}

std::vector<Gap> LogData::gaps(const Stream& stream) {
  read_all();
  const auto [first, end] = range(stream);
  std::vector<Gap> missing;
  TimeIndex next = first;
  const auto add = [&](TimeIndex behind) {
    if (next < behind) explain(stream, next, behind - 1, missing);
  };
  for (const Chunk& chunk : chunks_) {
    for (const Run& run : chunk.runs) {
      if (run.stream != &stream || run.is_end || run.last < next) continue;
      add(std::min(run.first, end));
      next = run.last + 1;
    }
  }
  add(end);
  return missing;
}

void LogData::explain(const Stream& stream, TimeIndex first, TimeIndex last,
                      std::vector<Gap>& gaps) {
  std::vector<Gap> written = stream.gaps;
  std::ranges::sort(written, {}, &Gap::first);
  const auto add = [&gaps](TimeIndex from, TimeIndex to, const std::string& reason) {
    if (from <= to) gaps.push_back({from, to, reason});
  };
  for (const Gap& gap : written) {
    if (gap.last < first || gap.first > last) continue;
    add(first, gap.first - 1, "lost with damaged bytes");
    add(std::max(first, gap.first), std::min(last, gap.last), gap.reason);
    first = std::max(first, gap.last + 1);
  }
  add(first, last, "lost with damaged bytes");
}

std::size_t LogData::max_messages(const Stream& stream) const noexcept {
  if (stream.channel == nullptr) return 0;
  std::uint64_t bytes = 0;
  for (const File& file : files_) {
    for (const mcap::ChunkPlace& chunk : file.reader.contents().chunks) {
      bytes += chunk.uncompressed_size;
    }
  }
  return static_cast<std::size_t>(bytes / stream.channel->layout->size());
}

}  // namespace trifinger::log::detail
