// SPDX-License-Identifier: BSD-3-Clause
#include "log/recorder.hpp"

#include <poll.h>
#include <sys/eventfd.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <cerrno>
#include <deque>
#include <mutex>
#include <optional>
#include <utility>

#include "log/format/text.hpp"
#include "log/write/recording_files.hpp"
#include "log/write/session_copier.hpp"
#include "log/write/session_counter.hpp"
#include "log/write/session_inbox.hpp"
#include "trifinger/core/errors.hpp"
#include "trifinger/ipc/file_descriptor.hpp"

namespace trifinger::log {

using namespace detail;

namespace {

constexpr Nanoseconds kPollPeriod = std::chrono::milliseconds(20);
// For histories that fill up within `kPollPeriod`.
constexpr Nanoseconds kMinPollPeriod = std::chrono::microseconds(500);
constexpr double kHurry = 0.125;
// How often refused writes are tried again, and how often rare changes are looked for.
constexpr Nanoseconds kSlowPeriod = std::chrono::milliseconds(100);
constexpr double kWorryingLag = 0.5;
constexpr double kHarmlessLag = 0.25;
constexpr std::size_t kMaxEvents = 1000;
// The total change of a slewed clock reaches this value eventually, too.
constexpr Nanoseconds kWallClockChange = std::chrono::milliseconds(100);

std::string seconds_text(Nanoseconds time) {
  const auto tenths = std::chrono::duration_cast<std::chrono::milliseconds>(time).count() / 100;
  return std::to_string(tenths / 10) + "." + std::to_string(tenths % 10) + " s";
}

// One robot and those of its sessions that are not in the log yet, oldest first.
struct RecordedRobot {
  std::string name;
  std::deque<std::unique_ptr<SessionCopier>> sessions;
  std::optional<Session> newest;
  std::uint64_t newest_id{0};
  bool is_known{false};       // earlier recordings were looked up
  std::int64_t last_time{0};  // time at which the previous session ends
  bool is_behind{false};      // a warning has said that it lags behind

  // Number of sessions that have appeared, including ours. `missed`: reported as missed.
  int appeared{-1};
  int before_counter{0};
  int found{0};
  int missed{0};
};

void drain(const ipc::FileDescriptor& file) noexcept {
  std::uint64_t count = 0;
  static_cast<void>(::read(file.get(), &count, sizeof(count)));
}

}  // namespace

class Recorder::Implementation {
 public:
  Implementation(const std::vector<std::string>& robots, RecorderOptions options)
      : options_(std::move(options)),
        wake_([] { return ::eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK); }),
        counter_(options_.is_follower ? std::vector<std::string>() : robots),
        recording_(robots, options_,
                   [this](Level level, std::string_view source, const std::string& text) {
                     report(level, source, text);
                   }) {
    if (!wake_) throw SystemError("make an event", errno);
    for (const std::string& name : robots) robots_.emplace_back().name = name;
    update_state();
  }

  void run() {
    try {
      while (!stop_requested_.load(std::memory_order_acquire) && !is_over()) {
        // relaxed: only a sign of life; no data depends on it.
        rounds_.fetch_add(1, std::memory_order_relaxed);
        look_for_sessions();
        watch_wall_clock();
        work();
        update_state();
        wait();
      }
      look_for_sessions();
      write_end();
      update_state();
    } catch (...) {
      leave();
      throw;
    }
    leave();
  }

  void request_stop() noexcept {
    // release: the last look then finds the sessions that were handed over before.
    stop_requested_.store(true, std::memory_order_release);
    wake();
  }

  RecorderState state() const {
    const std::lock_guard lock(mutex_);
    RecorderState state = state_;
    // relaxed: only the change counts. A long history is written in a single round.
    state.progress = rounds_.load(std::memory_order_relaxed);
    if (written_ != nullptr) {
      state.progress += static_cast<std::uint64_t>(written_->load(std::memory_order_relaxed));
    }
    return state;
  }

  void begin_session(const Session& robot, const std::vector<Session>& companions) {
    inbox_.put(robot, companions);
    wake();
  }
  [[nodiscard]] TimeIndex next_step() const noexcept { return inbox_.next_step(); }

 private:
  // --- finding sessions ---

