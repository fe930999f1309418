// SPDX-License-Identifier: BSD-3-Clause
#include <mujoco/mjbatch.h>
#include <mujoco/mujoco.h>

#include <algorithm>
#include <array>
#include <exception>
#include <mutex>
#include <string>
#include <string_view>
#include <utility>

#include "environment_batch_implementation.hpp"
#include "realtime/processors.hpp"
#include "shared_pipelines.hpp"
#include "trifinger/base/error.hpp"
#include "trifinger/camera/pixels.hpp"
#include "trifinger/sim/simulator.hpp"

namespace trifinger::learning {
namespace {

using trifinger::detail::require;

struct DeleteBatch {
  ipc::ForkGuard fork{};

  void operator()(mjBatch* batch) const noexcept {
    // In a forked child the threads that this would wait for do not exist.
    if (!fork.is_inherited()) mjb_deleteBatch(batch);
  }
};

// A field of the model that `Simulator::vary` or, after it, mj_setConst changes.
struct VariedField {
  std::string_view name;
  mjtNum* mjModel::* values;
  decltype(mjModel::nbody) mjModel::* count;
  int width;
};

constexpr std::array kVariedFields = std::to_array<VariedField>({
    {"body_mass", &mjModel::body_mass, &mjModel::nbody, 1},
    {"body_inertia", &mjModel::body_inertia, &mjModel::nbody, 3},
    {"body_subtreemass", &mjModel::body_subtreemass, &mjModel::nbody, 1},
    {"body_invweight0", &mjModel::body_invweight0, &mjModel::nbody, 2},
    {"geom_friction", &mjModel::geom_friction, &mjModel::ngeom, 3},
    {"geom_solref", &mjModel::geom_solref, &mjModel::ngeom, mjNREF},
    {"geom_size", &mjModel::geom_size, &mjModel::ngeom, 3},
    {"geom_rbound", &mjModel::geom_rbound, &mjModel::ngeom, 1},
    {"geom_aabb", &mjModel::geom_aabb, &mjModel::ngeom, 6},
    {"bvh_aabb", &mjModel::bvh_aabb, &mjModel::nbvhstatic, 6},
    {"pair_friction", &mjModel::pair_friction, &mjModel::npair, 5},
    {"pair_solref", &mjModel::pair_solref, &mjModel::npair, mjNREF},
    {"dof_armature", &mjModel::dof_armature, &mjModel::nv, 1},
    {"dof_damping", &mjModel::dof_damping, &mjModel::nv, 1},
    {"dof_dampingpoly", &mjModel::dof_dampingpoly, &mjModel::nv, mjNPOLY},
    {"dof_frictionloss", &mjModel::dof_frictionloss, &mjModel::nv, 1},
    {"dof_M0", &mjModel::dof_M0, &mjModel::nv, 1},
    {"dof_invweight0", &mjModel::dof_invweight0, &mjModel::nv, 1},
    {"jnt_range", &mjModel::jnt_range, &mjModel::njnt, 2},
    {"tendon_invweight0", &mjModel::tendon_invweight0, &mjModel::ntendon, 1},
    {"actuator_acc0", &mjModel::actuator_acc0, &mjModel::nactuator, 1},
    {"actuator_armature", &mjModel::actuator_armature, &mjModel::nactuator, 1},
    {"actuator_damping", &mjModel::actuator_damping, &mjModel::nactuator, 1},
    {"actuator_dampingpoly", &mjModel::actuator_dampingpoly, &mjModel::nactuator, mjNPOLY},
});

// Returns the part of `values` that belongs to one of `count` simulations.
template <class T>
std::span<T> row(std::vector<T>& values, std::size_t index, std::size_t count) noexcept {
  const std::size_t width = values.size() / count;
  return std::span(values).subspan(index * width, width);
}

}  // namespace

class EnvironmentBatch::Simulations final : public EnvironmentBatch::Implementation {
 public:
  Simulations(Environment its_environment, const SimulationOptions& options, std::size_t count,
              int num_threads, const std::optional<rendering::VisionOptions>& vision)
      : Implementation(std::move(its_environment), count, vision),
        simulator_(options),
        simulations_(count),
        is_of_many_(environment.is_of_many()) {
    oldest_sure_age = vision && vision->finds_objects ? rendering::oldest_sure_age(vision->capture)
                                                      : rendering::oldest_sure_age(options);
    require(environment.options().steps_per_action % simulator_.stride() == 0,
            "steps_per_action is " + std::to_string(environment.options().steps_per_action) +
                ", must be a multiple of " + std::to_string(simulator_.stride()) +
                ", the steps of the robot in one physics_step");
    require(num_threads >= 0,
            "num_threads is " + std::to_string(num_threads) + ", must be at least 0");
    for (Simulation& one : simulations_) {
      one.state = simulator_.make_state();
      one.action = hold_position(one.state.observation);
      one.objects.resize(objects().size());
    }
    const auto& model = simulator_.model();
    if (const std::string name(environment.object_name()); !name.empty()) {
      const auto found = std::ranges::find(objects(), name, &ObjectAddress::name);
      object_ = static_cast<std::size_t>(found - objects().begin());
      has_object_ = true;
    }
    mjBatchConfig config;
    mjb_defaultConfig(&config);
    config.nthread = num_threads > 0 ? num_threads : num_processors();
    char error[500] = "";
    batch_.reset(mjb_makeBatch(model.mujoco(), static_cast<int>(count), &config, error,
                               static_cast<int>(sizeof(error))));
    if (batch_ == nullptr) throw Error("MuJoCo cannot make the simulations: " + std::string(error));
    make_pipelines(vision);
    if (environment.options().varies()) {
      std::vector<const mjModel*> models;
      const SceneModel::Compiled varied = make_varied_model();
      for (Simulation& one : simulations_) {
        one.varied.reset(mj_copyModel(nullptr, varied.get()));
        if (one.varied == nullptr) throw Error("MuJoCo has no memory for the models");
        models.push_back(one.varied.get());
      }
      mjb_setModels(batch_.get(), models.data());
    }
  }

