// SPDX-License-Identifier: BSD-3-Clause
#include "trifinger/manipulation/report.hpp"

#include <algorithm>
#include <cmath>

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

}  // namespace

Report make_report(const Trace& trace, const std::vector<SeenPose>& poses) {
  Report report;
  report.is_done = trace.end == Phase::kDone;
  report.failure = trace.failure;
  report.grasps = trace.grasps;
  const auto& steps = trace.steps;
  // The last try begins with the last step of the phase kGrasp.
  auto last_try = steps.begin();
  for (auto step = steps.begin(); step != steps.end(); ++step) {
    if (step->phase == Phase::kGrasp) last_try = step;
  }
  const auto begin =
      std::find_if(last_try, steps.end(), [](const TraceStep& step) { return counts(step.phase); });
  const auto end =
      std::find_if(begin, steps.end(), [](const TraceStep& step) { return !counts(step.phase); });
  if (begin == end) return report;

  const auto is_hold = [](const TraceStep& step) { return step.phase == Phase::kHold; };
  const auto hold_begin = std::find_if(begin, end, is_hold);
  const auto hold_end = std::find_if_not(hold_begin, end, is_hold);
  const auto edge = static_cast<TimeIndex>(kEndOfHold / trace.period);
  const TimeIndex first_second = hold_begin == end ? 0 : hold_begin->step + edge;
  const TimeIndex last_second =
      hold_begin == end ? 0 : std::max((hold_end - 1)->step + 1 - edge, first_second);

  const double table = begin->desired.position.z();
  double position_sum = 0.0;
  double orientation_sum = 0.0;
  Mean first_mean;
  Mean last_mean;
  auto at = begin;
  for (const SeenPose& seen : poses) {
    at = std::find_if(at, end, [&](const TraceStep& step) { return step.step >= seen.step; });
    if (at == end) break;
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
    if (!is_hold(*at)) continue;
    if (at->step < first_second) first_mean.add(seen.pose.position);
    if (at->step >= last_second) last_mean.add(seen.pose.position);
  }
  const auto count = static_cast<double>(std::max<std::size_t>(report.num_poses, 1));
  report.position_rms = std::sqrt(position_sum / count);
  report.orientation_rms = std::sqrt(orientation_sum / count);

  std::vector<double> friction;
  Mean first_travel;
  Mean last_travel;
  double normal_sum = 0.0;
  std::size_t exact = 0;
  double torque_share = 0.0;
  report.normal_force_min = begin->normal_forces.minCoeff();
  for (auto step = begin; step != end; ++step) {
    report.normal_force_min = std::min(report.normal_force_min, step->normal_forces.minCoeff());
    report.normal_force_max = std::max(report.normal_force_max, step->normal_forces.maxCoeff());
    normal_sum += step->normal_forces.mean();
    report.tangential_force_max =
        std::max(report.tangential_force_max, step->tangential_forces.maxCoeff());
    friction.push_back(
        step->tangential_forces.cwiseQuotient(step->normal_forces.cwiseMax(1e-3)).maxCoeff());
    report.travel_max = std::max(report.travel_max, step->travel.maxCoeff());
    if (step->is_slipping) report.slip_time += trace.period;
    torque_share = std::max(torque_share, step->torque_share);
    if (step->status == control::ForceStatus::kExact) ++exact;
    if (!is_hold(*step)) continue;
    if (step->step < first_second) first_travel.add(step->travel);
    if (step->step >= last_second) last_travel.add(step->travel);
  }
  // If the object was not held long enough, there is no drift.
  if (!first_mean.is_empty() && !last_mean.is_empty()) {
    report.hold_drift = (last_mean.value() - first_mean.value()).norm();
    report.hold_slip = (last_travel.value() - first_travel.value()).cwiseAbs().maxCoeff();
  }
  const auto length = static_cast<double>(end - begin);
  report.normal_force_mean = normal_sum / length;
  report.friction_used = quantile(friction, 0.999);
  report.torque_margin = 1.0 - torque_share;
  report.exact_wrenches = static_cast<double>(exact) / length;

  std::vector<double> cycles;
  cycles.reserve(steps.size());
  for (const TraceStep& step : steps) cycles.push_back(step.cycle_time.count());
  report.cycle_p50 = quantile(cycles, 0.5);
  report.cycle_p999 = quantile(cycles, 0.999);
  return report;
}

}  // namespace trifinger::manipulation
