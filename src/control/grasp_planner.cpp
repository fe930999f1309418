// SPDX-License-Identifier: BSD-3-Clause
#include "trifinger/control/grasp_planner.hpp"

#include <mujoco/mujoco.h>

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <utility>

#include "base/moved.hpp"
#include "trifinger/base/error.hpp"
#include "trifinger/control/force_optimizer.hpp"
#include "trifinger/control/impedance.hpp"
#include "trifinger/model/kinematics.hpp"
#include "trifinger/model/robot_model.hpp"

namespace trifinger::control {
namespace {

using detail::require_not_negative;
using detail::require_positive;

// Forces that differ by less are the same [N].
constexpr double kSameForce = 0.01;

void check(const GraspPlannerConfig& config) {
  require_positive("friction", config.friction);
  require_not_negative("min_normal_force", config.min_normal_force);
  require_not_negative("clearance", config.clearance);
  require_not_negative("limit_margin", config.limit_margin);
  require_positive("largest_torque", config.largest_torque);
  if (config.limits) validate(*config.limits);
}

// A side face of a box, in its frame.
struct Face {
  Eigen::Vector3d outward;
  Eigen::Vector3d along;
  Eigen::Vector3d up;
  double distance;     // Distance from the centre.
  double half_length;  // Half of its edges along `along` and `up`.
  double half_height;
};

std::array<Face, 4> side_faces(const Eigen::Quaterniond& orientation, const Triple& size) {
  const Eigen::Matrix3d rotation = orientation.toRotationMatrix();
  Eigen::Index upright = 0;
  rotation.row(2).cwiseAbs().maxCoeff(&upright);
  const Eigen::Vector3d up =
      (rotation(2, upright) > 0.0 ? 1.0 : -1.0) * Eigen::Vector3d::Unit(upright);
  std::array<Face, 4> faces;
  for (std::size_t i = 0; i < faces.size(); ++i) {
    const auto half = [&](Eigen::Index k) { return size[static_cast<std::size_t>(k % 3)] / 2; };
    const auto axis = (upright + 1 + static_cast<Eigen::Index>(i / 2)) % 3;
    const Eigen::Vector3d outward = (i % 2 == 0 ? 1.0 : -1.0) * Eigen::Vector3d::Unit(axis);
    const double length = half(upright + 2 - static_cast<Eigen::Index>(i / 2));
    faces[i] = {outward, up.cross(outward), up, half(axis), length, half(upright)};
  }
  return faces;
}

// One finger with its tip at one place of a face.
struct Candidate {
  std::size_t face;
  Touch touch;
  // Per point of the trajectory: the finger's pose, the Jacobian of its tip, and the torques that
  // the finger needs in addition to those for the contact forces.
  std::vector<Eigen::Vector3d> poses;
  std::vector<Eigen::Matrix3d> jacobians;
  std::vector<Eigen::Vector3d> torques;
};

using Candidates = std::array<const Candidate*, kContacts>;

struct Choice {
  double torque_share;
  Candidates candidates;
  std::ptrdiff_t repeats{0};  // Most tips that touch where they did in a grasp that has failed.
};

// Returns how many tips touch where they do in `tried`.
std::ptrdiff_t repeats(const Candidates& three, const Touches& tried) {
  constexpr double kSamePlace = 1e-3;  // [m]
  std::ptrdiff_t count = 0;
  for (std::size_t i = 0; i < three.size(); ++i)
    if ((three[i]->touch.point - tried[i].point).norm() < kSamePlace) ++count;
  return count;
}

}  // namespace

Approach approach_to(const Touch& touch, const Pose& object, double tip_radius) noexcept {
  const Eigen::Vector3d outward = object.orientation * -touch.normal;
  const Eigen::Vector3d point = object.position + object.orientation * touch.point;
  Approach approach;
  approach.beside = point + (tip_radius + kStandoff) * outward;
  approach.above = approach.beside;
  approach.above.z() = kApproachHeight;
  return approach;
}

struct GraspPlanner::State {
  State(const RobotDescription& description, const std::string& name, GraspPlannerConfig wanted)
      : config(std::move(wanted)),
        fingers(figures(description)),
        limits(config.limits.value_or(safety_limits(description))),
        robot(description),
        kinematics(description),
        address(robot.object(name)),
        object(*std::ranges::find(description.objects, name, &ObjectDescription::name)),
        body(rigid_body(object)),
        optimizer({.friction_sides = config.friction_sides}),
        // The model is copied because the copy gets margins.
        model(robot.copy()),
        data(robot.make_data()) {
    check(config);
    if (robot.num_fingers() != kContacts)
      throw InvalidArgument("a grasp needs a robot with three fingers");
    if (object.shape != ObjectShape::kBox)
      throw InvalidArgument("'" + name + "' cannot be grasped: it is not a box");
    for (int geom = 0; geom < model->ngeom; ++geom) {
      finger_of_geom.push_back(finger_of_body(model->geom_bodyid[geom]));
      // Geoms that are nearer than the clearance count as contacts.
      if (finger_of_geom.back() >= 0) model->geom_margin[geom] = config.clearance;
    }
  }

