// SPDX-License-Identifier: BSD-3-Clause
#include "trifinger/control/predictive_planner.hpp"

#include <mujoco/mjbatch.h>
#include <mujoco/mujoco.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <string>
#include <utility>

#include "base/moved.hpp"
#include "realtime/processors.hpp"
#include "rollout_records.hpp"
#include "rollout_weights.hpp"
#include "trifinger/base/error.hpp"
#include "trifinger/base/random.hpp"
#include "trifinger/core/errors.hpp"
#include "trifinger/ipc/fork.hpp"

namespace trifinger::control {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

struct DeleteBatch {
  ipc::ForkGuard fork{};

  void operator()(mjBatch* batch) const noexcept {
    // In a forked child the threads that this would wait for do not exist.
    if (!fork.is_inherited()) mjb_deleteBatch(batch);
  }
};

int num_steps_of(Seconds horizon, Seconds step) noexcept {
  return std::max(1, static_cast<int>(std::lround(horizon / step)));
}

// As MuJoCo judges numbers: beyond this a simulation has diverged.
bool is_good(const double* values, std::size_t count) noexcept {
  constexpr double kMost = 1e10;
  bool good = true;
  // Written so that NaN is bad.
  for (std::size_t i = 0; i < count; ++i) good = good && std::abs(values[i]) < kMost;
  return good;
}

}  // namespace

class PredictivePlanner::Implementation {
 public:
  Implementation(PlanningModel its_model, PlanningTask its_task, const PlannerOptions& its_options)
      : model_((validate(its_options), std::move(its_model))),
        task_(std::move(its_task)),
        options_(its_options),
        num_steps_(num_steps_of(options_.horizon, model_.time_step())),
        num_samples_(static_cast<std::size_t>(options_.samples)),
        single_(model_.copy()) {
    validate(task_, model_);
    const int joints = model_.num_joints();
    const auto tips = static_cast<int>(model_.tip_sites().size());
    if (tips > 1 && joints % tips == 0) joints_per_finger_ = joints / tips;
    // A constant knot holds until the next one, so that the last one must begin before the end.
    const int parts =
        options_.spline == SplineKind::kConstant ? options_.knots : std::max(1, options_.knots - 1);
    const Seconds horizon = num_steps_ * model_.time_step();
    plan_.commands = KnotSpline(options_.spline, options_.knots, joints, horizon / parts);
    plan_.cost = kInfinity;
    size_ = plan_.commands.values().size();
    previous_ = plan_.commands;
    knots_.resize((num_samples_ + 1) * size_);
    sigma_.resize(size_);
    costs_.resize(num_samples_ + 1, kInfinity);
    weights_.resize(num_samples_);
    start_ = model_.initial_state();
    end_ = start_;

    PlannedStates& states = plan_.states;
    states.time_step = model_.time_step();
    states.count = num_states();
    states.positions.resize(num_states() * position_size());
    states.velocities.resize(num_states() * velocity_size());
    make_batch();
    make_records();
  }
  Implementation(const Implementation&) = delete;
  Implementation& operator=(const Implementation&) = delete;
  ~Implementation() = default;

  const Plan& plan(const PlanningState& start) {
    require_own();
    model_.check(start);
    std::ranges::copy(start.position, start_.position.begin());
    std::ranges::copy(start.velocity, start_.velocity.begin());
    start_.time = start.time;
    move_plan();
    ++plan_.number;
    std::ranges::fill(sigma_, options_.most_sigma);
    for (int round = 0; round < options_.rounds; ++round) {
      round_ = (plan_.number - 1) * static_cast<std::uint64_t>(options_.rounds) +
               static_cast<std::uint64_t>(round);
      job_ = Job::kSample;
      run(all_samples_);
      if (round == 0) plan_.previous_cost = costs_[0];
      combine();
    }
    evaluate_plan();
    plan_.median_cost = median_of(samples(), weights_scratch_);
    plan_.least_cost = kInfinity;
    plan_.num_masked = 0;
    for (const double cost : samples()) {
      plan_.least_cost = std::min(plan_.least_cost, cost);
      plan_.num_masked += std::isfinite(cost) ? 0 : 1;
    }
    return plan_;
  }

