// SPDX-License-Identifier: BSD-3-Clause
#include "png.hpp"

#include <libdeflate.h>

#include <cstdint>
#include <cstdlib>
#include <memory>
#include <vector>

#include "base/text_of.hpp"
#include "trifinger/base/error.hpp"

// PNG, third edition (W3C): only what images of 8 bits per channel need.
namespace trifinger::camera {
namespace {

using trifinger::detail::require;
using trifinger::detail::text_of;

constexpr std::string_view kSignature("\x89PNG\r\n\x1a\n", 8);

enum ColourType : unsigned { kGrey = 0, kRgb = 2, kPalette = 3, kGreyAlpha = 4, kRgba = 6 };

void append_number(std::string& text, std::uint32_t value) {
  for (int shift = 24; shift >= 0; shift -= 8) text += static_cast<char>(value >> shift & 0xffU);
}

std::uint32_t number_at(std::string_view text, std::size_t place) {
  std::uint32_t value = 0;
  for (std::size_t i = 0; i < 4; ++i) {
    value = value << 8U | static_cast<unsigned char>(text[place + i]);
  }
  return value;
}

void append_chunk(std::string& file, std::string_view type, std::string_view data) {
  append_number(file, static_cast<std::uint32_t>(data.size()));
  const std::size_t begin = file.size();
  file.append(type).append(data);
  append_number(file, libdeflate_crc32(0, file.data() + begin, file.size() - begin));
}

int paeth(int left, int above, int corner) {
  const int estimate = left + above - corner;
  const int to_left = std::abs(estimate - left);
  const int to_above = std::abs(estimate - above);
  const int to_corner = std::abs(estimate - corner);
  if (to_left <= to_above && to_left <= to_corner) return left;
  return to_above <= to_corner ? above : corner;
}

// Undoes the filter of a row. `above` is the row before, zeros for the first.
void unfilter(unsigned filter, std::uint8_t* row, const std::uint8_t* above, std::size_t size,
              std::size_t step) {
  for (std::size_t i = 0; i < size; ++i) {
    const int left = i >= step ? row[i - step] : 0;
    const int corner = i >= step ? above[i - step] : 0;
    int predicted = 0;
    switch (filter) {
      case 0:
        return;
      case 1:
        predicted = left;
        break;
      case 2:
        predicted = above[i];
        break;
      case 3:
        predicted = (left + above[i]) / 2;
        break;
      case 4:
        predicted = paeth(left, above[i], corner);
        break;
      default:
        throw InvalidArgument("the PNG image is damaged: it has a filter that does not exist");
    }
    row[i] = static_cast<std::uint8_t>(row[i] + predicted);
  }
}

struct Chunks {
  std::string_view header;
  std::string_view palette;
  std::string data;
};

Chunks read_chunks(std::string_view file) {
  Chunks chunks;
  std::size_t place = kSignature.size();
  while (true) {
    require(file.size() - place >= 12, "the PNG image is damaged: it is cut off");
    const std::size_t size = number_at(file, place);
    require(size <= file.size() - place - 12, "the PNG image is damaged: it is cut off");
    const std::string_view type = file.substr(place + 4, 4);
    const std::string_view data = file.substr(place + 8, size);
    const std::uint32_t sum = libdeflate_crc32(0, file.data() + place + 4, size + 4);
    require(sum == number_at(file, place + 8 + size),
            "the PNG image is damaged: a checksum is wrong");
    if (type == "IHDR") chunks.header = data;
    if (type == "PLTE") chunks.palette = data;
    if (type == "IDAT") chunks.data += data;
    if (type == "IEND") return chunks;
    place += 12 + size;
  }
}

}  // namespace

std::string compress_png(const ImageFormat& format, std::span<const std::byte> pixels) {
  const std::size_t step = channels(format.pixels);
  const std::size_t size = step * static_cast<std::size_t>(format.width);
  const auto rows = static_cast<std::size_t>(format.height);
  // Each row as the difference to the one above.
  std::vector<std::uint8_t> filtered(rows * (size + 1));
  const auto* const source = reinterpret_cast<const std::uint8_t*>(pixels.data());
  for (std::size_t y = 0; y < rows; ++y) {
    std::uint8_t* const target = &filtered[y * (size + 1)];
    target[0] = 2;
    for (std::size_t i = 0; i < size; ++i) {
      const int above = y > 0 ? source[(y - 1) * size + i] : 0;
      target[1 + i] = static_cast<std::uint8_t>(source[y * size + i] - above);
    }
  }
  constexpr int kLevel = 6;
  const std::unique_ptr<libdeflate_compressor, void (*)(libdeflate_compressor*)> compressor(
      libdeflate_alloc_compressor(kLevel), libdeflate_free_compressor);
  if (compressor == nullptr) throw Error("there is no memory to compress an image");
  std::string data(libdeflate_zlib_compress_bound(compressor.get(), filtered.size()), '\0');
  data.resize(libdeflate_zlib_compress(compressor.get(), filtered.data(), filtered.size(),
                                       data.data(), data.size()));
  std::string header;
  append_number(header, static_cast<std::uint32_t>(format.width));
  append_number(header, static_cast<std::uint32_t>(format.height));
  header += '\x08';  // bits
  header += static_cast<char>(step == 3 ? kRgb : kGrey);
  header.append(3, '\0');  // the only compression and filter, no interlace
  std::string file(kSignature);
  append_chunk(file, "IHDR", header);
  append_chunk(file, "IDAT", data);
  append_chunk(file, "IEND", {});
  return file;
}

Picture decompress_png(std::string_view file) {
  const Chunks chunks = read_chunks(file);
  require(chunks.header.size() == 13, "the PNG image is damaged: it has no header");
  const std::uint32_t width = number_at(chunks.header, 0);
  const std::uint32_t height = number_at(chunks.header, 4);
  const auto type = static_cast<unsigned char>(chunks.header[9]);
  constexpr std::uint32_t kLargest = 16384;
  require(
      width > 0 && height > 0 && width <= kLargest && height <= kLargest,
      text_of("the PNG image has ", width, " x ", height, " pixels, allowed are up to ", kLargest));
  const std::size_t step = type == kRgb ? 3 : type == kRgba ? 4 : type == kGreyAlpha ? 2 : 1;
  require(chunks.header[8] == 8 && chunks.header[12] == 0 &&
              (type == kGrey || type == kPalette || step > 1),
          "the PNG image has another number of bits than 8 per channel, or is interlaced");

  const std::size_t row_size = step * width;
  std::vector<std::uint8_t> rows(height * (row_size + 1));
  const std::unique_ptr<libdeflate_decompressor, void (*)(libdeflate_decompressor*)> decompressor(
      libdeflate_alloc_decompressor(), libdeflate_free_decompressor);
  if (decompressor == nullptr) throw Error("there is no memory to read an image");
  require(libdeflate_zlib_decompress(decompressor.get(), chunks.data.data(), chunks.data.size(),
                                     rows.data(), rows.size(), nullptr) == LIBDEFLATE_SUCCESS,
          "the PNG image is damaged: its pixels cannot be decompressed");

  const bool is_grey = type == kGrey || type == kGreyAlpha;
  Picture picture{.format = {.width = static_cast<int>(width),
                             .height = static_cast<int>(height),
                             .pixels = is_grey ? PixelFormat::kMono8 : PixelFormat::kRgb8},
                  .pixels = {}};
  picture.pixels.reserve(picture.format.size());
  const std::vector<std::uint8_t> nothing(row_size);
  const std::uint8_t* above = nothing.data();
  for (std::size_t y = 0; y < height; ++y) {
    std::uint8_t* const row = &rows[y * (row_size + 1) + 1];
    unfilter(row[-1], row, above, row_size, step);
    above = row;
    for (std::size_t x = 0; x < width; ++x) {
      const std::uint8_t* pixel = row + x * step;
      if (type == kPalette) {
        require(3 * (std::size_t{*pixel} + 1) <= chunks.palette.size(),
                "the PNG image is damaged: a colour is not in its palette");
        pixel =
            reinterpret_cast<const std::uint8_t*>(chunks.palette.data()) + std::size_t{3} * *pixel;
      }
      const auto* const begin = reinterpret_cast<const std::byte*>(pixel);
      picture.pixels.insert(picture.pixels.end(), begin, begin + (is_grey ? 1 : 3));
    }
  }
  return picture;
}

}  // namespace trifinger::camera