  [[nodiscard]] int num_threads() const noexcept override { return mjb_nthread(batch_.get()); }

  [[nodiscard]] std::vector<double> configuration(std::size_t index) const override {
    std::vector<double> values;
    for (const int part : {mjSTATE_QPOS, mjSTATE_QVEL}) {
      int count = 0;
      const mjtNum* const first = mjb_stateComponent(batch_.get(), part, &count);
      const std::size_t row = index * static_cast<std::size_t>(mjb_nstate(batch_.get()));
      values.insert(values.end(), first + row, first + row + count);
    }
    return values;
  }

  [[nodiscard]] BatchMemory memory() override {
    const auto rows_of = [this](int part) {
      BatchRows rows{.stride = mjb_nstate(batch_.get())};
      rows.first = mjb_stateComponent(batch_.get(), part, &rows.width);
      return rows;
    };
    return {.qpos = rows_of(mjSTATE_QPOS),
            .qvel = rows_of(mjSTATE_QVEL),
            .qacc_warmstart = rows_of(mjSTATE_WARMSTART),
            .ctrl = rows_of(mjSTATE_CTRL),
            .substeps = simulator_.substeps()};
  }

  [[nodiscard]] std::vector<std::byte> model_file() const override {
    const mjModel* const model = shown_model();
    std::vector<std::byte> file(static_cast<std::size_t>(mj_sizeModel(model)));
    mj_saveModel(model, nullptr, file.data(), static_cast<int>(file.size()));
    return file;
  }

  [[nodiscard]] std::vector<std::string_view> varied_fields() const override {
    std::vector<std::string_view> names;
    if (simulations_[0].varied == nullptr) return names;
    for (const VariedField& field : kVariedFields) {
      if (shown_model()->*field.count > 0) names.push_back(field.name);
    }
    return names;
  }

  [[nodiscard]] std::vector<double> varied_field(std::string_view name) const override {
    const auto* const field = std::ranges::find(kVariedFields, name, &VariedField::name);
    require(field != kVariedFields.end() && simulations_[0].varied != nullptr,
            "no field of the model called '" + std::string(name) + "' varies");
    std::vector<double> values;
    for (const Simulation& one : simulations_) {
      const mjtNum* const first = (*one.varied).*field->values;
      values.insert(values.end(), first, first + field->width * ((*one.varied).*field->count));
    }
    return values;
  }

