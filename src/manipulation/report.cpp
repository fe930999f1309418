// SPDX-License-Identifier: BSD-3-Clause
#include "trifinger/manipulation/report.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <span>
#include <vector>

namespace trifinger::manipulation {
namespace {

constexpr Seconds kEndOfHold{1.0};  // Duration over which a drift is averaged at both ends.

// Phases of a try that counts. Grasps before the last one ended without a result.
bool counts(Phase phase) {
  return phase == Phase::kFollow || phase == Phase::kHold || phase == Phase::kLower;
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

using Steps = std::span<const TraceStep>;

bool is_hold(const TraceStep& step) { return step.phase == Phase::kHold; }

// Returns the steps of the last try, from lifting the object to putting it down.
Steps last_try(const std::vector<TraceStep>& steps) {
  // The last try begins with the last step of the phase kGrasp.
  const auto grasp =
      std::ranges::find(steps.rbegin(), steps.rend(), Phase::kGrasp, &TraceStep::phase);
  const auto from = grasp == steps.rend() ? steps.begin() : grasp.base() - 1;
  const auto begin =
      std::find_if(from, steps.end(), [](const TraceStep& step) { return counts(step.phase); });
  const auto end =
      std::find_if(begin, steps.end(), [](const TraceStep& step) { return !counts(step.phase); });
  return {begin, end};
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

  void add(const TraceStep& at, const Eigen::Vector3d& value) {
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
void judge_poses(Steps steps, const std::vector<SeenPose>& poses, Drift drift, Report& report) {
  const double table = steps.front().desired.position.z();
  double position_sum = 0.0;
  double orientation_sum = 0.0;
  auto at = steps.begin();
  for (const SeenPose& seen : poses) {
    at = std::find_if(at, steps.end(),
                      [&](const TraceStep& step) { return step.step >= seen.step; });
    if (at == steps.end()) break;
    if (at->step != seen.step) continue;
    const double distance = (seen.pose.position - at->desired.position).norm();
    const double angle =
        control::rotation_error(at->desired.orientation, seen.pose.orientation).norm();
    position_sum += distance * distance;
    orientation_sum += angle * angle;
    report.position_max = std::max(report.position_max, distance);
    report.orientation_max = std::max(report.orientation_max, angle);
    report.height = std::max(report.height, seen.pose.position.z() - table);
    ++report.num_poses;
    drift.add(*at, seen.pose.position);
  }
  const auto count = static_cast<double>(std::max<std::size_t>(report.num_poses, 1));
  report.position_rms = std::sqrt(position_sum / count);
  report.orientation_rms = std::sqrt(orientation_sum / count);
  report.hold_drift = drift.value().norm();
}

// Sums up forces, travel of the tips and torques.
void judge_grasp(Steps steps, Seconds period, Drift drift, Report& report) {
  std::vector<double> friction;
  double normal_sum = 0.0;
  std::size_t exact = 0;
  double torque_share = 0.0;
  report.normal_force_min = steps.front().normal_forces.minCoeff();
  for (const TraceStep& step : steps) {
    report.normal_force_min = std::min(report.normal_force_min, step.normal_forces.minCoeff());
    report.normal_force_max = std::max(report.normal_force_max, step.normal_forces.maxCoeff());
    normal_sum += step.normal_forces.mean();
    report.tangential_force_max =
        std::max(report.tangential_force_max, step.tangential_forces.maxCoeff());
    friction.push_back(
        step.tangential_forces.cwiseQuotient(step.normal_forces.cwiseMax(1e-3)).maxCoeff());
    report.travel_max = std::max(report.travel_max, step.travel.maxCoeff());
    if (!step.is_in_sight) report.blind_time += period;
    if (step.is_slipping) report.slip_time += period;
    torque_share = std::max(torque_share, step.torque_share);
    if (step.status == control::ForceStatus::kExact) ++exact;
    drift.add(step, step.travel);
  }
  const auto length = static_cast<double>(steps.size());
  report.hold_slip = drift.value().cwiseAbs().maxCoeff();
  report.normal_force_mean = normal_sum / length;
  report.friction_used = quantile(friction, 0.999);
  report.torque_margin = 1.0 - torque_share;
  report.exact_wrenches = static_cast<double>(exact) / length;
}

}  // namespace

Report make_report(const Trace& trace, const std::vector<SeenPose>& poses) {
  Report report;
  report.is_done = trace.end == Phase::kDone;
  report.failure = trace.failure;
  report.grasps = trace.grasps;
  const Steps steps = last_try(trace.steps);
  if (steps.empty()) return report;
  const Drift drift(steps, trace.period);
  judge_poses(steps, poses, drift, report);
  judge_grasp(steps, trace.period, drift, report);

  std::vector<double> cycles;
  cycles.reserve(trace.steps.size());
  for (const TraceStep& step : trace.steps) cycles.push_back(step.cycle_time.count());
  report.cycle_p50 = quantile(cycles, 0.5);
  report.cycle_p999 = quantile(cycles, 0.999);
  return report;
}

}  // namespace trifinger::manipulation
