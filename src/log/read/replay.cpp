// SPDX-License-Identifier: BSD-3-Clause
#include "log/replay.hpp"

#include <algorithm>
#include <array>
#include <cstring>
#include <limits>
#include <string>
#include <utility>

#include "camera/image_file.hpp"
#include "log/format/extra_series.hpp"
#include "log/format/image_messages.hpp"
#include "log/logged_images.hpp"
#include "trifinger/base/error.hpp"
#include "trifinger/camera/images.hpp"
#include "trifinger/core/status.hpp"

namespace trifinger::log {

using namespace detail;

namespace {

constexpr std::uint64_t kMaxSize = std::uint64_t{4} << 30U;

// Stands for the action "hold". A back-end applies actions before step 0, too, and does not mark
// them. No other action consists of these bytes.
constexpr std::byte kHoldByte{0xf5};

std::vector<std::byte> read(const LoggedSession& session, Series series, TimeIndex first,
                            TimeIndex count) {
  std::vector<std::byte> bytes(session.element(series).size() * static_cast<std::size_t>(count));
  session.get(series, first, static_cast<std::size_t>(count), bytes.data());
  return bytes;
}

// True if the first image of a log is one.
bool is_jpeg(const LoggedCameras& cameras) {
  const auto [first, end] = cameras.range();
  for (TimeIndex i = first; i < end; ++i) {
    try {
      const LoggedImages images = cameras.at(i);
      for (std::size_t camera = 0; camera < images.cameras().size(); ++camera) {
        if (images.has(camera)) return images.recorded(camera).encoding == kJpegImages;
      }
    } catch (const NotInLog&) {  // NOLINT(bugprone-empty-catch): a gap has no images
    }
  }
  return false;
}

template <class Vector>
auto* at(Vector& bytes, std::size_t size, TimeIndex t) noexcept {
  return bytes.data() + static_cast<std::size_t>(t) * size;
}

}  // namespace

ReplayDriver::ReplayDriver(const LoggedSession& session, const ReplayOptions& options)
    : types_(session.header().types),
      period_(session.header().period),
      documents_(session.header().documents),
      recorded_end_(static_cast<std::int32_t>(session.fault().code)) {
  if (session.is_companion()) {
    throw InvalidArgument("'" + session.name() + "' is a companion; replay its robot");
  }
  if (!session.has_elements())
    throw InvalidArgument("the log has no step of '" + session.name() + "'");
  const auto [oldest, end] = session.range(Series::kAppliedAction);
  const TimeIndex first = options.first.value_or(oldest);
  const TimeIndex last = std::min(options.last.value_or(end), end);
  if (first < oldest || first >= last) {
    throw InvalidArgument("the steps " + std::to_string(first) + " to " +
                          std::to_string(options.last.value_or(end) - 1) + " of '" +
                          session.name() + "' cannot be replayed: the log has " +
                          std::to_string(oldest) + " to " + std::to_string(end - 1));
  }
  steps_ = last - first;
  // If the last observation is missing, the replay ends one step earlier.
  if (session.range(Series::kObservation).second <= last) --steps_;
  if (steps_ < 1)
    throw InvalidArgument("the log has a single step, without the observation after it");
  const std::uint64_t step_size = types_.observation.size() + types_.action.size() +
                                  types_.applied_action.size() + sizeof(Status);
  if (static_cast<std::uint64_t>(steps_) > kMaxSize / step_size) {
    throw InvalidArgument("these are " + std::to_string(steps_) +
                          " steps, more than fit into 4 GiB; replay a part of them");
  }
  observations_ = read(session, Series::kObservation, first, steps_ + 1);
  desired_actions_ = read(session, Series::kDesiredAction, first, steps_);
  applied_actions_ = read(session, Series::kAppliedAction, first, steps_);
  statuses_.resize(static_cast<std::size_t>(steps_));
  session.get({Series::kStatus, {}}, first, statuses_.size(), statuses_.data());
  hold_action_.assign(types_.action.size(), kHoldByte);
  for (const LoggedSession& companion : session.companions()) {
    if (!is_extra(types_.type, companion.type())) load_companion(companion, first);
  }
  load_images(session, options.images_of);
}

ReplayDriver::~ReplayDriver() = default;

// The images of a log on their way into the memory that readers share.
struct ReplayDriver::Images {
  Images(const LoggedSession& session, std::size_t its_companion, camera::ImageWriter its_writer)
      : cameras(session),
        companion(its_companion),
        writer(std::move(its_writer)),
        frames(cameras.calibration().cameras.size()),
        element(writer.element_size()) {}

