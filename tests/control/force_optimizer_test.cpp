// SPDX-License-Identifier: BSD-3-Clause
#include "trifinger/control/force_optimizer.hpp"

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <cmath>
#include <limits>
#include <numbers>
#include <optional>
#include <vector>

#include "random_grasps.hpp"
#include "support/allocation_counter.hpp"
#include "support/sanitizers.hpp"
#include "trifinger/base/error.hpp"

namespace trifinger::control {
namespace {

using test::Random;

constexpr double kTolerance = 1e-6;  // [N]

struct Instance {
  ForceOptimizerConfig config;
  Eigen::Vector3d centre;
  Grasp grasp;
  Wrench wrench;
  std::optional<TorqueLimits> torques;
};

ForceDistribution solve(ForceOptimizer& optimizer, const Instance& instance) {
  return instance.torques
             ? optimizer.solve(instance.grasp, instance.centre, instance.wrench, *instance.torques)
             : optimizer.solve(instance.grasp, instance.centre, instance.wrench);
}

Instance random_instance(Random& random) {
  Instance instance;
  instance.config.friction_sides =
      random.integer(FrictionPyramid::kMinSides, FrictionPyramid::kMaxSides);
  if (random.one_in(2)) {
    instance.config.normal_weight = std::pow(10.0, random.between(-1, 1));
    instance.config.tangential_weight = std::pow(10.0, random.between(-1, 1));
  }
  instance.centre = random.numbers<3>(0.2);
  instance.grasp = random.grasp(instance.centre);
  instance.wrench = random.wrench();
  if (random.one_in(2)) instance.torques = random.torques();
  return instance;
}

// The condition `normal.dot(forces) + offset >= 0`.
struct Condition {
  Eigen::VectorXd normal;
  double offset;

