// SPDX-License-Identifier: BSD-3-Clause
#include "learning/takeover.hpp"

#include <algorithm>
#include <chrono>
#include <cstddef>
#include <cstdint>

#include "trifinger/base/error.hpp"
#include "trifinger/joint/safety.hpp"
#include "trifinger/joint/safety_checks.hpp"

namespace trifinger::learning {
namespace {

constexpr Nanoseconds kLongestSilence = std::chrono::milliseconds(500);

BackendOptions options_for(Nanoseconds period) {
  const auto most = static_cast<std::uint32_t>(std::max<std::int64_t>(1, kLongestSilence / period));
  return {.mode = BackendOptions::Mode::kRealTime,
          .period = period,
          .max_action_repeats = most,
          .max_skipped_ticks = most,
          .max_rejected_actions = most};
}

}  // namespace

template <class R>
Takeover<R>::Takeover(const Session& robot, const JointLimits<R::kJoints>& limits,
                      const RealtimeOptions& realtime, Clock& clock)
    : limits_(limits),
      robot_(robot),
      seen_(robot_.latest_observation()),
      host_(SessionHost::named(name_for(robot.info().name), {.documents = robot.documents()})),
      backend_(*this, host_, options_for(robot.info().period), clock) {
  // However it ended, nobody acts any more, and nobody has to clear that a person was late.
  backend_.set_after_session([this](const Fault&) {
    doing_.write({});
    backend_.recover();
  });
  thread_.emplace(backend_, realtime);
  static_cast<void>(Frontend<R>(host_, {.control = false}));  // waits until it can be found
}

template <class R>
const typename R::Action* Takeover<R>::newest() noexcept {
  static_cast<void>(doing_.update());
  return doing_.seen().has_control ? &doing_.seen().action : nullptr;
}

template <class R>
DriverReport Takeover<R>::get_latest_observation(Observation& observation) noexcept {
  try {
    seen_ = robot_.latest_observation(Timeout::zero());
  } catch (const Error&) {
    // The robot's memory is damaged: its controller gets to know that, too, and ends.
  }
  observation = seen_;
  return DriverReport::ready();
}

// Takes what the robot would not reject.
template <class R>
DriverReport Takeover<R>::apply_action(const Action& desired, AppliedAction& applied) noexcept {
  bool is_rejected = false;
  for (std::size_t i = 0; i < R::kJoints; ++i) {
    const CheckedCommand checked =
        accept_command(trifinger::detail::command_of(desired, i), seen_.position[i], limits_[i]);
    trifinger::detail::set_command(applied, i, checked.command);
    applied.torque[i] = torque_of(checked.command, seen_.position[i], seen_.velocity[i]);
    applied.reasons[i] = checked.reasons;
    is_rejected = is_rejected || checked.reasons != 0;
  }
  if (!is_rejected) doing_.write({desired, true});
  return {.action_rejected = is_rejected};
}

// Nobody has control yet: an action that is not taken.
template <class R>
DriverReport Takeover<R>::hold(const Observation& /*observation*/, Action& action) noexcept {
  action = {};
  action.torque.fill(kNotGiven);
  return DriverReport::ready();
}

template class Takeover<TriFinger>;
template class Takeover<Finger>;

}  // namespace trifinger::learning
