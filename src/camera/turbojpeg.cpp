// SPDX-License-Identifier: BSD-3-Clause
#include "turbojpeg.hpp"

#include <memory>

#include "base/text_of.hpp"
#include "library.hpp"
#include "trifinger/base/error.hpp"

namespace trifinger::camera {
namespace {

// The functions and numbers of libturbojpeg that are used here, as its manual gives them.
struct TurboJpeg {
  using Handle = void*;

  static constexpr int kRgb = 0;
  static constexpr int kGrey = 6;
  static constexpr int kSamples420 = 2;
  static constexpr int kSamplesGrey = 3;
  static constexpr int kNoRealloc = 1024;

  Handle (*init_compress)();
  Handle (*init_decompress)();
  int (*destroy)(Handle);
  unsigned long (*buffer_size)(int width, int height, int samples);
  int (*compress)(Handle, const unsigned char*, int width, int pitch, int height, int format,
                  unsigned char**, unsigned long*, int samples, int quality, int flags);
  int (*header)(Handle, const unsigned char*, unsigned long, int*, int*, int*, int*);
  int (*decompress)(Handle, const unsigned char*, unsigned long, unsigned char*, int width,
                    int pitch, int height, int format, int flags);
  char* (*error)(Handle);

  static const TurboJpeg& instance() {
    static const TurboJpeg functions;
    return functions;
  }

 private:
  TurboJpeg() {
    const Library library("libturbojpeg.so.0", "JPEG", "on Debian: apt-get install libturbojpeg0");
    library.find("tjInitCompress", init_compress);
    library.find("tjInitDecompress", init_decompress);
    library.find("tjDestroy", destroy);
    library.find("tjBufSize", buffer_size);
    library.find("tjCompress2", compress);
    library.find("tjDecompressHeader3", header);
    library.find("tjDecompress2", decompress);
    library.find("tjGetErrorStr2", error);
  }
};

class Handle {
 public:
  explicit Handle(TurboJpeg::Handle handle) : handle_(handle) {
    if (handle_ == nullptr) throw Error("libturbojpeg has no memory");
  }
  Handle(const Handle&) = delete;
  Handle& operator=(const Handle&) = delete;
  ~Handle() { TurboJpeg::instance().destroy(handle_); }

  [[nodiscard]] TurboJpeg::Handle get() const noexcept { return handle_; }
  [[nodiscard]] std::string error() const { return TurboJpeg::instance().error(handle_); }

 private:
  TurboJpeg::Handle handle_;
};

// A handle takes a while to make, and works for one thread at a time.
std::unique_ptr<Handle>& decompressor() {
  thread_local std::unique_ptr<Handle> handle;
  if (handle == nullptr) handle = std::make_unique<Handle>(TurboJpeg::instance().init_decompress());
  return handle;
}

// After a damaged file the library may refuse sound ones, so the handle goes.
[[noreturn]] void refuse_damaged(std::unique_ptr<Handle>& handle) {
  const std::string text = "the JPEG image is damaged: " + handle->error();
  handle.reset();
  throw InvalidArgument(text);
}

const unsigned char* bytes_of(std::string_view file) {
  return reinterpret_cast<const unsigned char*>(file.data());
}

}  // namespace

void require_turbojpeg() { static_cast<void>(TurboJpeg::instance()); }

std::string compress_jpeg(const ImageFormat& format, std::span<const std::byte> pixels,
                          int quality) {
  const TurboJpeg& jpeg = TurboJpeg::instance();
  thread_local const Handle handle(jpeg.init_compress());
  const bool is_grey = format.pixels == PixelFormat::kMono8;
  const int samples = is_grey ? TurboJpeg::kSamplesGrey : TurboJpeg::kSamples420;
  unsigned long size = jpeg.buffer_size(format.width, format.height, samples);
  // It is kept: new memory of this size would take longer than the compression.
  thread_local std::string file;
  if (file.size() < size) file.resize(size);
  auto* target = reinterpret_cast<unsigned char*>(file.data());
  if (jpeg.compress(handle.get(), reinterpret_cast<const unsigned char*>(pixels.data()),
                    format.width, 0, format.height, is_grey ? TurboJpeg::kGrey : TurboJpeg::kRgb,
                    &target, &size, samples, quality, TurboJpeg::kNoRealloc) != 0) {
    throw Error("an image cannot be compressed: " + handle.error());
  }
  return file.substr(0, size);
}

Picture decompress_jpeg(std::string_view file) {
  const TurboJpeg& jpeg = TurboJpeg::instance();
  std::unique_ptr<Handle>& handle = decompressor();
  int width = 0;
  int height = 0;
  int samples = 0;
  int colours = 0;
  if (jpeg.header(handle->get(), bytes_of(file), file.size(), &width, &height, &samples,
                  &colours) != 0) {
    refuse_damaged(handle);
  }
  constexpr int kLargest = 16384;
  detail::require(width > 0 && height > 0 && width <= kLargest && height <= kLargest,
                  detail::text_of("the JPEG image has ", width, " x ", height,
                                  " pixels, allowed are up to ", kLargest));
  Picture picture{.format = {.width = width,
                             .height = height,
                             .pixels = samples == TurboJpeg::kSamplesGrey ? PixelFormat::kMono8
                                                                          : PixelFormat::kRgb8},
                  .pixels = {}};
  picture.pixels.resize(picture.format.size());
  decompress_jpeg(file, picture.format, picture.pixels);
  return picture;
}

void decompress_jpeg(std::string_view file, const ImageFormat& format,
                     std::span<std::byte> pixels) {
  std::unique_ptr<Handle>& handle = decompressor();
  const bool is_grey = format.pixels == PixelFormat::kMono8;
  if (TurboJpeg::instance().decompress(handle->get(), bytes_of(file), file.size(),
                                       reinterpret_cast<unsigned char*>(pixels.data()),
                                       format.width, 0, format.height,
                                       is_grey ? TurboJpeg::kGrey : TurboJpeg::kRgb, 0) != 0) {
    // It also warns of what it has repaired: pixels that are not those of the camera.
    refuse_damaged(handle);
  }
}

}  // namespace trifinger::camera