  // Returns -1 for a body that does not belong to a finger.
  [[nodiscard]] int finger_of_body(int id) const {
    for (; id != 0; id = model->body_parentid[id]) {
      if (model->body_jntnum[id] == 0) continue;
      const int joint = model->body_jntadr[id];
      return joint < robot.num_joints() ? joint / kJointsPerFinger : -1;
    }
    return -1;
  }

  void place_object(const Pose& pose) const {
    double* const values = data->qpos + address.position;
    std::copy_n(pose.position.data(), 3, values);
    const Eigen::Quaterniond& q = pose.orientation;
    const std::array<double, 4> quaternion{q.w(), q.x(), q.y(), q.z()};
    std::ranges::copy(quaternion, values + 3);
  }

  void place_finger(int finger, const Eigen::Vector3d& pose) const {
    std::copy_n(pose.data(), kJointsPerFinger,
                data->qpos + static_cast<std::ptrdiff_t>(kJointsPerFinger * finger));
  }

  [[nodiscard]] bool is_allowed(int tip, int other) const {
    const int finger = finger_of_geom[static_cast<std::size_t>(tip)];
    return finger >= 0 && robot.tip_geoms()[static_cast<std::size_t>(finger)] == tip &&
           model->geom_bodyid[other] == address.body;
  }

  // Returns true if fingers are too near to something that they should not touch. A single finger
  // is tested against itself and against everything that is not a finger; `kAllFingers` are tested
  // against everything.
  static constexpr int kAllFingers = -1;
  [[nodiscard]] bool collides(int finger) {
    mj_kinematics(model.get(), data.get());
    mj_collision(model.get(), data.get());
    for (int i = 0; i < data->ncon; ++i) {
      const auto& geoms = data->contact[i].geom;
      const int first = finger_of_geom[static_cast<std::size_t>(geoms[0])];
      const int second = finger_of_geom[static_cast<std::size_t>(geoms[1])];
      const bool counts = finger == kAllFingers ? first >= 0 || second >= 0
                                                : (first == finger || second == finger) &&
                                                      std::min(first, second) < 0;
      const bool is_own = finger >= 0 && first == finger && second == finger;
      if ((counts || is_own) && !is_allowed(geoms[0], geoms[1]) && !is_allowed(geoms[1], geoms[0]))
        return true;
    }
    return false;
  }

  // Returns the pose in which the finger's tip is at a point. Returns nothing if the pose is too
  // close to the limits or collides.
  [[nodiscard]] std::optional<Eigen::Vector3d> reach(int finger, const Eigen::Vector3d& tip,
                                                     const Eigen::Vector3d& near) {
    const FingerPose pose = kinematics.inverse_kinematics(finger, tip, near);
    if (!pose) return std::nullopt;
    const Eigen::Index first = static_cast<Eigen::Index>(kJointsPerFinger) * finger;
    const Eigen::Array3d lowest = Eigen::Array3d::Map(limits.soft_lower.data() + first);
    const Eigen::Array3d highest = Eigen::Array3d::Map(limits.soft_upper.data() + first);
    const Eigen::Array3d angles = pose.position.array();
    if ((angles < lowest + config.limit_margin || angles > highest - config.limit_margin).any())
      return std::nullopt;
    place_finger(finger, pose.position);
    if (collides(finger)) return std::nullopt;
    return pose.position;
  }

