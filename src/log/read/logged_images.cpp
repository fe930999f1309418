// SPDX-License-Identifier: BSD-3-Clause
#include "log/logged_images.hpp"

#include <algorithm>
#include <cstring>
#include <mutex>
#include <span>

#include "base/moved.hpp"
#include "camera/image_file.hpp"
#include "log/format/image_messages.hpp"
#include "log/read/log_data.hpp"
#include "trifinger/base/error.hpp"
#include "trifinger/camera/pixels.hpp"
#include "trifinger/config/file.hpp"

namespace trifinger::log {

using namespace detail;

namespace {

using camera::Frame;

camera::Calibration calibration_of(const LoggedSession& robot) {
  const std::vector<Document>& documents = robot.header().documents;
  const auto found = std::ranges::find(documents, camera::kDocument, &Document::name);
  if (robot.is_companion() || found == documents.end()) {
    throw InvalidArgument("'" + robot.name() + "' has no cameras in this log");
  }
  return camera::read_calibration(config::File::parse(found->text, found->name).root());
}

}  // namespace

// ---- LoggedImages ----

bool LoggedImages::has(std::size_t camera) const { return size(camera) > 0; }

std::size_t LoggedImages::size(std::size_t camera) const {
  (void)checked(log_);
  if (infos_.at(camera).frame().state != Frame::State::kGood) return 0;
  const std::scoped_lock lock(log_->mutex);
  const auto found = log_->find_image(robot_, (*cameras_)[camera].name, times_[camera], index_);
  if (!found) return 0;
  const auto image = image_in(found->is_compressed, found->message);
  return image ? image->bytes.size() : 0;
}

RecordedImage LoggedImages::recorded(std::size_t camera) const {
  (void)checked(log_);
  const Frame::State state = infos_.at(camera).frame().state;
  const std::string& name = (*cameras_)[camera].name;
  if (state != Frame::State::kGood) throw camera::CameraLost(name, state);
  const std::scoped_lock lock(log_->mutex);
  const auto found = log_->find_image(robot_, name, times_[camera], index_);
  const auto image = found ? image_in(found->is_compressed, found->message) : std::nullopt;
  if (!image) {
    throw NotInLog("the log of '" + robot_ + "' lacks the image of " + name + " of element " +
                   std::to_string(index_));
  }
  return {.encoding = image->encoding,
          .bytes =
              std::string(reinterpret_cast<const char*>(image->bytes.data()), image->bytes.size())};
}

std::vector<std::byte> LoggedImages::pixels(std::size_t camera) const {
  const RecordedImage image = recorded(camera);
  const camera::ImageFormat& format = (*cameras_)[camera].format;
  if (image.encoding == kJpegImages) {
    return camera::converted(camera::decode_image(image.bytes), format);
  }
  if (image.encoding != camera::name_of(format.pixels) || image.bytes.size() != format.size()) {
    throw InvalidArgument("the image of " + (*cameras_)[camera].name + " in the log has " +
                          std::to_string(image.bytes.size()) + " bytes in " + image.encoding +
                          ", its calibration says " + std::to_string(format.size()) + " in " +
                          std::string(camera::name_of(format.pixels)));
  }
  const auto bytes = std::as_bytes(std::span(image.bytes));
  return {bytes.begin(), bytes.end()};
}

std::vector<std::byte> LoggedImages::rgb(std::size_t camera) const {
  const camera::ImageFormat& format = checked(cameras_)->at(camera).format;
  const camera::ImageFormat colour{
      .width = format.width, .height = format.height, .pixels = camera::PixelFormat::kRgb8};
  const RecordedImage image = recorded(camera);
  if (image.encoding == kJpegImages)
    return camera::converted(camera::decode_image(image.bytes), colour);
  std::vector<std::byte> rgb(colour.size());
  camera::to_rgb(format, pixels(camera), rgb);
  return rgb;
}

// ---- LoggedCameras ----

LoggedCameras::LoggedCameras(const LoggedSession& robot)
    : companion_(robot),
      calibration_(calibration_of(robot)),
      cameras_(std::make_shared<const std::vector<camera::Camera>>(calibration_.cameras)) {
  companion_ = robot.companion(camera::kCompanion);
  if (!companion_.has_elements()) {
    throw InvalidArgument("the log of '" + robot.name() + "' has no images");
  }
  require_same_elements(companion_, camera::image_elements(*cameras_));
}

std::pair<TimeIndex, TimeIndex> LoggedCameras::range() const {
  return companion_.range(Series::kObservation);
}

LoggedImages LoggedCameras::at(TimeIndex index) const {
  std::vector<std::byte> element(companion_.element(Series::kObservation).size());
  companion_.get(Series::kObservation, index, 1, element.data());
  return images_of(index, element.data());
}

std::optional<LoggedImages> LoggedCameras::get_latest_at(TimeIndex t) const {
  std::vector<std::byte> element(companion_.element(Series::kObservation).size());
  TimeIndex index = 0;
  if (!companion_.get_latest_at(t, element.data(), &index)) return std::nullopt;
  return images_of(index, element.data());
}

std::optional<LoggedImages> LoggedCameras::find(std::int64_t time) const {
  const TimeIndex index = companion_.find(time);
  if (index >= range().second) return std::nullopt;
  return at(index);
}

LoggedImages LoggedCameras::images_of(TimeIndex index, const std::byte* element) const {
  LoggedImages images;
  images.log_ = companion_.log_;
  images.cameras_ = cameras_;
  images.robot_ = companion_.header().name;
  images.index_ = index;
  std::memcpy(&images.stamp_, element, sizeof(Stamp));
  images.infos_.resize(cameras_->size());
  const std::size_t size = images.infos_.size() * sizeof(camera::ImageInfo);
  std::memcpy(images.infos_.data(),
              element + companion_.element(Series::kObservation).size() - size, size);
  images.times_ = image_times(companion_.header(), images.infos_, images.stamp_);
  return images;
}

}  // namespace trifinger::log
