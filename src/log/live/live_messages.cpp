// SPDX-License-Identifier: BSD-3-Clause
#include "log/live_messages.hpp"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstring>
#include <limits>
#include <map>
#include <optional>
#include <span>
#include <string_view>
#include <utility>

#include "camera/image_file.hpp"
#include "log/format/session_messages.hpp"
#include "log/format/text.hpp"
#include "log/write/image_thread.hpp"
#include "trifinger/base/error.hpp"
#include "trifinger/base/time.hpp"
#include "trifinger/core/driver.hpp"
#include "trifinger/core/errors.hpp"
#include "trifinger/core/frontend.hpp"
#include "trifinger/core/session.hpp"
#include "trifinger/log/session_header.hpp"

namespace trifinger::log {

using namespace detail;

namespace {

// How often the next session is looked for.
constexpr Nanoseconds kLookPeriod = std::chrono::milliseconds(100);
// Messages of one series in one batch: a second of a robot at 1 kHz.
constexpr TimeIndex kMaxCount = 1000;
// Far below overflow, whatever a damaged file claims.
constexpr TimeIndex kEndless = TimeIndex{1} << 62U;
constexpr std::size_t kMaxImagesSize = std::size_t{16} << 20U;
constexpr std::size_t kEverything = std::numeric_limits<std::size_t>::max();
// The parts of "tf_static".
constexpr int kRobotPart = 0;
constexpr int kCameraPart = 1;

void require_rate(std::string_view what, double rate) {
  if (!std::isfinite(rate) || rate < 0) {
    throw InvalidArgument(std::string(what) + " is " + std::to_string(rate) +
                          " per second; it must be 0 or more");
  }
}

// Returns how many steps lie between two that are shown.
TimeIndex stride_of(Nanoseconds period, double rate) {
  if (rate <= 0 || period <= Nanoseconds::zero()) return 1;
  const double steps = 1e9 / rate / static_cast<double>(period.count());
  return static_cast<TimeIndex>(std::clamp(std::round(steps), 1.0, 1e12));
}

// A session that is shown.
struct ShownSession {
  struct Companion {
    Session session;
    UntypedFrontend series;
    std::vector<std::byte> element;
    TimeIndex next{-1};         // first element that was not read; -1 before the first one
    TimeIndex last_bucket{-1};  // of an element that was shown
  };

  Session session;
  UntypedFrontend robot;
  SessionMessages messages;
  std::vector<Companion> companions;
  TimeIndex stride;
  TimeIndex next{-1};  // first step that was not read; -1 before the first one
  bool is_described{false};
  bool has_end{false};
  Instant next_pose{};  // before step 0
  std::unique_ptr<ImageThread> images;
  std::vector<std::byte> desired_action;
  std::vector<std::byte> applied_action;
  std::vector<std::byte> observation;
  Status status;

  ShownSession(const Session& its_session, SessionHeader header,
               const std::vector<Session>& its_companions, const LiveOptions& options)
      : session(its_session),
        robot(its_session),
        messages(std::move(header), Precision::kDouble, options.viewer_rate),
        stride(stride_of(messages.header().period, options.rate)),
        desired_action(messages.header().types.action.size()),
        applied_action(messages.header().types.applied_action.size()),
        observation(messages.header().types.observation.size()) {
    for (std::size_t i = 0; i < its_companions.size(); ++i) {
      companions.push_back(
          {.session = its_companions[i],
           .series = UntypedFrontend(its_companions[i]),
           .element = std::vector<std::byte>(messages.header().companions[i].element.size())});
    }
  }

  [[nodiscard]] TimeIndex whole_steps() const {
    // The status is written last in each step, but the end has a status without a step.
    return std::min({robot.range(Series::kAppliedAction).second,
                     robot.range(Series::kStatus).second, kEndless});
  }

