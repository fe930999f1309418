// SPDX-License-Identifier: BSD-3-Clause
#include "trifinger/log/log_writer.hpp"

#include <sys/utsname.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <cstring>
#include <deque>
#include <limits>
#include <optional>
#include <set>
#include <span>
#include <utility>

#include "format/cdr.hpp"
#include "format/format.hpp"
#include "format/image_messages.hpp"
#include "format/records.hpp"
#include "format/ros_messages.hpp"
#include "format/text.hpp"
#include "format/viewer_messages.hpp"
#include "trifinger/base/error.hpp"
#include "trifinger/core/driver.hpp"
#include "trifinger/mcap/reader.hpp"

namespace trifinger::log {

using namespace detail;

namespace {

constexpr std::string_view kLibrary = "trifinger " TRIFINGER_VERSION;
constexpr std::string_view kSchemaEncoding = "ros2msg";
constexpr std::string_view kMessageEncoding = "cdr";

std::string host_name() {
  std::array<char, 256> name{};
  ::gethostname(name.data(), name.size() - 1);
  return name.data();
}

std::string kernel_version() {
  utsname name{};
  if (::uname(&name) != 0) return "unknown";
  return std::string(name.sysname) + " " + name.release;
}

std::uint64_t log_time(std::int64_t time) noexcept {
  return static_cast<std::uint64_t>(std::max<std::int64_t>(time, 0));
}

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

// Messages of one layout on one channel.
struct WrittenStream {
  MessageLayout layout;
  std::uint16_t channel{0};
  std::vector<std::byte> message;

  explicit WrittenStream(MessageLayout its_layout)
      : layout(std::move(its_layout)), message(layout.size()) {}
};

struct WrittenSession {
  SessionHeader header;
  WrittenStream step;
  WrittenStream end;
  std::vector<WrittenStream> companions;
  ViewerMessages viewer;
  std::array<std::uint16_t, kNumViewerTopics> viewer_channels{};
  std::optional<SessionCameras> cameras;
  std::vector<std::byte> no_observation;
  bool is_announced{false};
  bool has_shown_cameras{false};
  bool is_shown{false};        // true: viewers have its description
  TimeIndex observations{-1};  // known from the end on

  WrittenSession(SessionHeader its_header, Precision precision, double viewer_rate)
      : header(std::move(its_header)),
        step(step_layout(header.types, describe<Status>(), precision)),
        end(end_layout(header.types, describe<Status>(), precision)),
        viewer(header, viewer_rate),
        cameras(cameras_of(header)),
        no_observation(nothing(header.types.observation)) {
    for (const SessionHeader::Companion& companion : header.companions) {
      companions.emplace_back(companion_layout(companion.type, companion.element, precision));
    }
  }
};

}  // namespace

class LogWriter::Implementation {
 public:
  Implementation(mcap::Sink& sink, const LogOptions& options, const mcap::Contents* contents)
      : precision_(options.precision),
        compression_(options.compression),
        viewer_rate_(options.viewer_rate),
        writer_(make_writer(sink, options, contents)) {
    if (contents != nullptr) {
      for (const mcap::Metadata& record : contents->metadata) {
        if (record.name == kLogRecord) is_begun_ = true;
        if (record.name == kSessionRecord) {
          announced_.emplace(entry_of(record.entries, "name"),
                             entry_of(record.entries, "session_id"));
        }
      }
      for (const mcap::Attachment& attachment : contents->attachments) {
        documents_[attachment.name] = attachment.data;
      }
    }
    origin_ = {{"format_version", std::to_string(kFormatVersion)},
               {"trifinger_version", TRIFINGER_VERSION},
               {"host", host_name()},
               {"kernel", kernel_version()},
               {"created", utc_text(std::chrono::system_clock::now(), "%FT%TZ")},
               {"part", std::to_string(options.part)},
               {"recording", options.recording.empty() ? random_id() : options.recording},
               {"precision", std::string(name_of(precision_))}};
    event_channel_ = add_channel("/events", event_type().name, event_type().definition, {});
  }

  // Writes the first record of the file. The constructor does not, because it may have to be
  // repeated.
  void begin() {
    if (is_begun_) return;
    writer_.write(mcap::Metadata{kLogRecord, origin_});
    is_begun_ = true;
  }

