// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <string_view>
#include <vector>

#include "trifinger/camera/camera.hpp"
#include "trifinger/learning/environment.hpp"
#include "trifinger/learning/task.hpp"
#include "trifinger/rendering/simulation_with_cameras.hpp"
#include "trifinger/sim/simulation_options.hpp"
#include "trifinger/sim/simulator.hpp"

namespace trifinger::learning {

/// When a simulation whose episode has ended begins the next one. These are Gymnasium's modes.
enum class Autoreset : std::uint8_t {
  kNextStep,  ///< In the next `step`, which ignores its action.
  kSameStep,  ///< At once; `Results::final` holds the last observations.
  kDisabled,  ///< Only when `reset` is called. Until then nothing moves.
};

/// Images that are older count as this old [steps].
inline constexpr TimeIndex kOldestImage = 10'000;

/// The observations of all simulations, one simulation after the other.
struct Observations {
  std::vector<float> observation;
  std::vector<double> achieved;
  std::vector<double> desired;
  /// `Outcome::distance`, as many numbers per simulation as `Environment::num_parts`.
  std::vector<double> distance;
  std::vector<double> finger_rewards;  ///< `Outcome::finger_rewards`, as many.
  std::vector<double> scores;          ///< `Outcome::scores`, those that the task has.
  std::vector<float> hidden;           ///< The numbers of `Environment::hidden_entries`.
  std::vector<std::uint8_t> success;
  /// Age of the object's pose [steps]; -1 if it was not found yet. Empty if there is no object.
  std::vector<TimeIndex> object_age;
  /// The newest images of each camera that have arrived, in RGB, with `Layout::kImages`.
  std::vector<std::vector<std::uint8_t>> images;
  /// Ages of these images [steps], one per camera and simulation, at most `kOldestImage`.
  std::vector<float> image_age;
};

/// The results of a call of `EnvironmentBatch`. They stay at the same addresses as long as the
/// batch lives.
struct Results {
  Observations seen;
  /// Final observations of the episodes that ended in this step, with `Autoreset::kSameStep`.
  Observations final;
  /// Reward of the step. A fault repeats the reward of the last observation.
  std::vector<double> reward;
  std::vector<std::uint8_t> terminated;
  std::vector<std::uint8_t> truncated;
  std::vector<std::int32_t> fault;  ///< Fault of the driver, which ends the episode; 0: none.
};

/// What moves all simulations of a batch at once, instead of MuJoCo on threads, by as many steps of
/// the model as `BatchMemory` says. It reads and writes the rows of simulations that the first
/// argument marks with a number other than 0. The second one is true if models have changed since
/// the last call.
using BatchPhysics = std::function<void(std::span<const std::uint8_t> moves, bool models_changed)>;

/// One kind of numbers of all simulations, a row for each. Rows are `stride` numbers apart.
struct BatchRows {
  double* first{nullptr};
  int width{0};
  int stride{0};
};

/// What `BatchPhysics` reads and writes, in the words of MuJoCo. The rows stay where they are.
struct BatchMemory {
  BatchRows qpos;
  BatchRows qvel;
  BatchRows qacc_warmstart;  ///< Must be the newest accelerations afterwards.
  BatchRows ctrl;            ///< Read only.
  int substeps{1};
};

/// Many simulations of one decision process, each in an episode of its own. `Environment` computes
/// the decision process and `Simulator` the physics, on the threads of MuJoCo's batches.
///
/// Each simulation gives the same results, bit for bit, as an `Environment` with a simulation of
/// its own, unless `set_reset_states` is used. One batch must not be used by several threads at
/// once. In a forked child `reset` and `step` throw InheritedHandle.
///
/// Simulations with cameras share one vision pipeline per thread. An image is drawn when an
/// observation needs it.
class EnvironmentBatch {
 public:
  /// `num_threads` includes the calling thread; 0 means one per
  /// processor that this process may use. Options that need
  /// cameras need `vision`.
  /// @throws InvalidArgument, Error that says what to install if this machine cannot draw
  EnvironmentBatch(const TaskDescription& task, const EnvironmentOptions& options,
                   const SimulationOptions& simulation, int size, int num_threads = 0,
                   const std::optional<rendering::VisionOptions>& vision = {});
  /// Makes simulations for the task with this name.
  EnvironmentBatch(std::string_view task, const EnvironmentOptions& options,
                   const SimulationOptions& simulation, int size, int num_threads = 0,
                   const std::optional<rendering::VisionOptions>& vision = {})
      : EnvironmentBatch(find_task(task), options, simulation, size, num_threads, vision) {}
  ~EnvironmentBatch();

