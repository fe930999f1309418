// SPDX-License-Identifier: BSD-3-Clause
#include "log/log_writer.hpp"

#include <sys/utsname.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <deque>
#include <optional>
#include <set>
#include <utility>

#include "base/moved.hpp"
#include "log/format/format.hpp"
#include "log/format/image_messages.hpp"
#include "log/format/records.hpp"
#include "log/format/session_messages.hpp"
#include "log/format/text.hpp"
#include "trifinger/base/error.hpp"
#include "trifinger/mcap/reader.hpp"

namespace trifinger::log {

using namespace detail;

namespace {

constexpr std::string_view kLibrary = "trifinger " TRIFINGER_VERSION;

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

struct WrittenSession {
  SessionMessages messages;
  std::uint16_t step_channel{0};
  std::uint16_t end_channel{0};
  std::vector<std::uint16_t> companion_channels;
  std::array<std::uint16_t, kNumViewerTopics> viewer_channels{};
  bool is_announced{false};
  bool has_shown_cameras{false};
  bool is_shown{false};        // true: viewers have its description
  TimeIndex observations{-1};  // known from the end on

  WrittenSession(const SessionHeader& header, Precision precision, double viewer_rate)
      : messages(header, precision, viewer_rate) {}
  [[nodiscard]] const SessionHeader& header() const noexcept { return messages.header(); }
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
               {"created", trifinger::detail::utc_text(wall_seconds(), "%FT%TZ")},
               {"part", std::to_string(options.part)},
               {"recording", options.recording.empty() ? random_id() : options.recording},
               {"precision", std::string(name_of(precision_))}};
    event_channel_ = add_channel(kEventTopic, event_type().name, event_type().definition, {});
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
      return session != nullptr && session->header().name == header.name &&
             session->header().session_id == header.session_id;
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
    const RobotTypes& types = session.header().types;
    const auto* desired = static_cast<const std::byte*>(steps.desired_actions);
    const auto* applied = static_cast<const std::byte*>(steps.applied_actions);
    const auto* observation = static_cast<const std::byte*>(steps.observations);
    const auto* status = static_cast<const std::byte*>(steps.statuses);
    for (std::size_t i = 0; i < steps.count; ++i) {
      const TimeIndex index = steps.first + static_cast<TimeIndex>(i);
      const SessionMessages::Message message =
          session.messages.step(index, status, observation, applied, desired);
      write(session.step_channel, message);
      if (session.messages.viewer().shows(index)) show_step(session, message.log_time, observation);
      desired += types.action.size();
      applied += types.applied_action.size();
      observation += types.observation.size();
      status += sizeof(Status);
    }
  }

  void write_companion(std::size_t number, std::size_t companion, TimeIndex first,
                       std::size_t count, const void* elements) {
    WrittenSession& session = at(number);
    const auto* element = static_cast<const std::byte*>(elements);
    for (std::size_t i = 0; i < count; ++i) {
      write(session.companion_channels[companion],
            session.messages.companion(companion, first + static_cast<TimeIndex>(i), element));
      element += session.header().companions[companion].element.size();
    }
  }

  void write_end(std::size_t number, TimeIndex time_index, const void* observation,
                 const Status& status) {
    WrittenSession& session = at(number);
    write(session.end_channel, session.messages.end(time_index, observation, status));
    session.observations = time_index + (observation != nullptr ? 1 : 0);
  }

  void end_session(std::size_t number, TimeIndex steps, const Fault& fault,
                   std::string_view fault_text) {
    const WrittenSession& session = at(number);
    const TimeIndex observations = session.observations < 0 ? steps : session.observations;
    writer_.write(end_record(session.header(), steps, observations, fault, fault_text));
    // Released now, because sessions may come and go for days.
    sessions_[number].reset();
  }

  void write_gap(std::size_t number, const std::string& name, TimeIndex first, TimeIndex last,
                 std::string_view reason) {
    writer_.write(gap_record(name, at(number).header().session_id, first, last, reason));
  }

  void write_event(Level level, std::string_view source, std::string_view text, std::int64_t time) {
    const std::vector<std::byte> message = event_message(level, source, text, time);
    writer_.write(mcap::Message{.channel_id = event_channel_,
                                .log_time = log_time(time),
                                .publish_time = log_time(time),
                                .data = message});
  }

