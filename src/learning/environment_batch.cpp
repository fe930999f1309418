// SPDX-License-Identifier: BSD-3-Clause
#include "trifinger/learning/environment_batch.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <string>
#include <utility>

#include "environment_batch_implementation.hpp"
#include "trifinger/base/error.hpp"
#include "trifinger/core/errors.hpp"

namespace trifinger::learning {
namespace {

using trifinger::detail::require;

std::size_t checked_size(int size) {
  constexpr int kMost = 100000;
  require(size >= 1 && size <= kMost, "the number of simulations is " + std::to_string(size) +
                                          ", must be 1 to " + std::to_string(kMost));
  return static_cast<std::size_t>(size);
}

}  // namespace

EnvironmentBatch::Implementation::Implementation(
    Environment its_environment, std::size_t count,
    const std::optional<rendering::VisionOptions>& vision)
    : environment(std::move(its_environment)), size(count), seeds(count), runs(count) {
  const EnvironmentOptions& options = environment.options();
  require(vision.has_value() || !options.needs_cameras(),
          "the options need simulated cameras, which are missing in the configuration");
  if (options.layout == Layout::kImages) cameras = vision->cameras;
  std::iota(seeds.begin(), seeds.end(), std::uint64_t{0});
  std::size_t hidden = 0;
  for (const Entry& entry : environment.hidden_entries()) hidden += entry.low.size();
  for (Observations* observations : {&results.seen, &results.final}) {
    observations->observation.resize(size * environment.observation_size());
    observations->achieved.resize(size * environment.goal_size());
    observations->desired.resize(size * environment.goal_size());
    observations->distance.resize(size * environment.num_parts());
    observations->finger_rewards.resize(size * environment.num_parts());
    observations->scores.resize(size * environment.scores().size());
    observations->hidden.resize(size * hidden);
    observations->success.resize(size);
    if (!environment.object_name().empty()) observations->object_age.resize(size);
    observations->image_age.resize(size * cameras.size());
    for (const camera::Camera& camera : cameras) {
      const auto pixels = static_cast<std::size_t>(camera.format.width) *
                          static_cast<std::size_t>(camera.format.height);
      observations->images.emplace_back(size * 3 * pixels);
    }
  }
  results.reward.resize(size);
  results.terminated.resize(size);
  results.truncated.resize(size);
  results.fault.resize(size);
}

void EnvironmentBatch::Implementation::require_own() const {
  if (!fork.is_inherited()) return;
  throw InheritedHandle(
      "these simulations were made before fork(); make new ones in the child process");
}

void EnvironmentBatch::Implementation::require_simulation(std::size_t index) const {
  require(index < size, "there is no simulation " + std::to_string(index) + ", there are " +
                            std::to_string(size));
}

EnvironmentBatch::EnvironmentBatch(const TaskDescription& task, const EnvironmentOptions& options,
                                   const SimulationOptions& simulation, int size, int num_threads,
                                   const std::optional<rendering::VisionOptions>& vision)
    : implementation_(Implementation::make(Environment(task, options, simulation), simulation,
                                           checked_size(size), num_threads, vision)) {}
EnvironmentBatch::~EnvironmentBatch() = default;

const Environment& EnvironmentBatch::environment() const noexcept {
  return implementation_->environment;
}
std::size_t EnvironmentBatch::size() const noexcept { return implementation_->size; }
int EnvironmentBatch::num_threads() const noexcept { return implementation_->num_threads(); }
TimeIndex EnvironmentBatch::oldest_sure_age() const noexcept {
  return implementation_->oldest_sure_age;
}
const std::vector<camera::Camera>& EnvironmentBatch::cameras() const noexcept {
  return implementation_->cameras;
}
Results& EnvironmentBatch::results() noexcept { return implementation_->results; }

std::size_t EnvironmentBatch::first_finger(std::size_t index) const {
  implementation_->require_simulation(index);
  return implementation_->environment.first_finger(implementation_->runs[index].episode);
}

std::vector<double> EnvironmentBatch::configuration(std::size_t index) const {
  implementation_->require_own();
  implementation_->require_simulation(index);
  return implementation_->configuration(index);
}

void EnvironmentBatch::set_physics(BatchPhysics physics) {
  require(!implementation_->environment.options().needs_cameras(),
          "options with images need the physics of MuJoCo itself");
  implementation_->physics = std::move(physics);
}
BatchMemory EnvironmentBatch::memory() { return implementation_->memory(); }
std::vector<std::byte> EnvironmentBatch::model_file() const {
  return implementation_->model_file();
}
std::vector<std::string_view> EnvironmentBatch::varied_fields() const {
  return implementation_->varied_fields();
}
std::vector<double> EnvironmentBatch::varied_field(std::string_view name) const {
  return implementation_->varied_field(name);
}

void EnvironmentBatch::seed(std::size_t index, std::uint64_t seed, std::uint64_t episode) {
  implementation_->require_simulation(index);
  implementation_->seeds[index] = seed;
  implementation_->runs[index].next_episode = episode;
}

void EnvironmentBatch::set_reset_states(ResetStates resets) {
  implementation_->environment.check_reset_states(resets);
  implementation_->reset_states = std::move(resets);
}

void EnvironmentBatch::reset(std::span<const std::uint8_t> which) {
  Implementation& self = *implementation_;
  self.require_own();
  require(which.empty() || which.size() == self.size,
          "there are " + std::to_string(which.size()) + " marks for " + std::to_string(self.size) +
              " simulations");
  self.selected.clear();
  for (std::size_t i = 0; i < self.size; ++i) {
    if (!which.empty() && which[i] == 0) continue;
    self.selected.push_back(static_cast<int>(i));
    self.results.terminated[i] = self.results.truncated[i] = 0;
  }
  self.call = Implementation::Call::kReset;
  if (!self.selected.empty()) self.run(self.selected);
}

void EnvironmentBatch::step(std::span<const float> actions, Autoreset autoreset) {
  Implementation& self = *implementation_;
  self.require_own();
  const std::size_t width = self.environment.num_joints();
  require(actions.size() == self.size * width,
          "there are " + std::to_string(actions.size()) + " numbers in the actions, must be " +
              std::to_string(self.size) + " times " + std::to_string(width));
  const auto bad =
      std::ranges::find_if(actions, [](float number) { return !std::isfinite(number); });
  if (bad != actions.end()) {
    const auto place = static_cast<std::size_t>(bad - actions.begin());
    throw InvalidArgument("number " + std::to_string(place % width) + " of the action of " +
                          "simulation " + std::to_string(place / width) + " is " +
                          std::to_string(*bad) + ", must be finite");
  }
  self.selected.clear();
  for (std::size_t i = 0; i < self.size; ++i) self.selected.push_back(static_cast<int>(i));
  self.call = Implementation::Call::kStep;
  self.actions = actions;
  self.autoreset = autoreset;
  self.run(self.selected);
}

}  // namespace trifinger::learning
