// SPDX-License-Identifier: BSD-3-Clause
#include "trifinger/guiding/guide.hpp"

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cmath>
#include <condition_variable>
#include <cstddef>
#include <exception>
#include <future>
#include <mutex>
#include <thread>
#include <utility>
#include <vector>

#include "base/text_of.hpp"
#include "guiding/joint_elements.hpp"
#include "trifinger/base/error.hpp"
#include "trifinger/core/errors.hpp"
#include "trifinger/core/session.hpp"

namespace trifinger::guiding {
namespace {

using trifinger::detail::text_of;

// Callers that wait call their interrupt at least this often.
constexpr Nanoseconds kSlice = std::chrono::milliseconds(100);
// How often a caller looks whether the robot has arrived.
constexpr Nanoseconds kLook = std::chrono::milliseconds(5);
// How long a robot may brake before its session ends.
constexpr Nanoseconds kLongestBrake = std::chrono::seconds(2);
// A destructor waits this long for the end of the session.
constexpr Nanoseconds kTimeout = std::chrono::seconds(1);

// How far the guide's thread shall go towards its end. Values only grow.
enum class End : int {
  kNone,
  kBrake,    // Brake, then end the session.
  kAtOnce,   // End the session at once.
  kAbandon,  // Do not even wait for the end of the session.
};

// Ends a wait of the guide's thread.
struct Stop : std::exception {};

// What the thread of a guide knows of itself. Null in all other threads.
struct OwnThread {
  const std::atomic<End>* end;
  bool is_ending_session{false};
};
thread_local OwnThread* own_thread = nullptr;

// True if `setpoint` leaves nothing to do of what was asked before.
bool is_whole(const Setpoint& setpoint) {
  if (setpoint.mode == Mode::kMoveJoints) return !setpoint.joints.hasNaN();
  return setpoint.mode != Mode::kMoveFrame;
}

bool replaces(const Setpoint& setpoint, const Setpoint& earlier) {
  if (is_whole(setpoint)) return true;
  if (setpoint.mode != earlier.mode) return false;
  if (setpoint.mode == Mode::kMoveFrame) return setpoint.frame == earlier.frame;
  return !(setpoint.joints.array().isNaN() && !earlier.joints.array().isNaN()).any();
}

// The setpoints that the thread has not seen yet, in their order: at most one for the whole robot,
// one for each frame and one for each joint.
class Mailbox {
 public:
  void put(const Setpoint& setpoint) {
    std::erase_if(setpoints_, [&](const Setpoint& earlier) { return replaces(setpoint, earlier); });
    setpoints_.push_back(setpoint);
  }
  [[nodiscard]] bool is_empty() const noexcept { return setpoints_.empty(); }

  // Hands each setpoint to `take` and forgets it, without freeing memory.
  template <class Take>
  void empty(const Take& take) noexcept {
    std::ranges::for_each(setpoints_, take);
    setpoints_.clear();
  }

