// SPDX-License-Identifier: BSD-3-Clause
#include "trifinger/control/force_optimizer.hpp"

#include <algorithm>
#include <cmath>
#include <eiquadprog/eiquadprog-rt.hpp>

#include "base/moved.hpp"
#include "trifinger/base/error.hpp"

namespace trifinger::control {
namespace {

using detail::require_positive;

constexpr int kForces = 3 * kContacts;
constexpr int kSideRows = kContacts * FrictionPyramid::kMaxSides;
constexpr int kMinRows = kSideRows;
constexpr int kMaxRows = kMinRows + kContacts;
constexpr int kTorqueRows = kMaxRows + kContacts;
constexpr int kRows = kTorqueRows + 2 * kMaxJoints;

using Hessian = Eigen::Matrix<double, kForces, kForces>;
using Bounds = Eigen::Matrix<double, kRows, kForces>;
using Offsets = Eigen::Matrix<double, kRows, 1>;

// A constraint that is violated by more than this makes a solution invalid [N].
constexpr double kTolerance = 1e-6;
// When the squared error of the wrench is minimised, the cost of the forces is added with this
// weight. The weight is small, and the cost is that of the exact problem, so that the forces do not
// jump where a wrench goes out of reach.
//
// With weights from 1 to `kMaxWeightRatio` and constraints of unit length, this weight keeps the
// inverse root of the Hessian below 1e3. The solver has a branch for constraints that depend on
// each other although the step is not zero. That branch writes outside its arrays and may not end.
// Here the solver never enters it: the step threshold is 1.5e-8, so the remaining part of the
// constraint is above 1.5e-11, and the solver compares it with at most 2.2e-16 times 2e3.
constexpr double kRegularisation = 1e-6;
constexpr double kMaxWeightRatio = 100.0;
constexpr int kMaxIterations = 200;

struct Problem {
  Eigen::Matrix<double, 6, kForces> map;  // With the moments divided by a length.
  Eigen::Matrix<double, 6, 1> wrench;
  Bounds bounds;  // bounds * forces + offsets >= 0
  Offsets offsets;
};

// Sets a row to `normal * forces + offset >= 0`, of unit length.
template <class Normal>
void set_row(Problem& problem, int row, const Normal& normal, double offset) {
  const double length = normal.norm();
  const double scale = length > 0.0 ? 1.0 / length : 1.0;
  problem.bounds.row(row) = scale * normal;
  problem.offsets[row] = scale * offset;
}

void leave_out(Problem& problem, int row) {
  problem.bounds.row(row).setZero();
  problem.offsets[row] = 1.0;
}

bool is_valid(const Contact& contact) {
  return contact.position.allFinite() && contact.normal.allFinite() &&
         !contact.normal.isZero(0.0) && std::isfinite(contact.friction) &&
         contact.friction >= 0.0 && contact.min_normal_force >= 0.0 &&
         contact.max_normal_force >= contact.min_normal_force &&
         std::isfinite(contact.max_normal_force);
}

bool is_valid(const TorqueLimits& torques) {
  return torques.jacobians.allFinite() && torques.bias.allFinite() && torques.limits.allFinite() &&
         torques.limits.minCoeff() >= 0.0;
}

}  // namespace

struct ForceOptimizer::State {
  explicit State(const ForceOptimizerConfig& config) : pyramid(config.friction_sides) {
    require_positive("normal_weight", config.normal_weight);
    require_positive("tangential_weight", config.tangential_weight);
    const double larger = std::max(config.normal_weight, config.tangential_weight);
    const double smaller = std::min(config.normal_weight, config.tangential_weight);
    if (larger > kMaxWeightRatio * smaller)
      throw InvalidArgument("normal_weight and tangential_weight differ by more than a factor 100");
    const Eigen::Vector3d weights(config.tangential_weight, config.tangential_weight,
                                  config.normal_weight);
    hessian = (weights / smaller).replicate<kContacts, 1>().asDiagonal();
    exact.setMaxIter(kMaxIterations);
    closest.setMaxIter(kMaxIterations);
  }

  // States the problem with the forces in their contact frames.
  void state_problem(const Grasp& grasp, const Eigen::Vector3d& centre, const Wrench& wrench) {
    double squared_distance = 0.0;
    for (const Contact& contact : grasp)
      squared_distance += (contact.position - centre).squaredNorm() / kContacts;
    // If all contacts lie in the centre, they make no moments, and any length will do.
    const double per_length = squared_distance > 0.0 ? 1.0 / std::sqrt(squared_distance) : 1.0;
    problem.map = grasp_map(grasp, centre);
    problem.map.bottomRows<3>() *= per_length;
    problem.wrench << wrench.force, per_length * wrench.moment;

    using Row = Eigen::Matrix<double, 1, kForces>;
    for (int i = 0; i < kContacts; ++i) {
      const Contact& contact = grasp[static_cast<std::size_t>(i)];
      frames[static_cast<std::size_t>(i)] = contact_frame(contact.normal);
      auto columns = problem.map.middleCols<3>(3 * i);
      columns = (columns * frames[static_cast<std::size_t>(i)]).eval();
      for (int side = 0; side < FrictionPyramid::kMaxSides; ++side) {
        const int row = i * FrictionPyramid::kMaxSides + side;
        if (side >= pyramid.sides()) {
          leave_out(problem, row);
          continue;
        }
        Row normal = Row::Zero();
        normal.segment<3>(3 * i) = pyramid.side(side, contact.friction);
        set_row(problem, row, normal, 0.0);
      }
      const Row along = Row::Unit(3 * i + 2);
      set_row(problem, kMinRows + i, along, -contact.min_normal_force);
      set_row(problem, kMaxRows + i, -along, contact.max_normal_force);
    }
  }