  void run(std::span<const int> which) override {
    if (!is_of_many_) {
      run_physics(which);
      return;
    }
    try {
      run_for_many(which);
    } catch (...) {
      // Nobody knows how these episodes go on.
      for (const int i : which) {
        const auto index = static_cast<std::size_t>(i);
        simulations_[index].is_due = false;
        results.truncated[index] = 1;
        runs[index].must_reset = true;
      }
      throw;
    }
  }

 private:
  // A task of many is asked before and after the physics.
  void run_for_many(std::span<const int> which) {
    due_.clear();
    for (const int i : which) {
      if (begins_in_call(static_cast<std::size_t>(i))) due_.push_back(i);
    }
    draw_starts(due_);
    run_physics(which);
    observe_due(which);
    if (call != Call::kStep || autoreset != Autoreset::kSameStep) return;
    due_.clear();
    for (const int i : which) {
      if (runs[static_cast<std::size_t>(i)].must_reset) due_.push_back(i);
    }
    if (due_.empty()) return;
    for (const int i : due_) keep_final(static_cast<std::size_t>(i));
    draw_starts(due_);
    call = Call::kBegin;
    run_physics(due_);
    observe_due(due_);
  }

  // Whether an episode begins in this simulation.
  [[nodiscard]] bool begins_in_call(std::size_t i) const noexcept {
    return call != Call::kStep || (autoreset != Autoreset::kDisabled && runs[i].must_reset);
  }

  void draw_starts(std::span<const int> which) {
    if (which.empty()) return;
    std::vector<Beginning> beginnings;
    for (const int i : which) {
      const auto index = static_cast<std::size_t>(i);
      Run& run = runs[index];
      beginnings.push_back({.robot = index,
                            .seed = seeds[index],
                            .number = run.next_episode++,
                            .episode = &run.episode,
                            .start = &simulations_[index].start});
    }
    environment.begin(beginnings);
  }

  // Lets the task judge those that have moved or begun, all at once.
  void observe_due(std::span<const int> which) {
    std::vector<std::size_t> moved;
    for (const int i : which) {
      const auto index = static_cast<std::size_t>(i);
      if (std::exchange(simulations_[index].is_due, false)) moved.push_back(index);
    }
    if (moved.empty()) return;
    std::vector<Observed> robots(moved.size());
    for (std::size_t k = 0; k < moved.size(); ++k) {
      const std::size_t i = moved[k];
      robots[k].robot = i;
      robots[k].measurement = simulations_[i].measurement;
      robots[k].episode = &runs[i].episode;
      robots[k].observation = row(results.seen.observation, i, size);
      robots[k].achieved = row(results.seen.achieved, i, size);
      robots[k].desired = row(results.seen.desired, i, size);
    }
    environment.observe(robots);
    for (const Observed& one : robots) {
      show_hidden(one.robot);
      keep(one.robot, one.outcome);
      if (runs[one.robot].episode.actions > 0) end_of_step(one.robot, one.outcome);
    }
  }

  void run_physics(std::span<const int> which) {
    if (physics && call == Call::kStep) {
      step_at_once(which);
    } else {
      apply(which);
    }
    given_up_.clear();
    const int* const status = mjb_status(batch_.get());
    for (const int i : which) {
      if (status[i] == 0) continue;
      // A simulation in which MuJoCo has failed has ended, just like one that has diverged.
      const auto index = static_cast<std::size_t>(i);
      end_with_fault(index, Simulator::kDiverged);
      keep_final(index);
      given_up_.push_back(i);
    }
    const bool resets = call == Call::kStep && autoreset == Autoreset::kSameStep && !is_of_many_;
    if (!given_up_.empty() && resets) {
      call = Call::kBegin;
      apply(given_up_);
    }
    // Only now, when all simulations are in order.
    if (failure_ != nullptr) std::rethrow_exception(std::exchange(failure_, nullptr));
  }