 private:
  std::vector<Setpoint> setpoints_;
};

std::string point_text(const Eigen::Vector3d& point) {
  // In millimetres, because nobody wants to read more digits.
  const auto coordinate = [](double metres) { return std::round(1e3 * metres) / 1e3; };
  return text_of("(", coordinate(point.x()), ", ", coordinate(point.y()), ", ",
                 coordinate(point.z()), ") m");
}

// One sentence for each frame and joint that does not get where it was sent.
std::string refusal_of(const ControllerState& state, const GuidedRobot& robot) {
  std::string text;
  const auto add = [&text](const std::string& sentence) {
    text += (text.empty() ? "" : "; ") + sentence;
  };
  std::string at_limits;
  for (std::size_t i = 0; i < robot.limits.size(); ++i) {
    const DrivenJoint& joint = robot.model->joints()[i];
    const double target = state.target[static_cast<Eigen::Index>(i)];
    if (state.is_clamped[i]) {
      add(text_of(joint.name, " goes only to its soft limit of ", target,
                  joint.is_slide ? " m" : " rad"));
    }
    if (target == robot.limits[i].soft_lower || target == robot.limits[i].soft_upper)
      at_limits += (at_limits.empty() ? "" : ", ") + joint.name;
  }
  for (std::size_t i = 0; i < robot.frames.size(); ++i) {
    if (state.missing[i] == 0.0) continue;
    add(text_of(robot.frames[i], " goes only to ",
                point_text(state.target_frames.col(static_cast<Eigen::Index>(i))),
                ": its point cannot be reached",
                at_limits.empty() ? "" : " from here within the soft limits of " + at_limits));
  }
  return text;
}

template <class Numbers>
void require_finite_numbers(const char* what, const Numbers& numbers) {
  for (Eigen::Index i = 0; i < numbers.size(); ++i) {
    if (std::isfinite(numbers[i])) continue;
    throw InvalidArgument(text_of(what, " ", i, " is ", numbers[i], ", must be a finite number"));
  }
}

// Returns `frontend` if a guide can steer its robot.
std::shared_ptr<UntypedFrontend> steerable(std::shared_ptr<UntypedFrontend> frontend) {
  const SessionInfo info = frontend->session().info();
  if (info.is_companion || !frontend->is_controller()) {
    throw InvalidArgument("a guide must control its robot, but this handle of '" + info.name +
                          "' only observes; use connect()");
  }
  if (!info.is_real_time) {
    throw InvalidArgument("robot '" + info.name +
                          "' is not in real-time mode: it waits for every action, so nobody can "
                          "steer it; 'trifinger run' runs robots in real time");
  }
  return frontend;
}

}  // namespace

bool interrupt_guide() {
  if (own_thread == nullptr) return false;
  // relaxed: a flag that guards no data.
  const End end = own_thread->end->load(std::memory_order_relaxed);
  if (end == End::kAbandon || (end == End::kAtOnce && !own_thread->is_ending_session)) throw Stop();
  return true;
}

class Guide::Implementation {
 public:
  Implementation(std::shared_ptr<UntypedFrontend> frontend, const GuidedRobot& robot,
                 GuideOptions options)
      : options_(std::move(options)),
        frontend_(std::move(frontend)),
        name_(frontend_->session().info().name),
        elements_(frontend_->session()),
        controller_(robot, options_.speeds, frontend_->session().info().period),
        seen_(controller_.state()) {
    if (elements_.num_joints() != robot.limits.size()) {
      throw InvalidArgument(text_of("robot '", name_, "' has ", elements_.num_joints(),
                                    " joints, its description ", robot.limits.size()));
    }
    std::promise<std::vector<std::string>> entered;
    std::future<std::vector<std::string>> warnings = entered.get_future();
    thread_ = std::thread([this, &entered] { work(entered); });
    try {
      realtime_warnings_ = warnings.get();
    } catch (...) {
      thread_.join();
      throw;
    }
  }
  ~Implementation() {
    try {
      static_cast<void>(end(End::kAtOnce, kTimeout, {}));
    } catch (...) {
      // The thread has ended; nobody is left to hear why.
    }
  }

  void put(const Setpoint& setpoint) {
    const std::lock_guard lock(mutex_);
    require_running();
    mailbox_.put(setpoint);
  }

  [[nodiscard]] GuideState state(Timeout timeout) const {
    GuideState state;
    const ControllerState seen = wait_for_state(timeout, state);
    state.mode = seen.mode;
    state.joints = seen.measured;
    state.reference_joints = seen.reference;
    state.target_joints = seen.target;
    state.frames = seen.measured_frames;
    state.reference_frames = seen.reference_frames;
    state.target_frames = seen.target_frames;
    state.refusal = refusal_of(seen, controller_.robot());
    return state;
  }

  void wait_until_arrived(Timeout timeout) const {
    const Deadline deadline(timeout);
    std::unique_lock lock(mutex_);
    while (true) {
      if (failure_ == nullptr && has_arrived()) return;
      require_running();
      if (has_begun_ && mailbox_.is_empty() && seen_.mode == Mode::kFloat)
        throw InvalidArgument("robot '" + name_ +
                              "' floats, so it never arrives; hold it or move it");
      if (deadline.passed())
        throw TimedOut("robot '" + name_ + "' has not arrived at its target in time");
      wait(lock, deadline, kLook, [] { return false; });
    }
  }

