// SPDX-License-Identifier: BSD-3-Clause
// fuzzer_seeds FOLDER: writes small files with which the fuzzer of the reader begins.
#include <cstdint>
#include <cstdio>
#include <exception>
#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

#include "mcap/encoding.hpp"
#include "mcap/files.hpp"

namespace {

using namespace trifinger::mcap;

// The first byte tells the fuzzer how to read.
void write(const std::filesystem::path& folder, const std::string& name,
           std::span<const std::byte> bytes) {
  for (const char mode : {'\0', '\1'}) {
    std::ofstream file(folder / (name + (mode == 0 ? "_opened" : "_verified")), std::ios::binary);
    file.exceptions(std::ios::failbit | std::ios::badbit);
    file.put(mode);
    file.write(reinterpret_cast<const char*>(bytes.data()),
               static_cast<std::streamsize>(bytes.size()));
  }
}

void write_without_chunks(const std::filesystem::path& folder) {
  Buffer buffer;
  Encoder encoder(buffer);
  encoder.bytes(kMagic);
  encoder.header("", "");
  encoder.schema({.id = 1, .name = "s", .encoding = "json", .data = "{}"});
  encoder.channel({.id = 1, .schema_id = 1, .topic = "/a", .message_encoding = "json"});
  for (std::uint64_t i = 0; i < 3; ++i) {
    encoder.message({.channel_id = 1, .log_time = i, .data = test::bytes_of("{}")});
  }
  write(folder, "without_chunks", buffer.view());
}

}  // namespace

int main(int argc, char** argv) {
  try {
    if (argc != 2) throw trifinger::InvalidArgument("usage: fuzzer_seeds FOLDER");
    const std::filesystem::path folder = argv[1];
    std::filesystem::create_directories(folder);
    for (const Compression compression : test::kCompressions) {
      for (const bool finished : {false, true}) {
        const test::Sample sample = test::make_sample(compression, finished);
        const std::string name = std::string("sample_").append(name_of(compression)) +
                                 (finished ? "_finished" : "_unfinished");
        write(folder, name, sample.bytes);
        write(folder, name + "_cut", std::span(sample.bytes).first(sample.bytes.size() * 2 / 3));
      }
    }
    write_without_chunks(folder);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "fuzzer_seeds: %s\n", error.what());
    return 1;
  }
}
