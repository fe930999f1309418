// SPDX-License-Identifier: BSD-3-Clause
#include "endurance/drive.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <cstring>
#include <thread>
#include <utility>

#include "trifinger/base/error.hpp"
#include "trifinger/core/errors.hpp"
#include "trifinger/sim/robot_config.hpp"

namespace trifinger::apps {
namespace {

using namespace std::chrono_literals;

// Actions that are appended at once. One such part is always ahead of the robot, so a controller
// that gets no processor for so long costs nothing.
constexpr std::size_t kPart = 20;
// How often what was counted is handed over.
constexpr int kPartsToHandOver = 50;
// Homing may take long.
constexpr Timeout kBeginTimeout = 3min;
constexpr Timeout kStepTimeout = 10s;
constexpr Timeout kRestTimeout = 20s;
constexpr Nanoseconds kSlice = 100ms;
constexpr std::size_t kMaxEvents = 32;
// After a self-test that failed, the joints go back the way they came, and free themselves for at
// least this time per attempt.
constexpr Seconds kFreeTime{3.0};

const FieldDescription& field_of(const ElementDescription& element, std::string_view what,
                                 std::string_view name, ScalarType type) {
  for (const FieldDescription& field : element.fields()) {
    if (field.name == name && field.type == type && field.shape.size() == 1) return field;
  }
  throw InvalidArgument(
      fmt::format("the robot is none of joints: its {} has no field '{}' with one value per joint",
                  what, name));
}

std::span<const double> numbers(const std::byte* element, std::size_t offset, std::size_t count) {
  return {reinterpret_cast<const double*>(element + offset), count};
}

}  // namespace

std::vector<JointLimit> limits_of(const Session& session) {
  return read_robot_config(config_file_of(session)).simulation.limits.value();
}

RunningRobot::RunningRobot(std::string name, const std::atomic<bool>& stop)
    : name_(std::move(name)), stop_(stop) {}

UntypedFrontend RunningRobot::connect() {
  return UntypedFrontend(name_, {.control = true, .timeout = 5s});
}

void RunningRobot::recover() { trifinger::recover(name_, 5s); }

void RunningRobot::pause(Nanoseconds time) {
  const Deadline deadline(time);
  while (!deadline.passed()) {
    if (stop_.load(std::memory_order_relaxed)) throw Stopped();
    std::this_thread::sleep_for(deadline.remaining(kSlice));
  }
}

Nanoseconds RunningRobot::now() const noexcept {
  return std::chrono::steady_clock::now().time_since_epoch();
}

bool RunningRobot::expect(std::uint64_t) {
  if (stop_.load(std::memory_order_relaxed)) throw Stopped();
  return false;
}

JointLayout::JointLayout(const RobotTypes& types) : types_(types) {
  const auto find = [](const ElementDescription& element, std::string_view what,
                       std::string_view name, ScalarType type = ScalarType::kFloat64) {
    return &field_of(element, what, name, type);
  };
  const FieldDescription* const wanted = find(types.action, "action", "position");
  joints_ = wanted->count();
  const auto offset = [this](const FieldDescription* field) {
    if (field->count() == joints_) return field->offset;
    throw InvalidArgument("the robot's field '" + field->name + "' has another number of joints");
  };
  wanted_position_ = offset(wanted);
  wanted_torque_ = offset(find(types.action, "action", "torque"));
  position_ = offset(find(types.observation, "observation", "position"));
  torque_ = offset(find(types.observation, "observation", "torque"));
  reasons_ = offset(find(types.applied_action, "applied action", "reasons", ScalarType::kUint64));
  thermal_margin_ = offset(find(types.applied_action, "applied action", "thermal_margin"));
}

Drive::Drive(Place& place, const Session& session, DriveOptions options,
             const std::atomic<bool>& stop)
    : place_(place),
      layout_(session.description()),
      type_(session.info().type),
      options_([&] {
        options.motion.period = session.info().period;
        return options;
      }()),
      stop_(stop),
      motion_(limits_of(session), options_.motion),
      health_(motion_),
      recovery_(options_.recovery),
      actions_(kPart * layout_.types_.action.size()),
      observations_(kPart * layout_.types_.observation.size()),
      applied_(kPart * layout_.types_.applied_action.size()),
      statuses_(kPart),
      current_(layout_.joints()),
      begun_(place.now()),
      handed_over_(begun_),
      pending_(layout_.joints()) {
  if (motion_.joints() != layout_.joints()) {
    throw InvalidArgument(fmt::format("the configuration has {} joints, the robot {}",
                                      motion_.joints(), layout_.joints()));
  }
  for (Part& part : parts_) {
    part.steps.resize(kPart);
    part.wanted.resize(kPart * layout_.joints());
  }
}

Outcome Drive::run() {
  static_cast<void>(enter_realtime(options_.realtime));
  Outcome outcome;
  try {
    while (const std::optional<Ended> ended = drive_session()) {
      if (!failure_since_) failure_since_ = place_.now();
      const bool is_missing =
          ended->failure == Failure::kAbsent || ended->failure == Failure::kControlHeld;
      // While a robot cannot be had, this is said once and not once a second.
      if (!is_missing || !is_missing_) note(ended->failure, ended->text);
      is_missing_ = is_missing;
      const Recovery::Decision decision =
          recovery_.after(ended->failure, ended->text, place_.now());
      hand_over(true);
      if (decision.needs_operator) {
        outcome = {.needs_operator = true, .why = decision.why};
        break;
      }
      place_.pause(decision.pause);
      if (!ended->needs_recovery) continue;
      try {
        place_.recover();
      } catch (const Error& error) {
        // The back-end has gone, or takes long. Connecting tells more.
      }
    }
  } catch (const Stopped&) {
    // The session was brought to rest, or there was none.
  }
  hand_over(true);
  return outcome;
}

std::optional<Drive::Ended> Drive::drive_session() {
  bool is_connected = false;
  try {
    UntypedFrontend robot = place_.connect();
    is_connected = true;
    robot.set_interrupt([this] {
      if (stop_.load(std::memory_order_relaxed)) throw Stopped();
    });
    const SessionInfo info = robot.session().info();
    const RobotTypes& types = robot.session().description();
    if (info.type != type_ || types.action.text() != layout_.types_.action.text() ||
        types.observation.text() != layout_.types_.observation.text()) {
      return Ended{.failure = Failure::kOtherRobot,
                   .text = fmt::format("'{}' is a {} with other fields now", info.name, info.type)};
    }
    begin_session(robot, info.period);
    return move_at_random(robot);
  } catch (const RobotStopped& stopped) {
    if (!is_connected && stopped.fault().code == Fault::Code::kBackendDied) {
      return Ended{.failure = Failure::kAbsent, .text = stopped.what()};
    }
    const Failure failure = failure_of(stopped.fault(), stopped.what());
    // It has moved and not come through its self-test, or was pushed beyond a limit: something may
    // hold its joints.
    const bool may_be_held = !is_tested_ || failure == Failure::kHardLimit;
    if (is_connected && may_be_held && next_ > 0) ++failed_tests_;
    return Ended{.failure = failure,
                 .text = stopped.what(),
                 .needs_recovery = stopped.fault().needs_recovery() &&
                                   stopped.fault().code != Fault::Code::kBackendDied};
  } catch (const SessionNotFound& error) {
    return Ended{.failure = Failure::kAbsent, .text = error.what()};
  } catch (const ControlHeld& error) {
    return Ended{.failure = Failure::kControlHeld, .text = error.what()};
  } catch (const IncompatibleSession& error) {
    return Ended{.failure = Failure::kOtherRobot, .text = error.what()};
  } catch (const TimedOut& error) {
    return Ended{.failure = Failure::kDriverHangs, .text = error.what()};
  } catch (const SystemError& error) {
    // For instance a session file that is being replaced, or a limit of the system.
    return Ended{.failure = Failure::kAbsent, .text = error.what()};
  }
}

void Drive::begin_session(const UntypedFrontend& robot, Nanoseconds period) {
  period_ = period;
  robot.latest_observation(observations_.data(), kBeginTimeout);
  const auto position = numbers(observations_.data(), layout_.position_, layout_.joints());
  if (home_.empty()) home_.assign(position.begin(), position.end());
  motion_.begin(position, home_, options_.first_session + sessions_++, failed_tests_ * kFreeTime);
  health_.begin_session();
  next_ = 0;
  ++current_.sessions;
  is_tested_ = false;
  lost_frames_ = 0;
  discarded_ = 0;
}

std::optional<Drive::Ended> Drive::move_at_random(UntypedFrontend& robot) {
  try {
    std::size_t oldest = 0;
    append(robot, parts_[0]);
    for (;;) {
      append(robot, parts_[1 - oldest]);
      read(robot, parts_[oldest]);
      hand_over(false);
      if (const std::optional<Ended> ended = judge_pass()) {
        bring_to_rest(robot);
        return ended;
      }
      if (is_over()) break;
      if (health_.take_hindrance()) {
        const std::size_t last = (kPart - 1) * layout_.types_.observation.size();
        motion_.give_way(numbers(observations_.data() + last, layout_.position_, layout_.joints()));
      }
      oldest = 1 - oldest;
    }
  } catch (const Stopped&) {
    bring_to_rest(robot);
    throw;
  } catch (const RobotStopped&) {
    read_rests(robot);
    throw;
  }
  bring_to_rest(robot);
  return std::nullopt;
}

void Drive::append(UntypedFrontend& robot, Part& part) {
  part.count = 0;
  const bool is_unfit = place_.expect(kPart);
  const std::size_t joints = layout_.joints();
  const std::size_t size = layout_.types_.action.size();
  for (std::size_t step = 0; step < kPart; ++step) {
    part.steps[step] = motion_.next();
    std::byte* const action = actions_.data() + step * size;
    std::memcpy(action, layout_.types_.default_action.data(), size);
    std::memcpy(action + layout_.wanted_position_, motion_.position().data(),
                joints * sizeof(double));
    std::memcpy(action + layout_.wanted_torque_, motion_.torque().data(), joints * sizeof(double));
    std::ranges::copy(motion_.position(),
                      part.wanted.begin() + static_cast<std::ptrdiff_t>(step * joints));
    if (is_unfit) {
      const double unfit = kNotGiven;
      std::memcpy(action + layout_.wanted_torque_, &unfit, sizeof(unfit));
    }
  }
  const TimeIndex last = robot.append_desired_actions(actions_.data(), kPart, kStepTimeout);
  part.first = last + 1 - static_cast<TimeIndex>(kPart);
  part.count = kPart;
}

void Drive::read(const UntypedFrontend& robot, Part& part) {
  const std::size_t count = std::exchange(part.count, 0);
  try {
    robot.get(Series::kStatus, part.first, count, statuses_.data(), kStepTimeout);
    robot.get(Series::kObservation, part.first, count, observations_.data(), kStepTimeout);
    robot.get(Series::kAppliedAction, part.first, count, applied_.data(), kStepTimeout);
  } catch (const HistoryLost&) {
    current_.lost_observations += count;
    next_ = part.first + static_cast<TimeIndex>(count);
    current_.steps += count;
    steps_ += count;
    health_.begin_session();
    return;
  } catch (const RobotStopped&) {
    part.count = count;  // for `read_rest`
    throw;
  }
  judge(part, count);
  const std::size_t last = (count - 1) * layout_.types_.observation.size();
  motion_.remember(numbers(observations_.data() + last, layout_.position_, layout_.joints()));
}

void Drive::read_rests(const UntypedFrontend& robot) noexcept {
  const std::size_t older = parts_[0].first < parts_[1].first ? 0 : 1;
  read_rest(robot, parts_[older]);
  read_rest(robot, parts_[1 - older]);
}

void Drive::read_rest(const UntypedFrontend& robot, Part& part) noexcept {
  try {
    const auto end = robot.range(Series::kAppliedAction).second;
    const TimeIndex left = end - part.first;
    if (left <= 0) return;
    part.count = std::min(part.count, static_cast<std::size_t>(left));
    if (part.count > 0) read(robot, part);
  } catch (const std::exception&) {
    // The history went with its back-end.
  }
}

void Drive::judge(const Part& part, std::size_t count) {
  const std::size_t joints = layout_.joints();
  if (part.first > next_) {
    // We were late: the robot has repeated an action in the steps between.
    const auto repeated = static_cast<std::uint64_t>(part.first - next_);
    current_.late_steps_of_user += repeated;
    current_.steps += repeated;
    steps_ += repeated;
    health_.begin_session();
  }
  next_ = part.first + static_cast<TimeIndex>(count);
  for (std::size_t step = 0; step < count; ++step) {
    const std::byte* const observation =
        observations_.data() + step * layout_.types_.observation.size();
    const std::byte* const applied = applied_.data() + step * layout_.types_.applied_action.size();
    const StepRecord record{
        .position = numbers(observation, layout_.position_, joints),
        .torque = numbers(observation, layout_.torque_, joints),
        .reasons = {reinterpret_cast<const std::uint64_t*>(applied + layout_.reasons_), joints},
        .thermal_margin = numbers(applied, layout_.thermal_margin_, joints)};
    const Status& status = statuses_[step];
    health_.add(part.steps[step], {part.wanted.data() + step * joints, joints}, record, current_);
    Health::add(status, period_, current_);
    current_.lost_frames += status.lost_frames - lost_frames_;
    current_.discarded_actions += status.discarded_actions - discarded_;
    lost_frames_ = status.lost_frames;
    discarded_ = status.discarded_actions;
  }
  steps_ += count;
}

std::optional<Drive::Ended> Drive::judge_pass() {
  const std::optional<PassResult> pass = health_.take_pass();
  if (!pass || is_tested_) return std::nullopt;
  if (pass->hindered) {
    ++failed_tests_;
    return Ended{.failure = Failure::kSelfTest,
                 .text = fmt::format("joint {} did not follow in the self-test: it went {:.3f} of "
                                     "{:.3f} rad",
                                     *pass->hindered, pass->went, pass->wanted)};
  }
  is_tested_ = true;
  failed_tests_ = 0;
  recovery_.is_well();
  is_missing_ = false;
  if (failure_since_) {
    const Nanoseconds time = place_.now() - *failure_since_;
    ++current_.recoveries;
    current_.recovery_times.add(time);
    failure_since_.reset();
    const std::lock_guard lock(mutex_);
    if (events_.size() < kMaxEvents) {
      events_.push_back({.text = "moves again, after " + duration_text(time), .is_over = true});
    }
  }
  return std::nullopt;
}

void Drive::bring_to_rest(UntypedFrontend& robot) {
  // A second request to stop must not keep the robot from coming to rest.
  robot.set_interrupt({});
  try {
    robot.finish(kRestTimeout);
    const Deadline deadline(kRestTimeout);
    while (robot.session().info().is_real_time && !robot.session().info().is_at_rest &&
           !deadline.passed()) {
      std::this_thread::sleep_for(1ms);
    }
    read_rests(robot);
  } catch (const Error&) {
    // It has ended otherwise, which is just as well.
  }
}

bool Drive::is_over() const noexcept {
  return steps_ >= options_.most_steps || place_.now() - begun_ >= options_.most_time;
}

void Drive::note(Failure failure, const std::string& text) {
  ++current_.failures[static_cast<std::size_t>(failure)];
  const std::lock_guard lock(mutex_);
  if (events_.size() < kMaxEvents) events_.push_back({.failure = failure, .text = text});
}

void Drive::hand_over(bool at_once) {
  if (!at_once && ++parts_since_ < kPartsToHandOver) return;
  std::unique_lock lock(mutex_, std::defer_lock);
  if (at_once) {
    lock.lock();
  } else if (!lock.try_lock()) {
    return;  // The loop waits for nobody.
  }
  parts_since_ = 0;
  const Nanoseconds now = place_.now();
  current_.time = now - std::exchange(handed_over_, now);
  pending_.add(current_);
  current_.clear();
}

void Drive::take(Tally& tally, std::vector<Event>& events) {
  const std::lock_guard lock(mutex_);
  tally.add(pending_);
  pending_.clear();
  std::ranges::move(events_, std::back_inserter(events));
  events_.clear();
}

}  // namespace trifinger::apps
