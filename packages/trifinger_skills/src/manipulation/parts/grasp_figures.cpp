// SPDX-License-Identifier: BSD-3-Clause
#include "manipulation/parts/grasp_figures.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <span>
#include <vector>

#include "manipulation/parts/manipulation.hpp"

namespace trifinger::manipulation {
namespace {

constexpr Seconds kEndOfHold{1.0};  // Duration over which a drift is averaged at both ends.

// Phases of a try that counts. Grasps before the last one ended without a result.
bool counts(const SkillStep& step) {
  return step.phase == name_of(Phase::kFollow) || step.phase == name_of(Phase::kHold) ||
         step.phase == name_of(Phase::kLower);
}

double quantile(std::vector<double>& values, double share) {
  if (values.empty()) return 0.0;
  const auto place =
      values.begin() + static_cast<std::ptrdiff_t>(share * static_cast<double>(values.size() - 1));
  std::nth_element(values.begin(), place, values.end());
  return *place;
}

class Mean {
 public:
  void add(const Eigen::Vector3d& value) {
    sum_ += value;
    ++count_;
  }
  [[nodiscard]] Eigen::Vector3d value() const { return sum_ / std::max(count_, 1); }
  [[nodiscard]] bool is_empty() const { return count_ == 0; }

 private:
  Eigen::Vector3d sum_{Eigen::Vector3d::Zero()};
  int count_{0};
};

using Steps = std::span<const SkillStep>;

bool is_hold(const SkillStep& step) { return step.phase == name_of(Phase::kHold); }

// Returns the steps of the last try, from lifting the object to putting it down.
Steps last_try(const std::vector<SkillStep>& steps) {
  // The last try begins with the last step of the phase kGrasp.
  const auto grasp =
      std::ranges::find(steps.rbegin(), steps.rend(), name_of(Phase::kGrasp), &SkillStep::phase);
  const auto from = grasp == steps.rend() ? steps.begin() : grasp.base() - 1;
  const auto begin = std::find_if(from, steps.end(), counts);
  return {begin, std::find_if_not(begin, steps.end(), counts)};
}

// Averages a value over the first and the last second of holding.
class Drift {
 public:
  Drift(Steps steps, Seconds period) {
    const auto begin = std::ranges::find_if(steps, is_hold);
    if (begin == steps.end()) return;
    const auto end = std::find_if_not(begin, steps.end(), is_hold);
    const auto edge = static_cast<TimeIndex>(kEndOfHold / period);
    first_second_ = begin->step + edge;
    last_second_ = std::max((end - 1)->step + 1 - edge, first_second_);
  }

  void add(const SkillStep& at, const Eigen::Vector3d& value) {
    if (!is_hold(at)) return;
    if (at.step < first_second_) first_.add(value);
    if (at.step >= last_second_) last_.add(value);
  }

  // Zero if the object was not held long enough.
  [[nodiscard]] Eigen::Vector3d value() const {
    if (first_.is_empty() || last_.is_empty()) return Eigen::Vector3d::Zero();
    return last_.value() - first_.value();
  }