  // Copies step `t`. Returns false if it was overwritten.
  [[nodiscard]] bool read(TimeIndex t) {
    try {
      return robot.try_get(Series::kDesiredAction, t, desired_action.data()) &&
             robot.try_get(Series::kAppliedAction, t, applied_action.data()) &&
             robot.try_get(Series::kObservation, t, observation.data()) &&
             robot.try_get(Series::kStatus, t, &status);
    } catch (const HistoryLost&) {
      return false;
    }
  }
};

}  // namespace

class LiveMessages::Implementation {
 public:
  Implementation(const std::string& name, const LiveOptions& options)
      : name_(name), options_(options) {
    if (name.find('.') != std::string::npos) {
      throw InvalidArgument("'" + name + "' is a companion: name its robot, '" +
                            name.substr(0, name.find('.')) + "', which shows its companions, too");
    }
    require_rate("the rate", options.rate);
    require_rate("the rate of viewers", options.viewer_rate);
    if (options.jpeg_quality < 1 || options.jpeg_quality > 100) {
      throw InvalidArgument("the quality of JPEG is " + std::to_string(options.jpeg_quality) +
                            "; it must be 1 to 100");
    }
    event_channel_ = channel(std::string(kEventTopic), event_type().name, event_type().definition);
  }

  LiveBatch take() {
    LiveBatch batch;
    batch_ = &batch;
    if (!shown_) look_for_session();
    if (shown_) {
      try {
        show(*shown_);
      } catch (const InvalidArgument& error) {
        give_up(error);
      } catch (const IncompatibleSession& error) {
        give_up(error);
      }
    }
    batch_ = nullptr;
    return batch;
  }

  [[nodiscard]] const std::vector<LiveChannel>& channels() const noexcept { return channels_; }
  void want_images(bool wanted) noexcept { images_wanted_ = wanted; }
  [[nodiscard]] bool is_running() const noexcept { return shown_ != nullptr; }

 private:
  // --- finding sessions ---

  void look_for_session() {
    if (now() < next_look_) return;
    next_look_ = now() + kLookPeriod;
    try {
      const Session session = Session::open(name_);
      if (session.info().session_id == shown_id_) return;
      std::vector<Session> companions;
      for (const std::string& name : session.companion_names()) {
        companions.push_back(session.companion(name));
      }
      SessionHeader header = SessionHeader::of(session, companions);
      if (!header.is_real_time) {
        header.time_offset = std::max(header.time_offset, last_time_ + header.period.count());
      }
      shown_id_ = header.session_id;
      shown_ = std::make_unique<ShownSession>(session, std::move(header), companions, options_);
      declare(*shown_);
      error_.clear();
      report(Level::kInfo, "session " + std::to_string(shown_id_) + " is shown");
    } catch (const SessionNotFound&) {
      report_error(Level::kInfo, "is not running; waits for it");
    } catch (const RobotStopped&) {
      // The next session began during the look.
    } catch (const IncompatibleSession& error) {
      report_error(Level::kError, error.what());
    } catch (const SystemError& error) {
      report_error(Level::kError, error.what());
    }
  }

  void give_up(const Error& error) {
    report(Level::kError, std::string("is no longer shown: ") + error.what());
    shown_.reset();
  }

  // --- channels ---

  std::size_t channel(const std::string& topic, std::string_view type,
                      const std::string& definition) {
    const auto known = numbers_.find(topic);
    if (known != numbers_.end() && channels_[known->second].type == type &&
        channels_[known->second].definition == definition) {
      return known->second;
    }
    channels_.push_back({.topic = topic, .type = std::string(type), .definition = definition});
    return numbers_[topic] = channels_.size() - 1;
  }
  std::size_t channel(const std::string& topic, const MessageType& type) {
    return channel(topic, type.name, type.definition);
  }
  std::size_t channel(const SessionMessages::Stream& stream) {
    return channel(stream.topic, stream.layout.type(), stream.layout.definition());
  }
  std::size_t latched_channel(const std::string& topic, const MessageType& type) {
    const std::size_t number = channel(topic, type);
    channels_[number].is_latched = true;
    return number;
  }