  void look_for_sessions() {
    if (options_.is_follower) {
      take_handed_over();
      return;
    }
    const bool is_time = now() >= next_slow_look_;
    if (is_time) next_slow_look_ = now() + kSlowPeriod;
    const std::map<std::string, int> counts = counter_.count();
    for (RecordedRobot& robot : robots_) {
      const int count = counts.at(robot.name);
      if (count == robot.appeared && (counter_.is_working() || !is_time)) continue;
      const bool is_first = robot.appeared < 0;
      if (find_session(robot)) robot.appeared = count;
      // A session that existed before the counter is not counted.
      if (is_first && robot.found > 0 && counter_.count().at(robot.name) == 0)
        robot.before_counter = 1;
      const int missed = count + robot.before_counter - robot.found - robot.missed;
      if (missed > 0 && robot.appeared == count) {
        robot.missed += missed;
        report(Level::kError, kRecorder,
               (missed == 1 ? "a session of " + robot.name + " was"
                            : std::to_string(missed) + " sessions of " + robot.name + " were") +
                   " over before the recorder looked");
      }
    }
  }

  // Looks for a new session of the robot. Returns false if it has to be called again.
  bool find_session(RecordedRobot& robot) {
    try {
      Session session = Session::open(robot.name);
      const SessionInfo info = session.info();
      if (info.is_companion) {
        throw InvalidArgument("'" + robot.name + "' is a companion: record its robot");
      }
      if (info.session_id == robot.newest_id) return true;
      std::vector<Session> companions;
      for (const std::string& name : session.companion_names()) {
        companions.push_back(session.companion(name));
      }
      robot.newest_id = info.session_id;
      ++robot.found;
      add(robot, session, companions, std::make_shared<std::atomic<TimeIndex>>(0));
      return true;
    } catch (const SessionNotFound&) {
      if (robot.appeared < 0) report(Level::kInfo, kRecorder, "waits for " + robot.name);
      return true;  // the session does not exist yet, or no longer
    } catch (const RobotStopped&) {
      return false;  // the next session began during the look
    } catch (const IncompatibleSession& error) {
      ++robot.found;
      report(Level::kError, kRecorder, error.what());
      return true;
    } catch (const SystemError& error) {
      const bool is_new = robot.newest_id != 0 || robot.appeared < 0;
      if (is_new) report(Level::kError, kRecorder, error.what());
      robot.newest_id = 0;
      return true;
    }
  }

  void take_handed_over() {
    RecordedRobot& robot = robots_.front();
    const SessionInbox::Taken taken = inbox_.take(
        SessionInbox::kMaxWaiting - std::min(SessionInbox::kMaxWaiting, robot.sessions.size()));
    for (const HandedSession& session : taken.sessions) {
      add(robot, session.robot, session.companions, session.next_step);
    }
    if (taken.dropped > 0) {
      report(Level::kError, kRecorder,
             std::to_string(taken.dropped) + " sessions of " + robot.name +
                 " are not in the log: the disk is too slow");
    }
  }

  void add(RecordedRobot& robot, const Session& session, const std::vector<Session>& companions,
           std::shared_ptr<std::atomic<TimeIndex>> next_step) {
    auto recorder = std::make_unique<SessionCopier>(
        session, companions, std::move(next_step),
        ImageOptions{.storage = options_.images, .quality = options_.jpeg_quality},
        [this](Level level, std::string_view source, const std::string& text) {
          report(level, source, text);
        });
    robot.newest = session;
    // Files of other recorders can only contain sessions that began before this recorder.
    if (!std::exchange(robot.is_known, true)) {
      robot.last_time = recording_.last_time();
      report_lost_ends(robot, recorder->header().session_id);
      if (const auto position = recording_.find(robot.name, recorder->header().session_id)) {
        // After a clean end, the recording continues only if no step is missing. Otherwise a new
        // one begins.
        const bool is_same =
            recording_.is_unfinished(position->file) ||
            (!position->is_closed && recorder->has_all_since(position->next_step) &&
             recording_.join(position->file));
        recorder->go_on_at(*position, is_same);
      }
    }
    if (recorder->is_done()) return;
    if (robot.sessions.size() >= SessionInbox::kMaxWaiting) {
      robot.sessions.pop_front();
      report(Level::kError, kRecorder,
             "a session of " + robot.name + " is not in the log: too many wait to be written");
    }
    robot.sessions.push_back(std::move(recorder));
  }

  // Reports sessions that ended and were replaced while no recorder was running.
  void report_lost_ends(const RecordedRobot& robot, std::uint64_t session_id) {
    for (const std::uint64_t id : recording_.open_sessions(robot.name)) {
      if (id == session_id) continue;
      const auto position = recording_.find(robot.name, id);
      if (!position) continue;
      const std::string since =
          position->next_step == 0
              ? "no step"
              : "nothing after step " + std::to_string(position->next_step - 1);
      report(Level::kError, kRecorder,
             since + " of the previous session of " + robot.name +
                 " was recorded: that session ended without a recorder");
    }
  }

  // --- writing ---

  // Writes everything that is available. What the disk refuses is tried again later.
  void work() {
    hurry_ = false;
    for (RecordedRobot& robot : robots_) watch_lag(robot);
    if (error_since_ && now() < next_attempt_) return;
    try {
      write();
      end_error();
    } catch (const SystemError& error) {
      begin_error(error);
    }
  }