  std::size_t begin_session(const SessionHeader& header) {
    begin();
    const auto is_it = [&header](const std::unique_ptr<WrittenSession>& session) {
      return session != nullptr && session->header.name == header.name &&
             session->header.session_id == header.session_id;
    };
    auto found = std::ranges::find_if(sessions_, is_it);
    if (found == sessions_.end()) {
      auto session = std::make_unique<WrittenSession>(header, precision_, viewer_rate_);
      add_channels(*session);
      sessions_.push_back(std::move(session));
      found = sessions_.end() - 1;
    }
    announce(**found);
    return static_cast<std::size_t>(found - sessions_.begin());
  }

  void write_steps(std::size_t number, const Steps& steps) {
    WrittenSession& session = at(number);
    const RobotTypes& types = session.header.types;
    const auto* desired = static_cast<const std::byte*>(steps.desired_actions);
    const auto* applied = static_cast<const std::byte*>(steps.applied_actions);
    const auto* observation = static_cast<const std::byte*>(steps.observations);
    const auto* status = static_cast<const std::byte*>(steps.statuses);
    for (std::size_t i = 0; i < steps.count; ++i) {
      const MessageHead head{.session_id = session.header.session_id,
                             .index = steps.first + static_cast<TimeIndex>(i)};
      const std::array<const void*, 5> elements{&head, status, observation, applied, desired};
      const std::uint64_t time = time_of(session.header, head.index, status);
      write(session.step, elements, time, time);
      if (session.viewer.shows(head.index)) show_step(session, time, observation);
      desired += types.action.size();
      applied += types.applied_action.size();
      observation += types.observation.size();
      status += sizeof(Status);
    }
  }

  void write_companion(std::size_t number, std::size_t companion, TimeIndex first,
                       std::size_t count, const void* elements) {
    WrittenSession& session = at(number);
    const SessionHeader& header = session.header;
    const auto* element = static_cast<const std::byte*>(elements);
    for (std::size_t i = 0; i < count; ++i) {
      const MessageHead head{.session_id = header.session_id,
                             .index = first + static_cast<TimeIndex>(i)};
      Stamp stamp;
      std::memcpy(&stamp, element, sizeof(stamp));
      const auto time = [&header](TimeIndex step, std::int64_t monotonic) {
        return log_time(stamp_time(header, step, monotonic));
      };
      const std::array<const void*, 2> parts{&head, element};
      const std::uint64_t arrival = time(stamp.arrival_index, stamp.arrival_time);
      const std::uint64_t capture = time(stamp.capture_index, stamp.capture_time);
      write(session.companions[companion], parts, arrival, capture);
      session.viewer.see(companion, static_cast<std::int64_t>(arrival),
                         static_cast<std::int64_t>(capture), element);
      element += header.companions[companion].element.size();
    }
  }

  void write_end(std::size_t number, TimeIndex time_index, const void* observation,
                 const Status& status) {
    WrittenSession& session = at(number);
    const MessageHead head{.session_id = session.header.session_id, .index = time_index};
    const std::array<const void*, 3> elements{
        &head, &status, observation != nullptr ? observation : session.no_observation.data()};
    const std::uint64_t time = time_of(session.header, time_index, &status);
    write(session.end, elements, time, time);
    session.observations = time_index + (observation != nullptr ? 1 : 0);
  }

  void end_session(std::size_t number, TimeIndex steps, const Fault& fault,
                   std::string_view fault_text) {
    const WrittenSession& session = at(number);
    const TimeIndex observations = session.observations < 0 ? steps : session.observations;
    writer_.write(end_record(session.header, steps, observations, fault, fault_text));
    // Released now, because sessions may come and go for days.
    sessions_[number].reset();
  }

  void write_gap(std::size_t number, const std::string& name, TimeIndex first, TimeIndex last,
                 std::string_view reason) {
    writer_.write(gap_record(name, at(number).header.session_id, first, last, reason));
  }

  void write_event(Level level, std::string_view source, std::string_view text, std::int64_t time) {
    CdrWriter message;
    message.add_time(time);
    message.add(static_cast<std::uint8_t>(level));
    message.add(source);
    message.add(text);
    message.add(std::string_view());  // file
    message.add(std::string_view());  // function
    message.add(std::uint32_t{0});    // line
    writer_.write(mcap::Message{.channel_id = event_channel_,
                                .log_time = log_time(time),
                                .publish_time = log_time(time),
                                .data = message.bytes()});
  }