  // Makes all channels, so that users can choose among them before the first message.
  void declare(const ShownSession& shown) {
    const SessionMessages& messages = shown.messages;
    channel(messages.step_stream());
    channel(messages.end_stream());
    for (const SessionMessages::Stream& stream : messages.companion_streams()) channel(stream);
    if (messages.viewer().has_description() || messages.viewer().has_frames()) {
      for (std::size_t i = 0; i < kNumViewerTopics; ++i) {
        const std::string topic = messages.topic_of(viewer_topics()[i].name);
        const MessageType& type = *viewer_topics()[i].type;
        if (i == kRobotDescription || i == kStaticFrames) {
          latched_channel(topic, type);
        } else {
          channel(topic, type);
        }
      }
    }
    if (!messages.cameras()) return;
    image_type_ = &compressed_image_type();
    try {
      camera::require_jpeg();
    } catch (const Error& error) {
      image_type_ = &raw_image_type();
      report(Level::kWarning, std::string("images are shown raw: ") + error.what());
    }
    for (std::size_t i = 0; i < messages.cameras()->cameras.size(); ++i) {
      channels_[channel(messages.image_topic(i), *image_type_)].is_image = true;
    }
    for (const SessionMessages::Typed& one : messages.camera_messages(0)) {
      latched_channel(one.topic, *one.type);
    }
  }

  // --- messages ---

  void add(std::size_t number, std::uint64_t time, std::span<const std::byte> data) {
    batch_->messages.push_back(
        {.channel = number, .log_time = time, .part = 0, .data = {data.begin(), data.end()}});
  }
  void add(std::size_t number, std::uint64_t time, std::vector<std::byte> data, int part) {
    batch_->messages.push_back(
        {.channel = number, .log_time = time, .part = part, .data = std::move(data)});
  }
  void add(const SessionMessages::Stream& stream, const SessionMessages::Message& message) {
    add(channel(stream), message.log_time, message.data);
  }
  void add(const ShownSession& shown, std::vector<ViewerMessage> messages) {
    for (ViewerMessage& message : messages) {
      const ViewerTopic& topic = viewer_topics()[message.topic];
      add(channel(shown.messages.topic_of(topic.name), *topic.type), log_time(message.time),
          std::move(message.data), kRobotPart);
    }
  }

  void report(Level level, const std::string& text) {
    const std::int64_t time = wall_time();
    add(event_channel_, log_time(time), event_message(level, name_, text, time), 0);
    batch_->events.push_back({.time = time, .level = level, .source = name_, .text = text});
  }
  // Reports an error that lasts, once.
  void report_error(Level level, const std::string& text) {
    if (std::exchange(error_, text) != text) report(level, text);
  }

  void show(ShownSession& shown) {
    // The fault is read first: then everything from before the end is seen below.
    const std::optional<Fault> fault = shown.robot.fault();
    const TimeIndex end = shown.whole_steps();
    // Companions come first, because the messages for viewers of a step need their elements.
    for (std::size_t i = 0; i < shown.companions.size(); ++i) show_companion(shown, i);
    if (end == 0) {
      shown.next = 0;  // all that comes is new
      show_pose(shown);
    } else {
      show_steps(shown, end);
    }
    if (fault && !std::exchange(shown.has_end, true)) show_end(shown, end, *fault);
    show_images(shown);
    if (fault && !shown.images) {
      if (!shown.messages.header().is_real_time) {
        last_time_ =
            shown.messages.header().time_offset + end * shown.messages.header().period.count();
      }
      shown_.reset();
    }
  }

  // Shows what does not move: once, and again when the documents change.
  void describe(ShownSession& shown, std::int64_t time) {
    if (std::exchange(shown.is_described, true)) return;
    const SessionHeader& header = shown.messages.header();
    if (std::exchange(shown_documents_, header.documents) == header.documents) return;
    add(shown, shown.messages.viewer().still(time));
    for (SessionMessages::Typed& message : shown.messages.camera_messages(time)) {
      add(channel(message.topic, *message.type), log_time(time), std::move(message.data),
          kCameraPart);
    }
    for (const std::string& mistake : shown.messages.viewer().mistakes()) {
      report(Level::kWarning, mistake);
    }
  }