  void write() {
    for (RecordedRobot& robot : robots_) {
      while (!robot.sessions.empty()) {
        SessionCopier& session = *robot.sessions.front();
        pump(robot, session);
        if (!session.is_done()) break;
        robot.last_time = session.last_time();
        images_ += session.images();
        left_out_images_ += session.left_out_images();
        steps_ += session.steps();
        lost_steps_ += session.lost_steps();
        robot.sessions.pop_front();
      }
    }
    if (recording_.is_open()) write_events();
    recording_.flush(error_since_.has_value());
  }

  void pump(RecordedRobot& robot, SessionCopier& session) {
    {
      const std::lock_guard lock(mutex_);
      written_ = session.shared_next_step();
    }
    try {
      session.begin_after(robot.last_time);
      LogWriter& log = recording_.log();
      session.pump(log, recording_.number());
    } catch (const SystemError&) {
      throw;
    } catch (const Error& error) {
      report(Level::kError, kRecorder, robot.name + " cannot be recorded: " + error.what());
      session.give_up();
    }
  }

  void write_events() {
    LogWriter& log = recording_.log();
    while (!events_.empty()) {
      const Event& event = events_.front();
      if (log.open_chunk_size() > LogWriter::kMaxChunkSize / 2) log.flush();
      log.write_event(event.level, event.source, event.text, event.time);
      events_.pop_front();
    }
  }

  void begin_error(const SystemError& error) {
    next_attempt_ = now() + kSlowPeriod;
    if (error_since_ && error_ == error.what()) return;
    error_ = error.what();
    if (!error_since_) {
      error_since_ = now();
      lost_before_error_ = lost_steps();
    }
    report(
        Level::kError, "recorder",
        "cannot write: " + error_ + "; tries again as long as the history holds what is missing");
  }

  void end_error() {
    if (!error_since_) return;
    const std::int64_t lost = lost_steps() - lost_before_error_;
    report(
        Level::kWarning, kRecorder,
        "writes again after " + seconds_text(now() - *error_since_) +
            (lost == 0 ? "; nothing was lost" : "; " + std::to_string(lost) + " steps were lost"));
    error_since_.reset();
    error_.clear();
  }

  // Writes everything that is left and closes the file: after a stop, or when nothing more can
  // come.
  void write_end() {
    write_all();
    // Sessions that were handed over may still be waiting.
    while (options_.is_follower && !inbox_.is_empty()) {
      look_for_sessions();
      write_all();
    }
    end_error();
    if (recording_.is_open()) write_events();
    recording_.finish();
    update_state();
  }

  // Writes what is available, with the images that are still being made.
  void write_all() {
    const auto end_images = [this] {
      bool is_any = false;
      for (RecordedRobot& robot : robots_) {
        if (!robot.sessions.empty()) is_any = robot.sessions.front()->end_images() || is_any;
      }
      return is_any;
    };
    do {
      write();
    } while (end_images());
  }

  void watch_lag(RecordedRobot& robot) {
    if (robot.sessions.empty()) return;
    const SessionCopier& session = *robot.sessions.front();
    const double lag = session.lag();
    if (lag >= kHurry) hurry_ = true;
    if (lag < kHarmlessLag) robot.is_behind = false;
    if (lag < kWorryingLag || robot.is_behind || !session.header().is_real_time) return;
    robot.is_behind = true;
    report(Level::kWarning, kRecorder,
           "far behind " + robot.name + ": at step " + std::to_string(session.next_step()) +
               ", and half of its history is used up");
  }

  // --- other functions ---

  void report(Level level, std::string_view source, const std::string& text) {
    Event event{.time = wall_time(), .level = level, .source = std::string(source), .text = text};
    if (options_.on_event) options_.on_event(event);
    if (events_.size() >= kMaxEvents) events_.pop_front();
    events_.push_back(std::move(event));
  }

  // Reports when the wall clock was set, with the new offset. Steps of a session keep the offset of
  // its beginning, so the log would not show it otherwise.
  void watch_wall_clock() {
    const auto before = now();
    const std::int64_t wall = wall_time();
    const auto after = now();
    // This thread was interrupted between the two readings, so the change would appear too large.
    if (after - before > kWallClockChange / 10) return;
    const Nanoseconds offset = Nanoseconds(wall) - before.time_since_epoch();
    const Nanoseconds change = offset - wall_clock_offset_.value_or(offset);
    if (!wall_clock_offset_) wall_clock_offset_ = offset;
    if (std::chrono::abs(change) < kWallClockChange) return;
    wall_clock_offset_ = offset;
    const auto seconds = static_cast<double>(change.count()) / 1e9;
    report(Level::kWarning, kRecorder,
           "the wall clock has moved by " + std::to_string(seconds) +
               " s; minus the monotonic clock it is now " + std::to_string(offset.count()) + " ns");
  }