  double simulate(const PlanningState& start, const KnotSpline& commands, Seconds duration,
                  PlanningState& end) {
    require_own();
    model_.check(start);
    check_width(commands);
    detail::require_not_negative("duration", duration.count());
    std::ranges::copy(start.position, start_.position.begin());
    std::ranges::copy(start.velocity, start_.velocity.begin());
    start_.time = start.time;
    // Whole steps, but shorter ones, so that they end at the right time.
    single_steps_ = static_cast<int>(std::ceil(duration / model_.time_step() - 1e-9));
    single_->opt.timestep =
        single_steps_ > 0 ? duration.count() / single_steps_ : model_.time_step().count();
    single_commands_ = &commands;
    job_ = Job::kSingle;
    run(single_id_);
    end.position = end_.position;
    end.velocity = end_.velocity;
    end.time = start.time + duration;
    return single_cost_;
  }

  void begin_with(const KnotSpline& commands) {
    check_width(commands);
    previous_ = commands;
    has_previous_ = true;
    is_own_ = false;
  }

  void restart() noexcept {
    has_previous_ = false;
    is_own_ = false;
  }

  void set_task(PlanningTask task) {
    validate(task, model_);
    task_ = std::move(task);
    make_records();
  }

  void set_terms(std::span<const CostTerm> terms) {
    swapped_.terms.assign(terms.begin(), terms.end());
    validate(swapped_, model_);
    std::swap(swapped_.terms, task_.terms);
  }

  [[nodiscard]] const PlanningModel& model() const noexcept { return model_; }
  [[nodiscard]] const PlanningTask& task() const noexcept { return task_; }
  [[nodiscard]] const PlannerOptions& options() const noexcept { return options_; }
  [[nodiscard]] const Plan& newest() const noexcept { return plan_; }
  [[nodiscard]] int num_threads() const noexcept { return mjb_nthread(batch_.get()); }
  [[nodiscard]] int num_steps() const noexcept { return num_steps_; }
  [[nodiscard]] std::span<const double> samples() const noexcept {
    return std::span(costs_).first(num_samples_);
  }
  [[nodiscard]] std::span<const double> weights() const noexcept { return weights_; }
  [[nodiscard]] std::span<const double> knots_of(int rollout) const noexcept {
    return std::span(knots_).subspan(static_cast<std::size_t>(rollout) * size_, size_);
  }

 private:
  enum class Job : std::uint8_t {
    kSample,  // Changes the plan and simulates the change.
    kPlan,    // Simulates the plan.
    kSingle,  // Simulates what `simulate` was asked for.
  };

  void check_width(const KnotSpline& commands) const {
    if (commands.width() == model_.num_joints()) return;
    throw InvalidArgument("the commands have " + std::to_string(commands.width()) +
                          " numbers per knot, must have " + std::to_string(model_.num_joints()));
  }

  [[nodiscard]] std::size_t num_states() const noexcept {
    return static_cast<std::size_t>(num_steps_) + 1;
  }
  [[nodiscard]] std::size_t position_size() const noexcept {
    return static_cast<std::size_t>(model_.position_size());
  }
  [[nodiscard]] std::size_t velocity_size() const noexcept {
    return static_cast<std::size_t>(model_.velocity_size());
  }
  [[nodiscard]] std::size_t num_joints() const noexcept { return model_.joints().size(); }
  [[nodiscard]] std::span<double> row(std::size_t rollout) noexcept {
    return std::span(knots_).subspan(rollout * size_, size_);
  }

