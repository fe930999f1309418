// SPDX-License-Identifier: BSD-3-Clause
#include "trifinger/mcap/reader.hpp"

#include <algorithm>
#include <array>
#include <string_view>
#include <utility>

#include "base/moved.hpp"
#include "encoding.hpp"
#include "file_walk.hpp"
#include "summary.hpp"
#include "trifinger/base/error.hpp"

namespace trifinger::mcap {
namespace {

constexpr std::string_view kNotBegun = "There is nothing in the file yet.";

std::string hex_of(std::span<const std::byte> bytes) {
  constexpr std::string_view kDigits = "0123456789abcdef";
  std::string text;
  for (const std::byte byte : bytes) {
    if (!text.empty()) text += ' ';
    text += kDigits[std::to_integer<std::size_t>(byte) >> 4U];
    text += kDigits[std::to_integer<std::size_t>(byte) & 15U];
  }
  return text;
}

}  // namespace

class Reader::Implementation {
 public:
  Implementation(std::unique_ptr<Source> source, const ReaderOptions& options,
                 const std::string& name);

  [[nodiscard]] const Contents& contents() const noexcept { return contents_; }
  [[nodiscard]] std::optional<std::span<const Message>> read_chunk(std::size_t index);

 private:
  // Returns false if the file is too short for the magic bytes.
  [[nodiscard]] bool has_magic(const std::string& name);
  // Reads the file with its summary. Returns false, having done nothing, if the summary is
  // incomplete.
  [[nodiscard]] bool open_by(Summary& summary);
  void walk_finished(Summary& summary);
  void walk_unfinished();
  void check_data_end(std::uint64_t offset);
  void check_summary(Summary& summary);