  [[nodiscard]] bool is_running() const {
    const std::lock_guard lock(mutex_);
    return !has_ended_;
  }

  void check() const {
    const std::lock_guard lock(mutex_);
    if (failure_ != nullptr) std::rethrow_exception(failure_);
  }

  // Ends the thread, and returns whether its session has ended. Throws what the interrupt throws.
  [[nodiscard]] bool end(End how, Timeout timeout, const std::function<void()>& interrupt) {
    raise_end(how);
    std::unique_lock lock(mutex_);
    const Deadline deadline(timeout);
    const auto has_ended = [this] { return has_ended_; };
    while (!has_ended_ && !deadline.passed()) {
      changed_.wait_for(lock, deadline.remaining(kSlice), has_ended);
      if (has_ended_ || !interrupt) continue;
      lock.unlock();
      interrupt();
      lock.lock();
    }
    if (!has_ended_) {
      raise_end(End::kAbandon);
      // The thread's waits call their interrupt every 100 ms, so this ends.
      changed_.wait(lock, has_ended);
    }
    // The thread has nothing left to do but to return.
    if (thread_.joinable()) {
      std::thread ended = std::exchange(thread_, std::thread());
      lock.unlock();
      ended.join();
    }
    return !is_abandoned_;
  }

  void throw_unanswered() const {
    throw TimedOut("robot '" + name_ +
                   "' has not ended its session in time: its back-end does not answer; if this "
                   "lasts, 'trifinger stop " +
                   name_ + "' ends it");
  }

  [[nodiscard]] const GuideOptions& options() const noexcept { return options_; }
  [[nodiscard]] const GuideController& controller() const noexcept { return controller_; }
  [[nodiscard]] const UntypedFrontend& frontend() const noexcept { return *frontend_; }
  [[nodiscard]] const std::vector<std::string>& realtime_warnings() const noexcept {
    return realtime_warnings_;
  }

 private:
  // Throws unless the guide still runs. The caller has locked the mutex.
  void require_running() const {
    if (failure_ != nullptr) std::rethrow_exception(failure_);
    // relaxed: a flag that guards no data.
    if (has_ended_ || end_.load(std::memory_order_relaxed) != End::kNone)
      throw InvalidArgument("the guide of '" + name_ + "' has ended; make a new one");
  }

  // What setpoints are put after the newest state counts as not arrived.
  [[nodiscard]] bool has_arrived() const noexcept {
    return has_begun_ && seen_.has_arrived && mailbox_.is_empty();
  }

  void raise_end(End how) noexcept {
    End now = end_.load(std::memory_order_relaxed);
    // relaxed: a flag that guards no data.
    while (now < how && !end_.compare_exchange_weak(now, how, std::memory_order_relaxed)) {
    }
  }

  // Waits at most one slice for `ready`, then calls the interrupt of the options without the lock.
  template <class Ready>
  void wait(std::unique_lock<std::mutex>& lock, const Deadline& deadline, Nanoseconds slice,
            const Ready& ready) const {
    changed_.wait_for(lock, deadline.remaining(slice), ready);
    if (!options_.interrupt) return;
    lock.unlock();
    options_.interrupt();
    lock.lock();
  }

  ControllerState wait_for_state(Timeout timeout, GuideState& state) const {
    const Deadline deadline(timeout);
    std::unique_lock lock(mutex_);
    while (!has_begun_) {
      require_running();
      if (deadline.passed()) {
        throw TimedOut("robot '" + name_ +
                       "' has not measured anything in time; it may still be homing");
      }
      wait(lock, deadline, kSlice, [this] { return has_begun_ || has_ended_; });
    }
    state.step = step_;
    state.has_arrived = has_arrived();
    return seen_;
  }