  // An action of simulations that other physics move, in turns: each does its part of a step, then
  // all are moved.
  void step_at_once(std::span<const int> which) {
    for (const int i : which) simulations_[static_cast<std::size_t>(i)].moves = false;
    turn_ = Turn::kFirst;
    apply(which);
    turn_ = Turn::kNext;
    moved_.resize(size);
    std::vector<int> moving;
    while (true) {
      bool models_changed = false;
      moving.clear();
      for (std::size_t i = 0; i < size; ++i) {
        moved_[i] = simulations_[i].moves ? 1 : 0;
        models_changed |= simulations_[i].is_new;
        if (simulations_[i].moves) moving.push_back(static_cast<int>(i));
      }
      if (moving.empty()) break;
      try {
        physics(moved_, models_changed);
      } catch (...) {
        // Nobody knows where they are.
        for (const int i : moving)
          end_with_fault(static_cast<std::size_t>(i), Simulator::kDiverged);
        turn_ = Turn::kWhole;
        throw;
      }
      for (Simulation& one : simulations_) one.is_new = false;
      apply(moving);
    }
    turn_ = Turn::kWhole;
  }

  // The model of a simulation that has not been varied yet, with all that may vary.
  [[nodiscard]] const mjModel* shown_model() const noexcept {
    const auto& varied = simulations_[0].varied;
    return varied ? varied.get() : simulator_.model().mujoco();
  }

  [[nodiscard]] const std::vector<ObjectAddress>& objects() const noexcept {
    return simulator_.model().objects();
  }

  void make_pipelines(const std::optional<rendering::VisionOptions>& vision) {
    if (!vision || !(environment.options().needs_cameras() || vision->finds_objects)) return;
    is_tracked_ = vision->finds_objects;
    for (Simulation& one : simulations_) {
      one.captures.emplace(vision->capture, objects().size());
      if (vision->varies) one.captures->vary(vision->rendering);
    }
    const std::size_t num_pipelines = std::min(static_cast<std::size_t>(num_threads()), size);
    for (std::size_t i = 0; i < num_pipelines; ++i) {
      pipelines_.add(rendering::make_vision_pipeline(simulator_.options(), *vision));
    }
  }

  // Makes a model that contains all pairs of surfaces whose friction any episode may set.
  [[nodiscard]] SceneModel::Compiled make_varied_model() const {
    // Every robot in this condition has its own friction of the same pairs.
    Random any;
    Variation variation = draw(environment.options().condition, any);
    for (const SurfacePair pair : all_surface_pairs()) {
      const auto& range = environment.options().pair_friction[pair];
      if (range) variation.pair_friction[pair] = range->low < range->high ? 0.0 : range->low;
    }
    return simulator_.make_varied_model(variation);
  }

  void apply(std::span<const int> which) {
    mjb_apply(batch_.get(), which.data(), static_cast<int>(which.size()), &Simulations::run_one,
              this,
              /*save=*/1);
  }

  struct Simulation {
    Simulator::State state{};
    SceneModel::Compiled varied{};
    std::vector<ObjectPose> objects{};  // Newest poses seen.
    TimeIndex object_step{kNeverSeen};
    CountedAction action{};  // The action in effect.
    CountedAction next{};    // The one that follows during this call.
    int begun{0};            // Number of steps of the robot that this call has begun.
    bool moves{false};       // Other physics must move it.
    bool is_new{true};       // Its model may have changed since other physics have moved.
    std::optional<rendering::CaptureQueue> captures{};
    bool is_blind{false};  // Drawing or reading an image has failed.
    // For tasks of many: where the next episode begins, what was measured in this call, and whether
    // it must be observed.
    Start start{};
    Measurement measurement{};
    bool is_due{false};
    HiddenState hidden{};
  };
  static constexpr TimeIndex kNeverSeen = -2;  // Step -1 is that before the first one.

  // While MuJoCo's physics run, no object in here may have a destructor, because MuJoCo leaves them
  // by longjmp.
  static void run_one(const mjModel* model, mjData* data, int index, void* self) {
    static_cast<Simulations*>(self)->run_one(*model, *data, static_cast<std::size_t>(index));
  }

  void run_one(const mjModel& model, mjData& data, std::size_t i) noexcept {
    if (turn_ == Turn::kNext) {
      go_on(model, data, i);
    } else {
      do_call(model, data, i);
    }
    // Whoever has called gets the exception, and this episode does not go on.
    if (!std::exchange(simulations_[i].is_blind, false)) return;
    end_with_fault(i, results.fault[i]);
    simulations_[i].is_due = false;
  }

