// SPDX-License-Identifier: BSD-3-Clause
#include "manipulation/parts/grasped_motion.hpp"

#include "manipulation/parts/grasp_figures.hpp"
#include "manipulation/parts/plan_untried.hpp"
#include "manipulation/parts/torque_action.hpp"

namespace trifinger::manipulation {

GraspedMotion::GraspedMotion(const SkillContext& context, const ManipulationConfig& config)
    : config_(config),
      manipulation_(context.description, config, context.period),
      planner_(context.description, config) {
  note();
}

const TriFinger::Action& GraspedMotion::update(TimeIndex step,
                                               const control::JointState& joints) noexcept {
  set_torques(action_, manipulation_.update(step, joints));
  note();
  return action_;
}

void GraspedMotion::stop() noexcept {
  manipulation_.stop();
  note();
}

void GraspedMotion::plan() {
  plan_ =
      plan_untried(tried_, [this] { return planner_.plan(manipulation_.resting_pose(), tried_); });
  if (plan_) tried_.push_back(plan_->touches);
}

void GraspedMotion::begin() noexcept {
  manipulation_.begin(plan_);
  note();
}

void GraspedMotion::note() noexcept {
  const control::GraspState& grasp = manipulation_.grasp();
  state_ = {.phase = name_of(manipulation_.phase()),
            .has_ended = manipulation_.has_ended(),
            .failure = manipulation_.failure(),
            .desired = manipulation_.desired(),
            .object = manipulation_.object(),
            .torque_share = grasp.torque_share,
            .is_visible = manipulation_.is_visible(),
            .grasp = FeltGrasp{.normal_forces = grasp.normal_forces,
                               .tangential_forces = grasp.tangential_forces,
                               .travel = grasp.travel,
                               .is_slipping = grasp.is_slipping,
                               .is_exact = grasp.wanted.status == control::ForceStatus::kExact}};
}

std::vector<Figure> GraspedMotion::figures(const SkillTrace& trace,
                                           std::span<const SeenPose> poses) const {
  std::vector<Figure> all = grasp_figures(trace, poses);
  all.push_back({"grasps", static_cast<double>(manipulation_.grasps()), "", "how often it began"});
  if (manipulation_.plan())
    all.push_back({"planned_torque_share", manipulation_.plan()->torque_share, "1",
                   "of the motors' torque, as planned"});
  return all;
}

}  // namespace trifinger::manipulation
