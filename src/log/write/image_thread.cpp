// SPDX-License-Identifier: BSD-3-Clause
#include "log/write/image_thread.hpp"

#include <chrono>
#include <cstring>
#include <span>
#include <utility>

#include "camera/image_file.hpp"
#include "trifinger/camera/images.hpp"
#include "trifinger/core/errors.hpp"

namespace trifinger::log::detail {
namespace {

// Pixels can be read for some 16 images, so this is soon enough for 1000 images per second.
constexpr Nanoseconds kImagePollPeriod = std::chrono::milliseconds(5);
// How long a back-end that waits for its recorder waits for room, like for anything else.
constexpr Nanoseconds kTimeout = std::chrono::seconds(1);

}  // namespace

ImageThread::ImageThread(const Session& companion, const SessionHeader& header,
                         SessionCameras cameras, const ImageOptions& options, TimeIndex first)
    : companion_(companion),
      header_(header),
      cameras_(std::move(cameras)),
      options_(options),
      is_patient_(!header.is_real_time),
      element_(header.companions[cameras_.companion].element.size()),
      next_(first) {
  header_.time_offset = 0;
  for (const camera::Camera& camera : cameras_.cameras) {
    frames_.push_back(frame_of(header_.name, camera));
  }
  grabber_ = std::thread([this] { grab(); });
  if (options_.storage == ImageStorage::kJpeg) compressor_ = std::thread([this] { compress(); });
}

ImageThread::~ImageThread() { end(); }

ImageThread::Taken ImageThread::take(std::size_t max_size) {
  Taken taken;
  const std::lock_guard lock(mutex_);
  std::size_t size = 0;
  while (!images_.empty() && (size == 0 || size + images_.front().message.size() <= max_size)) {
    size += images_.front().message.size();
    taken.images.push_back(std::move(images_.front()));
    images_.pop_front();
  }
  size_ -= size;
  taken.left_out = std::exchange(left_out_, 0);
  taken.error = std::exchange(error_, {});
  return taken;
}

// acquire: the pixels of all earlier elements were copied before.
TimeIndex ImageThread::next() const noexcept { return next_.load(std::memory_order_acquire); }
bool ImageThread::has_ended() const noexcept { return has_ended_.load(std::memory_order_acquire); }

void ImageThread::request_end() noexcept {
  // release: what the caller knows to be there is seen.
  end_requested_.store(true, std::memory_order_release);
}

void ImageThread::end() noexcept {
  if (fork_.is_inherited()) {
    // They belong to the parent process.
    for (std::thread* const thread : {&grabber_, &compressor_}) {
      if (thread->joinable()) thread->detach();
    }
    return;
  }
  // relaxed: no data depends on it.
  is_hasty_.store(true, std::memory_order_relaxed);
  request_end();
  for (std::thread* const thread : {&grabber_, &compressor_}) {
    if (thread->joinable()) thread->join();
  }
}

void ImageThread::grab() {
  while (true) {
    // The request is read first: then everything from before it is seen below.
    const bool is_last = end_requested_.load(std::memory_order_acquire);
    const TimeIndex end = companion_.range(Series::kObservation).second;
    // relaxed: only this thread writes it.
    for (TimeIndex i = next_.load(std::memory_order_relaxed); i < end; ++i) {
      grab(i);
      next_.store(i + 1, std::memory_order_release);
    }
    if (is_last) break;
    // Nobody wakes it: the back-end would need a system call for that.
    std::this_thread::sleep_for(kImagePollPeriod);
  }
  has_grabbed_.store(true, std::memory_order_release);
  if (options_.storage == ImageStorage::kRaw) has_ended_.store(true, std::memory_order_release);
}

void ImageThread::grab(TimeIndex element) {
  const std::size_t count = cameras_.cameras.size();
  std::vector<camera::ImageInfo> infos(count);
  Stamp stamp;
  std::int64_t left = 0;  // good images that were not copied yet
  try {
    if (!companion_.try_get(Series::kObservation, element, element_.data())) return;
    std::memcpy(&stamp, element_.data(), sizeof(stamp));
    std::memcpy(infos.data(), element_.data() + element_.size() - count * sizeof(infos[0]),
                count * sizeof(infos[0]));
    for (const camera::ImageInfo& info : infos) {
      left += info.frame().state == camera::Frame::State::kGood ? 1 : 0;
    }
    if (left == 0) return;
    const std::vector<std::int64_t> times = image_times(header_, infos, stamp);
    const PayloadView view = companion_.payload(element_.data());
    std::size_t offset = 0;
    for (std::size_t i = 0; i < count; ++i) {
      const std::size_t size = cameras_.cameras[i].format.size();
      const std::span<const std::byte> pixels = view.bytes().subspan(offset, size);
      offset += size;
      if (infos[i].frame().state != camera::Frame::State::kGood) continue;
      LogWriter::Image image{.camera = i,
                             .element = element,
                             .time = times[i],
                             .is_compressed = false,
                             .message = raw_image(frames_[i], cameras_.cameras[i].format, pixels)};
      view.require_valid();
      if (put(image)) --left;
    }
    if (left > 0) leave_out(left);
  } catch (const HistoryLost&) {
    leave_out(left);
  } catch (const Error& error) {
    leave_out(left, error.what());
  }
}

void ImageThread::compress() {
  while (true) {
    // acquire: then all that was grabbed is seen below.
    const bool is_last = has_grabbed_.load(std::memory_order_acquire);
    while (std::optional<LogWriter::Image> image = next_to_compress()) {
      const std::size_t before = image->message.size();
      try {
        compress(*image);
      } catch (const Error& error) {
        leave_out(1, error.what());
        image->message.clear();
      }
      const std::lock_guard lock(mutex_);
      size_ -= before - image->message.size();
      if (!image->message.empty()) images_.push_back(std::move(*image));
    }
    if (is_last) break;
    std::this_thread::sleep_for(kImagePollPeriod);
  }
  has_ended_.store(true, std::memory_order_release);
}

std::optional<LogWriter::Image> ImageThread::next_to_compress() {
  const std::lock_guard lock(mutex_);
  if (grabbed_.empty()) return std::nullopt;
  LogWriter::Image image = std::move(grabbed_.front());
  grabbed_.pop_front();
  return image;
}

void ImageThread::compress(LogWriter::Image& image) const {
  const std::optional<ImageInMessage> raw = image_in(false, image.message);
  if (!raw) throw Error("a message cannot be read");  // never: it is ours
  const std::string jpeg =
      camera::encode_jpeg(cameras_.cameras[image.camera].format, raw->bytes, options_.quality);
  image.message = compressed_image(frames_[image.camera], std::as_bytes(std::span(jpeg)));
  image.is_compressed = true;
}

// Returns false if there is no room.
bool ImageThread::put(LogWriter::Image& image) {
  const Deadline deadline(is_patient_ ? kTimeout : Nanoseconds::zero());
  while (true) {
    {
      const std::lock_guard lock(mutex_);
      if (size_ + image.message.size() <= options_.max_size) {
        size_ += image.message.size();
        (options_.storage == ImageStorage::kRaw ? images_ : grabbed_).push_back(std::move(image));
        return true;
      }
    }
    // relaxed: no data depends on it.
    if (deadline.passed() || is_hasty_.load(std::memory_order_relaxed)) return false;
    std::this_thread::sleep_for(kImagePollPeriod);
  }
}

void ImageThread::leave_out(std::int64_t count, const std::string& error) {
  const std::lock_guard lock(mutex_);
  left_out_ += count;
  if (!error.empty()) error_ = error;
}

}  // namespace trifinger::log::detail