  // The guide's thread.
  void work(std::promise<std::vector<std::string>>& entered) {
    try {
      entered.set_value(enter_realtime(options_.realtime));
    } catch (...) {
      const std::lock_guard lock(mutex_);
      has_ended_ = true;
      entered.set_exception(std::current_exception());
      return;
    }
    OwnThread self{&end_};
    own_thread = &self;
    std::exception_ptr failure;
    bool is_abandoned = false;
    try {
      try {
        drive();
      } catch (const Stop&) {
        // Somebody wants the guide to end, whatever it waits for.
        if (end_.load(std::memory_order_relaxed) == End::kAbandon) throw;
      }
      // A session that has not begun does not end. It is free for the next controller.
      self.is_ending_session = true;
      if (has_appended_) frontend_->finish(kForever);
    } catch (const Stop&) {
      is_abandoned = has_appended_;
    } catch (...) {
      failure = std::current_exception();
    }
    own_thread = nullptr;
    const std::lock_guard lock(mutex_);
    failure_ = failure;
    is_abandoned_ = is_abandoned;
    has_ended_ = true;
    changed_.notify_all();
  }

  // Drives the robot until somebody wants the guide to end.
  void drive() {
    frontend_->latest_observation(elements_.observation(), kForever);
    if (!controller_.begin(elements_.measured())) {
      throw Error("robot '" + name_ +
                  "' measures positions that are no numbers; a guide cannot begin there");
    }
    {
      const std::lock_guard lock(mutex_);
      seen_ = controller_.state();
      has_begun_ = true;
      changed_.notify_all();
    }
    const TimeIndex most = kLongestBrake / frontend_->session().info().period;
    TimeIndex braked = -1;  // Steps since the guide began to brake at its end.
    TimeIndex step = -1;
    while (true) {
      const End end = end_.load(std::memory_order_relaxed);
      if (end >= End::kAtOnce) return;
      if (end == End::kBrake) {
        if (++braked == 0) static_cast<void>(controller_.accept({.mode = Mode::kHold}));
        if (braked > most || (braked > 0 && controller_.state().has_arrived)) return;
      }
      const void* const action = elements_.action(controller_.update(elements_.measured()));
      const TimeIndex next = frontend_->append_desired_action(action, kForever);
      has_appended_ = true;
      exchange(step, end == End::kNone);
      step = next;
      frontend_->get(Series::kObservation, step, elements_.observation(), kForever);
    }
  }

  // Takes new setpoints and shows the newest state. If a caller is just then at it, the next step
  // does.
  void exchange(TimeIndex step, bool takes_setpoints) noexcept {
    const std::unique_lock lock(mutex_, std::try_to_lock);
    if (!lock.owns_lock()) return;
    if (takes_setpoints) {
      // `put` has checked all setpoints, so none is refused.
      mailbox_.empty(
          [this](const Setpoint& setpoint) { static_cast<void>(controller_.accept(setpoint)); });
    }
    seen_ = controller_.state();
    step_ = step;
  }

  GuideOptions options_;
  std::shared_ptr<UntypedFrontend> frontend_;
  std::string name_;
  std::vector<std::string> realtime_warnings_;
  std::atomic<End> end_{End::kNone};

  // The thread uses these without a lock.
  detail::JointElements elements_;
  GuideController controller_;
  bool has_appended_{false};

