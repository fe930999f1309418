// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <string_view>
#include <vector>

#include "trifinger/learning/environment.hpp"
#include "trifinger/sim/simulation_options.hpp"

namespace trifinger::learning {

/// When a simulation whose episode has ended begins the next one, as Gymnasium has it.
enum class Autoreset : std::uint8_t {
  kNextStep,  ///< In the next `step`, whose action is ignored.
  kSameStep,  ///< At once; `Results::final` has what was seen last.
  kDisabled,  ///< When `reset` says so. Until then nothing moves.
};

/// What is seen of all simulations, one after the other.
struct Observations {
  std::vector<float> observation;
  std::vector<double> achieved;
  std::vector<double> desired;
  std::vector<double> distance;        ///< `kMaxFingers` for each simulation: `Outcome::distance`.
  std::vector<double> finger_rewards;  ///< Likewise.
  std::vector<std::uint8_t> success;
};

/// What a call of `EnvironmentBatch` has brought. Lies where it is until the batch is gone.
struct Results {
  Observations seen;
  /// Of the episodes that have ended in this step, with `Autoreset::kSameStep`.
  Observations final;
  /// Of the step. A fault repeats the reward of what was seen last.
  std::vector<double> reward;
  std::vector<std::uint8_t> terminated;
  std::vector<std::uint8_t> truncated;
  std::vector<std::int32_t> fault;  ///< Of the driver, which ends the episode; 0 for none.
};

/// Many simulations of one decision process, each in an episode of its own: what `Environment` says
/// of them, and what `Simulator` does with them, on the threads of MuJoCo's batches.
///
/// Each is, bit for bit, what the same `Environment` is on a front-end of a simulation of its own.
/// Not for several threads at once.
class EnvironmentBatch {
 public:
  /// `num_threads` includes the caller's; 0 for one per processor.
  /// @throws InvalidArgument
  template <class R>
  EnvironmentBatch(std::string_view task, const EnvironmentOptions& options,
                   const SimulationOptions<R>& simulation, int size, int num_threads = 0);
  ~EnvironmentBatch();
  EnvironmentBatch(const EnvironmentBatch&) = delete;
  EnvironmentBatch& operator=(const EnvironmentBatch&) = delete;

  [[nodiscard]] const Environment& environment() const noexcept;
  [[nodiscard]] std::size_t size() const noexcept;
  [[nodiscard]] int num_threads() const noexcept;

  /// The next `reset` of simulation `index` begins this episode of `seed`; from then on each reset
  /// begins the next one.
  /// @throws InvalidArgument if there is no such simulation
  void seed(std::size_t index, std::uint64_t seed, std::uint64_t episode = 0);
  /// Begins an episode in those simulations whose number in `which` is not 0; in all if it is
  /// empty.
  /// @throws InvalidArgument if its size is another one
  void reset(std::span<const std::uint8_t> which = {});
  /// Lets one action act in each simulation: rows of numbers, as `Environment::take_action` takes
  /// them.
  /// @throws InvalidArgument if their count is wrong or one is not finite; then nothing moves
  void step(std::span<const float> actions, Autoreset autoreset = Autoreset::kNextStep);

  [[nodiscard]] Results& results() noexcept;

 private:
  class Implementation;
  template <class R>
  class Typed;
  std::unique_ptr<Implementation> implementation_;
};

extern template EnvironmentBatch::EnvironmentBatch(std::string_view, const EnvironmentOptions&,
                                                   const SimulationOptions<TriFinger>&, int, int);
extern template EnvironmentBatch::EnvironmentBatch(std::string_view, const EnvironmentOptions&,
                                                   const SimulationOptions<Finger>&, int, int);

}  // namespace trifinger::learning