  [[nodiscard]] double left(const ContactForces& forces) const {
    return normal.dot(forces) + offset;
  }
};

std::vector<Condition> conditions(const Instance& instance, bool with_torques) {
  const FrictionPyramid pyramid(instance.config.friction_sides);
  std::vector<Condition> conditions;
  for (int i = 0; i < kContacts; ++i) {
    const Contact& contact = instance.grasp[static_cast<std::size_t>(i)];
    const auto add = [&](const Eigen::Vector3d& normal, double offset) {
      Eigen::VectorXd row = Eigen::VectorXd::Zero(9);
      row.segment<3>(3 * i) = normal;
      conditions.push_back({row, offset});
    };
    const Eigen::Vector3d inward = contact.normal.normalized();
    add(inward, -contact.min_normal_force);
    add(-inward, contact.max_normal_force);
    for (int side = 0; side < pyramid.sides(); ++side)
      add(contact_frame(contact.normal) * pyramid.side(side, contact.friction), 0.0);
  }
  if (with_torques && instance.torques) {
    const TorqueLimits& torques = *instance.torques;
    for (int joint = 0; joint < kMaxJoints; ++joint) {
      const Eigen::VectorXd column = torques.jacobians.col(joint);
      conditions.push_back({column, torques.limits[joint] + torques.bias[joint]});
      conditions.push_back({-column, torques.limits[joint] - torques.bias[joint]});
    }
  }
  return conditions;
}

double smallest_left(const std::vector<Condition>& conditions, const ContactForces& forces) {
  double smallest = std::numeric_limits<double>::infinity();
  for (const Condition& condition : conditions)
    smallest = std::min(smallest, condition.left(forces));
  return smallest;
}

double distance(const Wrench& a, const Wrench& b) {
  return std::hypot((a.force - b.force).norm(), (a.moment - b.moment).norm());
}

// The cost W of the exact problem, in the frames of the grasp.
Eigen::MatrixXd weights(const Instance& instance) {
  Eigen::MatrixXd weights = Eigen::MatrixXd::Zero(9, 9);
  const ForceOptimizerConfig& config = instance.config;
  for (int i = 0; i < kContacts; ++i) {
    const Eigen::Matrix3d frame = contact_frame(instance.grasp[static_cast<std::size_t>(i)].normal);
    const Eigen::Vector3d diagonal(config.tangential_weight, config.tangential_weight,
                                   config.normal_weight);
    weights.block<3, 3>(3 * i, 3 * i) = frame * diagonal.asDiagonal() * frame.transpose();
  }
  return weights;
}

// The grasp map and the wrench. Moments are divided by the mean distance of the contacts.
struct Scaled {
  Eigen::MatrixXd map;
  Eigen::VectorXd wrench;
};

Scaled scaled(const Instance& instance) {
  double squares = 0;
  for (const Contact& contact : instance.grasp)
    squares += (contact.position - instance.centre).squaredNorm();
  const double length = std::sqrt(squares / kContacts);
  Scaled result{grasp_map(instance.grasp, instance.centre), Eigen::VectorXd(6)};
  result.map.bottomRows(3) /= length;
  result.wrench << instance.wrench.force, instance.wrench.moment / length;
  return result;
}

// Returns the smallest |target - columns x| with x >= 0, by the method of Lawson and Hanson.
double non_negative_residual(const Eigen::MatrixXd& columns, const Eigen::VectorXd& target) {
  const Eigen::Index count = columns.cols();
  Eigen::VectorXd x = Eigen::VectorXd::Zero(count);
  std::vector<bool> is_free(static_cast<std::size_t>(count), false);
  for (int round = 0; round < 200; ++round) {
    const Eigen::VectorXd residual = target - columns * x;
    Eigen::Index best = -1;
    double best_slope = 1e-12 * (1 + target.norm());
    for (Eigen::Index i = 0; i < count; ++i) {
      const double slope = columns.col(i).dot(residual);
      if (!is_free[static_cast<std::size_t>(i)] && slope > best_slope) {
        best = i;
        best_slope = slope;
      }
    }
    if (best < 0) break;
    is_free[static_cast<std::size_t>(best)] = true;
    for (;;) {
      std::vector<Eigen::Index> free;
      for (Eigen::Index i = 0; i < count; ++i) {
        if (is_free[static_cast<std::size_t>(i)]) free.push_back(i);
      }
      const Eigen::VectorXd part =
          columns(Eigen::all, free).completeOrthogonalDecomposition().solve(target);
      double step = 1;
      for (std::size_t k = 0; k < free.size(); ++k) {
        const auto i = static_cast<Eigen::Index>(k);
        if (part[i] <= 0) step = std::min(step, x[free[k]] / (x[free[k]] - part[i]));
      }
      for (std::size_t k = 0; k < free.size(); ++k) {
        const Eigen::Index i = free[k];
        x[i] += step * (part[static_cast<Eigen::Index>(k)] - x[i]);
        if (step < 1 && x[i] <= 1e-14) {
          x[i] = 0;
          is_free[static_cast<std::size_t>(i)] = false;
        }
      }
      if (step >= 1) break;
    }
  }
  return (target - columns * x).norm();
}

// Returns how far `gradient` is from a sum of multiples of `equalities` (any sign) and of the
// normals of active conditions (not negative): zero exactly at the optimum.
double stationarity(const Eigen::VectorXd& gradient, const Eigen::MatrixXd& equalities,
                    const std::vector<Condition>& conditions, const ContactForces& forces) {
  std::vector<Eigen::VectorXd> active;
  for (const Condition& condition : conditions) {
    const double length = condition.normal.norm();
    if (length > 0 && condition.left(forces) <= kTolerance * length)
      active.emplace_back(condition.normal / length);
  }
  Eigen::MatrixXd columns(9, static_cast<Eigen::Index>(active.size()) + 2 * equalities.rows());
  for (std::size_t i = 0; i < active.size(); ++i)
    columns.col(static_cast<Eigen::Index>(i)) = active[i];
  columns.rightCols(2 * equalities.rows()) << equalities.transpose(), -equalities.transpose();
  return non_negative_residual(columns, gradient);
}

TEST(ForceOptimizer, SatisfiesTheConditionsOfKarushKuhnAndTucker) {
  Random random(1);
  int exact = 0;
  int closest = 0;
  int without_torques = 0;
  for (int i = 0; i < (trifinger::test::kHasSanitizer ? 5'000 : 100'000); ++i) {
    const Instance instance = random_instance(random);
    ForceOptimizer optimizer(instance.config);
    const ForceDistribution found = solve(optimizer, instance);
    const bool with_torques = found.status != ForceStatus::kTorqueLimitsExceeded;
    const auto bounds = conditions(instance, with_torques);
    const Scaled problem = scaled(instance);
    ASSERT_GE(smallest_left(bounds, found.forces), -2 * kTolerance) << i;
    ASSERT_LT(distance(found.wrench, wrench_of(instance.grasp, instance.centre, found.forces)),
              1e-12);
    if (found) {
      ++exact;
      ASSERT_LT((problem.map * found.forces - problem.wrench).norm(), 3 * kTolerance) << i;
      const Eigen::VectorXd gradient = weights(instance) * found.forces;
      ASSERT_LT(stationarity(gradient, problem.map, bounds, found.forces),
                1e-6 * (1 + gradient.norm()))
          << i;
    } else {
      ++(with_torques ? closest : without_torques);
      const double least_weight =
          std::min(instance.config.normal_weight, instance.config.tangential_weight);
      const Eigen::VectorXd gradient =
          problem.map.transpose() * (problem.map * found.forces - problem.wrench) +
          1e-6 * weights(instance) / least_weight * found.forces;
      ASSERT_LT(stationarity(gradient, Eigen::MatrixXd(0, 9), bounds, found.forces),
                1e-6 * (1 + gradient.norm()))
          << i;
    }
  }
  // All kinds of instances must occur.
  const int num_instances = exact + closest + without_torques;
  EXPECT_GT(exact, num_instances / 20);
  EXPECT_GT(closest, num_instances / 20);
  EXPECT_GT(without_torques, num_instances / 200);
}

// Returns forces in the middle of what each contact allows.
ContactForces allowed_forces(const Instance& instance, Random& random) {
  const FrictionPyramid pyramid(instance.config.friction_sides);
  ContactForces forces;
  for (int i = 0; i < kContacts; ++i) {
    const Contact& contact = instance.grasp[static_cast<std::size_t>(i)];
    const double normal = random.between(contact.min_normal_force, contact.max_normal_force);
    // Half of the friction is inside every pyramid.
    const Eigen::Vector2d direction = random.numbers<2>(1.0).normalized();
    const Eigen::Vector2d tangential =
        random.between(0, 0.49) * contact.friction * normal * direction;
    forces.segment<3>(3 * i) =
        contact_frame(contact.normal) * Eigen::Vector3d(tangential.x(), tangential.y(), normal);
  }
  return forces;
}

TEST(ForceOptimizer, MakesEveryWrenchThatAllowedForcesMakeAndWithNoGreaterCost) {
  Random random(2);
  for (int i = 0; i < 20'000; ++i) {
    Instance instance = random_instance(random);
    const ContactForces allowed = allowed_forces(instance, random);
    instance.wrench = wrench_of(instance.grasp, instance.centre, allowed);
    if (instance.torques) {
      instance.torques->limits =
          (instance.torques->jacobians.transpose() * allowed + instance.torques->bias)
              .cwiseAbs()
              .array() +
          1e-3;
    }
    ForceOptimizer optimizer(instance.config);
    const ForceDistribution found = solve(optimizer, instance);
    ASSERT_EQ(found.status, ForceStatus::kExact) << i;
    ASSERT_LT(distance(found.wrench, instance.wrench), 3 * kTolerance);
    const Eigen::MatrixXd cost = weights(instance);
    const double least = found.forces.dot(cost * found.forces);
    ASSERT_LE(least, allowed.dot(cost * allowed) * (1 + 1e-9) + 1e-6 * cost.norm()) << i;
  }
}

TEST(ForceOptimizer, ComesAsCloseToTheWrenchAsAllowedForcesCan) {
  Random random(3);
  int closest = 0;
  for (int i = 0; i < 2000; ++i) {
    Instance instance = random_instance(random);
    instance.torques.reset();
    ForceOptimizer optimizer(instance.config);
    const ForceDistribution found = solve(optimizer, instance);
    if (found) continue;
    ASSERT_EQ(found.status, ForceStatus::kClosestWrench);
    ++closest;
    const Scaled problem = scaled(instance);
    const double error = (problem.map * found.forces - problem.wrench).norm();
    for (int j = 0; j < 50; ++j) {
      const ContactForces other = allowed_forces(instance, random);
      // 1e-3 allows for the small weight of the forces' own cost.
      ASSERT_LE(error, (problem.map * other - problem.wrench).norm() + 1e-3);
    }
  }
  EXPECT_GT(closest, 500);
}

// Three tips at a cube's side faces.
Grasp around_cube() {
  Grasp grasp;
  grasp[0] = {.position = {0.0325, 0, 0}, .normal = {-1, 0, 0}};
  grasp[1] = {.position = {-0.0325, 0, 0}, .normal = {1, 0, 0}};
  grasp[2] = {.position = {0, 0.0325, 0}, .normal = {0, -1, 0}};
  return grasp;
}

const Wrench kWeight{.force = {0, 0, 0.094 * 9.81}, .moment = {0, 0, 0}};

TEST(ForceOptimizer, HoldsACubeWithTheLeastForce) {
  ForceOptimizer optimizer;
  const ForceDistribution found = optimizer.solve(around_cube(), {0, 0, 0}, kWeight);
  ASSERT_EQ(found.status, ForceStatus::kExact);
  // The third tip has no opposite tip to push against, and lifting with it would tilt the cube.
  EXPECT_LT(found.forces.segment<3>(6).norm(), 1e-9);
  const double half_weight = kWeight.force.z() / 2;
  EXPECT_NEAR(found.forces[2], half_weight, 1e-9);
  EXPECT_NEAR(found.forces[5], half_weight, 1e-9);
  // The force is at the edge of the pyramid: |tangential| = friction / sqrt(2) * normal.
  EXPECT_NEAR(-found.forces[0], half_weight / (0.5 / std::numbers::sqrt2), 1e-9);
}

TEST(ForceOptimizer, PressesLessWithMoreSides) {
  ForceOptimizer four({.friction_sides = 4});
  ForceOptimizer eight({.friction_sides = 8});
  EXPECT_LT(eight.solve(around_cube(), {0, 0, 0}, kWeight).forces.norm(),
            four.solve(around_cube(), {0, 0, 0}, kWeight).forces.norm());
}

TEST(ForceOptimizer, DoesNotJumpWhereAWrenchGoesOutOfReach) {
  Random random(7);
  ForceOptimizer optimizer({.normal_weight = 10});
  for (int i = 0; i < 200; ++i) {
    // The wrench goes from the weight of the cube to one that no forces can make.
    const Wrench far{.force = 100 * random.direction(), .moment = random.direction()};
    const auto at = [&](double share) {
      return optimizer.solve(around_cube(), {0, 0, 0},
                             {.force = kWeight.force + share * (far.force - kWeight.force),
                              .moment = share * far.moment});
    };
    double inside = 0;
    double outside = 1;
    ASSERT_FALSE(at(outside));
    while (outside - inside > 1e-9) {
      const double middle = (inside + outside) / 2;
      (at(middle) ? inside : outside) = middle;
    }
    EXPECT_LT((at(inside).forces - at(outside).forces).norm(), 0.01) << i;
  }
}

TEST(ForceOptimizer, GivesNothingToATipThatDoesNotTouch) {
  Grasp grasp = around_cube();
  grasp[1].max_normal_force = 0;
  ForceOptimizer optimizer;
  const ForceDistribution found = optimizer.solve(grasp, {0, 0, 0}, kWeight);
  EXPECT_EQ(found.status, ForceStatus::kClosestWrench);
  EXPECT_LT(found.forces.segment<3>(3).norm(), kTolerance);
}

TEST(ForceOptimizer, StaysWithinTheTorquesOfTheJoints) {
  TorqueLimits torques{.jacobians = decltype(TorqueLimits::jacobians)::Identity() * 0.2,
                       .bias = decltype(TorqueLimits::bias)::Constant(0.05),
                       .limits = decltype(TorqueLimits::limits)::Constant(0.36)};
  ForceOptimizer optimizer;
  ASSERT_EQ(optimizer.solve(around_cube(), {0, 0, 0}, kWeight, torques).status,
            ForceStatus::kExact);
  torques.limits.setConstant(0.2);
  const ForceDistribution weak = optimizer.solve(around_cube(), {0, 0, 0}, kWeight, torques);
  EXPECT_EQ(weak.status, ForceStatus::kClosestWrench);
  const Eigen::VectorXd torque = torques.jacobians.transpose() * weak.forces + torques.bias;
  EXPECT_LT(torque.cwiseAbs().maxCoeff(), 0.2 + kTolerance);
  EXPECT_GT(weak.wrench.force.z(), 0.1);  // It lifts as much as it can.
}

TEST(ForceOptimizer, KeepsHoldingWhenTheJointsAreTooWeakForTheLeastForce) {
  Grasp grasp = around_cube();
  for (Contact& contact : grasp) contact.min_normal_force = 1;
  const TorqueLimits torques{.jacobians = decltype(TorqueLimits::jacobians)::Identity(),
                             .bias = decltype(TorqueLimits::bias)::Zero(),
                             .limits = decltype(TorqueLimits::limits)::Constant(0.1)};
  ForceOptimizer optimizer;
  const ForceDistribution found = optimizer.solve(grasp, {0, 0, 0}, kWeight, torques);
  EXPECT_EQ(found.status, ForceStatus::kTorqueLimitsExceeded);
  EXPECT_GE(-found.forces[0], 1 - kTolerance);
  EXPECT_GE(found.forces[3], 1 - kTolerance);
}

TEST(ForceOptimizer, AnswersDegenerateGraspsWithTheClosestWrench) {
  ForceOptimizer optimizer;
  Grasp one_point;
  for (Contact& contact : one_point) contact = {.position = {0, 0, 0}, .normal = {0, 0, 1}};
  const ForceDistribution lifted = optimizer.solve(one_point, {0, 0, 0}, kWeight);
  EXPECT_FALSE(lifted);
  EXPECT_NEAR(lifted.wrench.force.z(), kWeight.force.z(), 1e-4);  // A push is enough for that.

  Grasp line = around_cube();
  line[2] = line[1];
  line[2].position *= 0.5;
  const ForceDistribution held =
      optimizer.solve(line, {0, 0, 0}, {.force = kWeight.force, .moment = {0.01, 0, 0}});
  EXPECT_EQ(held.status, ForceStatus::kClosestWrench);
  EXPECT_NEAR(held.wrench.force.z(), kWeight.force.z(), 1e-4);
  EXPECT_NEAR(held.wrench.moment.x(), 0, 1e-9);  // A force on a line has no moment about it.
}

TEST(ForceOptimizer, AnswersNonsenseWithNoForces) {
  const double nan = std::nan("");
  const auto expect_invalid = [](const ForceDistribution& found) {
    EXPECT_EQ(found.status, ForceStatus::kInvalid);
    EXPECT_TRUE(found.forces.isZero(0.0));
    EXPECT_TRUE(found.wrench.force.isZero(0.0));
  };
  ForceOptimizer optimizer;
  const auto expect_invalid_contact = [&](auto change) {
    Grasp grasp = around_cube();
    change(grasp[1]);
    expect_invalid(optimizer.solve(grasp, {0, 0, 0}, kWeight));
  };
  expect_invalid(optimizer.solve(around_cube(), {0, nan, 0}, kWeight));
  expect_invalid(optimizer.solve(around_cube(), {0, 0, 0}, {.force = {nan, 0, 0}}));
  expect_invalid(optimizer.solve(around_cube(), {0, 0, 0}, {.moment = {0, 0, nan}}));
  expect_invalid_contact([&](Contact& contact) { contact.position.x() = nan; });
  expect_invalid_contact([&](Contact& contact) { contact.normal.x() = nan; });
  expect_invalid_contact([&](Contact& contact) { contact.normal.setZero(); });
  expect_invalid_contact([&](Contact& contact) { contact.friction = nan; });
  expect_invalid_contact([&](Contact& contact) { contact.friction = -0.1; });
  expect_invalid_contact([&](Contact& contact) { contact.min_normal_force = -0.1; });
  expect_invalid_contact([&](Contact& contact) { contact.min_normal_force = nan; });
  expect_invalid_contact([&](Contact& contact) { contact.max_normal_force = nan; });
  expect_invalid_contact([&](Contact& contact) {
    contact.max_normal_force = std::numeric_limits<double>::infinity();
  });
  expect_invalid_contact([&](Contact& contact) { contact.min_normal_force = 11; });
  const TorqueLimits torques{.jacobians = decltype(TorqueLimits::jacobians)::Identity(),
                             .bias = decltype(TorqueLimits::bias)::Zero(),
                             .limits = decltype(TorqueLimits::limits)::Constant(-1)};
  expect_invalid(optimizer.solve(around_cube(), {0, 0, 0}, kWeight, torques));
}

TEST(ForceOptimizer, AnswersNumbersOfAnySizeWithFiniteForces) {
  Random random(4);
  for (int i = 0; i < 5000; ++i) {
    Instance instance = random_instance(random);
    const auto stretch = [&] { return std::pow(10.0, random.between(-300, 300)); };
    instance.wrench.force *= stretch();
    instance.wrench.moment *= stretch();
    for (Contact& contact : instance.grasp) {
      contact.position *= stretch();
      contact.normal *= stretch();
      contact.friction *= stretch();
      contact.max_normal_force *= stretch();
      contact.min_normal_force = std::min(contact.min_normal_force, contact.max_normal_force);
    }
    if (instance.torques) {
      instance.torques->jacobians *= stretch();
      instance.torques->limits *= stretch();
    }
    ForceOptimizer optimizer(instance.config);
    EXPECT_TRUE(solve(optimizer, instance).forces.allFinite());
  }
}

TEST(ForceOptimizer, RemembersNothingOfEarlierProblems) {
  Random random(5);
  ForceOptimizer used;
  for (int i = 0; i < 500; ++i) {
    Instance instance = random_instance(random);
    instance.config = {};
    ForceOptimizer fresh;
    EXPECT_EQ(solve(used, instance).forces, solve(fresh, instance).forces);
  }
}

TEST(ForceOptimizer, RefusesASettingThatMakesNoSense) {
  const auto make = [](const ForceOptimizerConfig& config) { ForceOptimizer{config}; };
  EXPECT_THROW(make({.friction_sides = 2}), InvalidArgument);
  EXPECT_THROW(make({.friction_sides = 9}), InvalidArgument);
  EXPECT_THROW(make({.normal_weight = 0}), InvalidArgument);
  EXPECT_THROW(make({.tangential_weight = std::nan("")}), InvalidArgument);
  EXPECT_THROW(make({.normal_weight = 101}), InvalidArgument);
}

TEST(ForceOptimizer, DoesNotAllocateOnceItExists) {
  Random random(6);
  ForceOptimizer optimizer;
  std::vector<Instance> instances;
  instances.reserve(100);
  for (int i = 0; i < 100; ++i) instances.push_back(random_instance(random));
  const trifinger::test::AllocationCounter allocations;
  for (const Instance& instance : instances) (void)solve(optimizer, instance);
  EXPECT_EQ(allocations.count(), 0U);
}

}  // namespace
}  // namespace trifinger::control
