// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string_view>
#include <vector>

#include "trifinger/ipc/fork.hpp"
#include "trifinger/learning/environment_batch.hpp"

namespace trifinger::learning {

// The episodes of a batch, their results, and the call in progress.
class EnvironmentBatch::Implementation {
 public:
  // Makes simulations that run on `num_threads` threads; 0: one for each processor.
  [[nodiscard]] static std::unique_ptr<Implementation> make(
      Environment its_environment, const SimulationOptions& options, std::size_t count,
      int num_threads, const std::optional<rendering::VisionOptions>& vision);
  Implementation(Environment its_environment, std::size_t count,
                 const std::optional<rendering::VisionOptions>& vision);
  Implementation(const Implementation&) = delete;
  Implementation& operator=(const Implementation&) = delete;
  virtual ~Implementation() = default;

  [[nodiscard]] virtual int num_threads() const noexcept = 0;
  // Does what `call` says in the given simulations.
  virtual void run(std::span<const int> which) = 0;

  [[nodiscard]] virtual std::vector<double> configuration(std::size_t index) const = 0;
  [[nodiscard]] virtual BatchMemory memory() = 0;
  [[nodiscard]] virtual std::vector<std::byte> model_file() const = 0;
  [[nodiscard]] virtual std::vector<std::string_view> varied_fields() const = 0;
  [[nodiscard]] virtual std::vector<double> varied_field(std::string_view name) const = 0;

  // Throws InheritedHandle in a forked child, which has none of the threads.
  void require_own() const;
  // Throws InvalidArgument if there is no such simulation.
  void require_simulation(std::size_t index) const;

  // The progress of one simulation.
  struct Run {
    Episode episode{};
    std::uint64_t next_episode{0};
    bool must_reset{true};
    double reward{0.0};  // Reward of the newest observation.
  };

  // kBegin begins new episodes and keeps the results of those that have ended.
  enum class Call : std::uint8_t { kReset, kStep, kBegin };

  ipc::ForkGuard fork;
  Environment environment;
  std::vector<camera::Camera> cameras;  // that are observed
  std::size_t size;
  TimeIndex oldest_sure_age{0};
  std::vector<std::uint64_t> seeds;
  std::vector<Run> runs;
  Results results;
  BatchPhysics physics;  // none: MuJoCo's
  ResetStates reset_states;
  std::vector<int> selected;
  // The call in progress.
  Call call{Call::kReset};
  Autoreset autoreset{Autoreset::kNextStep};
  std::span<const float> actions;
};

}  // namespace trifinger::learning
