// SPDX-License-Identifier: BSD-3-Clause
#include "compression.hpp"

#include <lz4frame.h>
#include <zstd.h>

#include <algorithm>
#include <new>
#include <string>

#include "trifinger/base/error.hpp"

namespace trifinger::mcap {
namespace {

template <auto function>
struct Free {
  template <class T>
  void operator()(T* context) const noexcept {
    function(context);
  }
};

void require_zstd(std::size_t result) {
  if (ZSTD_isError(result) != 0) throw Error(std::string("zstd: ") + ZSTD_getErrorName(result));
}

void require_lz4(std::size_t result) {
  if (LZ4F_isError(result) != 0) throw Error(std::string("lz4: ") + LZ4F_getErrorName(result));
}

}  // namespace

// ---- Compressor ----

struct Compressor::Contexts {
  std::unique_ptr<ZSTD_CCtx, Free<ZSTD_freeCCtx>> zstd;
  std::unique_ptr<LZ4F_cctx, Free<LZ4F_freeCompressionContext>> lz4;
  LZ4F_preferences_t lz4_preferences{};
};

Compressor::Compressor(Compression compression, int level)
    : contexts_(std::make_unique<Contexts>()), compression_(compression) {
  switch (compression) {
    case Compression::kNone:
      break;
    case Compression::kZstd:
      if (level < 1 || level > 19) {
        throw InvalidArgument("zstd has the levels 1 to 19, not " + std::to_string(level));
      }
      contexts_->zstd.reset(ZSTD_createCCtx());
      if (!contexts_->zstd) throw std::bad_alloc();
      require_zstd(ZSTD_CCtx_setParameter(contexts_->zstd.get(), ZSTD_c_compressionLevel, level));
      break;
    case Compression::kLz4: {
      if (level < 1 || level > LZ4F_compressionLevel_max()) {
        throw InvalidArgument("lz4 has the levels 1 to " +
                              std::to_string(LZ4F_compressionLevel_max()) + ", not " +
                              std::to_string(level));
      }
      LZ4F_cctx* context = nullptr;
      require_lz4(LZ4F_createCompressionContext(&context, LZ4F_VERSION));
      contexts_->lz4.reset(context);
      contexts_->lz4_preferences.compressionLevel = level;
      contexts_->lz4_preferences.autoFlush = 1;
      contexts_->lz4_preferences.frameInfo.blockSizeID = LZ4F_max4MB;
      contexts_->lz4_preferences.frameInfo.blockMode = LZ4F_blockIndependent;
      break;
    }
  }
}

Compressor::Compressor(Compressor&&) noexcept = default;
Compressor& Compressor::operator=(Compressor&&) noexcept = default;
Compressor::~Compressor() = default;

void Compressor::compress(std::span<const std::byte> bytes, Buffer& output) {
  const std::size_t before = output.size();
  switch (compression_) {
    case Compression::kNone:
      output.append(bytes.data(), bytes.size());
      break;
    case Compression::kZstd: {
      output.resize(before + ZSTD_compressBound(bytes.size()));
      const std::size_t size = ZSTD_compress2(contexts_->zstd.get(), output.data() + before,
                                              output.size() - before, bytes.data(), bytes.size());
      require_zstd(size);
      output.resize(before + size);
      break;
    }
    case Compression::kLz4: {
      LZ4F_preferences_t& preferences = contexts_->lz4_preferences;
      preferences.frameInfo.contentSize = bytes.size();
      output.resize(before + LZ4F_HEADER_SIZE_MAX + LZ4F_compressBound(bytes.size(), &preferences));
      std::size_t end = before;
      const auto add = [&](std::size_t size) {
        require_lz4(size);
        end += size;
      };
      LZ4F_cctx* const context = contexts_->lz4.get();
      add(LZ4F_compressBegin(context, output.data() + end, output.size() - end, &preferences));
      add(LZ4F_compressUpdate(context, output.data() + end, output.size() - end, bytes.data(),
                              bytes.size(), nullptr));
      add(LZ4F_compressEnd(context, output.data() + end, output.size() - end, nullptr));
      output.resize(end);
      break;
    }
  }
}

// ---- Decompressor ----

struct Decompressor::Contexts {
  std::unique_ptr<ZSTD_DCtx, Free<ZSTD_freeDCtx>> zstd;
  std::unique_ptr<LZ4F_dctx, Free<LZ4F_freeDecompressionContext>> lz4;

  [[nodiscard]] bool decompress_lz4(std::span<const std::byte> bytes,
                                    std::span<std::byte> output) const {
    LZ4F_resetDecompressionContext(lz4.get());
    std::size_t hint = bytes.empty() ? 0 : 1;  // bytes that LZ4 expects next; 0: done
    while (!bytes.empty()) {
      std::size_t taken = bytes.size();
      std::size_t given = output.size();
      hint = LZ4F_decompress(lz4.get(), output.data(), &given, bytes.data(), &taken, nullptr);
      if (LZ4F_isError(hint) != 0 || taken + given == 0) return false;
      bytes = bytes.subspan(taken);
      output = output.subspan(given);
    }
    return hint == 0 && output.empty();
  }
};

Decompressor::Decompressor() : contexts_(std::make_unique<Contexts>()) {}
Decompressor::Decompressor(Decompressor&&) noexcept = default;
Decompressor& Decompressor::operator=(Decompressor&&) noexcept = default;
Decompressor::~Decompressor() = default;

bool Decompressor::decompress(Compression compression, std::span<const std::byte> bytes,
                              std::span<std::byte> output) {
  switch (compression) {
    case Compression::kNone:
      if (bytes.size() != output.size()) return false;
      std::ranges::copy(bytes, output.begin());
      return true;
    case Compression::kZstd:
      if (!contexts_->zstd) {
        contexts_->zstd.reset(ZSTD_createDCtx());
        if (!contexts_->zstd) throw std::bad_alloc();
      }
      return ZSTD_decompressDCtx(contexts_->zstd.get(), output.data(), output.size(), bytes.data(),
                                 bytes.size()) == output.size();
    case Compression::kLz4:
      if (!contexts_->lz4) {
        LZ4F_dctx* context = nullptr;
        require_lz4(LZ4F_createDecompressionContext(&context, LZ4F_VERSION));
        contexts_->lz4.reset(context);
      }
      return contexts_->decompress_lz4(bytes, output);
  }
  return false;
}

}  // namespace trifinger::mcap
