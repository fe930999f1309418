// SPDX-License-Identifier: BSD-3-Clause
#include "trifinger/camera/images.hpp"

#include <algorithm>
#include <chrono>
#include <cstring>
#include <utility>

#include "base/text_of.hpp"
#include "trifinger/base/error.hpp"
#include "trifinger/config/file.hpp"
#include "trifinger/core/errors.hpp"

namespace trifinger::camera {
namespace {

constexpr std::size_t kInfos = sizeof(Stamp) + sizeof(PayloadReference);
static_assert(sizeof(CameraImages<3>) == kInfos + 3 * sizeof(ImageInfo));

std::string sentence(const std::string& camera, Frame::State state) {
  switch (state) {
    case Frame::State::kNone:
      return "no image of " + camera + " has come: it is late or was lost";
    case Frame::State::kDamaged:
      return "the image of " + camera + " is damaged";
    case Frame::State::kLost:
      return camera + " is not there: unplugged, or without power";
    case Frame::State::kGood:
      break;
  }
  return "there is no image of " + camera;
}

bool is_good(const ImageInfo& info) { return info.frame().state == Frame::State::kGood; }

HistoryLost pixels_are_gone(const std::string& camera) {
  return {-1, "the pixels of " + camera +
                  " have been overwritten by newer images, or their process has ended"};
}

// Appends fields after those that are there.
void append(std::vector<FieldDescription>& fields, FieldDescription field) {
  if (!fields.empty()) {
    const FieldDescription& last = fields.back();
    field.offset = last.offset + last.count() * size_of(last.type);
  }
  fields.push_back(std::move(field));
}

void append(std::vector<FieldDescription>& fields, const ElementDescription& members,
            const std::string& prefix) {
  for (FieldDescription field : members.fields()) {
    field.name = prefix + "." + field.name;
    append(fields, std::move(field));
  }
}

// The pixels of an element, if they are still there: only who asks for them need know.
template <class View>
std::optional<PayloadView> view_of(std::span<const std::byte> element, const View& view) {
  PayloadReference reference;
  std::memcpy(&reference, element.data() + sizeof(Stamp), sizeof(reference));
  if (reference.memory == 0) return std::nullopt;
  try {
    return view(reference);
  } catch (const HistoryLost&) {
    return std::nullopt;
  }
}

}  // namespace

Frame ImageInfo::frame() const noexcept {
  return {.state = static_cast<Frame::State>(state),
          .number = number,
          .time = Instant(Nanoseconds(time)),
          .exposure = Nanoseconds(exposure)};
}

ElementDescription image_elements(const std::vector<Camera>& cameras) {
  std::vector<FieldDescription> fields;
  append(fields, describe<Stamp>(), "stamp");
  append(fields, describe<PayloadReference>(), "payload");
  for (const Camera& camera : cameras) {
    detail::require(camera.name.find('.') == std::string::npos,
                    "'" + camera.name + "' cannot be the name of a camera: it has a dot");
    append(fields, describe<ImageInfo>(), camera.name);
  }
  return ElementDescription(std::move(fields));
}

ElementDescription image_payload(const std::vector<Camera>& cameras) {
  std::vector<FieldDescription> fields;
  for (const Camera& camera : cameras) {
    std::vector<std::size_t> shape{static_cast<std::size_t>(camera.format.height),
                                   static_cast<std::size_t>(camera.format.width)};
    if (channels(camera.format.pixels) > 1) shape.push_back(channels(camera.format.pixels));
    // Brightness and mosaics have one shape. Whoever takes one for the other is refused.
    append(fields, {.name = camera.name,
                    .type = ScalarType::kUint8,
                    .shape = std::move(shape),
                    .unit = std::string(name_of(camera.format.pixels))});
  }
  return ElementDescription(std::move(fields));
}

CompanionDescription camera_companion(const std::vector<Camera>& cameras) {
  return {.name = kCompanion,
          .type = "images",
          .element = image_elements(cameras),
          .payload = image_payload(cameras)};
}

CameraLost::CameraLost(std::string camera, Frame::State state)
    : Error(sentence(camera, state)), camera_(std::move(camera)), state_(state) {}

// ---- reading ----

Images::Images(std::shared_ptr<const std::vector<Camera>> cameras,
               std::span<const std::byte> element, std::optional<PayloadView> view)
    : cameras_(std::move(cameras)), infos_(cameras_->size()), view_(std::move(view)) {
  std::memcpy(&stamp_, element.data(), sizeof(stamp_));
  std::memcpy(infos_.data(), element.data() + kInfos, infos_.size() * sizeof(ImageInfo));
}

std::span<const std::byte> Images::pixels(std::size_t camera) const {
  const auto state = static_cast<Frame::State>(infos_.at(camera).state);
  if (state != Frame::State::kGood) throw CameraLost((*cameras_)[camera].name, state);
  if (!view_) throw pixels_are_gone((*cameras_)[camera].name);
  std::size_t offset = 0;
  for (std::size_t i = 0; i < camera; ++i) offset += (*cameras_)[i].format.size();
  return view_->bytes().subspan(offset, (*cameras_)[camera].format.size());
}

bool Images::is_valid() const noexcept {
  if (view_) return view_->is_valid();
  return std::ranges::none_of(infos_, is_good);
}

void Images::require_valid() const {
  if (view_) {
    view_->require_valid();
    return;
  }
  const auto good = std::ranges::find_if(infos_, is_good);
  if (good == infos_.end()) return;
  throw pixels_are_gone((*cameras_)[static_cast<std::size_t>(good - infos_.begin())].name);
}

std::span<const std::byte> Images::pixels(const std::string& camera) const {
  const auto found = std::ranges::find(*cameras_, camera, &Camera::name);
  if (found == cameras_->end()) {
    throw InvalidArgument("there is no camera '" + camera + "'; there are " +
                          trifinger::detail::joined(*cameras_, &Camera::name));
  }
  return pixels(static_cast<std::size_t>(found - cameras_->begin()));
}

Calibration calibration_of(const Session& session) {
  for (const Document& document : session.documents()) {
    if (document.name != kDocument) continue;
    const config::File file = config::File::parse(document.text, document.name);
    return read_calibration(file.root());
  }
  throw InvalidArgument("robot '" + session.info().name +
                        "' has no cameras; its configuration needs a section 'cameras'");
}

CameraReader::CameraReader(const Session& robot, UntypedFrontend companion)
    : companion_(std::move(companion)),
      calibration_(calibration_of(robot)),
      cameras_(std::make_shared<const std::vector<Camera>>(calibration_.cameras)) {
  require_same_companion(companion_.session(), image_elements(*cameras_));
  if (companion_.session().payload() == image_payload(*cameras_)) return;
  throw IncompatibleSession("the images of '" + companion_.session().info().name +
                            "' have other sizes than its calibration says");
}

Images CameraReader::images_of(std::span<const std::byte> element) const {
  return {cameras_, element, view_of(element, [&](const PayloadReference&) {
            return companion_.payload(element.data());
          })};
}

std::optional<Images> CameraReader::get_latest_at(TimeIndex t, Timeout timeout) const {
  std::vector<std::byte> element(kInfos + cameras_->size() * sizeof(ImageInfo));
  if (!companion_.get_latest_at(t, element.data(), timeout)) return std::nullopt;
  return images_of(element);
}

std::optional<Images> CameraReader::latest() const {
  std::vector<std::byte> element(kInfos + cameras_->size() * sizeof(ImageInfo));
  while (true) {
    const auto [first, end] = companion_.range(Series::kObservation);
    if (end == first) return std::nullopt;
    try {
      companion_.get(Series::kObservation, end - 1, element.data(), kForever);
      return images_of(element);
    } catch (const HistoryLost&) {
      // The writer is a whole history further, so there are newer ones.
    }
  }
}

LiveCameras::LiveCameras(const std::string& robot, const std::vector<Camera>& cameras)
    : sensor_(robot, kCompanion, image_elements(cameras), image_payload(cameras)),
      payloads_(robot, kCompanion, image_payload(cameras)),
      cameras_(std::make_shared<const std::vector<Camera>>(cameras)) {}

std::optional<Images> LiveCameras::next(Timeout timeout) {
  std::vector<std::byte> element(kInfos + cameras_->size() * sizeof(ImageInfo));
  if (!sensor_.next(element.data(), timeout)) return std::nullopt;
  return Images(cameras_, element, view_of(element, [this](const PayloadReference& reference) {
                  return payloads_.view(reference);
                }));
}

// ---- writing ----

ImageWriter::ImageWriter(PayloadWriter payloads, const std::vector<Camera>& cameras)
    : payloads_(std::move(payloads)), places_(cameras.size()), last_(cameras.size()) {
  for (const Camera& camera : cameras) sizes_.push_back(camera.format.size());
}

ImageWriter::ImageWriter(const std::string& robot, const std::vector<Camera>& cameras,
                         std::size_t history)
    : ImageWriter(PayloadWriter(robot, kCompanion, image_payload(cameras), history), cameras) {}

ImageWriter ImageWriter::anonymous(const std::vector<Camera>& cameras, std::size_t history) {
  return {PayloadWriter::anonymous(image_payload(cameras), history), cameras};
}

std::size_t ImageWriter::element_size() const noexcept {
  return kInfos + sizes_.size() * sizeof(ImageInfo);
}

std::span<const std::span<std::byte>> ImageWriter::begin() noexcept {
  std::span<std::byte> rest = payloads_.begin();
  for (std::size_t i = 0; i < sizes_.size(); ++i) {
    places_[i] = rest.first(sizes_[i]);
    rest = rest.subspan(sizes_[i]);
  }
  return places_;
}

void ImageWriter::commit(std::span<const Frame> frames, std::span<std::byte> element) noexcept {
  bool is_any_good = false;
  for (std::size_t i = 0; i < last_.size(); ++i) {
    const Frame& frame = frames[i];
    ImageInfo& info = last_[i];
    if (frame.number >= 0) {
      // A camera that was started again counts from 0 again.
      if (info.number >= 0 && frame.number > info.number + 1) {
        info.missed += static_cast<std::uint32_t>(frame.number - info.number - 1);
      }
      info.number = frame.number;
    }
    if (frame.state == Frame::State::kDamaged) ++info.missed;
    info.time = frame.time.time_since_epoch().count();
    info.exposure = frame.exposure.count();
    info.state = static_cast<std::uint32_t>(frame.state);
    is_any_good = is_any_good || frame.state == Frame::State::kGood;
  }
  const PayloadReference reference = is_any_good ? payloads_.commit() : PayloadReference{};
  std::memcpy(element.data() + sizeof(Stamp), &reference, sizeof(reference));
  std::memcpy(element.data() + kInfos, last_.data(), last_.size() * sizeof(ImageInfo));
}

CameraSensor::CameraSensor(const std::string& robot, const std::vector<Camera>& cameras,
                           std::size_t history)
    : images_(robot, cameras, history),
      sensor_(robot, kCompanion, image_elements(cameras), 64, image_payload(cameras)),
      element_(images_.element_size()),
      captured_(std::chrono::steady_clock::now()) {}

void CameraSensor::write(std::span<const Frame> frames) noexcept {
  images_.commit(frames, element_);
  Nanoseconds sum{0};
  std::int64_t count = 0;
  for (const Frame& frame : frames) {
    if (frame.state != Frame::State::kGood) continue;
    // Sums of instants would overflow after some years; differences do not.
    sum += frame.time - frames[0].time;
    ++count;
  }
  if (count > 0) {
    const Instant middle = frames[0].time + sum / count;
    captured_ = has_written_ ? std::max(captured_, middle) : middle;
  }
  has_written_ = true;
  sensor_.write(captured_, element_.data());
}

}  // namespace trifinger::camera