  void make_batch() {
    mjBatchConfig config;
    mjb_defaultConfig(&config);
    config.nthread = options_.num_threads > 0 ? options_.num_threads : num_processors();
    // The last two are the plan, and what `simulate` was asked for.
    const int count = options_.samples + 2;
    char error[500] = "";
    batch_.reset(
        mjb_makeBatch(model_.mujoco(), count, &config, error, static_cast<int>(sizeof(error))));
    if (batch_ == nullptr) throw Error("MuJoCo cannot make the simulations: " + std::string(error));
    std::vector<const mjModel*> models(static_cast<std::size_t>(count), model_.mujoco());
    models.back() = single_.get();
    mjb_setModels(batch_.get(), models.data());
    for (int i = 0; i < options_.samples; ++i) all_samples_.push_back(i);
    plan_id_ = {options_.samples};
    single_id_ = {options_.samples + 1};
    weights_scratch_.resize(num_samples_);
  }

  void make_records() {
    if (!task_.batch_cost) return;
    records_.resize(model_, num_samples_ + 1, num_states());
  }

  // Makes `plan_.commands` the previous plan, seen from the new start.
  void move_plan() noexcept {
    KnotSpline& commands = plan_.commands;
    // The plan's own knots stay exactly as they are if time stands still.
    const bool stands_still = is_own_ && commands.begin() == start_.time;
    if (has_previous_ && !stands_still) {
      if (is_own_) {
        std::ranges::copy(commands.values(), previous_.values().begin());
        previous_.move_to(commands.begin());
      }
      for (int i = 0; i < commands.num_knots(); ++i)
        previous_.at(start_.time + i * commands.interval(), commands.knot(i));
    } else if (!has_previous_) {
      for (int i = 0; i < commands.num_knots(); ++i) {
        if (options_.command == PlannedCommand::kPosition) {
          std::copy_n(start_.position.begin(), num_joints(), commands.knot(i).begin());
        } else {
          std::ranges::fill(commands.knot(i), 0.0);
        }
      }
    }
    if (!is_own_) clip(commands.values());
    commands.move_to(start_.time);
    if (previous_.num_knots() != commands.num_knots() || previous_.kind() != commands.kind() ||
        previous_.interval() != commands.interval()) {
      previous_ = commands;
    }
    has_previous_ = true;
    is_own_ = true;
  }

  void clip(std::span<double> knots) const noexcept {
    for (std::size_t i = 0; i < knots.size(); ++i) {
      const PlannedJoint& joint = model_.joints()[i % num_joints()];
      knots[i] = options_.command == PlannedCommand::kPosition
                     ? std::clamp(knots[i], joint.lower, joint.upper)
                     : std::clamp(knots[i], -joint.max_torque, joint.max_torque);
    }
  }

  // Throws InheritedHandle in a forked child, which has none of the threads.
  void require_own() const {
    if (!batch_.get_deleter().fork.is_inherited()) return;
    throw InheritedHandle(
        "this planner was made before fork(); make a new one in the child process");
  }

  // Runs rollouts and adds what the batch costs.
  void run(std::span<const int> ids) {
    mjb_apply(batch_.get(), ids.data(), static_cast<int>(ids.size()), &Implementation::run_one,
              this, /*save=*/0);
    const int* const status = mjb_status(batch_.get());
    for (const int id : ids) {
      // MuJoCo has failed, for example for lack of memory.
      if (status[id] == 0) continue;
      if (job_ == Job::kSingle) {
        single_cost_ = kInfinity;
      } else {
        costs_[static_cast<std::size_t>(id)] = kInfinity;
      }
    }
    if (!task_.batch_cost || job_ == Job::kSingle) return;
    const auto first = static_cast<std::size_t>(ids.front());
    const std::size_t count = ids.size();
    const RolloutBatch batch{.num_rollouts = static_cast<int>(ids.size()),
                             .num_states = num_steps_ + 1,
                             .position_size = model_.position_size(),
                             .velocity_size = model_.velocity_size(),
                             .num_joints = model_.num_joints(),
                             .num_tips = static_cast<int>(model_.tip_sites().size()),
                             .begin = start_.time,
                             .time_step = model_.time_step(),
                             .positions = records_.positions(first, count),
                             .velocities = records_.velocities(first, count),
                             .targets = records_.targets(first, count),
                             .torques = records_.torques(first, count),
                             .tips = records_.tips(first, count)};
    const std::span costs = std::span(costs_).subspan(first, count);
    // Whatever is added to infinity must not make it finite.
    for (std::size_t i = 0; i < costs.size(); ++i) masked_[i] = std::isfinite(costs[i]) ? 0 : 1;
    task_.batch_cost(batch, costs);
    for (std::size_t i = 0; i < costs.size(); ++i) {
      if (masked_[i] != 0 || !std::isfinite(costs[i])) costs[i] = kInfinity;
    }
  }

