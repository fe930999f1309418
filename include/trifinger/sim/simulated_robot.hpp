// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "trifinger/base/random.hpp"
#include "trifinger/core/document.hpp"
#include "trifinger/core/driver.hpp"
#include "trifinger/joint/safety.hpp"
#include "trifinger/joint/types.hpp"
#include "trifinger/model/robot_model.hpp"
#include "trifinger/sim/object_observation.hpp"
#include "trifinger/sim/simulation_options.hpp"
#include "trifinger/sim/simulator.hpp"
#include "trifinger/sim/variation.hpp"

namespace trifinger {

/// The scene as documents of its sessions: "model.xml" in MuJoCo's format, and for viewers
/// "robot.urdf" and "frames.txt", which says how its links follow from what is measured.
/// @throws InvalidArgument if the description cannot be built
[[nodiscard]] std::vector<Document> model_documents(const RobotDescription& description);

/// Everything that decides how a simulation goes on, as bytes. It belongs to the model that it was
/// saved from.
using SimulationState = std::vector<std::byte>;

/// The robot R in MuJoCo, behind the same safety chain as the real one: a driver like any other.
///
/// One step of physics per action. Deterministic: options, state and actions decide the series, bit
/// for bit, on one machine.
///
/// `R` is TriFinger or Finger. The functions below the driver's own are for the owner of the
/// simulation; they must not be called while another thread runs the back-end. Every session begins
/// in the state that the last `reset`, `place_object`, `set_object_velocity` or `restore` has left.
/// In a session that goes on they take effect at once, to be seen from the next observation on. The
/// end of a session moves nothing unless `stop` says so: what `save` returns behind it goes on
/// behind the last action.
template <class R>
class SimulatedRobot final : public Driver<R> {
 public:
  using typename Driver<R>::Action;
  using typename Driver<R>::AppliedAction;
  using typename Driver<R>::Observation;
  using Options = SimulationOptions<R>;
  using Joints = JointVector<R::kJoints>;

  /// Fault codes besides those of `SafetyFault`.
  static constexpr std::int32_t kDiverged = Simulator<R>::kDiverged;

  /// @throws InvalidArgument
  explicit SimulatedRobot(Options options = {});
  ~SimulatedRobot() override;

  using Driver<R>::apply_action;
  using Driver<R>::get_latest_observation;
  using Driver<R>::hold;

  [[nodiscard]] DriverReport prepare(TimeIndex step) noexcept override;
  [[nodiscard]] DriverReport get_latest_observation(Observation& observation) noexcept override;
  [[nodiscard]] DriverReport apply_action(const Action& desired,
                                          AppliedAction& applied) noexcept override;
  [[nodiscard]] DriverReport hold(const Observation& observation, Action& action) noexcept override;
  [[nodiscard]] DriverReport stop(TimeIndex step) noexcept override;
  [[nodiscard]] std::span<const CompanionDescription> companions() const noexcept override;
  [[nodiscard]] bool get_companion_element(std::size_t index, TimeIndex time_index,
                                           void* element) noexcept override;
  [[nodiscard]] std::string_view fault_text(std::int32_t fault_code) const noexcept override;
  [[nodiscard]] std::string_view rejection_text() const noexcept override;

  [[nodiscard]] const Options& options() const noexcept;
  [[nodiscard]] const RobotModel& model() const noexcept;
  /// The checks between desired and applied actions: add your own here, before the first session.
  [[nodiscard]] SafetyChain<R>& safety() noexcept;

  /// Where every session begins unless it is told otherwise [rad].
  [[nodiscard]] const Joints& initial_position() const noexcept;
  /// Goes back to the beginning: initial pose, objects where and as fast as the description has
  /// them at the start; the seed, too.
  void reset();
  /// The same with the joints at `position` [rad] and other random numbers.
  /// @throws InvalidArgument if a joint would be beyond its hard limit or is no number
  void reset(const Joints& position, const Random& random);
  /// Differs from the description from now on, whatever is reset.
  /// @throws InvalidArgument
  void vary(const Variation& variation);
  /// Puts an object somewhere, at rest. The orientation is normalised.
  /// @throws InvalidArgument naming the objects there are, or if the pose is no pose
  void place_object(const std::string& name, const ObjectPose& pose);
  /// Lets a force act on an object's centre of mass from the next step on [N], in the world frame,
  /// as a hand that pushes; until the next call, `reset` or session.
  /// @throws InvalidArgument naming the objects there are, or if the force is not finite
  void push_object(const std::string& name, const std::array<double, 3>& force);
  /// Lets an object move from where it is: thrown, dropped with a spin, rolling.
  /// @throws InvalidArgument naming the objects there are, or if a number is not finite
  void set_object_velocity(const std::string& name, const ObjectVelocity& velocity);
  /// Where an object is now, without delay and noise.
  /// @throws InvalidArgument naming the objects there are
  [[nodiscard]] ObjectPose object_pose(const std::string& name) const;
  /// How an object moves now, without delay and noise.
  /// @throws InvalidArgument naming the objects there are
  [[nodiscard]] ObjectVelocity object_velocity(const std::string& name) const;

  /// The state as it is: physics, safety chain, delays, random numbers.
  [[nodiscard]] SimulationState save() const;
  /// Goes on as it went on from `state`, bit for bit.
  /// @throws InvalidArgument if it was saved from another model or by another version
  void restore(std::span<const std::byte> state);
  /// The last state before the simulation diverged, for a report or to try again; empty if it has
  /// not. `trifinger run` saves it in `log_folder()`.
  [[nodiscard]] const SimulationState& state_before_divergence() const noexcept;

  /// Positions and velocities of joints and objects as MuJoCo has them, to draw the scene: `qpos`,
  /// then `qvel`.
  [[nodiscard]] std::vector<double> configuration() const;

 private:
  class Implementation;
  std::unique_ptr<Implementation> implementation_;
};

extern template class SimulatedRobot<TriFinger>;
extern template class SimulatedRobot<Finger>;

}  // namespace trifinger