  void do_call(const mjModel& model, mjData& data, std::size_t i) noexcept {
    if (call == Call::kBegin) {
      reset(model, data, i);
      return;
    }
    if (begins_in_call(i)) {
      reset(model, data, i);
      results.reward[i] = 0.0;
      results.terminated[i] = 0;
      results.truncated[i] = 0;
      results.fault[i] = 0;
      return;
    }
    if (runs[i].must_reset) return;
    if (!begin_action(i)) return;
    if (turn_ == Turn::kFirst) {
      simulations_[i].moves = begin_step(data, i);
    } else {
      step(model, data, i);
    }
    begin_if_ended(model, data, i);
  }

  // Goes on after other physics have moved this simulation.
  void go_on(const mjModel& model, mjData& data, std::size_t i) noexcept {
    // Motors with play need the accelerations, which are no part of a state.
    mju_copy(data.qacc, data.qacc_warmstart, static_cast<int>(model.nv));
    Simulation& one = simulations_[i];
    one.moves = false;
    if (end_step(model, data, i)) {
      if (one.begun < environment.options().steps_per_action) {
        one.moves = begin_step(data, i);
      } else {
        end_action(data, i);
      }
    }
    begin_if_ended(model, data, i);
  }

  void begin_if_ended(const mjModel& model, mjData& data, std::size_t i) noexcept {
    if (!runs[i].must_reset || autoreset != Autoreset::kSameStep || is_of_many_) return;
    keep_final(i);
    reset(model, data, i);
  }

  // Keeps the last results of the episode, so that they can be read after the reset.
  void keep_final(std::size_t i) noexcept {
    const auto keep = [this, i](auto& final, auto& seen) {
      std::ranges::copy(row(seen, i, size), row(final, i, size).begin());
    };
    keep(results.final.observation, results.seen.observation);
    keep(results.final.achieved, results.seen.achieved);
    keep(results.final.desired, results.seen.desired);
    keep(results.final.distance, results.seen.distance);
    keep(results.final.finger_rewards, results.seen.finger_rewards);
    keep(results.final.scores, results.seen.scores);
    keep(results.final.hidden, results.seen.hidden);
    keep(results.final.success, results.seen.success);
    keep(results.final.object_age, results.seen.object_age);
    keep(results.final.image_age, results.seen.image_age);
    for (std::size_t k = 0; k < cameras.size(); ++k) {
      keep(results.final.images[k], results.seen.images[k]);
    }
  }

  void reset(const mjModel& model, mjData& data, std::size_t i) noexcept {
    Simulation& one = simulations_[i];
    Run& run = runs[i];
    Start start =
        is_of_many_ ? one.start : environment.begin(seeds[i], run.next_episode++, run.episode);
    const ResetState* const state =
        environment.choose_reset_state(reset_states, seeds[i], run.next_episode - 1, start);
    run.must_reset = false;
    if (one.varied != nullptr) simulator_.vary(start.variation, *one.varied, data);
    one.is_new = true;
    one.state.memory.counters.variation = start.variation;
    put_at(start, data, one.state);
    std::ranges::fill(one.objects, ObjectPose{});
    one.object_step = kNeverSeen;
    if (one.captures) one.captures->begin(one.state.memory.counters.random);
    see(-1, model, data, one);
    see(0, model, data, one);
    one.action = hold_position(one.state.observation);
    if (state != nullptr) {
      environment.begin_in(*state, one.state.observation.position, run.episode, one.action.torque,
                           one.action.position);
      std::ranges::fill(one.action.position_kp, environment.position_kp());
    }
    note_hidden(data, one);
    (void)observe(i);
  }

  void put_at(const Start& start, mjData& data, Simulator::State& state) noexcept {
    const std::size_t joints = simulator_.num_joints();
    const std::size_t others = std::min(state.model_position.size(), start.model_position.size());
    simulator_.reset(std::span(start.position).first(joints), start.random, data, state,
                     std::span(start.model_position).first(others));
    if (has_object_) simulator_.place(objects()[object_], start.object, data, state);
    if (!has_object_) return;
    simulator_.set_velocity(objects()[object_], start.object_velocity, data);
    simulator_.observe(data, state);
  }

  void step(const mjModel& model, mjData& data, std::size_t i) noexcept {
    const int steps = environment.options().steps_per_action;
    while (simulations_[i].begun < steps) {
      if (!begin_step(data, i)) return;
      for (int k = 0; k < simulator_.substeps(); ++k) mj_step(&model, &data);
      if (!end_step(model, data, i)) return;
    }
    end_action(data, i);
  }