  // Fills in where the pixels of element `index` lie, and the times of the new session.
  void show(TimeIndex index, Nanoseconds capture, std::byte* target) {
    const LoggedImages logged = cameras.at(index);
    const auto places = writer.begin();
    const std::int64_t newest = *std::ranges::max_element(logged.times());
    for (std::size_t i = 0; i < frames.size(); ++i) {
      frames[i] = logged.infos()[i].frame();
      frames[i].time = Instant(capture - Nanoseconds(newest - logged.times()[i]));
      if (frames[i].state != camera::Frame::State::kGood) continue;
      try {
        std::ranges::copy(logged.pixels(i), places[i].begin());
      } catch (const Error&) {
        frames[i].state = camera::Frame::State::kNone;  // not recorded, or damaged
      }
    }
    commit(target);
  }

  // The file has changed meanwhile: these images have not come.
  void show_none(std::byte* target) noexcept {
    for (camera::Frame& frame : frames) frame = {};
    commit(target);
  }

  // All but the stamp.
  void commit(std::byte* target) noexcept {
    writer.commit(frames, element);
    std::memcpy(target + sizeof(Stamp), element.data() + sizeof(Stamp),
                element.size() - sizeof(Stamp));
  }

  LoggedCameras cameras;
  std::size_t companion;  // number among the companions
  camera::ImageWriter writer;
  std::vector<camera::Frame> frames;
  std::vector<std::byte> element;
};

void ReplayDriver::load_images(const LoggedSession& session, const std::string& images_of) {
  const auto found =
      std::ranges::find(descriptions_, camera::kCompanion, &CompanionDescription::name);
  const std::optional<SessionCameras> known = cameras_of(session.header());
  if (found == descriptions_.end() || !known) return;
  const std::vector<camera::Camera>& cameras = known->cameras;
  if (is_jpeg(LoggedCameras(session))) camera::require_jpeg();
  found->payload = camera::image_payload(cameras);
  images_ =
      std::make_unique<Images>(session, static_cast<std::size_t>(found - descriptions_.begin()),
                               images_of.empty() ? camera::ImageWriter::anonymous(cameras)
                                                 : camera::ImageWriter(images_of, cameras));
}

void ReplayDriver::load_companion(const LoggedSession& companion, TimeIndex first) {
  if (!companion.has_elements()) return;
  constexpr std::size_t kBatch = 256;
  const std::size_t size = companion.element(Series::kObservation).size();
  SeriesReader reader = companion.read({{Series::kObservation, {}}});
  std::vector<TimeIndex> indices(kBatch);
  std::vector<std::byte> batch(kBatch * size);
  const std::array<void*, 1> column{batch.data()};

  // Copies elements from the newest one that is known at the first step on.
  CompanionElements elements{.size = size, .bytes = {}};
  TimeIndex before = -1;
  for (std::size_t count = kBatch; count == kBatch;) {
    count = reader.read(kBatch, {.indices = indices.data(), .columns = column});
    for (std::size_t i = 0; i < count; ++i) {
      std::byte* const element = batch.data() + i * size;
      Stamp stamp;
      std::memcpy(&stamp, element, sizeof(stamp));
      if (stamp.arrival_index > first + steps_) continue;
      if (stamp.arrival_index <= first) {
        elements.bytes.clear();
      } else if (!elements.bytes.empty() && indices[i] != before + 1) {
        throw NotInLog("the log of '" + companion.name() + "' lacks elements " +
                       std::to_string(before + 1) + " to " + std::to_string(indices[i] - 1) +
                       ", which the part to be replayed needs");
      }
      if (elements.bytes.empty()) elements.first = indices[i];
      before = indices[i];
      stamp.arrival_index = std::max<TimeIndex>(stamp.arrival_index - first, -1);
      stamp.capture_index -= first;
      stamp.capture_time = 0;  // The clock of the new back-end is another one.
      std::memcpy(element, &stamp, sizeof(stamp));
      elements.bytes.insert(elements.bytes.end(), element, element + size);
    }
  }
  companions_.push_back(std::move(elements));
  descriptions_.push_back({.name = companion.name().substr(companion.name().find('.') + 1),
                           .type = companion.type(),
                           .element = companion.element(Series::kObservation)});
}

DriverReport ReplayDriver::prepare(TimeIndex) noexcept {
  t_ = 0;
  for (CompanionElements& companion : companions_) companion.next = 0;
  return DriverReport::ready();
}

DriverReport ReplayDriver::get_latest_observation(void* observation) noexcept {
  const std::size_t size = types_.observation.size();
  std::memcpy(observation, at(observations_, size, t_), size);
  if (t_ == steps_) {
    DriverReport report = DriverReport::end();
    report.fault_code = recorded_end_;
    return report;
  }
  const Status& status = statuses_[static_cast<std::size_t>(t_)];
  return {.measurement_age = status.measurement_age, .lost_frames = status.lost_frames};
}

DriverReport ReplayDriver::apply_action(const void* desired, void* applied) noexcept {
  const std::size_t size = types_.action.size();
  const std::size_t applied_size = types_.applied_action.size();
  std::memcpy(applied, at(applied_actions_, applied_size, t_), applied_size);
  if (std::memcmp(desired, hold_action_.data(), size) == 0) return DriverReport::ready();
  const bool is_recorded = std::memcmp(desired, at(desired_actions_, size, t_), size) == 0;
  const bool was_rejected =
      (statuses_[static_cast<std::size_t>(t_)].flags & Status::kActionRejected) != 0;
  ++t_;
  return {.action_rejected = was_rejected || !is_recorded};
}

DriverReport ReplayDriver::hold(const void*, void* action) noexcept {
  std::memcpy(action, hold_action_.data(), hold_action_.size());
  return DriverReport::ready();
}

DriverReport ReplayDriver::stop(TimeIndex) noexcept { return DriverReport::ready(); }

bool ReplayDriver::get_companion_element(std::size_t index, TimeIndex time_index,
                                         void* element) noexcept {
  CompanionElements& companion = companions_[index];
  const std::size_t offset = companion.next * companion.size;
  if (offset >= companion.bytes.size()) return false;
  Stamp stamp;
  std::memcpy(&stamp, companion.bytes.data() + offset, sizeof(stamp));
  if (stamp.arrival_index > time_index) return false;
  std::memcpy(element, companion.bytes.data() + offset, companion.size);
  if (images_ != nullptr && images_->companion == index) {
    try {
      images_->show(companion.first + static_cast<TimeIndex>(companion.next),
                    period_ * std::max<TimeIndex>(stamp.capture_index, 0),
                    static_cast<std::byte*>(element));
    } catch (...) {
      images_->show_none(static_cast<std::byte*>(element));
    }
  }
  ++companion.next;
  return true;
}

BackendOptions ReplayDriver::backend_options() const noexcept {
  return {.mode = BackendOptions::Mode::kNonRealTime,
          .period = period_,
          .max_rejected_actions = std::numeric_limits<std::uint32_t>::max()};
}

SessionOptions ReplayDriver::session_options() const { return {.documents = documents_}; }

}  // namespace trifinger::log
