// SPDX-License-Identifier: BSD-3-Clause
#include "trifinger/model/kinematics.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <cassert>
#include <cmath>
#include <limits>
#include <numbers>
#include <vector>

#include "base/moved.hpp"
#include "blueprint.hpp"
#include "spec.hpp"
#include "trifinger/model/robot_model.hpp"

namespace trifinger {
namespace {

// Removes everything but the fingers, because nothing else enters the kinematics.
RobotDescription fingers_only(RobotDescription description) {
  description.objects.clear();
  description.boundary = false;
  return description;
}

// Parameters of the closed form. In a frame with y along the finger and z up, the tip lies in a
// plane at the distance `aside` from the axis of joint 0. Joint 0 turns that plane about y.
struct ClosedForm {
  double aside;        // Distance of the tip's plane from the joint-0 axis [m].
  double forward;      // Distance of joint 1 from the finger base [m].
  double joint1_sign;  // -1 if joint 1 turns the other way.
};

constexpr double kLinkLength = 0.16;

ClosedForm closed_form(Variant variant) {
  switch (variant) {
    case Variant::kPro:
      return {0.086, 0.0505, 1};
    case Variant::kOne:
      return {0, 0, -1};
    case Variant::kEdu:
      break;
  }
  return {-0.05945, 0, 1};
}

// The chain from the world to a tip: the transform before each joint, the joint's axis, and the
// tip's position after the last joint.
struct Chain {
  std::array<Eigen::Isometry3d, kJointsPerFinger> before;
  std::array<Eigen::Vector3d, kJointsPerFinger> axis;
  std::array<double, kJointsPerFinger> zero;  // Angle of a joint in the zero pose [rad].
  Eigen::Vector3d tip;
};

Chain chain_to(const RobotModel& model, std::size_t finger) {
  const mjModel& m = *model.mujoco();
  const auto vector = [](const mjtNum* numbers) {
    return Eigen::Vector3d(numbers[0], numbers[1], numbers[2]);
  };
  const auto frame = [&](const mjtNum* position, const mjtNum* quaternion) {
    Eigen::Isometry3d pose(
        Eigen::Quaterniond(quaternion[0], quaternion[1], quaternion[2], quaternion[3]));
    pose.pretranslate(vector(position));
    return pose;
  };
  const int site = model.tip_sites()[finger];
  std::vector<int> bodies;
  for (int body = m.site_bodyid[site]; body != 0; body = m.body_parentid[body]) {
    bodies.push_back(body);
  }
  Chain chain{};
  std::size_t count = 0;
  Eigen::Isometry3d fixed = Eigen::Isometry3d::Identity();
  for (const int body : std::vector(bodies.rbegin(), bodies.rend())) {
    fixed = fixed * frame(m.body_pos + 3 * body, m.body_quat + 4 * body);
    if (m.body_jntnum[body] == 0) continue;
    const int joint = m.body_jntadr[body];
    const Eigen::Vector3d anchor = vector(m.jnt_pos + 3 * joint);
    chain.before.at(count) = fixed * Eigen::Translation3d(anchor);
    chain.axis.at(count) = vector(m.jnt_axis + 3 * joint);
    chain.zero.at(count) = m.qpos0[m.jnt_qposadr[joint]];
    fixed = Eigen::Isometry3d(Eigen::Translation3d(-anchor));
    ++count;
  }
  chain.tip = fixed * vector(m.site_pos + 3 * site);
  return chain;
}

// Returns the angle of the same direction that lies within the limits, or least beyond them. Among
// several it is the one nearest to `near`.
double equivalent_angle(double angle, double near, double lower, double upper) {
  constexpr double kTurn = 2 * std::numbers::pi;
  const double wrapped = std::remainder(angle, kTurn);
  double chosen = wrapped;
  double chosen_cost = std::numeric_limits<double>::infinity();
  for (const double turn : {-kTurn, 0.0, kTurn}) {
    const double candidate = wrapped + turn;
    const double excess = std::max({0.0, lower - candidate, candidate - upper});
    const double cost = 1e3 * excess + std::abs(candidate - near);
    if (cost < chosen_cost) {
      chosen_cost = cost;
      chosen = candidate;
    }
  }
  return chosen;
}

// MuJoCo writes row-major.
using RowsOfJoints = Eigen::Matrix<double, 3, Eigen::Dynamic, Eigen::RowMajor, 3, kMaxJoints>;

}  // namespace

struct Kinematics::State {
  explicit State(RobotDescription wanted)
      : description(std::move(wanted)),
        model(fingers_only(description)),
        data(model.make_data()),
        form(closed_form(description.variant)) {
    const VariantFigures& limits = figures(description);
    for (int j = 0; j < kJointsPerFinger; ++j) {
      const auto i = static_cast<std::size_t>(j);
      initial[j] = limits.initial_position[i];
      lower[j] = limits.hard_lower[i];
      upper[j] = limits.hard_upper[i];
    }
    for (int finger = 0; finger < model.num_fingers(); ++finger) {
      const auto i = static_cast<std::size_t>(finger);
      // This turn makes y point along the finger for every variant.
      Eigen::Isometry3d along = detail::base_in_platform(description, finger);
      along.linear() =
          Eigen::AngleAxisd(detail::finger_azimuth(description, finger) - std::numbers::pi / 2,
                            Eigen::Vector3d::UnitZ())
              .toRotationMatrix();
      finger_from_world[i] = (detail::platform_in_world(description) * along).inverse();
      chains[i] = chain_to(model, i);
    }
  }

