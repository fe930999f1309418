// SPDX-License-Identifier: BSD-3-Clause
#include "log/read/log_data.hpp"

#include <algorithm>
#include <iterator>
#include <utility>

#include "log/format/cdr.hpp"
#include "trifinger/base/error.hpp"

namespace trifinger::log::detail {
namespace {

// Other programs may write levels that we do not have.
Level level_of(std::uint8_t number) {
  if (number >= static_cast<std::uint8_t>(Level::kError)) return Level::kError;
  return number >= static_cast<std::uint8_t>(Level::kWarning) ? Level::kWarning : Level::kInfo;
}

}  // namespace

LogData::LogData(const std::vector<std::filesystem::path>& parts, Several several)
    : files_(open_parts(parts, several, damage_)) {
  for (std::size_t i = 0; i < files_.size(); ++i) {
    paths_.push_back(files_[i].path);
    size_ += files_[i].size;
    if (origin_.empty()) origin_ = files_[i].origin;
    const std::size_t count = files_[i].reader.contents().chunks.size();
    for (std::size_t index = 0; index < count; ++index)
      chunks_.push_back({.file = i, .index = index, .runs = {}});
  }
  origin_["began"] = files_.front().began();
  bool is_certain = true;
  for (LogFile& file : files_) {
    const mcap::Contents& contents = file.reader.contents();
    for (const auto& [id, channel] : contents.channels) {
      is_certain = add_channel(file, channel) && is_certain;
    }
    mark_chunks(file);
    for (const mcap::Metadata& record : contents.metadata) {
      try {
        sessions_.read(record);
      } catch (const InvalidArgument& error) {
        ignore(file, error.what());
      }
    }
    is_certain = is_certain && contents.damage.empty();
  }
  for (const LogFile& file : files_) sessions_.find_documents(file.reader.contents());
  for (const LogFile& file : files_) {
    for (const auto& [id, channel] : file.channels) {
      if (channel.is_of_stream()) is_certain = sessions_.bind_by_name(channel) && is_certain;
    }
  }
  // The records about the sessions may be incomplete, so the messages are read as well.
  if (!is_certain || !sessions_.is_ordered()) read_all();
}

bool LogData::add_channel(LogFile& file, const mcap::Channel& channel) {
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

void LogData::mark_chunks(LogFile& file) {
  const mcap::Contents& contents = file.reader.contents();
  // Only a whole summary is sure to name all channels of a chunk.
  if (!contents.is_finished || !contents.damage.empty()) return;
  const auto has_elements = [&file](const auto& index) {
    const auto& [channel, offset] = index;
    const auto found = file.channels.find(channel);
    return found == file.channels.end() || found->second.is_of_stream() ||
           found->second.role == ChannelReader::Role::kEvent;
  };
  for (Chunk& chunk : chunks_) {
    if (&files_[chunk.file] != &file) continue;
    const auto& indexes = contents.chunks[chunk.index].indexes;
    if (indexes.empty() || std::ranges::any_of(indexes, has_elements)) continue;
    chunk.has_elements = false;
    chunk.is_known = true;
    ++num_known_;
  }
}

void LogData::ignore(const LogFile& file, const std::string& reason) {
  damage_.push_back({file.path, 0, 0, reason});
}

// ---- chunks ----

std::span<const mcap::Message> LogData::load(std::size_t n) {
  Chunk& chunk = chunks_[n];
  LogFile& file = files_[chunk.file];
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

void LogData::verify_all() {
  read_all();
  if (std::exchange(is_verified_, true)) return;
  for (std::size_t n = 0; n < chunks_.size(); ++n) {
    if (!chunks_[n].has_elements) (void)load(n);
  }
}

// ---- images ----

bool LogData::may_have_images(const Chunk& chunk) {
  LogFile& file = files_[chunk.file];
  const auto& indexes = file.reader.contents().chunks[chunk.index].indexes;
  return indexes.empty() || std::ranges::any_of(indexes, [&](const auto& index) {
           const ChannelReader* const channel = channel_of(file, index.first);
           return channel != nullptr && channel->role == ChannelReader::Role::kImage;
         });
}

std::optional<ImageMessage> LogData::find_image(const std::string& robot, const std::string& camera,
                                                std::int64_t time, TimeIndex element) {
  if (!image_chunks_) {
    image_chunks_.emplace();
    for (std::size_t n = 0; n < chunks_.size(); ++n) {
      if (may_have_images(chunks_[n])) image_chunks_->push_back(n);
    }
  }
  // Most readers want one image after the other.
  for (std::size_t i = 0; i < image_chunks_->size(); ++i) {
    const std::size_t place = (next_image_ + i) % image_chunks_->size();
    if (auto found = find_image_in((*image_chunks_)[place], robot, camera, time, element)) {
      next_image_ = place;
      return found;
    }
  }
  return std::nullopt;
}

std::optional<ImageMessage> LogData::find_image_in(std::size_t n, const std::string& robot,
                                                   const std::string& camera, std::int64_t time,
                                                   TimeIndex element) {
  LogFile& file = files_[chunks_[n].file];
  const mcap::ChunkPlace& place = file.reader.contents().chunks[chunks_[n].index];
  const auto wanted = static_cast<std::uint64_t>(std::max<std::int64_t>(time, 0));
  const auto sequence = static_cast<std::uint32_t>(element);
  if (wanted < place.first_time || wanted > place.last_time) return std::nullopt;
  for (const mcap::Message& message : load(n)) {
    if (message.log_time != wanted || message.sequence != sequence) continue;
    const ChannelReader* const channel = channel_of(file, message.channel_id);
    if (channel == nullptr || channel->role != ChannelReader::Role::kImage ||
        channel->session != robot || channel->camera != camera) {
      continue;
    }
    return ImageMessage{.is_compressed = channel->is_compressed, .message = message.data};
  }
  return std::nullopt;
}

void LogData::look_into(std::size_t n, std::span<const mcap::Message> messages) {
  std::vector<Run>& runs = chunks_[n].runs;
  LogFile& file = files_[chunks_[n].file];
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

ChannelReader* LogData::channel_of(LogFile& file, std::uint16_t id) {
  if (id < file.channels_by_id.size() && file.channels_by_id[id] != nullptr) {
    return file.channels_by_id[id];
  }
  // The channel's description was damaged in the chunk where it first stood.
  const auto channel = file.reader.contents().channels.find(id);
  if (channel == file.reader.contents().channels.end()) return nullptr;
  add_channel(file, channel->second);
  return file.channels_by_id[id];
}

std::optional<StreamMessage> LogData::identify(LogFile& file, ChannelReader& channel,
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
    Stream* const stream = sessions_.stream_of(channel, head.session_id);
    if (stream == nullptr) {
      ignore(file, "Messages of " + channel.topic + " have other fields than those before");
      return std::nullopt;
    }
    channel.session_id = head.session_id;
    channel.stream = stream;
  }
  return StreamMessage{*channel.stream, channel, head.index, message};
}

const Run* LogData::last_run(const Stream& stream) {
  for (std::size_t n = find_chunk(stream, [](const Run&) { return false; }); n-- > 0;) {
    const std::span<const Run> found = runs(n);
    for (std::size_t i = found.size(); i-- > 0;) {
      if (found[i].stream == &stream && !found[i].is_end) return &found[i];
    }
    if (std::ranges::any_of(
            found, [&](const Run& run) { return sessions_.compare(*run.stream, stream) < 0; })) {
      break;
    }
  }
  return nullptr;
}

bool LogData::is_behind(const Stream& stream, std::size_t n) {
  return std::ranges::any_of(
      runs(n), [&](const Run& run) { return sessions_.compare(*run.stream, stream) > 0; });
}

// ---- what is to be said about it ----

bool LogData::is_finished() const noexcept {
  return std::ranges::all_of(
      files_, [](const LogFile& file) { return file.reader.contents().is_finished; });
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
  verify_all();
  std::vector<Damage> all = damage_;
  for (const LogFile& file : files_) {
    std::ranges::move(damage_of(file.path, file.size, file.reader.contents()),
                      std::back_inserter(all));
  }
  return all;
}

std::uint64_t LogData::lost_bytes() {
  verify_all();
  std::uint64_t sum = 0;
  for (const LogFile& file : files_) {
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
  const auto add = [&](TimeIndex end_of_gap) {
    if (next < end_of_gap) explain(stream, next, end_of_gap - 1, missing);
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
  for (const LogFile& file : files_) {
    for (const mcap::ChunkPlace& chunk : file.reader.contents().chunks) {
      bytes += chunk.uncompressed_size;
    }
  }
  return static_cast<std::size_t>(bytes / stream.channel->layout->size());
}

}  // namespace trifinger::log::detail