  void write_image(std::size_t number, Image image) {
    WrittenSession& session = at(number);
    if (!session.cameras || image.camera >= session.cameras->cameras.size()) {
      throw InvalidArgument("'" + session.header.name + "' has no camera " +
                            std::to_string(image.camera) + " in the log");
    }
    show_cameras(session, image.time);
    set_time(image.message, image.time);
    images_size_ += image.message.size();
    images_.push_back({.channel = image_channel(session, image),
                       .sequence = static_cast<std::uint32_t>(image.element),
                       .time = log_time(image.time),
                       .data = std::move(image.message)});
  }
  [[nodiscard]] std::size_t waiting_images_size() const noexcept { return images_size_; }

  [[nodiscard]] WrittenSession& at(std::size_t number) const {
    if (number >= sessions_.size() || sessions_[number] == nullptr) {
      throw InvalidArgument("session " + std::to_string(number) + " of the log is not open");
    }
    return *sessions_[number];
  }
  void flush() {
    begin();
    writer_.set_compression(compression_);
    writer_.flush();
    write_images();
    if (viewer_size_ < kViewerChunkSize && !is_viewer_due_) return;
    write_viewer_messages();
    writer_.flush();
  }
  void finish() {
    begin();
    is_viewer_due_ = !viewer_messages_.empty();
    flush();
    writer_.finish();
  }
  [[nodiscard]] mcap::Writer& writer() noexcept { return writer_; }

 private:
  // Messages for viewers are collected and get chunks of their own. They are much alike but unlike
  // the steps, so in their own chunks they compress to a third.
  static constexpr std::size_t kViewerChunkSize = std::size_t{128} << 10U;

  struct WaitingMessage {
    std::uint16_t channel;
    std::uint32_t sequence;
    std::uint64_t time;
    std::vector<std::byte> data;
  };

  void show_step(WrittenSession& session, std::uint64_t time, const std::byte* observation) {
    show_still(session, time);
    show(session, session.viewer.at(static_cast<std::int64_t>(time), observation));
  }

  // Writes the frames that do not move: once in a file, and again when the documents change.
  void show_still(WrittenSession& session, std::uint64_t time) {
    if (session.is_shown) return;
    session.is_shown = true;
    std::vector<ViewerMessage> messages = session.viewer.still(static_cast<std::int64_t>(time));
    std::vector<Document>& known = shown_documents_[session.header.name];
    if (known == session.header.documents) return;
    known = session.header.documents;
    show(session, std::move(messages));
    is_viewer_due_ = true;
    for (const std::string& mistake : session.viewer.mistakes()) {
      write_event(Level::kWarning, session.header.name, mistake, static_cast<std::int64_t>(time));
    }
  }

  void show(const WrittenSession& session, std::vector<ViewerMessage> messages) {
    for (ViewerMessage& message : messages) {
      viewer_size_ += message.data.size();
      viewer_messages_.push_back({.channel = session.viewer_channels[message.topic],
                                  .sequence = 0,
                                  .time = log_time(message.time),
                                  .data = std::move(message.data)});
    }
  }

  // Tells viewers of the cameras, as `show_still` of the rest: where they are, and their lenses.
  void show_cameras(WrittenSession& session, std::int64_t time) {
    if (session.has_shown_cameras) return;
    session.has_shown_cameras = true;
    const SessionHeader& header = session.header;
    std::string text;
    for (const Document& document : header.documents) {
      if (document.name == camera::kDocument) text = document.text;
    }
    if (std::exchange(shown_calibrations_[header.name], text) == text) return;
    const auto add = [&](const std::string& topic, const MessageType& type,
                         std::vector<std::byte> data) {
      const std::uint16_t channel =
          add_channel("/" + header.name + "/" + topic, type.name, type.definition,
                      {{"role", "viewer"}, {"robot", header.name}});
      viewer_size_ += data.size();
      viewer_messages_.push_back(
          {.channel = channel, .sequence = 0, .time = log_time(time), .data = std::move(data)});
    };
    const std::vector<camera::Camera>& cameras = session.cameras->cameras;
    add("tf_static", frames_type(), camera_frames(header.name, cameras, time));
    for (const camera::Camera& camera : cameras) {
      add(camera.name + "/camera_info", camera_info_type(),
          camera_info(frame_of(header.name, camera), camera, time));
    }
    is_viewer_due_ = true;
  }

  std::uint16_t image_channel(const WrittenSession& session, const Image& image) {
    const std::string& robot = session.header.name;
    const std::string& camera = session.cameras->cameras[image.camera].name;
    const MessageType& type = image.is_compressed ? compressed_image_type() : raw_image_type();
    return add_channel("/" + robot + "/" + camera + "/image", type.name, type.definition,
                       {{"role", std::string(kImageRole)},
                        {"robot", robot},
                        {"camera", camera},
                        {"images", std::string(image.is_compressed ? kJpegImages : kRawImages)}});
  }