  // The site of a finger's tip.
  [[nodiscard]] int site(int finger) const noexcept {
    return model.tip_sites()[static_cast<std::size_t>(finger)];
  }

  RobotDescription description;
  RobotModel model;
  SceneModel::Data data;
  ClosedForm form;
  Eigen::Vector3d initial, lower, upper;
  std::array<Eigen::Isometry3d, kMaxFingers> finger_from_world;
  std::array<Chain, kMaxFingers> chains;
};

Kinematics::Kinematics(RobotDescription description)
    : state_(std::make_unique<State>(std::move(description))) {
  update(Eigen::Map<const Eigen::VectorXd>(checked(state_)->model.initial_position().data(),
                                           num_joints()));
}

Kinematics::Kinematics(Kinematics&&) noexcept = default;
Kinematics& Kinematics::operator=(Kinematics&&) noexcept = default;
Kinematics::~Kinematics() = default;

const RobotDescription& Kinematics::description() const noexcept {
  return checked(state_)->description;
}
int Kinematics::num_fingers() const noexcept { return checked(state_)->model.num_fingers(); }
int Kinematics::num_joints() const noexcept { return checked(state_)->model.num_joints(); }

void Kinematics::update(const JointValues& position) noexcept {
  const State& state = *checked(state_);
  assert(position.size() == num_joints());
  const mjModel* model = state.model.mujoco();
  mjData* data = state.data.get();
  Eigen::Map<Eigen::VectorXd>(data->qpos, num_joints()) = position;
  mj_kinematics(model, data);
  mj_comPos(model, data);
}

Eigen::Vector3d Kinematics::tip_position(int finger) const noexcept {
  const State& state = *checked(state_);
  return Eigen::Map<const Eigen::Vector3d>(state.data->site_xpos + 3 * state.site(finger));
}

TipPositions Kinematics::tip_positions() const noexcept {
  TipPositions tips(3 * num_fingers());
  for (int finger = 0; finger < num_fingers(); ++finger)
    tips.segment<3>(3 * finger) = tip_position(finger);
  return tips;
}

TipPositions Kinematics::tip_positions(const JointValues& position) const noexcept {
  const State& state = *checked(state_);
  assert(position.size() == num_joints());
  TipPositions tips(3 * num_fingers());
  for (int finger = 0; finger < num_fingers(); ++finger) {
    const Chain& chain = state.chains[static_cast<std::size_t>(finger)];
    Eigen::Vector3d tip = chain.tip;
    for (int joint = kJointsPerFinger - 1; joint >= 0; --joint) {
      const auto j = static_cast<std::size_t>(joint);
      const double angle = position[kJointsPerFinger * finger + joint] - chain.zero[j];
      tip = chain.before[j] * (Eigen::AngleAxisd(angle, chain.axis[j]) * tip);
    }
    tips.segment<3>(3 * finger) = tip;
  }
  return tips;
}

double Kinematics::finger_azimuth(int finger) const noexcept {
  const Eigen::Isometry3d world_from_finger =
      checked(state_)->finger_from_world[static_cast<std::size_t>(finger)].inverse();
  const Eigen::Vector3d forward = world_from_finger.linear().col(1);
  return std::atan2(forward.y(), forward.x());
}

TipJacobian Kinematics::tip_jacobian(int finger) const noexcept {
  const State& state = *checked(state_);
  RowsOfJoints rows(3, num_joints());
  mj_jacSite(state.model.mujoco(), state.data.get(), rows.data(), nullptr, state.site(finger));
  return rows;
}

TipJacobian Kinematics::tip_rotation_jacobian(int finger) const noexcept {
  const State& state = *checked(state_);
  RowsOfJoints rows(3, num_joints());
  mj_jacSite(state.model.mujoco(), state.data.get(), nullptr, rows.data(), state.site(finger));
  return rows;
}

JointMatrix Kinematics::tip_jacobians() const noexcept {
  JointMatrix jacobians(3 * num_fingers(), num_joints());
  for (int finger = 0; finger < num_fingers(); ++finger)
    jacobians.middleRows<3>(3 * finger) = tip_jacobian(finger);
  return jacobians;
}

TipPositions Kinematics::tip_accelerations(const JointValues& velocity) const noexcept {
  const State& state = *checked(state_);
  assert(velocity.size() == num_joints());
  const mjModel* model = state.model.mujoco();
  mjData* data = state.data.get();
  Eigen::Map<Eigen::VectorXd>(data->qvel, num_joints()) = velocity;
  mj_comVel(model, data);
  TipPositions accelerations(3 * num_fingers());
  for (int finger = 0; finger < num_fingers(); ++finger) {
    const int site = state.site(finger);
    RowsOfJoints rows(3, num_joints());
    mj_jacDot(model, data, rows.data(), nullptr, data->site_xpos + 3 * site,
              model->site_bodyid[site]);
    accelerations.segment<3>(3 * finger) = rows * velocity;
  }
  return accelerations;
}

JointValues Kinematics::gravity_torques() const noexcept {
  return bias_torques(JointValues::Zero(num_joints()));
}

JointValues Kinematics::bias_torques(const JointValues& velocity) const noexcept {
  const State& state = *checked(state_);
  assert(velocity.size() == num_joints());
  const mjModel* model = state.model.mujoco();
  mjData* data = state.data.get();
  Eigen::Map<Eigen::VectorXd>(data->qvel, num_joints()) = velocity;
  mj_comVel(model, data);
  JointValues torques(num_joints());
  mj_rne(model, data, 0, torques.data());
  return torques;
}

JointMatrix Kinematics::mass_matrix() const noexcept {
  const State& state = *checked(state_);
  mj_crb(state.model.mujoco(), state.data.get());
  JointMatrix mass(num_joints(), num_joints());
  mj_fullM(state.model.mujoco(), state.data.get(), mass.data());
  return mass;
}

FingerPose Kinematics::inverse_kinematics(int finger, const Eigen::Vector3d& tip) const noexcept {
  return inverse_kinematics(finger, tip, checked(state_)->initial);
}

FingerPose Kinematics::inverse_kinematics(int finger, const Eigen::Vector3d& tip,
                                          const Eigen::Vector3d& near) const noexcept {
  const State& state = *checked(state_);
  if (!tip.allFinite() || !near.allFinite()) return {state.initial, Reach::kTooFar};

  const ClosedForm& form = state.form;
  const Eigen::Vector3d local = state.finger_from_world[static_cast<std::size_t>(finger)] * tip;
  const double forward = local.y() - form.forward;

  Reach reach = Reach::kYes;
  const double squared_depth =
      local.x() * local.x() + local.z() * local.z() - form.aside * form.aside;
  // A value below zero by a rounding error still counts as touching.
  if (squared_depth < -1e-12) reach = Reach::kTooClose;
  const double depth = std::sqrt(std::max(0.0, squared_depth));

  const double squared_length = forward * forward + depth * depth;
  double cosine = squared_length / (2 * kLinkLength * kLinkLength) - 1;
  if (cosine > 1 + 1e-12 && reach == Reach::kYes) reach = Reach::kTooFar;
  cosine = std::min(cosine, 1.0);

  double best_distance = std::numeric_limits<double>::infinity();
  double best_excess = std::numeric_limits<double>::infinity();
  Eigen::Vector3d best = near;
  // The finger hangs below or rises above its joint-0 axis.
  for (const double side : {-1.0, 1.0}) {
    // The knee bends one way or the other.
    for (const double knee : {-1.0, 1.0}) {
      const double height = side * depth;
      Eigen::Vector3d pose;
      pose[0] = std::atan2(local.x(), local.z()) - std::atan2(form.aside, height);
      pose[2] = knee * std::acos(cosine);
      pose[1] = form.joint1_sign * (std::atan2(forward, -height) - pose[2] / 2);
      for (int j = 0; j < kJointsPerFinger; ++j) {
        pose[j] = equivalent_angle(pose[j], near[j], state.lower[j], state.upper[j]);
      }
      const Eigen::Vector3d inside = pose.cwiseMax(state.lower).cwiseMin(state.upper);
      const double excess = (pose - inside).cwiseAbs().maxCoeff();
      const double distance = (pose - near).norm();
      const bool better =
          excess < 1e-9 && best_excess < 1e-9 ? distance < best_distance : excess < best_excess;
      if (better) {
        best = inside;
        best_excess = excess;
        best_distance = distance;
      }
    }
  }
  if (reach == Reach::kYes && best_excess > 1e-9) reach = Reach::kOutsideLimits;
  return {best, reach};
}

}  // namespace trifinger