  // While MuJoCo's physics run, no object in here may have a destructor, because MuJoCo leaves them
  // by longjmp.
  static void run_one(const mjModel* model, mjData* data, int index, void* self) {
    static_cast<Implementation*>(self)->run_one(*model, *data, static_cast<std::size_t>(index));
  }

  void run_one(const mjModel& model, mjData& data, std::size_t index) noexcept {
    switch (job_) {
      case Job::kSample:
        change(index);
        costs_[index] =
            rollout(model, data, plan_.commands, row(index), num_steps_, record_of(index));
        return;
      case Job::kPlan: {
        const RolloutRecord record = record_of(index);
        costs_[index] =
            rollout(model, data, plan_.commands, plan_.commands.values(), num_steps_, record);
        return;
      }
      case Job::kSingle:
        single_cost_ =
            rollout(model, data, *single_commands_, single_commands_->values(), single_steps_, {});
        std::copy_n(data.qpos, position_size(), end_.position.begin());
        std::copy_n(data.qvel, velocity_size(), end_.velocity.begin());
        return;
    }
  }

  [[nodiscard]] RolloutRecord record_of(std::size_t index) noexcept {
    if (task_.batch_cost) return records_.of(index);
    RolloutRecord record;
    if (index == num_samples_) {
      record.positions = plan_.states.positions.data();
      record.velocities = plan_.states.velocities.data();
    }
    return record;
  }

  // Writes the knots of one sample. Its random numbers are its own, whichever thread does this.
  void change(std::size_t index) noexcept {
    const std::span knots = row(index);
    std::ranges::copy(plan_.commands.values(), knots.begin());
    if (index == 0) return;
    Random random{.seed = options_.seed, .episode = round_ * num_samples_ + index};
    const std::size_t joints = num_joints();
    std::size_t first = 0;
    std::size_t last = joints;
    if (joints_per_finger_ > 0 && random.uniform(0.0, 1.0) < options_.one_finger_share) {
      const auto per_finger = static_cast<std::size_t>(joints_per_finger_);
      first = per_finger * static_cast<std::size_t>(
                               random.integer(0, static_cast<std::int64_t>(joints / per_finger)));
      last = first + per_finger;
    }
    const bool is_constant = random.uniform(0.0, 1.0) < options_.constant_share;
    double sigma = 1.0;  // Cross-entropy has a deviation for each number.
    if (options_.method != PlanningMethod::kCrossEntropy) {
      sigma =
          std::exp(random.uniform(std::log(options_.least_sigma), std::log(options_.most_sigma)));
    }
    std::array<double, PlanningModel::kMaxPlannedJoints> noise;
    for (std::size_t knot = 0; knot < size_; knot += joints) {
      for (std::size_t i = first; i < last; ++i) {
        if (knot == 0 || !is_constant) noise[i] = random.normal();
        const double scale =
            options_.method == PlanningMethod::kCrossEntropy ? sigma_[knot + i] : sigma;
        knots[knot + i] += scale * noise[i];
      }
    }
    clip(knots);
  }

