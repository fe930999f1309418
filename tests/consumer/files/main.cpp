// SPDX-License-Identifier: BSD-3-Clause
// Writes a file of its own messages and reads it.
#include <cstdint>
#include <cstdio>
#include <span>
#include <string>

#include "trifinger/mcap/reader.hpp"
#include "trifinger/mcap/writer.hpp"

int main(int argc, char** argv) {
  if (argc != 2) return 2;
  using namespace trifinger::mcap;
  {
    FileSink sink = FileSink::create(argv[1]);
    Writer writer(sink, {.library = "consumer"});
    const std::uint16_t channel =
        writer.add_channel({.topic = "/greeting", .message_encoding = "text"});
    const std::string text = "hello";
    writer.write({.channel_id = channel, .log_time = 1, .data = std::as_bytes(std::span(text))});
    writer.finish();
  }
  Reader reader{std::filesystem::path(argv[1])};
  const auto messages = reader.read_chunk(0);
  std::printf("%d message of %d bytes\n", static_cast<int>(reader.contents().message_count),
              static_cast<int>(messages->front().data.size()));
}
