// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <optional>
#include <string>

#include "base/latest.hpp"
#include "trifinger/core/backend.hpp"
#include "trifinger/core/driver.hpp"
#include "trifinger/core/frontend.hpp"
#include "trifinger/joint/limits.hpp"
#include "trifinger/joint/types.hpp"

namespace trifinger::learning {

/// Lets a person take over a robot on which a policy acts: a session of its own, in real time, with
/// the robot's name and "-takeover". Whatever controls a robot can control it: a gamepad, a skill,
/// a hand, a program.
///
/// It shows what the robot measures. The person's actions go to whoever controls the robot, who
/// applies them in place of the policy's, so the robot's own safety checks see them. If a program
/// is late for half a second, the person has let go. The session is then ready for the next one.
template <class R>
class Takeover final : private Driver<R> {
 public:
  using Action = typename R::Action;

  /// Offers the session in a thread with these settings, as long as the object lives. `limits` are
  /// the robot's.
  /// @throws RobotOwned if another process offers it, InvalidArgument, SystemError
  Takeover(const Session& robot, const JointLimits<R::kJoints>& limits,
           const RealtimeOptions& realtime = {.demand = Demand::kOff},
           Clock& clock = MonotonicClock::instance());

  /// The newest action of the person; nullptr while nobody has taken over. It stays as it is until
  /// the next call. For one thread.
  [[nodiscard]] const Action* newest() noexcept TRIFINGER_REALTIME;
  [[nodiscard]] const JointLimits<R::kJoints>& limits() const noexcept { return limits_; }

  /// The name of the session for the robot `name`.
  [[nodiscard]] static std::string name_for(const std::string& name) { return name + "-takeover"; }

 private:
  using typename Driver<R>::AppliedAction;
  using typename Driver<R>::Observation;
  using Driver<R>::get_latest_observation;
  using Driver<R>::apply_action;
  using Driver<R>::hold;

  // What a person does with the robot.
  struct Doing {
    Action action;
    bool has_control{false};
  };

  [[nodiscard]] DriverReport get_latest_observation(Observation& observation) noexcept override;
  [[nodiscard]] DriverReport apply_action(const Action& desired,
                                          AppliedAction& applied) noexcept override;
  [[nodiscard]] DriverReport hold(const Observation& observation, Action& action) noexcept override;

  JointLimits<R::kJoints> limits_;
  Frontend<R> robot_;
  Observation seen_;
  Latest<Doing> doing_;
  SessionHost host_;
  Backend backend_;
  std::optional<BackendThread> thread_;  // Last member, because the thread uses the others.
};

extern template class Takeover<TriFinger>;
extern template class Takeover<Finger>;

}  // namespace trifinger::learning