  // Returns the cost of a rollout from `start_`.
  double rollout(const mjModel& model, mjData& data, const KnotSpline& commands,
                 std::span<const double> knots, int steps, const RolloutRecord& record) noexcept {
    std::ranges::copy(start_.position, data.qpos);
    std::ranges::copy(start_.velocity, data.qvel);
    std::fill_n(data.qacc_warmstart, velocity_size(), 0.0);
    const double step = model.opt.timestep;
    const int late = steps - static_cast<int>(std::lround(task_.late_share * steps));
    std::array<double, PlanningModel::kMaxPlannedJoints> targets;
    const std::span target = std::span(targets).first(num_joints());
    double cost = 0.0;
    bool is_bad = false;
    for (int k = 0; k <= steps; ++k) {
      const Seconds time = start_.time + Seconds(k * step);
      is_bad =
          is_bad || !is_good(data.qpos, position_size()) || !is_good(data.qvel, velocity_size());
      if (is_bad) {
        record.write(model_, static_cast<std::size_t>(k), nullptr, target);
        if (record.positions == nullptr) return kInfinity;
        continue;
      }
      data.time = time.count();
      const bool is_end = k == steps;
      if (is_end) {
        mj_kinematics(&model, &data);
      } else {
        mj_step1(&model, &data);
        commands.interpolate(time, knots, target);
        drive(data, target);
      }
      const CostInput input{.model = model_,
                            .data = data,
                            .target = target,
                            .has_position_targets = options_.command == PlannedCommand::kPosition,
                            .time = time,
                            .is_end = is_end};
      if (is_end) std::fill_n(data.ctrl, num_joints(), 0.0);
      const double weight = is_end ? 1.0 : step * (k >= late ? task_.late_factor : 1.0);
      cost += weight * cost_of(input);
      record.write(model_, static_cast<std::size_t>(k), &data, target);
      if (!is_end) mj_step2(&model, &data);
    }
    return std::isfinite(cost) && !is_bad ? cost : kInfinity;
  }

  // Joint targets become torques as in the robot's own position control.
  void drive(mjData& data, std::span<const double> target) const noexcept {
    for (std::size_t i = 0; i < target.size(); ++i) {
      const double most = model_.joints()[i].max_torque;
      const double torque =
          options_.command == PlannedCommand::kTorque
              ? target[i]
              : options_.kp * (target[i] - data.qpos[i]) - options_.kd * data.qvel[i];
      data.ctrl[i] = std::clamp(torque, -most, most);
    }
  }

  [[nodiscard]] double cost_of(const CostInput& input) const noexcept {
    double cost = 0.0;
    for (const CostTerm& term : task_.terms) {
      const double weight = input.is_end ? term.end_weight : term.weight;
      if (weight != 0.0) cost += weight * value_of(term, input);
    }
    if (task_.cost) cost += task_.cost(input);
    return cost;
  }

  // Makes a plan of the rollouts of a round.
  void combine() noexcept {
    const std::span values = plan_.commands.values();
    switch (options_.method) {
      case PlanningMethod::kPredictiveSampling:
        elite_weights(samples(), 1, weights_);
        break;
      case PlanningMethod::kCrossEntropy:
        elite_weights(samples(), options_.elites, weights_);
        break;
      case PlanningMethod::kPathIntegral:
        path_integral_weights(samples(), options_.temperature, weights_);
        break;
    }
    // If all rollouts have diverged, the plan stays.
    if (std::ranges::all_of(weights_, [](double weight) { return weight == 0.0; })) return;
    std::ranges::fill(values, 0.0);
    for (std::size_t i = 0; i < num_samples_; ++i) {
      if (weights_[i] == 0.0) continue;
      const std::span knots = row(i);
      for (std::size_t k = 0; k < size_; ++k) values[k] += weights_[i] * knots[k];
    }
    clip(values);
    if (options_.method != PlanningMethod::kCrossEntropy) return;
    std::ranges::fill(sigma_, 0.0);
    for (std::size_t i = 0; i < num_samples_; ++i) {
      if (weights_[i] == 0.0) continue;
      const std::span knots = row(i);
      for (std::size_t k = 0; k < size_; ++k) {
        const double difference = knots[k] - values[k];
        sigma_[k] += weights_[i] * difference * difference;
      }
    }
    for (double& sigma : sigma_)
      sigma = std::clamp(std::sqrt(sigma), options_.least_sigma, options_.most_sigma);
  }

