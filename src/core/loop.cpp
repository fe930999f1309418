// SPDX-License-Identifier: BSD-3-Clause
#include "loop.hpp"

#include <algorithm>
#include <cstring>
#include <limits>

#include "ipc/ring.hpp"
#include "trifinger/base/text.hpp"

namespace trifinger::detail {
namespace {

std::vector<std::uint64_t> element_buffer(std::size_t size) {
  return std::vector<std::uint64_t>((size + 7) / 8);
}

// For the detail of a fault. A time that does not fit (more than 24 days) becomes the largest
// value.
std::int32_t in_milliseconds(Nanoseconds time) noexcept {
  constexpr std::int64_t kMost = std::numeric_limits<std::int32_t>::max();
  return static_cast<std::int32_t>(
      std::min(std::chrono::ceil<std::chrono::milliseconds>(time).count(), kMost));
}

// One more byte is needed for the zero that ends the text.
static_assert(FixedText::kCapacity < sizeof(StateHeader::fault_text));

// One second of steps at 1 kHz: no sensor should be later.
constexpr TimeIndex kBeginsKept = 1024;

constexpr std::size_t place_of(TimeIndex time_index) noexcept {
  return static_cast<std::size_t>(time_index % kBeginsKept);
}

// True if the driver ends the session early: by a fault or an interruption.
bool breaks_off(const DriverReport& report) noexcept {
  return report.state == DriverReport::State::kFault ||
         report.state == DriverReport::State::kInterrupted;
}

}  // namespace

Loop::Loop(UntypedDriver& driver, SessionPlace::Writers& writers, const BackendOptions& options,
           const std::atomic<bool>& stop_requested, const Clock& clock)
    : driver_(driver),
      writer_(*writers.robot),
      companions_(writers.companions),
      options_(options),
      stop_requested_(stop_requested),
      clock_(clock),
      late_after_(options.late_after.value_or(options.period / 2)),
      queue_entry_(element_buffer(8 + driver.description().action.size())),
      desired_(element_buffer(driver.description().action.size())),
      applied_(element_buffer(driver.description().applied_action.size())),
      observation_(element_buffer(driver.description().observation.size())),
      hold_action_(element_buffer(driver.description().action.size())),
      time_index_(writer_.first_index()) {
  for (const CompanionDescription& companion : driver.companions()) {
    companion_elements_.push_back(element_buffer(companion.element.size()));
  }
  if (!companions_.empty()) begins_.assign(kBeginsKept, 0);
}

Progress Loop::tick(const Tick& now) noexcept {
  last_time_ = now.time;
  driver_time_ = Nanoseconds::zero();
  suspended_ = now.suspended;
  beat(now.time);
  // acquire: the watchdog has ended the session, and nothing may be added after that.
  if (was_cut_.load(std::memory_order_acquire)) stage_ = Stage::kDone;
  switch (stage_) {
    case Stage::kPreparing:
      return prepare(now);
    case Stage::kHolding:
      return hold(now);
    case Stage::kRunning:
      return run(now);
    case Stage::kStopping:
      return stop();
    case Stage::kDone:
      break;
  }
  return rest();
}

Progress Loop::prepare(const Tick& now) noexcept {
  if (const Fault request = end_request()) return end(request.code, request.detail);
  const DriverReport report = call_driver([&] { return driver_.prepare(count_); });
  ++count_;
  if (breaks_off(report)) return end(report);
  if (report.state == DriverReport::State::kBusy) return Progress::kStepped;
  stage_ = Stage::kHolding;
  holding_since_ = now.time;
  set_phase(Phase::kHolding);
  return hold(now);
}

Progress Loop::hold(const Tick& now) noexcept {
  // Without deadlines nothing moves before step 0, so one measurement is enough.
  if (!is_measured_) {
    if (!measure(now)) return Progress::kStepped;
    writer_.append(Series::kHolding, observation_.data());
    publish_companions(now, time_index_ - 1);
    announce(true);
  }

  const std::uint32_t requests_before = requests();
  const std::uint64_t sequence = writer_.queue().sequence_in_slot(time_index_);
  // This comes after the look at the slot, because that look notices memory that was cut off.
  if (writer_.is_damaged() || sequence > ipc::Ring::sequence_of(time_index_)) {
    return end(Fault::Code::kMemoryDamaged, 0);
  }
  if (sequence == ipc::Ring::sequence_of(time_index_)) {
    stage_ = Stage::kRunning;
    first_tick_ = now.number;
    set_phase(Phase::kRunning);
    publish_companions(now, time_index_);
    // Ticks skipped before step 0 do not count for step 0.
    Tick first = now;
    first.skipped = 0;
    return run(first);
  }
  if (const Fault request = end_request()) return end(request.code, request.detail);
  if ((requests_before & kFinish) != 0) return end(Fault::Code::kFinished, 0);
  if (!is_real_time()) return Progress::kWaiting;

  if (options_.first_action_timeout != kForever &&
      now.time - holding_since_ >= options_.first_action_timeout) {
    return end(Fault::Code::kFirstActionLate, 0);
  }
  if (!has_hold_action_) {
    // The holding action is computed only once. It keeps the pose of the beginning, even if the
    // robot creeps away from it.
    const DriverReport held =
        call_driver([&] { return driver_.hold(observation_.data(), hold_action_.data()); });
    if (breaks_off(held)) return end(held);
    has_hold_action_ = true;
  }
  const DriverReport report =
      call_driver([&] { return driver_.apply_action(hold_action_.data(), applied_.data()); });
  if (breaks_off(report)) return end(report);
  is_measured_ = false;
  return Progress::kStepped;
}

Progress Loop::run(const Tick& now) noexcept {
  // The tick is noted first. The last status then describes its tick even if the driver can no
  // longer measure.
  status_.tick = is_real_time() ? now.number - first_tick_ : time_index_ - writer_.first_index();
  status_.lateness = now.lateness.count();
  status_.skipped_ticks = now.skipped;
  if (is_real_time()) note_lateness(now);
  if (!is_measured_ && !measure(now)) return Progress::kStepped;
  if (now.skipped > options_.max_skipped_ticks && is_real_time()) {
    return end(Fault::Code::kBackendLate, static_cast<std::int32_t>(now.skipped));
  }
  if (late_in_a_row_ > options_.max_late_steps) {
    return end(Fault::Code::kBackendLate, -static_cast<std::int32_t>(late_in_a_row_));
  }
  // This check comes here and not after the step, so that the last step has an observation.
  if (status_.rejected_actions > options_.max_rejected_actions) {
    return end(Fault::Code::kActionsRejected, static_cast<std::int32_t>(status_.rejected_actions));
  }
  if (const Fault request = end_request()) return end(request.code, request.detail);

  // The request is read before the queue: every action appended before finish() must be found.
  const bool finish_requested = (requests() & kFinish) != 0;
  Take take = take_action();
  if (take == Take::kMissing && finish_requested) return end(Fault::Code::kFinished, 0);
  if (take == Take::kMissing && !is_real_time()) {
    if (!is_published_) {
      publish_observation();
      announce(false);
    }
    return Progress::kWaiting;
  }
  if (take == Take::kMissing) take = close_index();
  if (take == Take::kDamaged) return end(Fault::Code::kMemoryDamaged, 0);
  if (take == Take::kMissing) {
    if (time_index_ == writer_.first_index() ||
        status_.action_repeats >= options_.max_action_repeats) {
      return end(Fault::Code::kActionLate, static_cast<std::int32_t>(status_.action_repeats));
    }
    ++status_.action_repeats;
    status_.flags |= Status::kActionRepeated;
  } else {
    status_.action_repeats = 0;
  }
  return apply_action();
}

Progress Loop::apply_action() noexcept {
  const DriverReport report =
      call_driver([&] { return driver_.apply_action(desired_.data(), applied_.data()); });
  if (breaks_off(report)) return end(report);
  status_.rejected_actions = report.action_rejected ? status_.rejected_actions + 1 : 0;
  if (report.action_rejected) status_.flags |= Status::kActionRejected;

  if (!is_published_) publish_observation();
  writer_.append(Series::kDesiredAction, desired_.data());
  writer_.append(Series::kAppliedAction, applied_.data());
  writer_.append(Series::kStatus, &status_);
  announce(is_real_time());
  // The timing is recorded after the wake-up because nobody waits for it.
  record_timing();

  ++time_index_;
  is_measured_ = false;
  is_published_ = false;
  status_.flags = 0;
  return Progress::kStepped;
}

Progress Loop::stop() noexcept {
  // Record what the period before has done. A driver that stops at once is not asked again.
  if (count_ > 0) {
    const DriverReport measured =
        call_driver([&] { return driver_.get_latest_observation(observation_.data()); });
    if (measured.state == DriverReport::State::kReady) {
      writer_.append_stopping(observation_.data());
    }
  }
  const DriverReport report = call_driver([&] { return driver_.stop(count_); });
  ++count_;
  const bool takes_too_long = count_ * options_.period >= options_.max_stop_time;
  if (report.state == DriverReport::State::kBusy && !takes_too_long) return Progress::kStepped;
  if (report.state != DriverReport::State::kReady) driver_.cut();
  stage_ = Stage::kDone;
  return rest();
}

Progress Loop::rest() noexcept {
  for (const auto& companion : companions_) companion->come_to_rest();
  writer_.come_to_rest();
  return Progress::kEnded;
}

bool Loop::measure(const Tick& now) noexcept {
  status_.time = now.time.time_since_epoch().count();
  const DriverReport report =
      call_driver([&] { return driver_.get_latest_observation(observation_.data()); });
  if (breaks_off(report)) {
    end(report);
    return false;
  }
  status_.measurement_age = report.measurement_age;
  status_.lost_frames = report.lost_frames;
  is_measured_ = true;
  if (stage_ == Stage::kRunning) publish_companions(now, time_index_);
  if (Nanoseconds(report.measurement_age) > options_.max_measurement_age) {
    end(Fault::Code::kMeasurementStale, in_milliseconds(Nanoseconds(report.measurement_age)));
    return false;
  }
  if (report.state == DriverReport::State::kEnd) {
    end(Fault::Code::kExhausted, report.fault_code);
    return false;
  }
  return true;
}

Loop::Take Loop::take_action() noexcept {
  if (writer_.is_damaged()) return Take::kDamaged;
  const ipc::Ring& queue = writer_.queue();
  if (closed_index_ >= 0) {
    if (queue.sequence_in_slot(closed_index_) == ipc::Ring::sequence_of(closed_index_)) {
      ++status_.discarded_actions;
    }
    closed_index_ = -1;
  }

  const std::uint64_t sequence = queue.sequence_in_slot(time_index_);
  // A later action in this slot means damage: a correct writer waits until this action was taken.
  if (sequence > ipc::Ring::sequence_of(time_index_)) return Take::kDamaged;
  if (sequence != ipc::Ring::sequence_of(time_index_)) return Take::kMissing;
  if (queue.read(time_index_, queue_entry_.data()) != ipc::ReadResult::kDone) return Take::kDamaged;
  // The driver gets this copy. Later changes of the queue by its writer have no effect.
  std::memcpy(desired_.data(), queue_entry_.data() + 1, queue.shape().element_size - 8);
  if ((queue_entry_[0] & QueueFlags::kAcausal) != 0) status_.flags |= Status::kAcausal;
  // release: the slot is now free for the writer.
  writer_.header().next_action.store(time_index_ + 1, std::memory_order_release);
  return Take::kTaken;
}

// The action of this step is missing. This function closes the step and looks once more. An append
// that does not see this word has made its action visible to this second look (seq_cst on both
// sides). It can therefore rely on its action being taken.
Loop::Take Loop::close_index() noexcept {
  writer_.header().next_action.store(time_index_ + 1, std::memory_order_seq_cst);
  const Take take = take_action();
  if (take == Take::kMissing) closed_index_ = time_index_;
  return take;
}

Fault Loop::end_request() const noexcept {
  // relaxed: no other data depends on these flags.
  if (stop_requested_.load(std::memory_order_relaxed)) return {.code = Fault::Code::kStopped};
  if ((requests() & kDetach) != 0) return {.code = Fault::Code::kDetached};
  if (controller_died_.load(std::memory_order_relaxed)) {
    return {.code = Fault::Code::kControllerDied};
  }
  // The robot was without control for longer than is normal.
  if (suspended_ > options_.period) {
    return {.code = Fault::Code::kMachineSuspended, .detail = in_milliseconds(suspended_)};
  }
  return {};
}

// Notes whether the step is late, and the cause if it is not the user.
void Loop::note_lateness(const Tick& now) noexcept {
  const bool is_late = now.skipped > 0 || now.lateness > late_after_;
  late_in_a_row_ = is_late ? late_in_a_row_ + 1 : 0;
  if (is_late) status_.flags |= now.driver_overran ? Status::kDriverLate : Status::kSchedulerLate;
}

void Loop::set_phase(Phase phase) noexcept {
  for (const auto& companion : companions_) companion->set_phase(phase);
  writer_.set_phase(phase);
}

void Loop::publish_observation() noexcept {
  writer_.append(Series::kObservation, observation_.data());
  is_published_ = true;
}

void Loop::record_timing() noexcept {
  if (!is_real_time()) return;
  timing_.add(time_index_, status_, options_.period);
  writer_.write_timing(timing_);
}

void Loop::publish_companions(const Tick& now, TimeIndex time_index) noexcept {
  if (!begins_.empty() && time_index >= writer_.first_index()) {
    begins_[place_of(time_index)] = now.time.time_since_epoch().count();
  }
  for (std::size_t i = 0; i < companions_.size(); ++i) {
    SessionWriter& companion = *companions_[i];
    Element& element = companion_elements_[i];
    const auto has_element = [&] {
      bool is_there = false;
      const DriverReport report = call_driver([&] {
        is_there = driver_.get_companion_element(i, time_index, element.data());
        return DriverReport::ready();
      });
      return is_there && report.state == DriverReport::State::kReady;
    };
    while (has_element()) {
      // The buffer's first bytes are a Stamp: the description of every companion begins with one.
      auto& stamp = *reinterpret_cast<Stamp*>(element.data());
      stamp.arrival_time = now.time.time_since_epoch().count();
      if (stamp.capture_index == Stamp::kFromTime) {
        // What arrives now was captured before, whatever its sensor says.
        stamp.capture_time = std::clamp<std::int64_t>(stamp.capture_time, 0, stamp.arrival_time);
        stamp.capture_index = step_at(stamp.capture_time, time_index);
      }
      if (stamp.capture_time == 0) {
        stamp.capture_time = stamp.arrival_time -
                             (stamp.arrival_index - stamp.capture_index) * options_.period.count();
      }
      companion.append(Series::kObservation, element.data());
    }
    // release: whoever sees the step also finds its elements.
    companion.header().complete_through.store(time_index, std::memory_order_release);
  }
}

TimeIndex Loop::step_at(std::int64_t time, TimeIndex newest) const noexcept {
  const TimeIndex first = writer_.first_index();
  const TimeIndex oldest = std::max(first, newest + 1 - kBeginsKept);
  for (TimeIndex t = newest; t >= oldest; --t) {
    if (begins_[place_of(t)] <= time) return t;
  }
  if (oldest <= first) return first - 1;
  // Nobody remembers when that step began. Periods are as good as they can be.
  const TimeIndex periods = (begins_[place_of(oldest)] - time) / options_.period.count() + 1;
  return std::max(oldest - periods, first - 1);
}

void Loop::announce(bool always) noexcept {
  // Observers cannot announce that they wait. Without deadlines they are woken once a millisecond.
  // A system call in every step, often for nobody, would be its most expensive part.
  constexpr Nanoseconds kWakePeriod = std::chrono::milliseconds(1);
  if (last_time_ - last_wake_ >= kWakePeriod) always = true;
  if (always) last_wake_ = last_time_;
  const auto wake = always ? SessionWriter::Wake::kAlways : SessionWriter::Wake::kIfWanted;
  for (const auto& companion : companions_) companion->announce(wake);
  writer_.announce(wake);
}

Progress Loop::end(const DriverReport& report) noexcept {
  return report.state == DriverReport::State::kInterrupted
             ? end(Fault::Code::kDetached, 0)
             : end(Fault::Code::kDriver, report.fault_code);
}

Progress Loop::end(Fault::Code code, std::int32_t detail) noexcept {
  // acquire: the watchdog has ended the session during a call of the driver.
  if (was_cut_.load(std::memory_order_acquire)) {
    stage_ = Stage::kDone;
    return Progress::kEnded;
  }
  const bool has_begun = stage_ == Stage::kRunning || code == Fault::Code::kFinished;
  fault_ = {.code = code, .detail = detail, .time_index = has_begun ? time_index_ : -1};
  if (has_begun) {
    if (is_measured_ && !is_published_) publish_observation();
    status_.flags |= Status::kEnd;
    status_.fault_code = static_cast<std::int32_t>(code);
    status_.fault_detail = detail;
    writer_.append(Series::kStatus, &status_);
    record_timing();
  }
  // FixedText makes one line of whatever the driver says, and marks it if it is cut off.
  FixedText text;
  if (code == Fault::Code::kDriver) text.append(driver_.fault_text(detail));
  if (code == Fault::Code::kActionsRejected) text.append(driver_.rejection_text());
  for (const auto& companion : companions_) companion->end(fault_, text.view());
  writer_.end(fault_, text.view());
  stage_ = Stage::kStopping;
  count_ = 0;
  return Progress::kStepped;
}

void Loop::cut() noexcept {
  // The current step: there are as many whole steps as statuses. The loop owns the series and may
  // return from its call at any time, so this end has no status of its own.
  const StateHeader& header = writer_.header();
  const bool has_begun =
      header.phase.load(std::memory_order_relaxed) == static_cast<std::uint32_t>(Phase::kRunning);
  const auto& steps = header.ends[index_of(Series::kStatus)];
  cut_fault_ = {.code = Fault::Code::kDriverHangs,
                .detail = 0,
                .time_index = has_begun ? steps.load(std::memory_order_relaxed) : -1};
  // release: whoever sees the flag finds the fault. The flag is set before the power is cut: if the
  // hanging call returns because of the cut, no other call may follow.
  was_cut_.store(true, std::memory_order_release);
  driver_.cut();
  for (const auto& companion : companions_) companion->end(cut_fault_, {});
  // If the session had ended before and only its orderly stop hangs, it keeps its end.
  is_cut_the_end_.store(writer_.end(cut_fault_, {}), std::memory_order_release);
  rest();
}

Fault Loop::fault() const noexcept {
  return is_cut_the_end_.load(std::memory_order_acquire) ? cut_fault_ : fault_;
}

bool Loop::has_work() const noexcept {
  return writer_.queue().sequence_in_slot(time_index_) >= ipc::Ring::sequence_of(time_index_) ||
         (requests() & kEndRequests) != 0 || writer_.is_damaged() ||
         stop_requested_.load(std::memory_order_relaxed) ||
         controller_died_.load(std::memory_order_relaxed);
}

void Loop::beat(Instant now) noexcept {
  // relaxed: no other data depends on this sign of life.
  writer_.header().heartbeat.store(now.time_since_epoch().count(), std::memory_order_relaxed);
}

template <class Call>
DriverReport Loop::call_driver(const Call& call) noexcept {
  // relaxed: the watchdog only compares this number with the one of its last look.
  const std::uint64_t count = driver_calls_.load(std::memory_order_relaxed);
  driver_calls_.store(count + 1, std::memory_order_relaxed);
  const Instant begin = is_real_time() ? clock_.now() : Instant{};
  const DriverReport report = call();
  if (is_real_time()) driver_time_ += clock_.now() - begin;
  driver_calls_.store(count + 2, std::memory_order_relaxed);
  // acquire: if the watchdog has cut the power meanwhile, the report of the call no longer counts.
  return was_cut_.load(std::memory_order_acquire) ? DriverReport::fault(0) : report;
}

}  // namespace trifinger::detail