  // Call this only when the open chunk is empty. If the disk refuses a chunk, the images of that
  // chunk stay in it, and the others here.
  void write_images() {
    if (images_.empty()) return;
    writer_.set_compression(mcap::Compression::kNone);
    while (!images_.empty()) {
      const WaitingMessage& image = images_.front();
      writer_.write(mcap::Message{.channel_id = image.channel,
                                  .sequence = image.sequence,
                                  .log_time = image.time,
                                  .publish_time = image.time,
                                  .data = image.data});
      images_size_ -= image.data.size();
      images_.pop_front();
    }
    writer_.flush();
    writer_.set_compression(compression_);
  }

  // Call this only when the open chunk is empty: then the disk is not used, and nothing throws.
  void write_viewer_messages() {
    for (const WaitingMessage& message : viewer_messages_) {
      writer_.write(mcap::Message{.channel_id = message.channel,
                                  .log_time = message.time,
                                  .publish_time = message.time,
                                  .data = message.data});
    }
    viewer_messages_.clear();
    viewer_size_ = 0;
    is_viewer_due_ = false;
  }

  static mcap::Writer make_writer(mcap::Sink& sink, const LogOptions& options,
                                  const mcap::Contents* contents) {
    mcap::WriterOptions its_options{.profile = "ros2",
                                    .library = std::string(kLibrary),
                                    .compression = options.compression,
                                    .level = options.level,
                                    .max_chunk_size = kMaxChunkSize};
    if (contents == nullptr) return {sink, std::move(its_options)};
    return {sink, std::move(its_options), *contents};
  }

  std::uint16_t add_channel(std::string_view topic, std::string_view type,
                            std::string_view definition, Entries metadata) {
    return writer_.add_channel({.schema_id = writer_.add_schema(type, kSchemaEncoding, definition),
                                .topic = std::string(topic),
                                .message_encoding = std::string(kMessageEncoding),
                                .metadata = std::move(metadata)});
  }

  void add_channels(WrittenSession& session) {
    const SessionHeader& header = session.header;
    const RobotTypes& types = header.types;
    Entries metadata{{"session", header.name},
                     {"type", types.type},
                     {"precision", std::string(name_of(precision_))},
                     {"status", describe<Status>().text()},
                     {"observation", types.observation.text()}};
    const auto add = [this, &header](WrittenStream& stream, std::string_view suffix,
                                     Entries entries) {
      stream.channel = add_channel("/" + header.name + std::string(suffix), stream.layout.type(),
                                   stream.layout.definition(), std::move(entries));
    };
    metadata["role"] = "end";
    add(session.end, "/end", metadata);
    metadata["role"] = "step";
    metadata["applied_action"] = types.applied_action.text();
    metadata["action"] = types.action.text();
    metadata["default_action"] = hexadecimal(types.default_action);
    add(session.step, "/step", metadata);
    for (std::size_t i = 0; i < session.companions.size(); ++i) {
      const SessionHeader::Companion& companion = header.companions[i];
      // "sim.object" becomes "/sim/object".
      add(session.companions[i], "/" + companion.name.substr(companion.name.find('.') + 1),
          {{"session", companion.name},
           {"type", companion.type},
           {"role", "companion"},
           {"precision", std::string(name_of(precision_))},
           {"observation", companion.element.text()}});
    }
    if (session.viewer.has_description() || session.viewer.has_frames()) {
      add_viewer_channels(session);
    }
  }

  void add_viewer_channels(WrittenSession& session) {
    const std::string& name = session.header.name;
    for (std::size_t i = 0; i < kNumViewerTopics; ++i) {
      const ViewerTopic& topic = viewer_topics()[i];
      session.viewer_channels[i] =
          add_channel("/" + name + "/" + std::string(topic.name), topic.type->name,
                      topic.type->definition, {{"role", "viewer"}, {"robot", name}});
    }
  }

  // Writes the record of the session, unless the file has it already. The documents come first, so
  // that readers find the documents of a session before its record.
  void announce(WrittenSession& session) {
    if (session.is_announced) return;
    const SessionHeader& header = session.header;
    for (const Document& document : header.documents) {
      const std::string name = header.name + "." + document.name;
      const auto known = documents_.find(name);
      if (known != documents_.end() && known->second == document.text) continue;
      writer_.write(mcap::Attachment{.log_time = log_time(wall_time()),
                                     .create_time = log_time(header.created),
                                     .name = name,
                                     .media_type = document.media_type,
                                     .data = document.text});
      documents_[name] = document.text;
    }
    const std::string id = std::to_string(header.session_id);
    if (!announced_.contains({header.name, id})) writer_.write(session_record(header));
    session.is_announced = true;
  }

