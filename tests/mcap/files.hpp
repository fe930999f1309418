// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cerrno>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <ostream>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "trifinger/base/error.hpp"
#include "trifinger/mcap/reader.hpp"
#include "trifinger/mcap/writer.hpp"

namespace trifinger::mcap::test {

inline constexpr Compression kCompressions[] = {Compression::kNone, Compression::kLz4,
                                                Compression::kZstd};

[[nodiscard]] inline std::span<const std::byte> bytes_of(std::string_view text) noexcept {
  return std::as_bytes(std::span(text));
}

/// A file in memory.
class MemorySink final : public Sink {
 public:
  MemorySink() = default;
  explicit MemorySink(std::span<const std::byte> bytes) : bytes_(bytes.begin(), bytes.end()) {}

  void append(std::span<const std::byte> bytes) override {
    if (before_append) before_append();
    bytes_.insert(bytes_.end(), bytes.begin(), bytes.end());
  }
  void sync() override {}
  [[nodiscard]] std::uint64_t size() const noexcept override { return bytes_.size(); }

  [[nodiscard]] const std::vector<std::byte>& bytes() const noexcept { return bytes_; }

  std::function<void()> before_append;  ///< May throw.

 private:
  std::vector<std::byte> bytes_;
};

/// Counts the bytes that are read.
class CountingSource final : public Source {
 public:
  explicit CountingSource(std::span<const std::byte> bytes) : bytes_(open_memory(bytes)) {}

  [[nodiscard]] std::size_t read(std::uint64_t offset, std::span<std::byte> bytes) const override {
    const std::size_t count = bytes_->read(offset, bytes);
    num_bytes += count;
    return count;
  }
  [[nodiscard]] std::uint64_t size() const override { return bytes_->size(); }

  mutable std::uint64_t num_bytes{0};

 private:
  std::unique_ptr<Source> bytes_;
};

/// A message that owns its bytes and contains its topic's name.
struct StoredMessage {
  std::string topic;
  std::uint32_t sequence{0};
  std::uint64_t log_time{0};
  std::uint64_t publish_time{0};
  std::string data;

  friend bool operator==(const StoredMessage&, const StoredMessage&) = default;
};

inline std::ostream& operator<<(std::ostream& stream, const StoredMessage& message) {
  return stream << message.topic << " at " << message.log_time << " (" << message.data.size()
                << " bytes)";
}

/// Everything that a file should preserve.
struct Everything {
  std::vector<StoredMessage> messages;
  std::vector<Metadata> metadata;
  std::vector<Attachment> attachments;

  friend bool operator==(const Everything&, const Everything&) = default;
};

inline std::ostream& operator<<(std::ostream& stream, const Everything& everything) {
  return stream << everything.messages.size() << " messages, " << everything.metadata.size()
                << " metadata, " << everything.attachments.size() << " attachments";
}

[[nodiscard]] inline StoredMessage stored(const Contents& contents, const Message& message) {
  const auto channel = contents.channels.find(message.channel_id);
  return {.topic = channel == contents.channels.end() ? "?" : channel->second.topic,
          .sequence = message.sequence,
          .log_time = message.log_time,
          .publish_time = message.publish_time,
          .data = {reinterpret_cast<const char*>(message.data.data()), message.data.size()}};
}

/// Returns the messages of one chunk; none if it is damaged.
[[nodiscard]] inline std::vector<StoredMessage> read_messages(Reader& reader, std::size_t chunk) {
  std::vector<StoredMessage> messages;
  if (const auto found = reader.read_chunk(chunk)) {
    for (const Message& message : *found) messages.push_back(stored(reader.contents(), message));
  }
  return messages;
}

[[nodiscard]] inline Everything read_everything(Reader& reader) {
  Everything everything;
  for (std::size_t i = 0; i < reader.contents().chunks.size(); ++i) {
    for (StoredMessage& message : read_messages(reader, i)) {
      everything.messages.push_back(std::move(message));
    }
  }
  everything.metadata = reader.contents().metadata;
  everything.attachments = reader.contents().attachments;
  return everything;
}

[[nodiscard]] inline Reader read_bytes(std::span<const std::byte> bytes,
                                       const ReaderOptions& options = {}) {
  return Reader(open_memory(bytes), options);
}

/// Writes to a file and remembers what was written.
class RecordingWriter {
 public:
  explicit RecordingWriter(Writer& writer) noexcept : writer_(writer) {}

  /// Topics that begin with a letter have a schema.
  void write(const std::string& topic, std::uint64_t log_time, std::string_view data) {
    const StoredMessage message{.topic = topic,
                                .sequence = static_cast<std::uint32_t>(log_time % 7),
                                .log_time = log_time,
                                .publish_time = log_time + 1,
                                .data = std::string(data)};
    const bool has_schema = topic.front() != '/';
    const std::uint16_t schema =
        has_schema ? writer_.add_schema("test_msgs/msg/" + topic, "ros2msg", "int32 x") : 0;
    const std::uint16_t channel = writer_.add_channel({.schema_id = schema,
                                                       .topic = topic,
                                                       .message_encoding = "cdr",
                                                       .metadata = {{"topic", topic}}});
    writer_.write({.channel_id = channel,
                   .sequence = message.sequence,
                   .log_time = message.log_time,
                   .publish_time = message.publish_time,
                   .data = bytes_of(message.data)});
    everything_.messages.push_back(message);
  }
  void write(const Metadata& metadata) {
    writer_.write(metadata);
    everything_.metadata.push_back(metadata);
  }
  void write(const Attachment& attachment) {
    writer_.write(attachment);
    everything_.attachments.push_back(attachment);
  }

  [[nodiscard]] const Everything& everything() const noexcept { return everything_; }

 private:
  Writer& writer_;
  Everything everything_;
};

/// A small file with one of everything.
struct Sample {
  std::vector<std::byte> bytes;
  Everything everything;
};

[[nodiscard]] inline Sample make_sample(Compression compression, bool finished) {
  MemorySink sink;
  Writer writer(sink, {.profile = "ros2", .library = "sample", .compression = compression});
  RecordingWriter recorder(writer);
  recorder.write(Metadata{"first", {{"name", "sim"}, {"value", "1"}}});
  std::uint64_t time = 1'700'000'000'000'000'000;
  for (int chunk = 0; chunk < 6; ++chunk) {
    for (int i = 0; i < 5; ++i) {
      time += 1'000'000;
      const std::string data = std::to_string(time * 2654435761U) + std::string(12, 'x');
      recorder.write(i == 3 ? "Rare" : "Step", time, data);
    }
    if (chunk >= 3) recorder.write("/bare", time - 500'000, "late");
    writer.flush();
    if (chunk == 2) {
      recorder.write(Metadata{"middle", {}});
      recorder.write(Attachment{.log_time = time,
                                .create_time = time - 1,
                                .name = "notes.txt",
                                .media_type = "text/plain",
                                .data = "What was seen.\n"});
    }
  }
  recorder.write(Metadata{"last", {{"name", "sim"}}});
  if (finished) writer.finish();
  return {.bytes = sink.bytes(), .everything = recorder.everything()};
}

}  // namespace trifinger::mcap::test
