// SPDX-License-Identifier: BSD-3-Clause
#include "aravis_device.hpp"

#include <algorithm>
#include <chrono>
#include <cstring>
#include <exception>
#include <mutex>
#include <optional>
#include <thread>
#include <utility>

#include "aravis.hpp"
#include "base/text_of.hpp"
#include "trifinger/base/error.hpp"

namespace trifinger::camera {
namespace {

using trifinger::detail::text_of;

constexpr int kAravisBuffers = 8;
constexpr Nanoseconds kAravisRetry = std::chrono::milliseconds(500);
constexpr Nanoseconds kAravisSilence = std::chrono::seconds(1);

std::string text(const char* text) { return text == nullptr ? "" : text; }

// What Aravis knows of a camera.
struct Found {
  std::string id;
  std::string serial;
  std::string name;
  std::string protocol;
  std::string address;

  [[nodiscard]] const std::string& identity() const { return serial.empty() ? id : serial; }
};

// Aravis has one list for the whole process.
std::vector<Found> find_devices() {
  static std::mutex mutex;
  const std::lock_guard lock(mutex);
  const Aravis& aravis = Aravis::instance();
  aravis.update_device_list();
  const unsigned count = aravis.get_n_devices();
  std::vector<Found> devices;
  devices.reserve(count);
  for (unsigned i = 0; i < count; ++i) {
    devices.push_back(
        {.id = text(aravis.get_device_id(i)),
         .serial = text(aravis.get_device_serial(i)),
         .name = text(aravis.get_device_vendor(i)) + " " + text(aravis.get_device_model(i)),
         .protocol = text(aravis.get_device_protocol(i)),
         .address = text(aravis.get_device_address(i))});
  }
  return devices;
}

std::uint32_t format_of(PixelFormat format) {
  switch (format) {
    case PixelFormat::kMono8:
      return Aravis::kMono8;
    case PixelFormat::kBayerRg8:
      return Aravis::kBayerRg8;
    case PixelFormat::kRgb8:
      break;
  }
  return Aravis::kRgb8;
}

}  // namespace

AravisDevice::AravisDevice(AravisSettings settings) : settings_(std::move(settings)) {
  // The library's own pretended camera, for a try without hardware.
  if (settings_.device.starts_with("Fake_")) Aravis::instance().enable_interface("Fake");
  try {
    open();
  } catch (const InvalidArgument&) {
    throw;
  } catch (const Error& error) {
    report(error.what());
  }
}

AravisDevice::~AravisDevice() { close(); }

std::vector<std::string> AravisDevice::take_messages() { return std::exchange(messages_, {}); }

void AravisDevice::report(const std::string& error) {
  if (throttle_.is_due(error, std::chrono::steady_clock::now())) messages_.push_back(error);
}

void AravisDevice::open() {
  const std::vector<Found> devices = find_devices();
  const bool is_any = settings_.device == "any";
  std::exception_ptr problem;
  std::string others;
  for (const Found& device : devices) {
    others += (others.empty() ? "" : ", ") + device.identity();
    const bool is_meant = is_any
                              ? settings_.claims->take(device.serial, device.id)
                              : device.serial == settings_.device || device.id == settings_.device;
    if (!is_meant) continue;
    is_loopback_ = device.address.starts_with("127.");
    try {
      connect(device.id);
    } catch (const Error&) {
      // One that cannot be used must not keep this camera from taking another one.
      if (is_any) settings_.claims->give_back(device.serial, device.id);
      if (!problem) problem = std::current_exception();
      continue;
    }
    if (!is_any) return;
    // Another one that comes later must not take its place.
    settings_.device = device.identity();
    messages_.push_back("any camera may be this one; it is '" + settings_.device +
                        "' from now on, and cameras.devices can say so for good");
    return;
  }
  if (problem) std::rethrow_exception(problem);
  throw Error((is_any ? "no camera is free" : "camera '" + settings_.device + "' is not there") +
              (others.empty() ? "" : "; there are " + others));
}

void AravisDevice::connect(const std::string& name) {
  name_ = name;
  Aravis::Outcome outcome;
  camera_ = Aravis::instance().camera_new(name.c_str(), outcome.get());
  if (camera_ == nullptr) {
    throw Error("camera '" + name_ + "' cannot be opened: " + outcome.text());
  }
  try {
    configure();
  } catch (...) {
    close();
    throw;
  }
  is_there_ = true;
}

void AravisDevice::close() noexcept {
  if (camera_ == nullptr) return;
  const Aravis& aravis = Aravis::instance();
  Aravis::Outcome ignored;
  if (stream_ != nullptr) {
    aravis.stop_acquisition(camera_, ignored.get());
    aravis.object_unref(std::exchange(stream_, nullptr));
  }
  aravis.object_unref(std::exchange(camera_, nullptr));
}

void AravisDevice::configure() {
  const Aravis& aravis = Aravis::instance();
  const ImageFormat& format = settings_.format;
  Aravis::Outcome outcome;
  const auto require = [&](const std::string& what) {
    if (outcome.is_error()) {
      throw Error("camera '" + name_ + "' refuses " + what + ": " + outcome.text());
    }
  };
  aravis.set_pixel_format(camera_, format_of(format.pixels), outcome.get());
  if (outcome.is_error()) {
    throw InvalidArgument("camera '" + name_ + "' has no images in " +
                          std::string(name_of(format.pixels)) + ": " + outcome.text());
  }
  const std::array<int, 2> offset = set_region();
  aravis.set_acquisition_mode(camera_, Aravis::kContinuous, outcome.get());
  require("to deliver without a pause");
  aravis.set_frame_rate(camera_, 1e9 / static_cast<double>(settings_.period.count()),
                        outcome.get());
  require("the rate");
  aravis.set_exposure_time(camera_, static_cast<double>(settings_.exposure.count()) / 1e3,
                           outcome.get());
  require("the exposure time");
  if (aravis.is_gain_available(camera_, outcome.get()) != 0) {
    aravis.set_gain(camera_, settings_.gain, outcome.get());
    require("the gain");
  }
  is_gv_ = aravis.camera_is_gv(camera_) != 0;
  if (is_gv_) {
    // A packet socket hears nothing of what stays on this machine.
    if (is_loopback_) aravis.gv_set_stream_options(camera_, Aravis::kNoPacketSocket);
    static_cast<void>(aravis.gv_auto_packet_size(camera_, outcome.get()));
  }
  settings_.offset = offset;
}

// The calibration is good for one place on the sensor. A camera forgets it without power.
std::array<int, 2> AravisDevice::set_region() {
  const Aravis& aravis = Aravis::instance();
  const ImageFormat& format = settings_.format;
  const std::optional<std::array<int, 2>>& offset = settings_.offset;
  constexpr std::array<int, 2> kOrigin{0, 0};
  Aravis::Outcome outcome;
  aravis.set_region(camera_, offset ? (*offset)[0] : -1, offset ? (*offset)[1] : -1, format.width,
                    format.height, outcome.get());
  const std::string refusal = outcome.is_error() ? ": " + outcome.text() : "";
  int x = 0;
  int y = 0;
  int width = 0;
  int height = 0;
  aravis.get_region(camera_, &x, &y, &width, &height, outcome.get());
  if (outcome.is_error()) {
    throw Error("camera '" + name_ + "' refuses to say the size of its images: " + outcome.text());
  }
  detail::require(width == format.width && height == format.height,
                  text_of("camera '", name_, "' has images of ", width, " x ", height,
                          " pixels, needed are ", format.width, " x ", format.height, refusal));
  detail::require(!offset || (x == (*offset)[0] && y == (*offset)[1]),
                  text_of("images of camera '", name_, "' begin at pixel (", x, ", ", y,
                          ") of its sensor and cannot begin at (", offset.value_or(kOrigin)[0],
                          ", ", offset.value_or(kOrigin)[1],
                          "), as cameras.offset or its first start says", refusal));
  return {x, y};
}

void AravisDevice::start() {
  const Aravis& aravis = Aravis::instance();
  Aravis::Outcome outcome;
  const unsigned payload = aravis.get_payload(camera_, outcome.get());
  if (outcome.is_error()) throw Error("camera '" + name_ + "' has no images: " + outcome.text());
  stream_ = aravis.create_stream(camera_, nullptr, nullptr, outcome.get());
  if (stream_ == nullptr) {
    throw Error("camera '" + name_ + "' cannot be connected: " + outcome.text());
  }
  if (is_gv_) {
    // With the default size of the socket's buffer most images at 100 Hz would be incomplete.
    aravis.object_set(stream_, "socket-buffer", Aravis::kAutomaticSocketBuffer, nullptr);
    // An image that waits for lost packets holds up those after it.
    const Nanoseconds wait = std::clamp<Nanoseconds>(settings_.period, std::chrono::milliseconds(5),
                                                     std::chrono::milliseconds(100));
    aravis.object_set(stream_, "frame-retention", static_cast<unsigned>(wait.count() / 1000),
                      nullptr);
  }
  for (int i = 0; i < kAravisBuffers; ++i) {
    aravis.push_buffer(stream_, aravis.buffer_new(payload, nullptr));
  }
  aravis.start_acquisition(camera_, outcome.get());
  if (outcome.is_error()) {
    const std::string why = outcome.text();
    throw Error("camera '" + name_ + "' does not start: " + why);
  }
  last_image_ = std::chrono::steady_clock::now();
  clock_ = {};
  last_stamp_ = {};
  is_counting_ = false;
}

// Continues the count over connections and over the end of the camera's 16 bits.
std::int64_t AravisDevice::number_of(std::uint64_t id) noexcept {
  std::int64_t step = 1;
  if (is_counting_) {
    step = static_cast<std::int64_t>(id) - static_cast<std::int64_t>(last_id_);
    // Numbers at Ethernet go from 65535 to 1.
    constexpr std::int64_t kRound = 65535;
    if (step < -kRound / 2 && last_id_ <= kRound) step += is_gv_ ? kRound : kRound + 1;
    if (step <= 0) step = 1;
  }
  is_counting_ = true;
  last_id_ = id;
  return number_ += step;
}

// The middle of the exposure of an image that came `steps` images after the one before.
Instant AravisDevice::time_of(Nanoseconds stamp, Instant arrival, bool is_whole,
                              std::int64_t steps) noexcept {
  Instant time = arrival - settings_.exposure / 2;
  if (stamp > Nanoseconds(0) && (is_whole || stamp > last_stamp_)) {
    // The camera marks the beginning of the exposure. The shortest way of an image, which the clock
    // cannot tell from a difference, is at least as long as the exposure.
    last_stamp_ = stamp;
    time = clock_.host_time(stamp, arrival) - settings_.exposure / 2;
  } else if (!is_whole && last_time_ != Instant::min()) {
    // The packet with the stamp is lost: what is there is that of an earlier image.
    time = std::min(time, last_time_ + steps * settings_.period);
  }
  return last_time_ = std::max(time, last_time_ + Nanoseconds(1));
}

bool AravisDevice::grab(std::span<std::byte> pixels, Frame& frame, Timeout timeout) {
  const Deadline deadline(timeout);
  const Aravis& aravis = Aravis::instance();
  if (!is_there_) {
    // Taking leave of a camera that does not answer takes many seconds, so its loss was
    // reported before.
    close();
    const Instant now = std::chrono::steady_clock::now();
    if (now < next_try_) {
      std::this_thread::sleep_for(deadline.remaining(next_try_ - now));
      return false;
    }
  }
  try {
    if (!is_there_) open();
    // Not before somebody takes images: those that nobody took would count as lost.
    if (stream_ == nullptr) start();
  } catch (const Error& error) {
    // Whatever it is: the other cameras go on, and this one may be mended.
    report(error.what());
    is_there_ = false;
    next_try_ = std::chrono::steady_clock::now() + kAravisRetry;
    return false;
  }
  const Nanoseconds longest = deadline.remaining(kAravisSilence);
  void* const buffer = aravis.pop_buffer(
      stream_, static_cast<std::uint64_t>(
                   std::chrono::duration_cast<std::chrono::microseconds>(longest).count()));
  const Instant arrival = std::chrono::steady_clock::now();
  if (buffer == nullptr) {
    if (arrival - last_image_ > std::max<Nanoseconds>(kAravisSilence, 10 * settings_.period)) {
      report("camera '" + name_ + "' delivers nothing any more: it is lost");
      is_there_ = false;
      next_try_ = arrival;
    }
    return false;
  }
  const int status = aravis.buffer_status(buffer);
  if (status == Aravis::kCleared || status == Aravis::kAborted) {
    aravis.push_buffer(stream_, buffer);
    return false;
  }
  last_image_ = arrival;
  if (throttle_.end()) messages_.push_back("camera '" + name_ + "' is connected");
  std::size_t size = 0;
  const void* const data = aravis.buffer_data(buffer, &size);
  const bool is_whole =
      status == Aravis::kSuccess && data != nullptr && size >= settings_.format.size();
  const std::int64_t before = number_;
  const std::int64_t number = number_of(aravis.buffer_frame_id(buffer));
  const auto stamp = Nanoseconds(static_cast<std::int64_t>(aravis.buffer_timestamp(buffer)));
  frame = {.state = is_whole ? Frame::State::kGood : Frame::State::kDamaged,
           .number = number,
           .time = time_of(stamp, arrival, is_whole, number - before),
           .exposure = settings_.exposure};
  if (is_whole) std::memcpy(pixels.data(), data, settings_.format.size());
  aravis.push_buffer(stream_, buffer);
  return true;
}

std::vector<DeviceInfo> list_aravis_devices() {
  std::vector<DeviceInfo> devices;
  for (const Found& found : find_devices()) {
    devices.push_back({.kind = "aravis",
                       .id = found.identity(),
                       .name = found.name,
                       .detail = found.protocol + " " + found.address});
  }
  return devices;
}

}  // namespace trifinger::camera