  [[nodiscard]] const Environment& environment() const noexcept;
  [[nodiscard]] std::size_t size() const noexcept;
  [[nodiscard]] int num_threads() const noexcept;
  /// Age of the newest pose of the object just before the next one arrives [steps]. If it is older,
  /// poses were lost, or the tracker was not sure since then.
  [[nodiscard]] TimeIndex oldest_sure_age() const noexcept;
  /// The cameras of each simulation that are observed; none without `Layout::kImages`.
  [[nodiscard]] const std::vector<camera::Camera>& cameras() const noexcept;

  /// Makes the next `reset` of simulation `index` begin this episode of `seed`. Each later reset
  /// begins the next episode.
  /// @throws InvalidArgument if there is no such simulation
  void seed(std::size_t index, std::uint64_t seed, std::uint64_t episode = 0);
  /// Lets a share of the later episodes begin in one of these states, for a training. Not for tasks
  /// that remember where an episode has begun: they remember the start that was drawn.
  /// @throws InvalidArgument if a robot cannot begin in one of the states
  void set_reset_states(ResetStates resets);
  /// Begins an episode in the simulations that `which` marks with a number other than 0, or in all
  /// of them without marks.
  /// @throws InvalidArgument if `which` has another size
  void reset(std::span<const std::uint8_t> which = {});
  /// Applies one action in each simulation. `actions` has one row of numbers per simulation, as for
  /// `Environment::take_action`.
  /// @throws InvalidArgument if there are too many or too few numbers, or one is not finite; then
  /// nothing moves. Error if an image could not be drawn; then the episode of that simulation has
  /// ended, and the others have moved on. What a task of many throws; then all episodes have ended.
  void step(std::span<const float> actions, Autoreset autoreset = Autoreset::kNextStep);

  [[nodiscard]] Results& results() noexcept;

  /// `Environment::first_finger` of simulation `index`.
  /// @throws InvalidArgument if there is no such simulation
  [[nodiscard]] std::size_t first_finger(std::size_t index) const;

  /// @name Other physics
  /// @{

  /// Lets `physics` move the simulations, in place of MuJoCo. Motors, safety checks and the task
  /// stay those of this class. What `physics` throws, `step` throws; the episodes that were under
  /// way have then ended.
  /// @throws InvalidArgument if images are needed
  void set_physics(BatchPhysics physics);
  [[nodiscard]] BatchMemory memory();
  /// The model as a file of MuJoCo, with all pairs of surfaces that may vary.
  [[nodiscard]] std::vector<std::byte> model_file() const;
  /// What of the model may differ from simulation to simulation: names of fields of `mjModel`; none
  /// if nothing does.
  [[nodiscard]] std::vector<std::string_view> varied_fields() const;
  /// One of these fields of all simulations, one after the other.
  /// @throws InvalidArgument if it is none of these
  [[nodiscard]] std::vector<double> varied_field(std::string_view name) const;
  /// @}

  /// Positions and velocities of joints and objects of simulation `index` in MuJoCo's layout, to
  /// draw it: `qpos`, then `qvel`.
  /// @throws InvalidArgument if there is no such simulation
  [[nodiscard]] std::vector<double> configuration(std::size_t index) const;

 private:
  class Implementation;
  class Simulations;
  std::unique_ptr<Implementation> implementation_;
};

}  // namespace trifinger::learning
