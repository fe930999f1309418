// SPDX-License-Identifier: BSD-3-Clause
#include "puller.hpp"

#include <mujoco/mujoco.h>

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <string>

#include "trifinger/model/frames.hpp"

namespace trifinger::detail {
namespace {

using Eigen::Map;
using Eigen::Matrix3d;
using Eigen::Vector3d;

// The force of the spring on a point at `stretch` from its target, at this velocity. `mobility` is
// the acceleration of the point per force [1/kg].
Vector3d force_of(double stiffness, const Vector3d& stretch, const Vector3d& velocity,
                  const Matrix3d& mobility, double step) {
  // The mean over the directions: a tip is heavy along its finger and light across.
  const double mass = 3.0 / std::max(mobility.trace(), 1e-6);
  // At most as light as the lightest direction: no eigenvalue is beyond this norm of a matrix.
  const double lightest = 1.0 / std::max(mobility.cwiseAbs().rowwise().sum().maxCoeff(), 1e-6);
  // The force acts for a whole step. Twice the damper plus the spring, in these units, must be
  // below 4, or each step would overshoot by more than the last. Here it is 1.25.
  const double spring = std::min(stiffness, 0.25 * lightest / (step * step));
  const double damper = std::min(2.0 * std::sqrt(spring * mass), 0.5 * lightest / step);
  // A body that is free moves at the spring's force over the damping.
  const double most = std::min(kMaxPullForce, kMaxPullSpeed * damper);
  const double pulls = std::min(spring, most / std::max(stretch.norm(), 1e-9));
  Vector3d force = pulls * stretch - damper * velocity;
  const double size = force.norm();
  // A simulation that diverges is not pulled.
  if (!std::isfinite(size)) return Vector3d::Zero();
  if (size > kMaxPullForce) force *= kMaxPullForce / size;
  return force;
}

}  // namespace

Puller::Puller(const SceneModel& model)
    : jacobian_(3 * static_cast<std::size_t>(model.mujoco()->nv)), solved_(jacobian_.size()) {
  const mjModel& compiled = *model.mujoco();
  for (const int geom : model.tip_geoms()) {
    Body& body = bodies_.emplace_back(Body{.index = compiled.geom_bodyid[geom], .centre = {}});
    std::copy_n(compiled.geom_pos + std::ptrdiff_t{3} * geom, 3, body.centre.begin());
  }
  for (const ObjectAddress& object : model.objects()) {
    bodies_.push_back({.index = object.body, .centre = {}});
  }
  if (!model.tip_geoms().empty()) return;
  for (const std::string& end : end_frames(model)) {
    const int site = mj_name2id(&compiled, mjOBJ_SITE, end.c_str());
    if (site < 0) {
      bodies_.push_back({.index = mj_name2id(&compiled, mjOBJ_BODY, end.c_str()), .centre = {}});
      continue;
    }
    Body& body = bodies_.emplace_back(Body{.index = compiled.site_bodyid[site], .centre = {}});
    std::copy_n(compiled.site_pos + std::ptrdiff_t{3} * site, 3, body.centre.begin());
  }
}

void Puller::set(std::int64_t body, const Pull& pull) noexcept {
  body_ = &bodies_[static_cast<std::size_t>(body)];
  pull_ = pull;
  force_ = {};
}

void Puller::step(const mjModel_& model, mjData_& data, int steps) noexcept {
  using Rows = Eigen::Matrix<double, 3, Eigen::Dynamic, Eigen::RowMajor>;
  const auto size = static_cast<Eigen::Index>(model.nv);
  const Map<const Rows> jacobian(jacobian_.data(), 3, size);
  const Map<const Rows> solved(solved_.data(), 3, size);
  const Map<const Eigen::VectorXd> velocities(data.qvel, size);
  Map<Eigen::VectorXd> applied(data.qfrc_applied, size);
  const Vector3d fixed =
      Map<const Vector3d>(body_->centre.data()) + Map<const Vector3d>(pull_.point.data());
  const Map<const Vector3d> target(pull_.target.data());
  Vector3d sum = Vector3d::Zero();
  for (int i = 0; i < steps; ++i) {
    // After the first half of mj_step, positions, velocities and the mass matrix are those of the
    // beginning of the step.
    mj_step1(&model, &data);
    const Map<const Vector3d> origin(data.xpos + std::ptrdiff_t{3} * body_->index);
    const Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>> rotation(
        data.xmat + std::ptrdiff_t{9} * body_->index);
    const Vector3d point = origin + rotation * fixed;
    mj_jac(&model, &data, jacobian_.data(), nullptr, point.data(), body_->index);
    mj_solveM(&model, &data, solved_.data(), jacobian_.data(), 3);
    const Matrix3d mobility = jacobian.lazyProduct(solved.transpose());
    const Vector3d velocity = jacobian.lazyProduct(velocities);
    const Vector3d force =
        force_of(pull_.stiffness, target - point, velocity, mobility, model.opt.timestep);
    applied = jacobian.transpose().lazyProduct(force);
    // The second half alone would not be the integrator of Runge and Kutta.
    if (model.opt.integrator == mjINT_RK4) {
      mj_step(&model, &data);
    } else {
      mj_step2(&model, &data);
    }
    sum += force;
  }
  // The hand is no part of the state: a saved simulation goes on without it.
  applied.setZero();
  Map<Vector3d>(force_.data()) = sum / steps;
}

}  // namespace trifinger::detail