  void add_torque_limits(const TorqueLimits& torques) {
    for (int joint = 0; joint < kMaxJoints; ++joint) {
      Eigen::Matrix<double, 1, kForces> torque = torques.jacobians.col(joint).transpose();
      for (int i = 0; i < kContacts; ++i) {
        auto of_contact = torque.segment<3>(3 * i);
        of_contact = (of_contact * frames[static_cast<std::size_t>(i)]).eval();
      }
      const double limit = torques.limits[joint];
      const double bias = torques.bias[joint];
      set_row(problem, kTorqueRows + 2 * joint, -torque, limit - bias);
      set_row(problem, kTorqueRows + 2 * joint + 1, torque, limit + bias);
    }
  }

  void leave_out_torque_limits() {
    for (int row = kTorqueRows; row < kRows; ++row) leave_out(problem, row);
  }

  // The solver's answer is checked, because its thresholds depend on the numbers.
  [[nodiscard]] bool holds_bounds() const {
    return forces.allFinite() &&
           (problem.bounds * forces + problem.offsets).minCoeff() >= -kTolerance;
  }

  [[nodiscard]] bool solve_exactly() {
    const auto status =
        exact.solve_quadprog(hessian, ContactForces::Zero(), problem.map, -problem.wrench,
                             problem.bounds, problem.offsets, forces);
    return status == eiquadprog::solvers::RT_EIQUADPROG_OPTIMAL && holds_bounds() &&
           (problem.map * forces - problem.wrench).cwiseAbs().maxCoeff() <= kTolerance;
  }

  [[nodiscard]] bool solve_closely() {
    Hessian squared_error = problem.map.transpose() * problem.map;
    squared_error += kRegularisation * hessian;
    const auto status =
        closest.solve_quadprog(squared_error, -problem.map.transpose() * problem.wrench,
                               Eigen::Matrix<double, 0, kForces>(), Eigen::Matrix<double, 0, 1>(),
                               problem.bounds, problem.offsets, forces);
    return status == eiquadprog::solvers::RT_EIQUADPROG_OPTIMAL && holds_bounds();
  }

  // Sets each normal force to its minimum and all others to zero. Every grasp allows these forces.
  void press_least(const Grasp& grasp) {
    forces.setZero();
    for (int i = 0; i < kContacts; ++i)
      forces[3 * i + 2] = grasp[static_cast<std::size_t>(i)].min_normal_force;
  }

  [[nodiscard]] ForceStatus optimise(const Grasp& grasp, bool has_torque_limits) {
    if (solve_exactly()) return ForceStatus::kExact;
    if (solve_closely()) return ForceStatus::kClosestWrench;
    if (has_torque_limits) {
      leave_out_torque_limits();
      if (solve_closely()) return ForceStatus::kTorqueLimitsExceeded;
    }
    press_least(grasp);
    return has_torque_limits ? ForceStatus::kTorqueLimitsExceeded : ForceStatus::kClosestWrench;
  }

  // `torques` is null if the joints have no limits.
  [[nodiscard]] ForceDistribution solve(const Grasp& grasp, const Eigen::Vector3d& centre,
                                        const Wrench& wrench, const TorqueLimits* torques) {
    const bool valid = centre.allFinite() && wrench.force.allFinite() &&
                       wrench.moment.allFinite() &&
                       std::ranges::all_of(grasp, [](const Contact& c) { return is_valid(c); }) &&
                       (torques == nullptr || is_valid(*torques));
    if (!valid) return {ContactForces::Zero(), {}, ForceStatus::kInvalid};

    state_problem(grasp, centre, wrench);
    if (torques != nullptr) {
      add_torque_limits(*torques);
    } else {
      leave_out_torque_limits();
    }
    const ForceStatus status = optimise(grasp, torques != nullptr);
    for (int i = 0; i < kContacts; ++i) {
      auto force = forces.segment<3>(3 * i);
      force = (frames[static_cast<std::size_t>(i)] * force).eval();
    }
    return {forces, wrench_of(grasp, centre, forces), status};
  }

  FrictionPyramid pyramid;
  Hessian hessian;
  Problem problem;
  std::array<Eigen::Matrix3d, kContacts> frames;  // Contact frames.
  ContactForces forces;                           // In the contact frames, until they are returned.
  eiquadprog::solvers::RtEiquadprog<kForces, 6, kRows> exact;
  eiquadprog::solvers::RtEiquadprog<kForces, 0, kRows> closest;
};

ForceOptimizer::ForceOptimizer(const ForceOptimizerConfig& config)
    : state_(std::make_unique<State>(config)) {}
ForceOptimizer::ForceOptimizer(ForceOptimizer&&) noexcept = default;
ForceOptimizer& ForceOptimizer::operator=(ForceOptimizer&&) noexcept = default;
ForceOptimizer::~ForceOptimizer() = default;

ForceDistribution ForceOptimizer::solve(const Grasp& grasp, const Eigen::Vector3d& centre,
                                        const Wrench& wrench) noexcept {
  return checked(state_)->solve(grasp, centre, wrench, nullptr);
}

ForceDistribution ForceOptimizer::solve(const Grasp& grasp, const Eigen::Vector3d& centre,
                                        const Wrench& wrench,
                                        const TorqueLimits& torques) noexcept {
  return checked(state_)->solve(grasp, centre, wrench, &torques);
}

}  // namespace trifinger::control
