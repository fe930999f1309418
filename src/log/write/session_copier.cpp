// SPDX-License-Identifier: BSD-3-Clause
#include "log/write/session_copier.hpp"

#include <algorithm>
#include <chrono>
#include <cstring>
#include <limits>
#include <utility>

#include "camera/image_file.hpp"
#include "trifinger/core/errors.hpp"
#include "trifinger/core/payload.hpp"

namespace trifinger::log::detail {
namespace {

// Chunks are closed above this size: large enough to compress well.
constexpr std::size_t kChunkSize = LogWriter::kMaxChunkSize / 2;
// Number of bytes that are read at once.
constexpr std::size_t kBatchSize = std::size_t{128} << 10U;
// Far below overflow, whatever a damaged file claims.
constexpr TimeIndex kEndless = TimeIndex{1} << 62U;
constexpr std::size_t kEverything = std::numeric_limits<std::size_t>::max();

std::vector<UntypedFrontend> observe_all(const std::vector<Session>& sessions) {
  std::vector<UntypedFrontend> observers;
  observers.reserve(sessions.size());
  for (const Session& session : sessions) observers.emplace_back(session);
  return observers;
}

std::string loss_text(const std::string& what, TimeIndex first, TimeIndex last,
                      const std::string& name) {
  const std::string which = first == last
                                ? what + " " + std::to_string(first) + " of " + name + " is"
                                : what + "s " + std::to_string(first) + " to " +
                                      std::to_string(last) + " of " + name + " are";
  return which + " not in the log: overwritten before being recorded";
}

// Flushes if `bytes` more do not fit: then adding them needs no write to the disk.
void make_room(LogWriter& log, std::size_t bytes) {
  if (log.open_chunk_size() > 0 && log.open_chunk_size() + bytes > kChunkSize) log.flush();
}

constexpr std::string_view kOverwritten = "overwritten before it was recorded";

}  // namespace

SessionCopier::SessionCopier(const Session& robot, const std::vector<Session>& companions,
                             std::shared_ptr<std::atomic<TimeIndex>> next_step,
                             const ImageOptions& images, Report report)
    : session_(robot),
      companion_sessions_(companions),
      report_(std::move(report)),
      robot_(robot),
      header_(SessionHeader::of(robot, companions)),
      next_step_(std::move(next_step)),
      image_options_(images),
      cameras_(images.storage == ImageStorage::kNone ? std::nullopt : cameras_of(header_)) {
  std::vector<UntypedFrontend> observers = observe_all(companions);
  for (std::size_t i = 0; i < observers.size(); ++i) {
    const std::size_t size = header_.companions[i].element.size();
    companions_.push_back({.series = std::move(observers[i]),
                           .element_size = size,
                           .elements = std::vector<std::byte>(std::max(size, kBatchSize))});
  }
  if (cameras_) {
    // Images from before the recorder knew of the session are not left out.
    constexpr TimeIndex kPayloads = PayloadWriter::kDefaultHistory;
    const UntypedFrontend& elements = companions_[cameras_->companion].series;
    first_images_ = elements.range(Series::kObservation).second - kPayloads;
  }
  const RobotTypes& types = header_.types;
  const std::size_t step_size =
      types.action.size() + types.applied_action.size() + types.observation.size() + sizeof(Status);
  batch_ = std::max<std::size_t>(kBatchSize / step_size, 1);
  desired_actions_.resize(batch_ * types.action.size());
  applied_actions_.resize(batch_ * types.applied_action.size());
  observations_.resize(batch_ * types.observation.size());
  statuses_.resize(batch_ * sizeof(Status));
}

void SessionCopier::go_on_at(const RecordedPosition& position, bool is_same_recording) {
  has_time_ = true;
  is_fresh_ = !is_same_recording && !has_all_since(position.next_step);
  if (!is_fresh_) first_images_ = 0;
  set_next(position.next_step);
  for (std::size_t i = 0; i < companions_.size(); ++i) {
    const auto found = position.next_elements.find(header_.companions[i].name);
    if (found != position.next_elements.end()) companions_[i].next = found->second;
  }
  header_.time_offset = position.time_offset;
  has_end_ = position.has_end;
  is_done_ = position.is_closed;
}

void SessionCopier::begin_after(std::int64_t time) noexcept {
  if (!header_.is_real_time && !has_time_) {
    header_.time_offset = std::max(header_.time_offset, time + header_.period.count());
  }
  has_time_ = true;
}

std::int64_t SessionCopier::last_time() const noexcept {
  if (header_.is_real_time) return 0;
  return header_.time_offset + next_step() * header_.period.count();
}

TimeIndex SessionCopier::next_step() const noexcept { return next_; }

void SessionCopier::set_next(TimeIndex step) noexcept {
  next_ = step;
  publish_next();
}

// Outside real-time mode the back-end waits for images, too.
void SessionCopier::publish_next() noexcept {
  TimeIndex step = next_;
  if (images_) {
    const TimeIndex read = images_->next();
    while (!unread_images_.empty() && unread_images_.front().element < read) {
      unread_images_.pop_front();
    }
    if (!unread_images_.empty()) step = std::min(step, unread_images_.front().arrival);
  }
  // release: after this, the back-end may overwrite what was read.
  next_step_->store(std::max<TimeIndex>(step, 0), std::memory_order_release);
}

void SessionCopier::give_up() noexcept {
  is_done_ = true;
  unread_images_.clear();
  set_next(kEndless);
  images_.reset();
}

TimeIndex SessionCopier::whole_steps() const {
  // The status is written last in each step, but the end has a status without a step.
  return std::min({robot_.range(Series::kAppliedAction).second,
                   robot_.range(Series::kStatus).second, kEndless});
}

TimeIndex SessionCopier::oldest_step() const {
  // Every series has its own history, and one may be a step ahead of another.
  TimeIndex oldest = 0;
  for (const Series series :
       {Series::kDesiredAction, Series::kAppliedAction, Series::kObservation, Series::kStatus}) {
    oldest = std::max(oldest, robot_.range(series).first);
  }
  return std::min(oldest, kEndless);
}

TimeIndex SessionCopier::margin(const UntypedFrontend& series) const {
  const auto [oldest, end] = series.range(Series::kObservation);
  const TimeIndex history = end - oldest;
  // Without deadlines, a back-end can run through a whole history in no time.
  if (!header_.is_real_time || header_.period <= Nanoseconds::zero()) return history / 4;
  constexpr Nanoseconds kMargin = std::chrono::milliseconds(10);
  return std::clamp<TimeIndex>(kMargin / header_.period, 1, std::max<TimeIndex>(history / 4, 1));
}

double SessionCopier::lag() const {
  const auto [oldest, end] = robot_.range(Series::kStatus);
  // The history has not overwritten anything yet.
  if (oldest <= 0) return 0.0;
  return std::clamp(static_cast<double>(end - next_step()) / static_cast<double>(end - oldest), 0.0,
                    1.0);
}

void SessionCopier::pump(LogWriter& log, int file) {
  if (is_done_) return;
  if (is_fresh_) {
    // Steps from before the recorder began are not a gap.
    if (const TimeIndex oldest = oldest_step(); oldest > 0) set_next(oldest + margin(robot_));
    for (CompanionReader& companion : companions_) {
      const TimeIndex oldest = companion.series.range(Series::kObservation).first;
      if (oldest > 0) companion.next = oldest + margin(companion.series);
    }
    is_fresh_ = false;
  }
  if (cameras_ && !images_) begin_images();
  if (!number_ || file_ != file) {
    header_.first_index = next_step();
    for (std::size_t i = 0; i < companions_.size(); ++i) {
      header_.companions[i].first_index = companions_[i].next;
    }
    number_ = log.begin_session(header_);
    if (file_ < 0) {
      report_(Level::kInfo, header_.name,
              "is recorded from step " + std::to_string(next_step()) + " on");
    }
    file_ = file;
  }
  // The fault is read first: then everything from before the end is seen below.
  const std::optional<Fault> fault = robot_.fault();
  const TimeIndex end = whole_steps();
  // Companions come first: recorded steps up to `end` promise that their elements were read as
  // well.
  for (std::size_t i = 0; i < companions_.size(); ++i) pump_companion(log, i);
  pump_steps(log, end);
  if (fault && images_) images_->request_end();
  pump_images(log);
  if (fault && (!images_ || has_all_images_)) write_end(log, *fault);
}

void SessionCopier::begin_images() {
  if (image_options_.storage == ImageStorage::kJpeg) {
    try {
      camera::require_jpeg();
    } catch (const Error& error) {
      report_(Level::kWarning, kRecorder,
              "images of " + header_.name + " are recorded raw: " + error.what());
      image_options_.storage = ImageStorage::kRaw;
    }
  }
  images_ = std::make_unique<ImageThread>(
      companion_sessions_[cameras_->companion], header_, *cameras_, image_options_,
      std::max(first_images_, companions_[cameras_->companion].next));
}

void SessionCopier::pump_images(LogWriter& log) {
  if (!images_) return;
  // More would only wait somewhere else for the same disk.
  constexpr std::size_t kMaxWaiting = std::size_t{16} << 20U;
  const std::size_t waiting = log.waiting_images_size();
  const bool is_over = images_->has_ended();
  if (waiting < kMaxWaiting || is_over) {
    ImageThread::Taken taken = images_->take(is_over ? kEverything : kMaxWaiting - waiting);
    for (LogWriter::Image& image : taken.images) {
      image.time += header_.time_offset;
      log.write_image(*number_, std::move(image));
      ++num_images_;
    }
    left_out_images_ += taken.left_out;
    if (!taken.error.empty()) image_error_ = taken.error;
  }
  has_all_images_ = is_over;
  publish_next();
  report_images(is_over);
}

// At most once per second.
void SessionCopier::report_images(bool is_end) {
  const Instant now = std::chrono::steady_clock::now();
  const std::int64_t count = left_out_images_ - reported_left_out_;
  if (count == 0 || (now < next_sentence_ && !is_end)) return;
  reported_left_out_ = left_out_images_;
  next_sentence_ = now + std::chrono::seconds(1);
  const std::string why = image_error_.empty() ? "processors or disk were too slow" : image_error_;
  report_(image_error_.empty() ? Level::kWarning : Level::kError, kRecorder,
          std::to_string(count) + (count == 1 ? " image of " : " images of ") + header_.name +
              (count == 1 ? " is" : " are") + " not in the log: " + why);
  image_error_.clear();
}

void SessionCopier::pump_steps(LogWriter& log, TimeIndex end) {
  const RobotTypes& types = header_.types;
  while (next_step() < end) {
    if (next_step() < oldest_step()) {
      lose_steps(log, end);
      continue;
    }
    const auto count = static_cast<std::size_t>(
        std::min<TimeIndex>(end - next_step(), static_cast<TimeIndex>(batch_)));
    make_room(log, count * (types.action.size() + types.applied_action.size() +
                            types.observation.size() + sizeof(Status)));
    const std::size_t found = read_steps(next_step(), count);
    if (found > 0) {
      log.write_steps(*number_, {.first = next_step(),
                                 .count = found,
                                 .desired_actions = desired_actions_.data(),
                                 .applied_actions = applied_actions_.data(),
                                 .observations = observations_.data(),
                                 .statuses = statuses_.data()});
      steps_ += static_cast<std::int64_t>(found);
      set_next(next_step() + static_cast<TimeIndex>(found));
    }
    if (found < count) lose_steps(log, end);
  }
}

// Returns the number of steps that could still be read whole.
std::size_t SessionCopier::read_steps(TimeIndex first, std::size_t count) {
  const RobotTypes& types = header_.types;
  for (std::size_t i = 0; i < count; ++i) {
    const TimeIndex t = first + static_cast<TimeIndex>(i);
    try {
      const bool is_whole =
          robot_.try_get(Series::kDesiredAction, t,
                         desired_actions_.data() + i * types.action.size()) &&
          robot_.try_get(Series::kAppliedAction, t,
                         applied_actions_.data() + i * types.applied_action.size()) &&
          robot_.try_get(Series::kObservation, t,
                         observations_.data() + i * types.observation.size()) &&
          robot_.try_get(Series::kStatus, t, statuses_.data() + i * sizeof(Status));
      // A step that should be there is missing: somebody has damaged the file of the session.
      if (!is_whole) return i;
    } catch (const HistoryLost&) {
      return i;
    }
  }
  return count;
}

void SessionCopier::lose_steps(LogWriter& log, TimeIndex end) {
  const TimeIndex first = next_step();
  const TimeIndex found =
      std::min(std::max(first + 1, oldest_step() + margin(robot_)), std::max(end, first + 1));
  log.write_gap(*number_, first, found - 1, kOverwritten);
  set_next(found);
  lost_steps_ += found - first;
  report_(Level::kError, kRecorder, loss_text("step", first, found - 1, header_.name));
}

void SessionCopier::pump_companion(LogWriter& log, std::size_t index) {
  CompanionReader& companion = companions_[index];
  const std::size_t batch = companion.elements.size() / companion.element_size;
  const TimeIndex end = std::min(companion.series.range(Series::kObservation).second, kEndless);
  while (companion.next < end) {
    const auto count = static_cast<std::size_t>(
        std::min<TimeIndex>(end - companion.next, static_cast<TimeIndex>(batch)));
    make_room(log, count * companion.element_size);
    std::size_t found = 0;
    try {
      while (found < count &&
             companion.series.try_get(Series::kObservation,
                                      companion.next + static_cast<TimeIndex>(found),
                                      companion.elements.data() + found * companion.element_size)) {
        ++found;
      }
    } catch (const HistoryLost&) {
      // The loss is reported below.
    }
    if (found > 0) {
      log.write_companion(*number_, index, companion.next, found, companion.elements.data());
      if (images_ && index == cameras_->companion && !header_.is_real_time) {
        for (std::size_t i = 0; i < found; ++i) {
          Stamp stamp;
          std::memcpy(&stamp, companion.elements.data() + i * companion.element_size,
                      sizeof(stamp));
          unread_images_.push_back(
              {companion.next + static_cast<TimeIndex>(i), stamp.arrival_index});
        }
      }
      companion.next += static_cast<TimeIndex>(found);
    }
    if (found == count) continue;
    const TimeIndex first = companion.next;
    const TimeIndex again =
        std::min(std::max(first + 1, companion.series.range(Series::kObservation).first +
                                         margin(companion.series)),
                 end);
    log.write_companion_gap(*number_, index, first, again - 1, kOverwritten);
    companion.next = again;
    report_(Level::kError, kRecorder,
            loss_text("element", first, again - 1, header_.companions[index].name));
  }
}

void SessionCopier::write_end(LogWriter& log, const Fault& fault) {
  const TimeIndex steps = whole_steps();
  if (!has_end_ && robot_.range(Series::kStatus).second > steps) {
    Status status;
    make_room(log, sizeof(status) + header_.types.observation.size());
    try {
      if (robot_.try_get(Series::kStatus, steps, &status)) {
        const bool has_observation =
            robot_.range(Series::kObservation).second > steps &&
            robot_.try_get(Series::kObservation, steps, observations_.data());
        log.write_end(*number_, steps, has_observation ? observations_.data() : nullptr, status);
      }
    } catch (const HistoryLost&) {
      // Nobody writes after the end, so the file of the session is damaged.
    }
    has_end_ = true;
  }
  const std::string text = session_.info().fault_text;
  log.end_session(*number_, steps, fault, text);
  is_done_ = true;
  // release: the payloads of the session may be overwritten, too.
  next_step_->store(kEndless, std::memory_order_release);
  report_(fault.needs_recovery() ? Level::kError : Level::kInfo, header_.name, text);
}

}  // namespace trifinger::log::detail
