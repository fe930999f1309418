// SPDX-License-Identifier: BSD-3-Clause
#include "log/format/image_messages.hpp"

#include <algorithm>
#include <array>

#include "log/format/cdr.hpp"
#include "trifinger/base/error.hpp"
#include "trifinger/camera/calibration.hpp"
#include "trifinger/config/file.hpp"
#include "trifinger/core/driver.hpp"

namespace trifinger::log::detail {
namespace {

void add_header(CdrWriter& message, std::int64_t time, std::string_view frame) {
  message.add_time(time);
  message.add(frame);
}

}  // namespace

std::optional<SessionCameras> cameras_of(const SessionHeader& header) {
  const std::string name = header.name + "." + camera::kCompanion;
  const auto companion =
      std::ranges::find(header.companions, name, &SessionHeader::Companion::name);
  const auto document = std::ranges::find(header.documents, camera::kDocument, &Document::name);
  if (companion == header.companions.end() || document == header.documents.end()) {
    return std::nullopt;
  }
  try {
    const config::File file = config::File::parse(document->text, document->name);
    SessionCameras found{
        .companion = static_cast<std::size_t>(companion - header.companions.begin()),
        .cameras = camera::read_calibration(file.root()).cameras};
    if (companion->element != camera::image_elements(found.cameras)) return std::nullopt;
    return found;
  } catch (const Error&) {
    return std::nullopt;  // another version's calibration
  }
}

std::string frame_of(const std::string& robot, const camera::Camera& camera) {
  return robot + "/" + camera.name;
}

std::int64_t stamp_time(const SessionHeader& header, TimeIndex step,
                        std::int64_t monotonic) noexcept {
  return header.time_offset + (header.is_real_time ? monotonic : step * header.period.count());
}

std::vector<std::int64_t> image_times(const SessionHeader& header,
                                      std::span<const camera::ImageInfo> infos,
                                      const Stamp& stamp) {
  // An element counts as captured in the middle of its good images. Only they have a time.
  const auto is_good = [](const camera::ImageInfo& info) {
    return info.frame().state == camera::Frame::State::kGood;
  };
  const auto first = std::ranges::find_if(infos, is_good);
  std::int64_t sum = 0;
  std::int64_t count = 0;
  for (const camera::ImageInfo& info : infos) {
    if (!is_good(info)) continue;
    sum += info.time - first->time;
    ++count;
  }
  const std::int64_t capture = stamp_time(header, stamp.capture_index, stamp.capture_time);
  std::vector<std::int64_t> times;
  times.reserve(infos.size());
  for (const camera::ImageInfo& info : infos) {
    const std::int64_t offset = is_good(info) ? info.time - first->time - sum / count : 0;
    times.push_back(capture + offset);
  }
  return times;
}

std::vector<std::byte> compressed_image(const std::string& frame, std::span<const std::byte> jpeg) {
  CdrWriter message;
  message.reserve(jpeg.size() + frame.size() + 64);
  add_header(message, 0, frame);
  message.add(kJpegImages);
  message.add(jpeg);
  return message.take();
}

std::vector<std::byte> raw_image(const std::string& frame, const camera::ImageFormat& format,
                                 std::span<const std::byte> pixels) {
  CdrWriter message;
  message.reserve(pixels.size() + frame.size() + 96);
  add_header(message, 0, frame);
  message.add(static_cast<std::uint32_t>(format.height));
  message.add(static_cast<std::uint32_t>(format.width));
  message.add(camera::name_of(format.pixels));
  message.add(std::uint8_t{0});  // little endian
  message.add(static_cast<std::uint32_t>(static_cast<std::size_t>(format.width) *
                                         camera::channels(format.pixels)));
  message.add(pixels);
  return message.take();
}

void set_time(std::span<std::byte> message, std::int64_t time) noexcept {
  CdrWriter stamp;
  stamp.add_time(time);
  std::ranges::copy(stamp.bytes(), message.begin());
}

std::optional<ImageInMessage> image_in(bool is_compressed, std::span<const std::byte> message) {
  CdrReader reader(message);
  static_cast<void>(reader.number<std::int32_t>());   // seconds
  static_cast<void>(reader.number<std::uint32_t>());  // nanoseconds
  static_cast<void>(reader.text());                   // frame
  ImageInMessage image;
  if (is_compressed) {
    image.encoding = reader.text();
  } else {
    static_cast<void>(reader.number<std::uint32_t>());  // height
    static_cast<void>(reader.number<std::uint32_t>());  // width
    image.encoding = reader.text();
    static_cast<void>(reader.number<std::uint8_t>());   // is_bigendian
    static_cast<void>(reader.number<std::uint32_t>());  // step
  }
  image.bytes = reader.bytes();
  if (!reader.is_whole() || (is_compressed && image.encoding != kJpegImages)) return std::nullopt;
  return image;
}

std::vector<std::byte> camera_info(const std::string& frame, const camera::Camera& camera,
                                   std::int64_t time) {
  const camera::Lens& lens = camera.lens;
  CdrWriter message;
  add_header(message, time, frame);
  message.add(static_cast<std::uint32_t>(camera.format.height));
  message.add(static_cast<std::uint32_t>(camera.format.width));
  message.add(std::string_view("plumb_bob"));  // k1 k2 p1 p2 k3
  message.add(static_cast<std::uint32_t>(lens.distortion.size()));
  for (const double number : lens.distortion) message.add(number);
  const std::array<double, 9> k{lens.fx, 0, lens.cx, 0, lens.fy, lens.cy, 0, 0, 1};
  const std::array<double, 9> r{1, 0, 0, 0, 1, 0, 0, 0, 1};
  const std::array<double, 12> p{lens.fx, 0, lens.cx, 0, 0, lens.fy, lens.cy, 0, 0, 0, 1, 0};
  for (const double number : k) message.add(number);
  for (const double number : r) message.add(number);
  for (const double number : p) message.add(number);
  // Binning and the region of interest: zeros mean that there is none.
  for (int i = 0; i < 6; ++i) message.add(std::uint32_t{0});
  message.add(std::uint8_t{0});
  return message.take();
}

std::vector<std::byte> camera_frames(const std::string& robot,
                                     const std::vector<camera::Camera>& cameras,
                                     std::int64_t time) {
  CdrWriter message;
  message.add(static_cast<std::uint32_t>(cameras.size()));
  for (const camera::Camera& camera : cameras) {
    add_header(message, time, kWorld);
    message.add(std::string_view(frame_of(robot, camera)));
    const Eigen::Vector3d position = camera.pose.translation();
    const Eigen::Quaterniond rotation(camera.pose.linear());
    for (const double number : {position.x(), position.y(), position.z()}) message.add(number);
    for (const double number : {rotation.x(), rotation.y(), rotation.z(), rotation.w()}) {
      message.add(number);
    }
  }
  return message.take();
}

}  // namespace trifinger::log::detail