  static std::uint64_t time_of(const SessionHeader& header, TimeIndex time_index,
                               const void* status) {
    if (!header.is_real_time) {
      return log_time(header.time_offset + time_index * header.period.count());
    }
    std::int64_t time;
    std::memcpy(&time, static_cast<const std::byte*>(status) + offsetof(Status, time),
                sizeof(time));
    return log_time(header.time_offset + time);
  }

  void write(WrittenStream& stream, std::span<const void* const> elements, std::uint64_t log_time,
             std::uint64_t publish_time) {
    stream.layout.encode(elements, stream.message.data());
    writer_.write(mcap::Message{.channel_id = stream.channel,
                                .log_time = log_time,
                                .publish_time = publish_time,
                                .data = stream.message});
  }

  Precision precision_;
  mcap::Compression compression_;
  double viewer_rate_;
  mcap::Writer writer_;
  bool is_begun_{false};
  Entries origin_;
  std::uint16_t event_channel_{0};
  std::vector<std::unique_ptr<WrittenSession>> sessions_;    // nullptr: the session has ended
  std::set<std::pair<std::string, std::string>> announced_;  // names and ids already in the file
  std::map<std::string, std::string> documents_;             // the newest of each name in the file
  std::map<std::string, std::vector<Document>> shown_documents_;  // by robot, as viewers know them
  std::map<std::string, std::string> shown_calibrations_;         // by robot
  std::deque<WaitingMessage> images_;
  std::size_t images_size_{0};  // bytes in `images_`
  std::vector<WaitingMessage> viewer_messages_;
  std::size_t viewer_size_{0};  // bytes in `viewer_messages_`
  bool is_viewer_due_{false};
};

LogWriter::LogWriter(mcap::Sink& sink, const LogOptions& options)
    : implementation_(std::make_unique<Implementation>(sink, options, nullptr)) {}
LogWriter::LogWriter(mcap::Sink& sink, const LogOptions& options, const mcap::Contents& contents)
    : implementation_(std::make_unique<Implementation>(sink, options, &contents)) {}
LogWriter::LogWriter(LogWriter&&) noexcept = default;
LogWriter& LogWriter::operator=(LogWriter&&) noexcept = default;
LogWriter::~LogWriter() = default;

std::size_t LogWriter::begin_session(const SessionHeader& header) {
  return implementation_->begin_session(header);
}
void LogWriter::write_steps(std::size_t session, const Steps& steps) {
  implementation_->write_steps(session, steps);
}
void LogWriter::write_companion(std::size_t session, std::size_t companion, TimeIndex first,
                                std::size_t count, const void* elements) {
  implementation_->write_companion(session, companion, first, count, elements);
}
void LogWriter::write_end(std::size_t session, TimeIndex time_index, const void* observation,
                          const Status& status) {
  implementation_->write_end(session, time_index, observation, status);
}
void LogWriter::end_session(std::size_t session, TimeIndex steps, const Fault& fault,
                            std::string_view fault_text) {
  implementation_->end_session(session, steps, fault, fault_text);
}
void LogWriter::write_gap(std::size_t session, TimeIndex first, TimeIndex last,
                          std::string_view reason) {
  implementation_->write_gap(session, implementation_->at(session).header.name, first, last,
                             reason);
}
void LogWriter::write_companion_gap(std::size_t session, std::size_t companion, TimeIndex first,
                                    TimeIndex last, std::string_view reason) {
  const SessionHeader& header = implementation_->at(session).header;
  implementation_->write_gap(session, header.companions.at(companion).name, first, last, reason);
}
void LogWriter::write_image(std::size_t session, Image image) {
  implementation_->write_image(session, std::move(image));
}
std::size_t LogWriter::waiting_images_size() const noexcept {
  return implementation_->waiting_images_size();
}
void LogWriter::write_event(Level level, std::string_view source, std::string_view text,
                            std::int64_t time) {
  implementation_->write_event(level, source, text, time);
}
void LogWriter::flush() { implementation_->flush(); }
void LogWriter::finish() { implementation_->finish(); }
std::size_t LogWriter::open_chunk_size() const noexcept {
  return implementation_->writer().open_chunk_size();
}

}  // namespace trifinger::log