  bool begin_action(std::size_t i) noexcept {
    Simulation& one = simulations_[i];
    one.next = one.action;
    one.begun = 0;
    if (!environment.take_action(row_of_actions(i), runs[i].episode, one.next.torque,
                                 one.next.position)) {
      return false;  // Never: the actions were checked before.
    }
    std::ranges::fill(one.next.position_kp, environment.position_kp());
    return true;
  }

  // Does what comes before the physics of a step; false if the episode has ended.
  bool begin_step(mjData& data, std::size_t i) noexcept {
    Simulation& one = simulations_[i];
    // Number of steps for which the previous action continues: docs/learning.md.
    const int lag = environment.options().mapping == Mapping::kApproximation
                        ? 1
                        : environment.options().steps_per_action;
    // With long steps the next action begins at the nearest of them.
    const int stride = static_cast<int>(simulator_.stride());
    if (one.begun == (lag + stride / 2) / stride * stride) one.action = one.next;
    one.begun += stride;
    CountedAppliedAction applied(simulator_.num_joints());
    const DriverReport report = simulator_.begin_step(one.action, data, one.state, applied);
    if (report.fault_code != 0) end_with_fault(i, report.fault_code);
    return report.fault_code == 0;
  }

  // Does what comes after them; false if the episode has ended.
  bool end_step(const mjModel& model, mjData& data, std::size_t i) noexcept {
    Simulation& one = simulations_[i];
    if (!simulator_.end_step(model, data, one.state)) {
      end_with_fault(i, Simulator::kDiverged);
      return false;
    }
    simulator_.observe(data, one.state);
    see(one.state.memory.counters.step, model, data, one);
    return true;
  }

  void end_action(const mjData& data, std::size_t i) noexcept {
    Simulation& one = simulations_[i];
    one.action = one.next;
    results.terminated[i] = 0;
    results.truncated[i] = 0;
    results.fault[i] = 0;
    note_hidden(data, one);
    if (const auto outcome = observe(i)) end_of_step(i, *outcome);
  }

  void end_of_step(std::size_t i, const Outcome& outcome) noexcept {
    results.reward[i] = outcome.reward;
    results.terminated[i] = outcome.terminated ? 1 : 0;
    results.truncated[i] = outcome.truncated ? 1 : 0;
    runs[i].must_reset = outcome.terminated || outcome.truncated;
  }

  void see(TimeIndex step, const mjModel& model, const mjData& data, Simulation& one) noexcept {
    if (one.captures && one.captures->is_due(step)) {
      std::vector<double> configuration(data.qpos, data.qpos + model.nq);
      configuration.insert(configuration.end(), data.qvel, data.qvel + model.nv);
      one.captures->capture(step, std::move(configuration));
    }
    // Tasks see all bodies of a robot from a file.
    const bool sees_objects = has_object_ || simulator_.options().file != nullptr;
    if (!sees_objects || one.objects.empty() || is_tracked_) return;
    const auto* const received = simulator_.receive_poses(step, data, one.state);
    if (received == nullptr) return;
    std::ranges::copy(received->objects, one.objects.begin());
    one.object_step = received->capture_index;
  }

  // Looks at the images that have arrived. An exception is thrown later, outside of MuJoCo.
  void look(std::size_t i) noexcept {
    Simulation& one = simulations_[i];
    const TimeIndex now = one.state.memory.counters.step;
    try {
      const SharedPipelines::Use pipeline(pipelines_);
      if (one.captures->look(now, *pipeline)) {
        for (std::size_t k = 0; k < cameras.size(); ++k) {
          camera::to_rgb(cameras[k].format, (*pipeline).images()[k],
                         std::as_writable_bytes(row(results.seen.images[k], i, size)));
        }
      }
      while (const auto poses = one.captures->take_poses(now)) {
        if (!is_tracked_) continue;
        std::ranges::copy(poses->objects, one.objects.begin());
        one.object_step = poses->capture_index;
      }
    } catch (...) {
      one.is_blind = true;
      const std::lock_guard lock(failure_mutex_);
      failure_ = std::current_exception();
    }
  }

