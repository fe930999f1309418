// SPDX-License-Identifier: BSD-3-Clause
#include "log/repair.hpp"

#include <algorithm>
#include <limits>
#include <map>
#include <memory>
#include <mutex>
#include <optional>

#include "log/format/records.hpp"
#include "log/read/log_data.hpp"
#include "log/repair/new_file.hpp"
#include "trifinger/mcap/reader.hpp"
#include "trifinger/mcap/writer.hpp"

namespace trifinger::log {

using namespace detail;

namespace {

// Reports on a file. Call this when all chunks have been read.
FileReport report_of(const std::filesystem::path& file, const mcap::Contents& contents,
                     std::uint64_t messages) {
  FileReport report{.size = std::filesystem::file_size(file),
                    .messages = messages,
                    .is_finished = contents.is_finished};
  report.damage = damage_of(file, report.size, contents);
  report.lost_bytes = lost_bytes_of(report.damage, report.size);
  return report;
}

// Writes everything that a reader has found, in the order of the file.
class Recovery {
 public:
  Recovery(mcap::Reader& reader, mcap::Sink& sink)
      : reader_(reader),
        writer_(sink, {.profile = reader.contents().profile,
                       .library = reader.contents().library,
                       .max_chunk_size = std::size_t{64} << 20U}) {}

  // Returns the number of messages written.
  std::uint64_t write_all() {
    const mcap::Contents& contents = reader_.contents();
    std::size_t metadata = 0;
    std::size_t attachment = 0;
    const auto write_records_before = [&](std::uint64_t offset) {
      while (metadata < contents.metadata.size() || attachment < contents.attachments.size()) {
        const auto place_of = [](const auto& places, std::size_t i) {
          return i < places.size() ? places[i].offset : std::numeric_limits<std::uint64_t>::max();
        };
        const std::uint64_t next_metadata = place_of(contents.metadata_places, metadata);
        const std::uint64_t next_attachment = place_of(contents.attachment_places, attachment);
        if (std::min(next_metadata, next_attachment) >= offset) return;
        if (next_metadata < next_attachment) {
          writer_.write(contents.metadata[metadata++]);
        } else {
          writer_.write(contents.attachments[attachment++]);
        }
      }
    };
    std::uint64_t messages = 0;
    for (std::size_t i = 0; i < contents.chunks.size(); ++i) {
      write_records_before(contents.chunks[i].offset);
      const auto found = reader_.read_chunk(i);
      if (!found) continue;
      // Images are not compressed once more.
      writer_.set_compression(contents.chunks[i].compression);
      for (const mcap::Message& message : *found) {
        const std::optional<std::uint16_t> channel = channel_of(message.channel_id);
        if (!channel) continue;
        mcap::Message copy = message;
        copy.channel_id = *channel;
        writer_.write(copy);
        ++messages;
      }
      writer_.flush();
    }
    write_records_before(std::numeric_limits<std::uint64_t>::max());
    return messages;
  }

  [[nodiscard]] mcap::Writer& writer() noexcept { return writer_; }

 private:
  // Returns the channel of the new file for a channel of the old one; nothing if that is unknown.
  [[nodiscard]] std::optional<std::uint16_t> channel_of(std::uint16_t id) {
    if (const auto known = channels_.find(id); known != channels_.end()) return known->second;
    const mcap::Contents& contents = reader_.contents();
    const auto found = contents.channels.find(id);
    if (found == contents.channels.end()) return std::nullopt;
    mcap::Channel channel = found->second;
    const auto schema = contents.schemas.find(channel.schema_id);
    channel.schema_id =
        schema == contents.schemas.end()
            ? std::uint16_t{0}
            : writer_.add_schema(schema->second.name, schema->second.encoding, schema->second.data);
    return channels_[id] = writer_.add_channel(channel);
  }

  mcap::Reader& reader_;
  mcap::Writer writer_;
  std::map<std::uint16_t, std::uint16_t> channels_;
};

// Writes gaps for everything that is missing in the log `file` and has no gap there yet.
void write_gaps(const std::filesystem::path& file, mcap::Writer& writer) {
  std::unique_ptr<LogData> data;
  try {
    data = std::make_unique<LogData>(std::vector{file}, Several::kRefuse);
  } catch (const mcap::FormatError&) {
    return;  // another MCAP file, or a log so damaged that it has no sessions
  }
  const std::scoped_lock lock(data->mutex);
  const auto write = [&](const Stream& stream) {
    for (const Gap& gap : data->gaps(stream)) {
      const auto covers = [&gap](const Gap& written) {
        return written.first <= gap.first && gap.last <= written.last;
      };
      if (std::ranges::any_of(stream.gaps, covers)) continue;
      writer.write(gap_record(stream.name, stream.session->header.session_id, gap.first, gap.last,
                              gap.reason));
    }
  };
  for (const SessionRecord& session : data->sessions()) {
    write(session.robot);
    for (const Stream& companion : session.companions) write(companion);
  }
}

}  // namespace

FileReport check(const std::filesystem::path& file) {
  mcap::Reader reader(file, {.verify = true});
  std::uint64_t messages = 0;
  for (std::size_t i = 0; i < reader.contents().chunks.size(); ++i) {
    if (const auto found = reader.read_chunk(i)) messages += found->size();
  }
  return report_of(file, reader.contents(), messages);
}

FileReport recover(const std::filesystem::path& file, const std::filesystem::path& whole) {
  mcap::Reader reader(file, {.verify = true});
  NewFile result(whole);
  Recovery recovery(reader, result.sink());
  const std::uint64_t messages = recovery.write_all();
  write_gaps(file, recovery.writer());
  recovery.writer().finish();
  result.finish();
  return report_of(file, reader.contents(), messages);
}

}  // namespace trifinger::log