  void write_image(std::size_t number, Image image) {
    WrittenSession& session = at(number);
    const std::optional<SessionCameras>& cameras = session.messages.cameras();
    if (!cameras || image.camera >= cameras->cameras.size()) {
      throw InvalidArgument("'" + session.header().name + "' has no camera " +
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
    show(session, session.messages.viewer().at(static_cast<std::int64_t>(time), observation));
  }

  // Writes the frames that do not move: once in a file, and again when the documents change.
  void show_still(WrittenSession& session, std::uint64_t time) {
    if (session.is_shown) return;
    session.is_shown = true;
    const ViewerMessages& viewer = session.messages.viewer();
    std::vector<ViewerMessage> messages = viewer.still(static_cast<std::int64_t>(time));
    std::vector<Document>& known = shown_documents_[session.header().name];
    if (known == session.header().documents) return;
    known = session.header().documents;
    show(session, std::move(messages));
    is_viewer_due_ = true;
    for (const std::string& mistake : viewer.mistakes()) {
      write_event(Level::kWarning, session.header().name, mistake, static_cast<std::int64_t>(time));
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
    const SessionHeader& header = session.header();
    std::string text;
    for (const Document& document : header.documents) {
      if (document.name == camera::kDocument) text = document.text;
    }
    if (std::exchange(shown_calibrations_[header.name], text) == text) return;
    for (SessionMessages::Typed& message : session.messages.camera_messages(time)) {
      const std::uint16_t channel =
          add_channel(message.topic, message.type->name, message.type->definition,
                      {{"role", "viewer"}, {"robot", header.name}});
      viewer_size_ += message.data.size();
      viewer_messages_.push_back({.channel = channel,
                                  .sequence = 0,
                                  .time = log_time(time),
                                  .data = std::move(message.data)});
    }
    is_viewer_due_ = true;
  }

  std::uint16_t image_channel(const WrittenSession& session, const Image& image) {
    const std::string& robot = session.header().name;
    const std::string& camera = session.messages.cameras()->cameras[image.camera].name;
    const MessageType& type = image.is_compressed ? compressed_image_type() : raw_image_type();
    return add_channel(session.messages.image_topic(image.camera), type.name, type.definition,
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
    const SessionHeader& header = session.header();
    const SessionMessages& messages = session.messages;
    const RobotTypes& types = header.types;
    Entries metadata{{"session", header.name},
                     {"type", types.type},
                     {"precision", std::string(name_of(precision_))},
                     {"status", describe<Status>().text()},
                     {"observation", types.observation.text()}};
    const auto add = [this](const SessionMessages::Stream& stream, Entries entries) {
      return add_channel(stream.topic, stream.layout.type(), stream.layout.definition(),
                         std::move(entries));
    };
    metadata["role"] = "end";
    session.end_channel = add(messages.end_stream(), metadata);
    metadata["role"] = "step";
    metadata["applied_action"] = types.applied_action.text();
    metadata["action"] = types.action.text();
    metadata["default_action"] = hexadecimal(types.default_action);
    session.step_channel = add(messages.step_stream(), metadata);
    for (std::size_t i = 0; i < header.companions.size(); ++i) {
      const SessionHeader::Companion& companion = header.companions[i];
      session.companion_channels.push_back(
          add(messages.companion_streams()[i], {{"session", companion.name},
                                                {"type", companion.type},
                                                {"role", "companion"},
                                                {"precision", std::string(name_of(precision_))},
                                                {"observation", companion.element.text()}}));
    }
    if (messages.viewer().has_description() || messages.viewer().has_frames()) {
      add_viewer_channels(session);
    }
  }

  void add_viewer_channels(WrittenSession& session) {
    for (std::size_t i = 0; i < kNumViewerTopics; ++i) {
      const ViewerTopic& topic = viewer_topics()[i];
      session.viewer_channels[i] = add_channel(
          session.messages.topic_of(topic.name), topic.type->name, topic.type->definition,
          {{"role", "viewer"}, {"robot", session.header().name}});
    }
  }

  // Writes the record of the session, unless the file has it already. The documents come first, so
  // that readers find the documents of a session before its record.
  void announce(WrittenSession& session) {
    if (session.is_announced) return;
    const SessionHeader& header = session.header();
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

  void write(std::uint16_t channel, const SessionMessages::Message& message) {
    writer_.write(mcap::Message{.channel_id = channel,
                                .log_time = message.log_time,
                                .publish_time = message.publish_time,
                                .data = message.data});
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
  return checked(implementation_)->begin_session(header);
}
void LogWriter::write_steps(std::size_t session, const Steps& steps) {
  checked(implementation_)->write_steps(session, steps);
}
void LogWriter::write_companion(std::size_t session, std::size_t companion, TimeIndex first,
                                std::size_t count, const void* elements) {
  checked(implementation_)->write_companion(session, companion, first, count, elements);
}
void LogWriter::write_end(std::size_t session, TimeIndex time_index, const void* observation,
                          const Status& status) {
  checked(implementation_)->write_end(session, time_index, observation, status);
}
void LogWriter::end_session(std::size_t session, TimeIndex steps, const Fault& fault,
                            std::string_view fault_text) {
  checked(implementation_)->end_session(session, steps, fault, fault_text);
}
void LogWriter::write_gap(std::size_t session, TimeIndex first, TimeIndex last,
                          std::string_view reason) {
  checked(implementation_)
      ->write_gap(session, checked(implementation_)->at(session).header().name, first, last,
                  reason);
}
void LogWriter::write_companion_gap(std::size_t session, std::size_t companion, TimeIndex first,
                                    TimeIndex last, std::string_view reason) {
  const SessionHeader& header = checked(implementation_)->at(session).header();
  checked(implementation_)
      ->write_gap(session, header.companions.at(companion).name, first, last, reason);
}
void LogWriter::write_image(std::size_t session, Image image) {
  checked(implementation_)->write_image(session, std::move(image));
}
std::size_t LogWriter::waiting_images_size() const noexcept {
  return checked(implementation_)->waiting_images_size();
}
void LogWriter::write_event(Level level, std::string_view source, std::string_view text,
                            std::int64_t time) {
  checked(implementation_)->write_event(level, source, text, time);
}
void LogWriter::flush() { checked(implementation_)->flush(); }
void LogWriter::finish() { checked(implementation_)->finish(); }
std::size_t LogWriter::open_chunk_size() const noexcept {
  return checked(implementation_)->writer().open_chunk_size();
}

}  // namespace trifinger::log