  // Tests a finger on its approach and on the whole trajectory. Returns nothing if it cannot do
  // them.
  [[nodiscard]] std::optional<Candidate> try_out(int finger, std::size_t face, const Touch& touch,
                                                 std::span<const Motion> trajectory) {
    const Eigen::Vector3d tip = touch.point - fingers.tip_radius * touch.normal;
    Eigen::Vector3d near = Eigen::Vector3d::Map(fingers.initial_position.data());
    place_object(trajectory.front().pose);
    // Most candidates fail at the end of the trajectory; to find out there costs least.
    for (const Motion& motion : {trajectory.back(), trajectory[trajectory.size() / 2]}) {
      if (!kinematics.inverse_kinematics(finger, point_of_body(motion, tip).position, near))
        return std::nullopt;
    }
    const Approach approach = approach_to(touch, trajectory.front().pose, fingers.tip_radius);
    for (const Eigen::Vector3d& point : {approach.above, approach.beside}) {
      const auto pose = reach(finger, point, near);
      if (!pose) return std::nullopt;
      near = *pose;
    }
    Candidate candidate{face, touch, {}, {}, {}};
    const Eigen::Index first = static_cast<Eigen::Index>(kJointsPerFinger) * finger;
    const auto damping = Eigen::Vector3d::Map(limits.safety_kd.data() + first);
    JointValues joints = JointValues::Zero(kinematics.num_joints());
    for (const Motion& motion : trajectory) {
      place_object(motion.pose);
      const PointMotion point = point_of_body(motion, tip);
      const auto pose = reach(finger, point.position, near);
      if (!pose) return std::nullopt;
      near = *pose;
      joints.segment<kJointsPerFinger>(first) = near;
      kinematics.update(joints);
      const Eigen::Matrix3d jacobian =
          kinematics.tip_jacobian(finger).middleCols<kJointsPerFinger>(first);
      const Eigen::Vector3d velocity = jacobian.partialPivLu().solve(point.velocity);
      candidate.poses.push_back(near);
      candidate.jacobians.push_back(jacobian);
      candidate.torques.emplace_back(kinematics.gravity_torques().segment<kJointsPerFinger>(first) +
                                     damping.cwiseProduct(velocity));
    }
    return candidate;
  }

  // Returns the largest share of its maximum torque that any motor needs with these three. Returns
  // nothing if they cannot hold the weight.
  [[nodiscard]] std::optional<double> torque_share(const Candidates& three,
                                                   std::span<const Motion> trajectory) {
    Grasp grasp;
    for (std::size_t i = 0; i < grasp.size(); ++i) {
      grasp[i] = {.position = three[i]->touch.point,
                  .normal = three[i]->touch.normal,
                  .friction = config.friction,
                  .min_normal_force = config.min_normal_force};
    }
    // The weight is largest where the trajectory accelerates up most.
    double heaviest = 0.0;
    for (const Motion& motion : trajectory)
      heaviest = std::max(heaviest, (motion.acceleration.linear - gravity()).z());
    const Eigen::Vector3d weight(0.0, 0.0, body.mass * heaviest);
    // The same forces hold the object as long as it is tilted the same way.
    Eigen::Vector3d carried = Eigen::Vector3d::Zero();
    ForceDistribution held;
    double largest = 0.0;
    for (std::size_t point = 0; point < trajectory.size(); ++point) {
      const Motion& motion = trajectory[point];
      const Eigen::Vector3d force_in_object = motion.pose.orientation.conjugate() * weight;
      if (point == 0 || (force_in_object - carried).norm() > kSameForce) {
        carried = force_in_object;
        held = optimizer.solve(grasp, Eigen::Vector3d::Zero(),
                               {.force = carried, .moment = Eigen::Vector3d::Zero()});
        if (!held) return std::nullopt;
      }
      for (std::size_t i = 0; i < three.size(); ++i) {
        const Eigen::Vector3d force =
            motion.pose.orientation *
            Eigen::Vector3d(held.forces.segment<3>(3 * static_cast<Eigen::Index>(i)));
        const Eigen::Vector3d torque =
            three[i]->jacobians[point].transpose() * force + three[i]->torques[point];
        const auto most = Eigen::Vector3d::Map(limits.max_torque.data() + kJointsPerFinger * i);
        largest = std::max(largest, torque.cwiseQuotient(most).cwiseAbs().maxCoeff());
      }
    }
    return largest;
  }