  // Shows where the robot is before its first step.
  void show_pose(ShownSession& shown) {
    if (options_.viewer_rate <= 0 || now() < shown.next_pose) return;
    const SessionHeader& header = shown.messages.header();
    const bool is_again = shown.next_pose != Instant();
    // Outside real-time mode the time stands still.
    if (is_again && !header.is_real_time) return;
    try {
      shown.robot.latest_observation(shown.observation.data(), Nanoseconds::zero());
    } catch (const TimedOut&) {
      return;
    } catch (const RobotStopped&) {
      return;
    }
    shown.next_pose = now() + Nanoseconds(std::llround(1e9 / options_.viewer_rate));
    const std::int64_t time =
        stamp_time(header, 0, std::chrono::steady_clock::now().time_since_epoch().count());
    describe(shown, time);
    add(shown, shown.messages.viewer().at(time, shown.observation.data()));
  }

  void show_steps(ShownSession& shown, TimeIndex end) {
    if (shown.next < 0) {
      // A robot that stands still is seen, too, so the newest step is shown in any case.
      shown.next = end;
      if (shown.read(end - 1)) show_step(shown, end - 1, true);
      return;
    }
    if (const TimeIndex oldest = end - kMaxCount * shown.stride; shown.next < oldest) {
      skip_to(shown, oldest);
    }
    for (; shown.next < end; ++shown.next) {
      const TimeIndex t = shown.next;
      const bool is_wanted = t % shown.stride == 0;
      if (!is_wanted && !shown.messages.viewer().shows(t)) continue;
      if (!shown.read(t)) {
        skip_to(shown, std::max(end - 1, t + 1));
        --shown.next;
        continue;
      }
      show_step(shown, t, is_wanted);
    }
  }

  void skip_to(ShownSession& shown, TimeIndex step) {
    batch_->lost += std::max<TimeIndex>((step - shown.next) / shown.stride, 1);
    shown.next = step;
  }

  void show_step(ShownSession& shown, TimeIndex t, bool is_wanted) {
    const SessionMessages::Message message =
        shown.messages.step(t, &shown.status, shown.observation.data(), shown.applied_action.data(),
                            shown.desired_action.data());
    const auto time = static_cast<std::int64_t>(message.log_time);
    const bool is_first = !shown.is_described;
    describe(shown, time);
    if (is_wanted) add(shown.messages.step_stream(), message);
    if (options_.viewer_rate > 0 && (is_first || shown.messages.viewer().shows(t))) {
      add(shown, shown.messages.viewer().at(time, shown.observation.data()));
    }
  }

  void show_companion(ShownSession& shown, std::size_t index) {
    ShownSession::Companion& companion = shown.companions[index];
    const TimeIndex end = std::min(companion.series.range(Series::kObservation).second, kEndless);
    if (companion.next < 0) companion.next = std::max<TimeIndex>(end - 1, 0);
    if (companion.next < end - kMaxCount) skip_to(companion, end - kMaxCount);
    for (; companion.next < end; ++companion.next) {
      if (!read(companion)) {
        skip_to(companion, std::max(end - 1, companion.next + 1));
        --companion.next;
        continue;
      }
      Stamp stamp;
      std::memcpy(&stamp, companion.element.data(), sizeof(stamp));
      // At most one element is shown per step that is shown.
      const TimeIndex bucket = stamp.arrival_index / shown.stride;
      const bool is_wanted = options_.rate <= 0 || bucket != companion.last_bucket;
      companion.last_bucket = bucket;
      if (is_wanted) {
        add(shown.messages.companion_streams()[index],
            shown.messages.companion(index, companion.next, companion.element.data()));
      } else {
        shown.messages.see(index, companion.element.data());
      }
    }
  }