  // True if nothing more can come.
  bool is_over() {
    const bool can_end = options_.until_end || options_.until_process_ends.has_value();
    if (!can_end || now() < next_look_at_ends_) return false;
    next_look_at_ends_ = now() + kSlowPeriod;
    if (options_.until_process_ends && !options_.until_process_ends->is_alive()) return true;
    return options_.until_end && std::ranges::all_of(robots_, [](const RecordedRobot& robot) {
             return robot.sessions.empty() && robot.newest &&
                    !robot.newest->info().backend_is_alive;
           });
  }

  void wait() {
    period_ = hurry_ ? kMinPollPeriod : std::min(2 * period_, kPollPeriod);
    std::array<pollfd, 2> files{{{.fd = wake_.get(), .events = POLLIN, .revents = 0},
                                 {.fd = counter_.descriptor(), .events = POLLIN, .revents = 0}}};
    const timespec time{.tv_sec = 0, .tv_nsec = period_.count()};
    if (::ppoll(files.data(), files.size(), &time, nullptr) > 0 && files[0].revents != 0) {
      drain(wake_);
    }
  }

  void wake() const noexcept {
    const std::uint64_t one = 1;
    static_cast<void>(::write(wake_.get(), &one, sizeof(one)));
  }

  [[nodiscard]] std::int64_t lost_steps() const {
    std::int64_t lost = lost_steps_;
    for (const RecordedRobot& robot : robots_) {
      for (const auto& session : robot.sessions) lost += session->lost_steps();
    }
    return lost;
  }

  void update_state() {
    RecorderState state;
    state.steps = steps_;
    state.images = images_;
    state.left_out_images = left_out_images_;
    for (const RecordedRobot& robot : robots_) {
      RecorderState::Robot& entry = state.robots.emplace_back();
      entry.name = robot.name;
      entry.session_id = robot.newest_id;
      for (const auto& session : robot.sessions) {
        state.steps += session->steps();
        state.images += session->images();
        state.left_out_images += session->left_out_images();
      }
      if (robot.sessions.empty()) continue;
      entry.is_recording = true;
      entry.next_step = robot.sessions.front()->next_step();
      entry.lag = robot.sessions.front()->lag();
    }
    state.file = recording_.path();
    state.bytes = recording_.bytes();
    state.lost_steps = lost_steps();
    state.error = error_;
    const std::lock_guard lock(mutex_);
    state_ = std::move(state);
  }

  // From now on the back-end never waits for this recorder.
  void leave() noexcept {
    inbox_.close();
    for (RecordedRobot& robot : robots_) {
      for (const auto& session : robot.sessions) session->give_up();
    }
  }

  RecorderOptions options_;
  ipc::FileDescriptor wake_;
  SessionCounter counter_;
  std::deque<Event> events_;  // events that are not in the log yet
  RecordingFiles recording_;
  SessionInbox inbox_;
  std::deque<RecordedRobot> robots_;
  std::atomic<bool> stop_requested_{false};
  std::atomic<std::uint64_t> rounds_{0};
  Nanoseconds period_{kPollPeriod};
  bool hurry_{false};
  std::optional<Nanoseconds> wall_clock_offset_;  // minus the monotonic clock, as reported
  Instant next_slow_look_;
  Instant next_look_at_ends_;

  std::optional<Instant> error_since_;
  std::string error_;
  Instant next_attempt_;
  std::int64_t lost_before_error_{0};
  std::int64_t images_{0};           // sum over finished sessions
  std::int64_t left_out_images_{0};  // sum over finished sessions
  std::int64_t steps_{0};            // sum over finished sessions
  std::int64_t lost_steps_{0};       // sum over finished sessions

  mutable std::mutex mutex_;
  // The mutex guards the following members.
  RecorderState state_;
  std::shared_ptr<const std::atomic<TimeIndex>> written_;  // session being written
};

Recorder::Recorder(const std::vector<std::string>& robots, RecorderOptions options)
    : implementation_(std::make_unique<Implementation>(robots, std::move(options))) {}
Recorder::~Recorder() = default;

void Recorder::run() { implementation_->run(); }
void Recorder::request_stop() noexcept { implementation_->request_stop(); }
RecorderState Recorder::state() const { return implementation_->state(); }
void Recorder::begin_session(const Session& robot,
                             const std::vector<Session>& companions) noexcept {
  implementation_->begin_session(robot, companions);
}
TimeIndex Recorder::next_step() const noexcept { return implementation_->next_step(); }

}  // namespace trifinger::log