  // Returns true if no two tips touch one face, or two do where that is allowed.
  [[nodiscard]] bool have_faces(const Candidates& three) const {
    int shared = 0;
    for (std::size_t i = 0; i < three.size(); ++i) {
      const Candidate& one = *three[i];
      const Candidate& other = *three[(i + 1) % three.size()];
      if (one.face != other.face) continue;
      ++shared;
      if ((one.touch.point - other.touch.point).norm() < 2.0 * fingers.tip_radius) return false;
    }
    return shared == 0 || (shared == 1 && config.shared_faces);
  }

  // Returns true if the fingers do not collide with each other.
  [[nodiscard]] bool is_free(const Candidates& three, std::span<const Motion> trajectory) {
    for (std::size_t point = 0; point < trajectory.size(); ++point) {
      place_object(trajectory[point].pose);
      for (std::size_t i = 0; i < three.size(); ++i)
        place_finger(static_cast<int>(i), three[i]->poses[point]);
      if (collides(kAllFingers)) return false;
    }
    return true;
  }

  GraspPlannerConfig config;
  const VariantFigures& fingers;
  SafetyLimits limits;
  RobotModel robot;
  Kinematics kinematics;
  ObjectAddress address;
  ObjectDescription object;
  RigidBody body;
  ForceOptimizer optimizer;
  SceneModel::Compiled model;
  SceneModel::Data data;
  std::vector<int> finger_of_geom;
};

GraspPlanner::GraspPlanner(const RobotDescription& description, const std::string& object,
                           GraspPlannerConfig config)
    : state_(std::make_unique<State>(description, object, std::move(config))) {}
GraspPlanner::GraspPlanner(GraspPlanner&&) noexcept = default;
GraspPlanner& GraspPlanner::operator=(GraspPlanner&&) noexcept = default;
GraspPlanner::~GraspPlanner() = default;

std::optional<PlannedGrasp> GraspPlanner::plan(std::span<const Motion> trajectory) {
  return plan(trajectory, {});
}

std::optional<PlannedGrasp> GraspPlanner::plan(std::span<const Motion> trajectory,
                                               std::span<const Touches> tried) {
  State& s = *checked(state_);
  if (trajectory.empty()) return std::nullopt;
  const auto faces = side_faces(trajectory.front().pose.orientation, s.object.size);
  std::vector<double> offsets;
  for (const double offset : s.config.offsets) {
    offsets.push_back(offset);
    if (offset != 0.0) offsets.push_back(-offset);
  }

  // All tips are at one height: at different heights the object would tip over.
  std::vector<std::array<std::vector<Candidate>, kContacts>> levels(s.config.heights.size());
  std::vector<Choice> choices;
  for (std::size_t level = 0; level < levels.size(); ++level) {
    auto& candidates = levels[level];
    for (std::size_t finger = 0; finger < candidates.size(); ++finger) {
      for (std::size_t face = 0; face < faces.size(); ++face) {
        for (const double offset : offsets) {
          const Face& at = faces[face];
          if (std::abs(offset) > at.half_length ||
              std::abs(s.config.heights[level]) > at.half_height)
            continue;
          const Touch touch{
              at.distance * at.outward + offset * at.along + s.config.heights[level] * at.up,
              -at.outward};
          if (auto candidate = s.try_out(static_cast<int>(finger), face, touch, trajectory))
            candidates[finger].push_back(std::move(*candidate));
        }
      }
    }
    for (const Candidate& a : candidates[0]) {
      for (const Candidate& b : candidates[1]) {
        for (const Candidate& c : candidates[2]) {
          const Candidates three{&a, &b, &c};
          if (!s.have_faces(three)) continue;
          Choice choice{.torque_share = 0.0, .candidates = three};
          for (const Touches& one : tried)
            choice.repeats = std::max(choice.repeats, repeats(three, one));
          if (choice.repeats == kContacts) continue;
          const auto share = s.torque_share(three, trajectory);
          if (!share || *share > s.config.largest_torque) continue;
          choice.torque_share = *share;
          choices.push_back(choice);
        }
      }
    }
  }
  std::ranges::stable_sort(choices, {}, [](const Choice& choice) {
    return std::pair(choice.repeats, choice.torque_share);
  });
  for (const Choice& choice : choices) {
    const Candidates& three = choice.candidates;
    if (s.is_free(three, trajectory)) {
      return PlannedGrasp{{three[0]->touch, three[1]->touch, three[2]->touch}, choice.torque_share};
    }
  }
  return std::nullopt;
}

}  // namespace trifinger::control