  static bool read(ShownSession::Companion& companion) {
    try {
      return companion.series.try_get(Series::kObservation, companion.next,
                                      companion.element.data());
    } catch (const HistoryLost&) {
      return false;
    }
  }

  void skip_to(ShownSession::Companion& companion, TimeIndex element) const {
    batch_->lost += element - companion.next;
    companion.next = element;
  }

  void show_end(ShownSession& shown, TimeIndex steps, const Fault& fault) {
    const std::string text = shown.session.info().fault_text;
    if (shown.robot.range(Series::kStatus).second > steps) {
      try {
        if (shown.robot.try_get(Series::kStatus, steps, &shown.status)) {
          const bool has_observation =
              shown.robot.range(Series::kObservation).second > steps &&
              shown.robot.try_get(Series::kObservation, steps, shown.observation.data());
          add(shown.messages.end_stream(),
              shown.messages.end(steps, has_observation ? shown.observation.data() : nullptr,
                                 shown.status));
        }
      } catch (const HistoryLost&) {
        // Nobody writes after the end, so the file of the session is damaged.
      }
    }
    report(fault.needs_recovery() ? Level::kError : Level::kInfo, text);
  }

  void show_images(ShownSession& shown) {
    const std::optional<SessionCameras>& cameras = shown.messages.cameras();
    if (!cameras) return;
    if (!shown.images) {
      if (!images_wanted_ || shown.has_end) return;
      const ShownSession::Companion& companion = shown.companions[cameras->companion];
      const TimeIndex end = companion.series.range(Series::kObservation).second;
      const ImageOptions options{
          .storage = image_type_ == &raw_image_type() ? ImageStorage::kRaw : ImageStorage::kJpeg,
          .quality = options_.jpeg_quality,
          .max_size = kMaxImagesSize};
      shown.images =
          std::make_unique<ImageThread>(companion.session, shown.messages.header(), *cameras,
                                        options, std::max<TimeIndex>(end - 1, 0));
    }
    if (shown.has_end || !images_wanted_) shown.images->request_end();
    const bool is_over = shown.images->has_ended();
    ImageThread::Taken taken = shown.images->take(kEverything);
    batch_->lost += taken.left_out;
    if (!taken.error.empty()) report_error(Level::kError, "images are missing: " + taken.error);
    for (LogWriter::Image& image : taken.images) {
      const std::int64_t time = image.time + shown.messages.header().time_offset;
      set_time(image.message, time);
      add(channel(shown.messages.image_topic(image.camera), *image_type_), log_time(time),
          std::move(image.message), 0);
    }
    if (is_over) shown.images.reset();
  }

  std::string name_;
  LiveOptions options_;
  std::vector<LiveChannel> channels_;
  std::map<std::string, std::size_t> numbers_;  // of the newest channel of each topic
  std::size_t event_channel_{0};
  bool images_wanted_{false};
  const MessageType* image_type_{nullptr};

  LiveBatch* batch_{nullptr};  // during `take`
  std::unique_ptr<ShownSession> shown_;
  std::uint64_t shown_id_{0};
  std::vector<Document> shown_documents_;
  std::int64_t last_time_{0};  // of the session before, outside real-time mode
  std::string error_;
  Instant next_look_{};
};

LiveMessages::LiveMessages(const std::string& name, const LiveOptions& options)
    : implementation_(std::make_unique<Implementation>(name, options)) {}
LiveMessages::~LiveMessages() = default;

LiveBatch LiveMessages::take() { return implementation_->take(); }
const std::vector<LiveChannel>& LiveMessages::channels() const noexcept {
  return implementation_->channels();
}
void LiveMessages::want_images(bool wanted) noexcept { implementation_->want_images(wanted); }
bool LiveMessages::is_running() const noexcept { return implementation_->is_running(); }

}  // namespace trifinger::log
