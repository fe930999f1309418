// SPDX-License-Identifier: BSD-3-Clause
// mcap_tool write FILE COMPRESSION CHUNK_SIZE: writes the items that the lines of input describe.
// mcap_tool resume FILE COMPRESSION CHUNK_SIZE: adds such items to a file that is not finished.
// mcap_tool read FILE [verify]: prints the items in the file, as such lines.
//
// Words are separated by tabs; texts and data are hexadecimal.
//   message TOPIC SCHEMA_NAME SCHEMA_DATA SEQUENCE LOG_TIME PUBLISH_TIME DATA
//   metadata NAME [KEY VALUE] ...
//   attachment LOG_TIME CREATE_TIME NAME MEDIA_TYPE DATA
//   flush, finish
#include <charconv>
#include <cstdint>
#include <exception>
#include <filesystem>
#include <iostream>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "trifinger/base/error.hpp"
#include "trifinger/mcap/reader.hpp"
#include "trifinger/mcap/writer.hpp"

namespace {

using namespace trifinger;

std::uint64_t number_of(std::string_view word, int base = 10) {
  std::uint64_t number = 0;
  const auto [end, error] = std::from_chars(word.data(), word.data() + word.size(), number, base);
  if (error != std::errc{} || end != word.data() + word.size()) {
    throw InvalidArgument("not a number: '" + std::string(word) + "'");
  }
  return number;
}

std::string text_of(std::string_view hex) {
  std::string text;
  for (std::size_t i = 0; i + 1 < hex.size(); i += 2) {
    text += static_cast<char>(number_of(hex.substr(i, 2), 16));
  }
  return text;
}

std::string hex_of(std::string_view text) {
  constexpr std::string_view kDigits = "0123456789abcdef";
  std::string hex;
  for (const char c : text) {
    hex += kDigits[static_cast<unsigned char>(c) >> 4U];
    hex += kDigits[static_cast<unsigned char>(c) & 15U];
  }
  return hex;
}

std::vector<std::string> words_of(const std::string& line) {
  std::vector<std::string> words;
  std::size_t begin = 0;
  for (;;) {
    const std::size_t end = line.find('\t', begin);
    words.push_back(line.substr(begin, end - begin));
    if (end == std::string::npos) return words;
    begin = end + 1;
  }
}

void act(mcap::Writer& writer, const std::vector<std::string>& words) {
  if (words.at(0) == "message") {
    const std::string schema_name = text_of(words.at(2));
    const std::uint16_t schema =
        schema_name.empty() ? std::uint16_t{0}
                            : writer.add_schema(schema_name, "ros2msg", text_of(words.at(3)));
    const std::string data = text_of(words.at(7));
    const std::uint16_t channel = writer.add_channel({.schema_id = schema,
                                                      .topic = text_of(words.at(1)),
                                                      .message_encoding = "cdr",
                                                      .metadata = {{"key", "value"}}});
    writer.write({.channel_id = channel,
                  .sequence = static_cast<std::uint32_t>(number_of(words.at(4))),
                  .log_time = number_of(words.at(5)),
                  .publish_time = number_of(words.at(6)),
                  .data = std::as_bytes(std::span(data))});
  } else if (words[0] == "metadata") {
    mcap::Metadata metadata{.name = text_of(words.at(1))};
    for (std::size_t i = 2; i + 1 < words.size(); i += 2) {
      metadata.entries[text_of(words[i])] = text_of(words[i + 1]);
    }
    writer.write(metadata);
  } else if (words[0] == "attachment") {
    writer.write(mcap::Attachment{.log_time = number_of(words.at(1)),
                                  .create_time = number_of(words.at(2)),
                                  .name = text_of(words.at(3)),
                                  .media_type = text_of(words.at(4)),
                                  .data = text_of(words.at(5))});
  } else if (words[0] == "flush") {
    writer.flush();
  } else if (words[0] == "finish") {
    writer.finish();
  } else {
    throw InvalidArgument("unknown: '" + words[0] + "'");
  }
}

void act_on_input(mcap::Writer writer) {
  for (std::string line; std::getline(std::cin, line);) act(writer, words_of(line));
}

void write(const char* path, std::string_view compression, std::string_view chunk_size,
           bool resume) {
  using mcap::Compression;
  const mcap::WriterOptions options{.profile = "ros2",
                                    .library = "mcap_tool",
                                    .compression = compression == "zstd"  ? Compression::kZstd
                                                   : compression == "lz4" ? Compression::kLz4
                                                                          : Compression::kNone,
                                    .max_chunk_size = number_of(chunk_size)};
  if (resume) {
    const mcap::Reader reader{std::filesystem::path(path)};
    mcap::FileSink sink = mcap::FileSink::resume(path, reader.contents().complete_size);
    act_on_input(mcap::Writer(sink, options, reader.contents()));
  } else {
    mcap::FileSink sink = mcap::FileSink::create(path);
    act_on_input(mcap::Writer(sink, options));
  }
}

void read(const char* path, bool verify) {
  mcap::Reader reader(path, {.verify = verify});
  const mcap::Contents& contents = reader.contents();
  for (std::size_t i = 0; i < contents.chunks.size(); ++i) {
    const auto messages = reader.read_chunk(i);
    if (!messages) continue;
    for (const mcap::Message& message : *messages) {
      const mcap::Channel& channel = contents.channels.at(message.channel_id);
      const mcap::Schema schema =
          channel.schema_id == 0 ? mcap::Schema{} : contents.schemas.at(channel.schema_id);
      const std::string_view data(reinterpret_cast<const char*>(message.data.data()),
                                  message.data.size());
      std::cout << "message\t" << hex_of(channel.topic) << '\t' << hex_of(schema.name) << '\t'
                << hex_of(schema.data) << '\t' << message.sequence << '\t' << message.log_time
                << '\t' << message.publish_time << '\t' << hex_of(data) << '\n';
    }
  }
  for (const mcap::Metadata& metadata : contents.metadata) {
    std::cout << "metadata\t" << hex_of(metadata.name);
    for (const auto& [key, value] : metadata.entries) {
      std::cout << '\t' << hex_of(key) << '\t' << hex_of(value);
    }
    std::cout << '\n';
  }
  for (const mcap::Attachment& attachment : contents.attachments) {
    std::cout << "attachment\t" << attachment.log_time << '\t' << attachment.create_time << '\t'
              << hex_of(attachment.name) << '\t' << hex_of(attachment.media_type) << '\t'
              << hex_of(attachment.data) << '\n';
  }
  for (const mcap::Damage& damage : contents.damage) {
    std::cout << "damage\t" << damage.offset << '\t' << damage.size << '\t' << damage.reason
              << '\n';
  }
  std::cout << "count\t" << contents.message_count << '\n';
  if (contents.is_finished) std::cout << "finish\n";
}

}  // namespace

int main(int argc, char** argv) {
  try {
    const std::string_view verb = argc > 2 ? argv[1] : "";
    if ((verb == "write" || verb == "resume") && argc == 5) {
      write(argv[2], argv[3], argv[4], verb == "resume");
    } else if (verb == "read" && argc <= 4) {
      read(argv[2], argc == 4);
    } else {
      throw InvalidArgument(
          "usage: mcap_tool write|resume FILE COMPRESSION CHUNK_SIZE | read FILE [verify]");
    }
  } catch (const std::exception& error) {
    std::cerr << "mcap_tool: " << error.what() << '\n';
    return 1;
  }
}