  std::unique_ptr<Source> source_;
  ReaderOptions options_;
  FileWalk walk_;
  Window& window_;
  Contents& contents_;
  std::vector<bool> is_damaged_;  // one entry per chunk
};

Reader::Implementation::Implementation(std::unique_ptr<Source> source, const ReaderOptions& options,
                                       const std::string& name)
    : source_(std::move(source)),
      options_(options),
      walk_(*source_, options),
      window_(walk_.window()),
      contents_(walk_.contents()) {
  if (!has_magic(name)) return;
  if (std::optional<Summary> summary = read_summary(window_)) {
    if (options_.verify || !open_by(*summary)) walk_finished(*summary);
    contents_.complete_size = window_.size();
    contents_.is_finished = true;
  } else {
    walk_unfinished();
  }
  is_damaged_.resize(contents_.chunks.size());
}

bool Reader::Implementation::has_magic(const std::string& name) {
  const auto bytes = window_.at(0, kMagic.size());
  if (bytes.empty()) throw FormatError(name + " is empty");
  if (std::equal(bytes.begin(), bytes.end(), kMagic.begin())) {
    if (bytes.size() == kMagic.size()) return true;
    walk_.add_damage(0, window_.size(), std::string(kNotBegun));
    return false;
  }
  if (bytes.size() < kMagic.size()) throw FormatError(name + " is no MCAP file: it is too short");
  std::array<std::byte, kMagic.size()> magic{};
  std::ranges::copy(bytes, magic.begin());
  std::array<std::byte, kMagic.size()> of_version_0 = magic;
  of_version_0[kVersionByte] = kMagic[kVersionByte];
  const bool ends_well = ends_with_magic(window_);
  if (of_version_0 == kMagic && !ends_well) {
    throw FormatError(name + " is an MCAP file of version '" +
                      std::to_integer<char>(magic[kVersionByte]) +
                      "', which a later version of this program may read; this one reads '0'");
  }
  // One damaged byte should not make the whole file unreadable.
  const auto header = window_.header_at(kMagic.size(), window_.size());
  const bool has_header = header && header->opcode == Opcode::kHeader &&
                          decode_header(window_.content_at(kMagic.size(), *header)).has_value();
  if (!ends_well && !has_header) {
    throw FormatError(name + " is no MCAP file: it begins with the bytes " + hex_of(magic) +
                      ", not with " + hex_of(kMagic));
  }
  walk_.add_damage(0, kMagic.size(), "The file does not begin as MCAP files do.");
  return true;
}

bool Reader::Implementation::open_by(Summary& summary) {
  const auto records = index_of(summary);
  if (!records || !walk_.adopt(std::move(summary.schemas), std::move(summary.channels))) {
    return false;
  }
  std::ranges::sort(summary.chunks, {}, &ChunkPlace::offset);
  auto chunk = summary.chunks.begin();
  std::uint64_t end = kMagic.size();
  for (const auto& [place, is_chunk] : *records) {
    // Records that the index does not list, such as the header of the file, are visited here.
    walk_.walk(end, place.offset);
    end = place.offset + place.length;
    if (is_chunk) {
      walk_.adopt(std::move(*chunk++));
    } else {
      walk_.walk(place.offset, end);
    }
  }
  walk_.walk(end, summary.data_end);
  walk_.leave_out_unproven();
  check_data_end(summary.data_end);
  contents_.message_count = summary.statistics->message_count;
  contents_.channel_message_counts = std::move(summary.statistics->channel_message_counts);
  return true;
}

void Reader::Implementation::walk_finished(Summary& summary) {
  walk_.walk(kMagic.size(), summary.data_end);
  walk_.leave_out_unproven();
  walk_.sum_up_counts();
  check_data_end(summary.data_end);
  check_summary(summary);
}

void Reader::Implementation::walk_unfinished() {
  const std::uint64_t whole_end = walk_.walk(kMagic.size(), window_.size());
  walk_.leave_out_unproven();
  contents_.complete_size = walk_.cut_damaged_tail(whole_end);
  walk_.sum_up_counts();
  if (contents_.complete_size > kMagic.size()) return;
  // Not even the header is whole, so a writer starts over.
  contents_.complete_size = 0;
  contents_.damage = {{.offset = 0, .size = window_.size(), .reason = std::string(kNotBegun)}};
}

void Reader::Implementation::check_data_end(std::uint64_t offset) {
  const auto header = window_.header_at(offset, offset + kDataEndSize);
  if (!header || header->opcode != Opcode::kDataEnd || header->record_length() != kDataEndSize) {
    walk_.add_damage(offset, kDataEndSize, "The end of the data is not marked.");
    return;
  }
  if (!options_.verify || !contents_.damage.empty()) return;
  const auto written = Decoder(window_.content_at(offset, *header)).number<std::uint32_t>();
  if (written != 0 && written != window_.checksum_between(0, offset)) {
    walk_.add_damage(
        0, offset,
        "The checksum of all data is wrong, though that of no single piece is: the header, "
        "or what has no checksum of its own, may be damaged.");
  }
}

void Reader::Implementation::check_summary(Summary& summary) {
  if (!options_.verify || !contents_.damage.empty()) return;
  const auto say = [&](std::string reason) {
    walk_.add_damage(summary.begin, window_.size() - summary.begin, std::move(reason));
  };
  if (summary.statistics && summary.statistics->message_count != contents_.message_count) {
    say("The summary says that there are " + std::to_string(summary.statistics->message_count) +
        " messages, there are " + std::to_string(contents_.message_count) + ".");
  }
  if (summary.chunks.empty()) return;  // not every program lists them
  std::ranges::sort(summary.chunks, {}, &ChunkPlace::offset);
  for (ChunkPlace& place : summary.chunks) {
    std::ranges::sort(place.indexes, {}, [](const auto& index) { return index.second; });
  }
  if (summary.chunks != contents_.chunks) say("The summary lists other chunks than there are.");
}

std::optional<std::span<const Message>> Reader::Implementation::read_chunk(std::size_t index) {
  if (index >= contents_.chunks.size()) {
    throw InvalidArgument("there is no chunk " + std::to_string(index) + ", only " +
                          std::to_string(contents_.chunks.size()));
  }
  if (is_damaged_[index]) return std::nullopt;
  ChunkPlace& place = contents_.chunks[index];
  std::string reason = walk_.load(place);
  if (!reason.empty()) {
    is_damaged_[index] = true;
    walk_.add_damage(place.offset, place.length, std::move(reason));
    return std::nullopt;
  }
  walk_.correct_times(place);
  return walk_.messages();
}

// ---- Reader ----

Reader::Reader(std::unique_ptr<Source> source, const ReaderOptions& options)
    : implementation_(std::make_unique<Implementation>(std::move(source), options, "this")) {}

Reader::Reader(const std::filesystem::path& path, const ReaderOptions& options)
    : implementation_(std::make_unique<Implementation>(open_file(path), options, path.string())) {}

Reader::Reader(Reader&&) noexcept = default;
Reader& Reader::operator=(Reader&&) noexcept = default;
Reader::~Reader() = default;

const Contents& Reader::contents() const noexcept { return checked(implementation_)->contents(); }

std::optional<std::span<const Message>> Reader::read_chunk(std::size_t index) {
  return checked(implementation_)->read_chunk(index);
}

}  // namespace trifinger::mcap