  // Notes what is hidden, which is shown once the goal is known that the observation has.
  void note_hidden(const mjData& data, Simulation& one) const noexcept {
    one.hidden.variation = one.state.memory.counters.variation;
    if (!has_object_) return;
    one.hidden.object = one.state.objects[object_];
    one.hidden.object_velocity = simulator_.object_velocity(objects()[object_], data);
  }

  void show_hidden(std::size_t i) noexcept {
    environment.show_hidden(simulations_[i].hidden, runs[i].episode,
                            row(results.seen.hidden, i, size));
  }

  // Observes a robot. A task of many gets what was measured later, with that of all others.
  std::optional<Outcome> observe(std::size_t i) noexcept {
    Simulation& one = simulations_[i];
    Observations& seen = results.seen;
    const TimeIndex now = one.state.memory.counters.step;
    if (one.captures) {
      look(i);
      const TimeIndex age = std::min(now - one.captures->images().capture_index, kOldestImage);
      std::ranges::fill(row(seen.image_age, i, size), static_cast<float>(age));
    }
    Measurement measurement{.position = one.state.observation.position,
                            .velocity = one.state.observation.velocity};
    measurement.torque = one.state.observation.torque;
    if (simulator_.options().file != nullptr) measurement.bodies = one.objects;
    measurement.model_position = one.state.model_position;
    measurement.model_velocity = one.state.model_velocity;
    if (has_object_) {
      measurement.object = &one.objects[object_];
      if (environment.judges_by_truth()) measurement.true_object = &one.state.objects[object_];
      seen.object_age[i] = one.object_step == kNeverSeen ? -1 : now - one.object_step;
    }
    if (is_of_many_) {
      one.measurement = measurement;
      one.is_due = true;
      return std::nullopt;
    }
    const Outcome outcome =
        environment.observe(measurement, runs[i].episode, row(seen.observation, i, size),
                            row(seen.achieved, i, size), row(seen.desired, i, size));
    show_hidden(i);
    keep(i, outcome);
    return outcome;
  }

  void keep(std::size_t i, const Outcome& outcome) noexcept {
    Observations& seen = results.seen;
    const auto copy = [i, this](const auto& numbers, std::vector<double>& all) {
      const std::span target = row(all, i, size);
      std::copy_n(numbers.begin(), target.size(), target.begin());
    };
    copy(outcome.distance, seen.distance);
    copy(outcome.finger_rewards, seen.finger_rewards);
    copy(outcome.scores, seen.scores);
    seen.success[i] = outcome.success ? 1 : 0;
    runs[i].reward = outcome.reward;
  }

  // The observation stays the one before the fault.
  void end_with_fault(std::size_t i, std::int32_t fault) noexcept {
    results.fault[i] = fault;
    results.reward[i] = runs[i].reward;
    results.terminated[i] = 0;
    results.truncated[i] = 1;
    results.seen.success[i] = 0;
    runs[i].must_reset = true;
  }

  [[nodiscard]] std::span<const float> row_of_actions(std::size_t i) const noexcept {
    const std::size_t width = environment.num_joints();
    return actions.subspan(i * width, width);
  }

  // What each simulation does in a call: all of it, or its part before or after other physics.
  enum class Turn : std::uint8_t { kWhole, kFirst, kNext };

  Simulator simulator_;
  std::vector<Simulation> simulations_;
  Turn turn_{Turn::kWhole};
  std::vector<std::uint8_t> moved_;  // Simulations that other physics must move.
  const bool is_of_many_;            // The task is.
  std::vector<int> due_;             // Simulations in which an episode begins in this call.
  std::vector<int> given_up_;        // Simulations in which MuJoCo has failed during this call.
  std::size_t object_{0};
  bool has_object_{false};
  bool is_tracked_{false};  // A tracker finds the objects.
  SharedPipelines pipelines_;
  std::mutex failure_mutex_;
  std::exception_ptr failure_;  // of somebody who looked at images
  std::unique_ptr<mjBatch, DeleteBatch> batch_;
};

std::unique_ptr<EnvironmentBatch::Implementation> EnvironmentBatch::Implementation::make(
    Environment its_environment, const SimulationOptions& options, std::size_t count,
    int num_threads, const std::optional<rendering::VisionOptions>& vision) {
  return std::make_unique<Simulations>(std::move(its_environment), options, count, num_threads,
                                       vision);
}

}  // namespace trifinger::learning
