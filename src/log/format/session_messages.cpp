// SPDX-License-Identifier: BSD-3-Clause
#include "log/format/session_messages.hpp"

#include <array>
#include <cstring>
#include <limits>
#include <utility>

#include "log/format/cdr.hpp"
#include "trifinger/core/driver.hpp"

namespace trifinger::log::detail {
namespace {

// Returns an element that stands for a missing one: NaN in floating-point fields, otherwise 0.
std::vector<std::byte> nothing(const ElementDescription& element) {
  std::vector<std::byte> bytes(element.size());
  const auto fill = [&bytes](const FieldDescription& field, const auto& number) {
    for (std::size_t i = 0; i < field.count(); ++i) {
      std::memcpy(bytes.data() + field.offset + i * sizeof(number), &number, sizeof(number));
    }
  };
  for (const FieldDescription& field : element.fields()) {
    if (field.type == ScalarType::kFloat64) fill(field, std::numeric_limits<double>::quiet_NaN());
    if (field.type == ScalarType::kFloat32) fill(field, std::numeric_limits<float>::quiet_NaN());
  }
  return bytes;
}

SessionMessages::Stream stream(std::string topic, MessageLayout layout) {
  std::vector<std::byte> message(layout.size());
  return {.topic = std::move(topic), .layout = std::move(layout), .message = std::move(message)};
}

// Times of arrival and capture, since 1970 [ns].
struct ElementTimes {
  std::uint64_t arrival;
  std::uint64_t capture;
};

ElementTimes times_of(const SessionHeader& header, const void* element) {
  Stamp stamp;
  std::memcpy(&stamp, element, sizeof(stamp));
  return {.arrival = log_time(stamp_time(header, stamp.arrival_index, stamp.arrival_time)),
          .capture = log_time(stamp_time(header, stamp.capture_index, stamp.capture_time))};
}

}  // namespace

std::vector<std::byte> event_message(Level level, std::string_view source, std::string_view text,
                                     std::int64_t time) {
  CdrWriter message;
  message.add_time(time);
  message.add(static_cast<std::uint8_t>(level));
  message.add(source);
  message.add(text);
  message.add(std::string_view());  // file
  message.add(std::string_view());  // function
  message.add(std::uint32_t{0});    // line
  return message.take();
}

SessionMessages::SessionMessages(SessionHeader header, Precision precision, double viewer_rate)
    : header_(std::move(header)),
      step_(stream(topic_of("step"), step_layout(header_.types, describe<Status>(), precision))),
      end_(stream(topic_of("end"), end_layout(header_.types, describe<Status>(), precision))),
      viewer_(header_, viewer_rate),
      cameras_(cameras_of(header_)),
      no_observation_(nothing(header_.types.observation)) {
  for (const SessionHeader::Companion& companion : header_.companions) {
    // "sim.object" becomes "/sim/object".
    companions_.push_back(stream(topic_of(companion.name.substr(companion.name.find('.') + 1)),
                                 companion_layout(companion.type, companion.element, precision)));
  }
}

std::string SessionMessages::topic_of(std::string_view name) const {
  return "/" + header_.name + "/" + std::string(name);
}

std::string SessionMessages::image_topic(std::size_t camera) const {
  return topic_of(cameras_->cameras[camera].name + "/image");
}

std::uint64_t SessionMessages::time_of(TimeIndex index, const void* status) const noexcept {
  std::int64_t time = 0;
  std::memcpy(&time, static_cast<const std::byte*>(status) + offsetof(Status, time), sizeof(time));
  return log_time(stamp_time(header_, index, time));
}

SessionMessages::Message SessionMessages::encode(Stream& stream,
                                                 std::span<const void* const> elements,
                                                 std::uint64_t log_time,
                                                 std::uint64_t publish_time) {
  stream.layout.encode(elements, stream.message.data());
  return {.log_time = log_time, .publish_time = publish_time, .data = stream.message};
}

SessionMessages::Message SessionMessages::step(TimeIndex index, const void* status,
                                               const void* observation, const void* applied_action,
                                               const void* desired_action) {
  const MessageHead head{.session_id = header_.session_id, .index = index};
  const std::array<const void*, 5> elements{&head, status, observation, applied_action,
                                            desired_action};
  const std::uint64_t time = time_of(index, status);
  return encode(step_, elements, time, time);
}

SessionMessages::Message SessionMessages::end(TimeIndex index, const void* observation,
                                              const Status& status) {
  const MessageHead head{.session_id = header_.session_id, .index = index};
  const std::array<const void*, 3> elements{
      &head, &status, observation != nullptr ? observation : no_observation_.data()};
  const std::uint64_t time = time_of(index, &status);
  return encode(end_, elements, time, time);
}

SessionMessages::Message SessionMessages::companion(std::size_t companion, TimeIndex index,
                                                    const void* element) {
  const MessageHead head{.session_id = header_.session_id, .index = index};
  const std::array<const void*, 2> elements{&head, element};
  const ElementTimes times = times_of(header_, element);
  see(companion, element);
  return encode(companions_[companion], elements, times.arrival, times.capture);
}

void SessionMessages::see(std::size_t companion, const void* element) {
  const ElementTimes times = times_of(header_, element);
  viewer_.see(companion, static_cast<std::int64_t>(times.arrival),
              static_cast<std::int64_t>(times.capture), static_cast<const std::byte*>(element));
}

std::vector<SessionMessages::Typed> SessionMessages::camera_messages(std::int64_t time) const {
  std::vector<Typed> messages;
  if (!cameras_) return messages;
  messages.push_back({topic_of("tf_static"), &frames_type(),
                      camera_frames(header_.name, cameras_->cameras, time)});
  for (const camera::Camera& camera : cameras_->cameras) {
    messages.push_back({topic_of(camera.name + "/camera_info"), &camera_info_type(),
                        camera_info(frame_of(header_.name, camera), camera, time)});
  }
  return messages;
}

}  // namespace trifinger::log::detail