 private:
  TimeIndex first_second_{0};
  TimeIndex last_second_{0};
  Mean first_;
  Mean last_;
};

// Compares the object's poses with the desired ones.
void add_poses(Steps steps, std::span<const SeenPose> poses, Drift drift,
               std::vector<Figure>& figures) {
  const double table = steps.front().desired.position.z();
  double position_sum = 0.0;
  double position_max = 0.0;
  double orientation_sum = 0.0;
  double orientation_max = 0.0;
  double height = 0.0;
  std::size_t num_poses = 0;
  auto at = steps.begin();
  for (const SeenPose& seen : poses) {
    at = std::find_if(at, steps.end(),
                      [&](const SkillStep& step) { return step.step >= seen.step; });
    if (at == steps.end()) break;
    if (at->step != seen.step) continue;
    const double distance = (seen.pose.position - at->desired.position).norm();
    const double angle =
        control::rotation_error(at->desired.orientation, seen.pose.orientation).norm();
    position_sum += distance * distance;
    orientation_sum += angle * angle;
    position_max = std::max(position_max, distance);
    orientation_max = std::max(orientation_max, angle);
    height = std::max(height, seen.pose.position.z() - table);
    ++num_poses;
    drift.add(*at, seen.pose.position);
  }
  const auto count = static_cast<double>(std::max<std::size_t>(num_poses, 1));
  figures.insert(
      figures.end(),
      {{"num_poses", static_cast<double>(num_poses), "", "from which the errors are computed"},
       {"position_rms", std::sqrt(position_sum / count), "m", "from the desired position"},
       {"position_max", position_max, "m", "from the desired position"},
       {"orientation_rms", std::sqrt(orientation_sum / count), "rad",
        "from the desired orientation"},
       {"orientation_max", orientation_max, "rad", "from the desired orientation"},
       {"height", height, "m", "greatest above its place on the table"},
       {"hold_drift", drift.value().norm(), "m", "from the first second of holding to the last"}});
}

// Sums up forces, travel of the tips and torques.
void add_grasp(Steps steps, Seconds period, Drift drift, std::vector<Figure>& figures) {
  std::vector<double> friction;
  double normal_min = std::numeric_limits<double>::infinity();
  double normal_sum = 0.0;
  double normal_max = 0.0;
  double tangential_max = 0.0;
  double travel_max = 0.0;
  double torque_share = 0.0;
  Seconds blind_time{0};
  Seconds slip_time{0};
  std::size_t exact = 0;
  for (const SkillStep& step : steps) {
    const FeltGrasp grasp = step.grasp.value_or(FeltGrasp{});
    normal_min = std::min(normal_min, grasp.normal_forces.minCoeff());
    normal_max = std::max(normal_max, grasp.normal_forces.maxCoeff());
    normal_sum += grasp.normal_forces.mean();
    tangential_max = std::max(tangential_max, grasp.tangential_forces.maxCoeff());
    friction.push_back(
        grasp.tangential_forces.cwiseQuotient(grasp.normal_forces.cwiseMax(1e-3)).maxCoeff());
    travel_max = std::max(travel_max, grasp.travel.maxCoeff());
    if (!step.is_visible) blind_time += period;
    if (grasp.is_slipping) slip_time += period;
    torque_share = std::max(torque_share, step.torque_share);
    if (grasp.is_exact) ++exact;
    drift.add(step, grasp.travel);
  }
  const auto length = static_cast<double>(steps.size());
  figures.insert(
      figures.end(),
      {{"hold_slip", drift.value().cwiseAbs().maxCoeff(), "m",
        "of tips along their faces while holding"},
       {"normal_force_min", normal_min, "N", "of any tip"},
       {"normal_force_mean", normal_sum / length, "N", "of the tips"},
       {"normal_force_max", normal_max, "N", "of any tip"},
       {"tangential_force_max", tangential_max, "N", "of any tip"},
       {"friction_used", quantile(friction, 0.999), "1", "tangential by normal force, 99.9 %"},
       {"travel_max", travel_max, "m", "of a tip along its face, rolling and slipping"},
       {"blind_time", blind_time.count(), "s", "out of sight, led by what the tips felt"},
       {"slip_time", slip_time.count(), "s", "in which a tip slipped"},
       {"torque_margin", 1.0 - torque_share, "1", "least torque left, as a share of its limit"},
       {"exact_wrenches", static_cast<double>(exact) / length, "1",
        "of the steps, with exactly the desired wrench"}});
}

}  // namespace

std::vector<Figure> grasp_figures(const SkillTrace& trace, std::span<const SeenPose> poses) {
  const Steps steps = last_try(trace.steps);
  if (steps.empty()) return {{"num_poses", 0.0, "", "from which errors are computed"}};
  std::vector<Figure> figures;
  const Drift drift(steps, trace.period);
  add_poses(steps, poses, drift, figures);
  add_grasp(steps, trace.period, drift, figures);

  std::vector<double> cycles;
  cycles.reserve(trace.steps.size());
  for (const SkillStep& step : trace.steps) cycles.push_back(step.cycle_time.count());
  figures.push_back(
      {"cycle_p50", quantile(cycles, 0.5), "s", "of a step of the controller, median"});
  figures.push_back(
      {"cycle_p999", quantile(cycles, 0.999), "s", "of a step of the controller, 99.9 %"});
  return figures;
}

}  // namespace trifinger::manipulation
