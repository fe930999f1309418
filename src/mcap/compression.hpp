// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <memory>
#include <span>

#include "buffer.hpp"
#include "trifinger/mcap/records.hpp"

namespace trifinger::mcap {

// Compresses chunks. Keeps its memory for the next chunk.
class Compressor {
 public:
  Compressor(Compression compression, int level);
  Compressor(Compressor&&) noexcept;
  Compressor& operator=(Compressor&&) noexcept;
  ~Compressor();

  // Appends `bytes`, compressed.
  void compress(std::span<const std::byte> bytes, Buffer& output);

 private:
  struct Contexts;
  std::unique_ptr<Contexts> contexts_;
  Compression compression_;
};

// Decompresses chunks. Keeps its memory for the next chunk.
class Decompressor {
 public:
  Decompressor();
  Decompressor(Decompressor&&) noexcept;
  Decompressor& operator=(Decompressor&&) noexcept;
  ~Decompressor();

  // Fills `output`. Returns false if `bytes` are damaged, or do not decompress to exactly that
  // size.
  [[nodiscard]] bool decompress(Compression compression, std::span<const std::byte> bytes,
                                std::span<std::byte> output);

 private:
  struct Contexts;
  std::unique_ptr<Contexts> contexts_;
};

}  // namespace trifinger::mcap