  void evaluate_plan() {
    job_ = Job::kPlan;
    run(plan_id_);
    plan_.cost = costs_[num_samples_];
    plan_.states.begin = start_.time;
    if (!task_.batch_cost) return;
    std::ranges::copy(records_.positions(num_samples_, 1), plan_.states.positions.begin());
    std::ranges::copy(records_.velocities(num_samples_, 1), plan_.states.velocities.begin());
  }

  PlanningModel model_;
  PlanningTask task_;
  PlanningTask swapped_;  // Terms wait here for their check.
  PlannerOptions options_;
  int num_steps_;
  int joints_per_finger_{0};  // 0: fingers are not known.
  std::size_t num_samples_;
  std::size_t size_{0};  // Numbers of all knots.

  Plan plan_;
  KnotSpline previous_;
  bool has_previous_{false};
  bool is_own_{false};         // The previous plan is in `plan_`, otherwise in `previous_`.
  std::vector<double> knots_;  // of all samples
  std::vector<double> sigma_;
  std::vector<double> costs_;  // of all samples, then of the plan
  std::vector<double> weights_;
  std::vector<double> weights_scratch_;
  std::vector<std::uint8_t> masked_ = std::vector<std::uint8_t>(num_samples_ + 1);

  // Of all samples and the plan, for costs of batches.
  RolloutRecords records_;

  // The call in progress.
  Job job_{Job::kSample};
  std::uint64_t round_{0};
  PlanningState start_;

  SceneModel::Compiled single_;
  const KnotSpline* single_commands_{nullptr};
  int single_steps_{0};
  double single_cost_{0.0};
  PlanningState end_;

  std::vector<int> all_samples_;
  std::array<int, 1> plan_id_{};
  std::array<int, 1> single_id_{};
  std::unique_ptr<mjBatch, DeleteBatch> batch_;
};

PredictivePlanner::PredictivePlanner(PlanningModel model, PlanningTask task,
                                     const PlannerOptions& options)
    : implementation_(
          std::make_unique<Implementation>(std::move(model), std::move(task), options)) {}
PredictivePlanner::~PredictivePlanner() = default;
PredictivePlanner::PredictivePlanner(PredictivePlanner&&) noexcept = default;
PredictivePlanner& PredictivePlanner::operator=(PredictivePlanner&&) noexcept = default;

const Plan& PredictivePlanner::plan(const PlanningState& start) {
  return checked(implementation_)->plan(start);
}
const Plan& PredictivePlanner::newest() const noexcept {
  return checked(implementation_)->newest();
}
void PredictivePlanner::restart() noexcept { checked(implementation_)->restart(); }
void PredictivePlanner::begin_with(const KnotSpline& commands) {
  checked(implementation_)->begin_with(commands);
}
double PredictivePlanner::simulate(const PlanningState& start, const KnotSpline& commands,
                                   Seconds duration, PlanningState& end) {
  return checked(implementation_)->simulate(start, commands, duration, end);
}
void PredictivePlanner::set_task(PlanningTask task) {
  checked(implementation_)->set_task(std::move(task));
}
void PredictivePlanner::set_terms(std::span<const CostTerm> terms) {
  checked(implementation_)->set_terms(terms);
}
const PlanningModel& PredictivePlanner::model() const noexcept {
  return checked(implementation_)->model();
}
const PlanningTask& PredictivePlanner::task() const noexcept {
  return checked(implementation_)->task();
}
const PlannerOptions& PredictivePlanner::options() const noexcept {
  return checked(implementation_)->options();
}
int PredictivePlanner::num_threads() const noexcept {
  return checked(implementation_)->num_threads();
}
int PredictivePlanner::num_steps() const noexcept { return checked(implementation_)->num_steps(); }
std::span<const double> PredictivePlanner::costs() const noexcept {
  return checked(implementation_)->samples();
}
std::span<const double> PredictivePlanner::weights() const noexcept {
  return checked(implementation_)->weights();
}
std::span<const double> PredictivePlanner::knots_of(int rollout) const noexcept {
  return checked(implementation_)->knots_of(rollout);
}

}  // namespace trifinger::control
