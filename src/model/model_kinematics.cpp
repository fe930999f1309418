// SPDX-License-Identifier: BSD-3-Clause
#include "trifinger/model/model_kinematics.hpp"

#include <mujoco/mujoco.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <utility>

#include "base/text_of.hpp"
#include "symmetric_solve.hpp"
#include "trifinger/base/error.hpp"
#include "trifinger/base/random.hpp"

namespace trifinger {
namespace {

using detail::require;
using detail::text_of;
using Vector6 = Eigen::Matrix<double, 6, 1>;

constexpr double kReached = 1e-6;       // [m], [rad]
constexpr double kExact = 1e-9;         // a search ends here
constexpr double kLeastDamping = 1e-9;  // of the squares of a Jacobian
constexpr double kTiny = 1e-300;        // so that nothing divides by zero
constexpr double kLargestStep = 0.5;    // of a joint [rad], [m]
constexpr int kNumSteps = 100;          // of one search
constexpr int kNumSearches = 50;

std::vector<std::string> frames_or_ends(const SceneModel& model,
                                        std::span<const std::string> names) {
  if (names.empty()) return end_frames(model);
  return {names.begin(), names.end()};
}

// The rotation vector that turns `from` to `to`.
Eigen::Vector3d turn_between(const Eigen::Quaterniond& from, const Eigen::Quaterniond& to) {
  Eigen::Quaterniond turn = to * from.conjugate();
  if (turn.w() < 0.0) turn.coeffs() *= -1.0;
  const double sine = turn.vec().norm();
  if (sine == 0.0) return Eigen::Vector3d::Zero();
  return turn.vec() * (2.0 * std::atan2(sine, turn.w()) / sine);
}

// Draws a position of a joint; one without an end may be anywhere within a turn, or 1 m.
double draw(const JointRange& range, bool is_slide, Random& random) {
  const double most = is_slide ? 1.0 : std::numbers::pi;
  const double lower = std::isfinite(range.lower) ? range.lower : -most;
  const double upper = std::isfinite(range.upper) ? range.upper : most;
  return random.uniform(lower, std::max(lower, upper));
}

}  // namespace

ModelKinematics::ModelKinematics(std::shared_ptr<const SceneModel> model,
                                 std::span<const std::string> frames)
    : model_(std::move(model)),
      names_(frames_or_ends(*model_, frames)),
      frames_(model_, names_),
      data_(model_->make_data()) {
  const auto joints = static_cast<Eigen::Index>(model_->joints().size());
  const auto dofs = static_cast<Eigen::Index>(model_->mujoco()->nv);
  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  for (const DrivenJoint& joint : model_->joints()) {
    const auto range = joint.range.value_or(std::array{-kInfinity, kInfinity});
    ranges_.push_back({.lower = range[0], .upper = range[1]});
  }
  model_->reset(*data_);
  std::fill_n(data_->qvel, dofs, 0.0);
  // How fast each degree of freedom is for a velocity of 1 of each joint.
  speeds_.setZero(dofs, joints);
  Eigen::VectorXd unit = Eigen::VectorXd::Zero(dofs);
  for (Eigen::Index dof = 0; dof < dofs; ++dof) {
    unit[dof] = 1.0;
    for (Eigen::Index joint = 0; joint < joints; ++joint) {
      speeds_(dof, joint) = model_->torque_of(static_cast<std::size_t>(joint), unit.data());
    }
    unit[dof] = 0.0;
  }
  rows_.setZero(6, dofs);
  jacobian_.setZero(6, joints);
  gravity_.setZero(joints);
  bias_.setZero(joints);
  inertia_.setZero(dofs, dofs);
  moved_.setZero(dofs, joints);
  mass_.setZero(joints, joints);
  solver_ = Eigen::LDLT<Eigen::MatrixXd>(joints);
  inverse_.setZero(joints, 6);
  free_.setZero(joints);
}

std::size_t ModelKinematics::frame(const std::string& name) const {
  const auto found = std::ranges::find(names_, name);
  require(found != names_.end(), text_of("there is no frame '", name, "'"));
  return static_cast<std::size_t>(found - names_.begin());
}

std::span<const double> ModelKinematics::configuration() const noexcept {
  return {data_->qpos, static_cast<std::size_t>(model_->mujoco()->nq)};
}

void ModelKinematics::update(const Eigen::Ref<const Eigen::VectorXd>& position) noexcept {
  for (Eigen::Index joint = 0; joint < position.size(); ++joint) {
    model_->set_position(static_cast<std::size_t>(joint), position[joint], *data_);
  }
}

Eigen::VectorXd ModelKinematics::position() const {
  Eigen::VectorXd position(num_joints());
  for (Eigen::Index joint = 0; joint < position.size(); ++joint) {
    position[joint] = model_->position(static_cast<std::size_t>(joint), *data_);
  }
  return position;
}

Eigen::Isometry3d ModelKinematics::pose(std::size_t frame) const noexcept {
  const auto [position, orientation] = frames_.pose(frame, configuration());
  const auto& [w, x, y, z] = orientation;
  Eigen::Isometry3d pose(Eigen::Quaterniond(w, x, y, z));
  pose.pretranslate(Eigen::Vector3d(position[0], position[1], position[2]));
  return pose;
}

const ModelKinematics::Jacobian& ModelKinematics::jacobian(std::size_t frame) noexcept {
  rows_.setZero();  // of a chain only its joints are filled in
  frames_.jacobian(frame, configuration(),
                   std::span(rows_.data(), static_cast<std::size_t>(rows_.size())));
  jacobian_.noalias() = rows_.lazyProduct(speeds_);
  return jacobian_;
}

const Eigen::VectorXd& ModelKinematics::gravity_torques() noexcept {
  std::fill_n(data_->qvel, speeds_.rows(), 0.0);
  weigh(gravity_);
  return gravity_;
}

const Eigen::VectorXd& ModelKinematics::bias_torques(
    const Eigen::Ref<const Eigen::VectorXd>& velocity) noexcept {
  Eigen::Map<Eigen::VectorXd>(data_->qvel, speeds_.rows()).noalias() =
      speeds_.lazyProduct(velocity);
  weigh(bias_);
  return bias_;
}

void ModelKinematics::weigh(Eigen::VectorXd& torques) noexcept {
  model_->compute_weight(*model_->mujoco(), *data_,
                         std::span(torques.data(), static_cast<std::size_t>(torques.size())));
}

const Eigen::MatrixXd& ModelKinematics::mass_matrix() noexcept {
  const mjModel* const model = model_->mujoco();
  mj_kinematics(model, data_.get());
  mj_comPos(model, data_.get());
  mj_tendon(model, data_.get());
  mj_makeM(model, data_.get());
  mj_fullM(model, data_.get(), inertia_.data());
  moved_.noalias() = inertia_.lazyProduct(speeds_);
  mass_.noalias() = speeds_.transpose().lazyProduct(moved_);
  return mass_;
}

const Eigen::VectorXd& ModelKinematics::null_space_torques(
    std::size_t frame, const Eigen::Ref<const Eigen::VectorXd>& torques) noexcept {
  (void)mass_matrix();
  (void)jacobian(frame);
  solver_.compute(mass_);
  inverse_ = jacobian_.transpose();
  solver_.solveInPlace(inverse_);
  Eigen::Matrix<double, 6, 6> mobility = jacobian_.lazyProduct(inverse_);
  // Directions in which the joints cannot move the frame stay out of it.
  mobility.diagonal().array() += kLeastDamping * mobility.trace() + kTiny;
  const Vector6 acceleration = inverse_.transpose().lazyProduct(torques);
  const Vector6 wrench = symmetric_solve(mobility, acceleration);
  free_ = torques - jacobian_.transpose().lazyProduct(wrench);
  return free_;
}

// Searches from a pose, within the ranges: damped least squares, with a damping that falls with the
// squared error (T. Sugihara: Solvability-unconcerned inverse kinematics by the
// Levenberg-Marquardt method. IEEE Transactions on Robotics, 2011). A joint at its stop leaves its
// part to the others.
JointSolution ModelKinematics::search(std::size_t frame, const Eigen::Vector3d& point,
                                      const std::optional<Eigen::Quaterniond>& orientation,
                                      const Eigen::VectorXd& begin,
                                      std::span<const JointRange> ranges) {
  JointSolution found{.position = begin};
  JointSolution best;
  Vector6 error = Vector6::Zero();
  Jacobian columns = jacobian_;
  Eigen::VectorXd step;
  double least = std::numeric_limits<double>::infinity();
  for (int i = 0; i <= kNumSteps; ++i) {
    update(found.position);
    const Eigen::Isometry3d now = pose(frame);
    error.head<3>() = point - now.translation();
    if (orientation) error.tail<3>() = turn_between(Eigen::Quaterniond(now.linear()), *orientation);
    found.distance = error.head<3>().norm();
    found.angle = error.tail<3>().norm();
    if (const double cost = error.norm(); cost < least) {
      least = cost;
      best = found;
    }
    if (least <= kExact) break;
    columns = jacobian(frame);
    if (!orientation) columns.bottomRows<3>().setZero();
    const double damping = 0.5 * error.squaredNorm() + kLeastDamping;
    for (Eigen::Index turn = 0; turn <= columns.cols(); ++turn) {
      Eigen::Matrix<double, 6, 6> square = columns.lazyProduct(columns.transpose());
      square.diagonal().array() += damping;
      step = columns.transpose() * symmetric_solve(square, error);
      const double largest = step.cwiseAbs().maxCoeff();
      if (largest > kLargestStep) step *= kLargestStep / largest;
      bool has_stopped = false;
      for (Eigen::Index joint = 0; joint < step.size(); ++joint) {
        const JointRange& range = ranges[static_cast<std::size_t>(joint)];
        const double wanted = found.position[joint] + step[joint];
        const double allowed = std::clamp(wanted, range.lower, range.upper);
        if (allowed == wanted) continue;
        error -= columns.col(joint) * (allowed - found.position[joint]);
        columns.col(joint).setZero();
        found.position[joint] = allowed;
        step[joint] = 0.0;
        has_stopped = true;
      }
      if (has_stopped) continue;
      found.position += step;
      break;
    }
  }
  best.is_reached = best.distance <= kReached && best.angle <= kReached;
  return best;
}

JointSolution ModelKinematics::inverse_kinematics(
    std::size_t frame, const Eigen::Vector3d& point,
    const std::optional<Eigen::Quaterniond>& orientation,
    const Eigen::Ref<const Eigen::VectorXd>& near, std::span<const JointRange> ranges) {
  require(frame < names_.size(), text_of("there is no frame ", frame));
  require(near.size() == num_joints() && near.allFinite(),
          text_of("near must be ", num_joints(), " finite positions"));
  require(point.allFinite() && (!orientation || orientation->coeffs().allFinite()),
          "the goal of a frame must be finite");
  if (ranges.empty()) ranges = ranges_;
  require(std::ssize(ranges) == num_joints(),
          text_of("there are ", ranges.size(), " ranges for ", num_joints(), " joints"));
  for (const JointRange& range : ranges) {
    require(range.lower <= range.upper, text_of("a joint has the range from ", range.lower, " to ",
                                                range.upper, ": lower must be first"));
  }
  std::optional<Eigen::Quaterniond> goal = orientation;
  if (goal) goal->normalize();
  Eigen::VectorXd begin = near;
  for (Eigen::Index joint = 0; joint < begin.size(); ++joint) {
    const JointRange& range = ranges[static_cast<std::size_t>(joint)];
    begin[joint] = std::clamp(begin[joint], range.lower, range.upper);
  }
  const std::vector<double> before(data_->qpos, data_->qpos + model_->mujoco()->nq);
  JointSolution best = search(frame, point, goal, begin, ranges);
  Random random;
  for (int i = 1; i < kNumSearches && !best.is_reached; ++i) {
    // Joints that do not move the frame stay.
    for (Eigen::Index joint = 0; joint < begin.size(); ++joint) {
      const auto place = static_cast<std::size_t>(joint);
      const double drawn = draw(ranges[place], model_->joints()[place].is_slide, random);
      if (!jacobian_.col(joint).isZero(0.0)) begin[joint] = drawn;
    }
    JointSolution next = search(frame, point, goal, begin, ranges);
    if (next.distance + next.angle < best.distance + best.angle) best = std::move(next);
  }
  std::ranges::copy(before, data_->qpos);
  return best;
}

}  // namespace trifinger