  mutable std::mutex mutex_;
  mutable std::condition_variable changed_;  // The guide has begun, or has ended.
  // The mutex guards these.
  Mailbox mailbox_;
  ControllerState seen_;
  TimeIndex step_{-1};
  bool has_begun_{false};
  bool has_ended_{false};
  bool is_abandoned_{false};
  std::exception_ptr failure_;
  std::thread thread_;  // Not joinable once somebody joins it.
};

namespace {

std::shared_ptr<UntypedFrontend> owned(UntypedFrontend frontend) {
  frontend.set_interrupt([] { static_cast<void>(interrupt_guide()); });
  return std::make_shared<UntypedFrontend>(std::move(frontend));
}

}  // namespace

Guide::Guide(const std::string& name, GuideOptions options)
    : Guide(UntypedFrontend(name), std::move(options)) {}

Guide::Guide(UntypedFrontend frontend, GuideOptions options)
    : Guide(owned(std::move(frontend)), std::move(options)) {}

Guide::Guide(std::shared_ptr<UntypedFrontend> frontend, GuideOptions options) {
  frontend = steerable(std::move(frontend));
  const GuidedRobot robot = guided_robot(frontend->session(), options.frames);
  implementation_ =
      std::make_unique<Implementation>(std::move(frontend), robot, std::move(options));
}

Guide::Guide(std::shared_ptr<UntypedFrontend> frontend, const GuidedRobot& robot,
             GuideOptions options)
    : implementation_(std::make_unique<Implementation>(steerable(std::move(frontend)), robot,
                                                       std::move(options))) {}

Guide::~Guide() {
  // The thread stayed in the parent, and its locks may be held for ever in this copy of them.
  if (!fork_.is_inherited()) return;
  [[maybe_unused]] const Implementation* const left = implementation_.release();
}

Guide::Implementation& Guide::own() const {
  if (fork_.is_inherited())
    throw InheritedHandle("this guide was made before fork(); make a new one in the child process");
  return *implementation_;
}

int Guide::num_joints() const noexcept { return static_cast<int>(robot().limits.size()); }
const GuidedRobot& Guide::robot() const noexcept { return implementation_->controller().robot(); }

void Guide::move_frame(int frame, const Eigen::Vector3d& position) {
  const int count = static_cast<int>(robot().frames.size());
  if (frame < 0 || frame >= count) {
    throw InvalidArgument(text_of(
        "frame ", frame, " does not exist; ",
        count == 0 ? "this robot's frames have no names: name some when you make the guide (frames)"
                   : text_of("frames are 0 to ", count - 1)));
  }
  require_finite_numbers("coordinate", position);
  own().put({.mode = Mode::kMoveFrame, .frame = frame, .point = position});
}

void Guide::move_joints(const GuidedJoints& positions) {
  if (positions.size() != num_joints()) {
    throw InvalidArgument(text_of(positions.size(), " positions were given, the robot has ",
                                  num_joints(), " joints"));
  }
  require_finite_numbers("position", positions);
  own().put({.mode = Mode::kMoveJoints, .joints = positions});
}

void Guide::move_joint(int joint, double position) {
  if (joint < 0 || joint >= num_joints()) {
    throw InvalidArgument(
        text_of("joint ", joint, " does not exist; joints are 0 to ", num_joints() - 1));
  }
  if (!std::isfinite(position))
    throw InvalidArgument(text_of("position is ", position, ", must be a finite number"));
  Setpoint setpoint{.mode = Mode::kMoveJoints,
                    .joints = GuidedJoints::Constant(num_joints(), kNotGiven)};
  setpoint.joints[joint] = position;
  own().put(setpoint);
}

void Guide::home() { own().put({.mode = Mode::kHome}); }
void Guide::hold() { own().put({.mode = Mode::kHold}); }
void Guide::float_freely() {
  if (robot().refuses_torques) {
    throw InvalidArgument("robot '" + own().frontend().session().info().name +
                          "' cannot float: its motors follow positions and refuse torques "
                          "(dynamixel.mode: position); run it with dynamixel.mode: torque");
  }
  own().put({.mode = Mode::kFloat});
}

GuideState Guide::state(Timeout timeout) const { return own().state(timeout); }
void Guide::wait_until_arrived(Timeout timeout) const { own().wait_until_arrived(timeout); }
bool Guide::is_running() const { return own().is_running(); }
void Guide::check() const { own().check(); }

void Guide::finish(Timeout timeout) {
  Implementation& guide = own();
  const bool has_answered = guide.end(End::kBrake, timeout, guide.options().interrupt);
  guide.check();
  if (!has_answered) guide.throw_unanswered();
}

void Guide::stop(Timeout timeout) {
  Implementation& guide = own();
  if (!guide.end(End::kAtOnce, timeout, guide.options().interrupt)) guide.throw_unanswered();
}

const UntypedFrontend& Guide::frontend() const { return own().frontend(); }

const std::vector<std::string>& Guide::realtime_warnings() const noexcept {
  return implementation_->realtime_warnings();
}

}  // namespace trifinger::guiding
