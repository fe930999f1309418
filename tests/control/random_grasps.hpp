// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Geometry>
#include <random>

#include "trifinger/control/force_optimizer.hpp"
#include "trifinger/control/motion.hpp"

namespace trifinger::control::test {

/// Half the width of the default scene's cube [m].
inline constexpr double kCubeHalfWidth = 0.0325;

/// Draws random inputs for tests of control. Equal seeds give equal sequences.
class Random {
 public:
  explicit Random(unsigned seed) : generator_(seed) {}

  double between(double low, double high) {
    return std::uniform_real_distribution(low, high)(generator_);
  }
  bool one_in(int count) { return std::uniform_int_distribution(1, count)(generator_) == 1; }
  int integer(int low, int high) { return std::uniform_int_distribution(low, high)(generator_); }

  template <int Rows, int Columns = 1>
  Eigen::Matrix<double, Rows, Columns> numbers(double largest) {
    return Eigen::Matrix<double, Rows, Columns>::NullaryExpr(
        [&](Eigen::Index) { return between(-largest, largest); });
  }

  Eigen::Vector3d direction() {
    std::normal_distribution<double> normal;
    return Eigen::Vector3d(normal(generator_), normal(generator_), normal(generator_)).normalized();
  }

  Eigen::Quaterniond orientation() {
    std::normal_distribution<double> normal;
    return Eigen::Quaterniond(normal(generator_), normal(generator_), normal(generator_),
                              normal(generator_))
        .normalized();
  }

  Pose pose() { return {numbers<3>(0.3), orientation()}; }

  Motion motion() {
    return {.pose = pose(),
            .twist = {numbers<3>(0.5), numbers<3>(3.0)},
            .acceleration = {numbers<3>(2.0), numbers<3>(10.0)}};
  }

  /// Returns tips around an object of some centimetres. One in ten does not touch.
  Grasp grasp(const Eigen::Vector3d& centre) {
    Grasp grasp;
    for (Contact& contact : grasp) {
      const Eigen::Vector3d out = direction();
      contact.position = centre + between(0.01, 0.06) * out;
      contact.normal = between(0.1, 3.0) * (0.5 * direction() - out);
      contact.friction = between(0.1, 1.5);
      contact.min_normal_force = one_in(2) ? 0.0 : between(0.0, 1.0);
      contact.max_normal_force = between(1.0, 10.0);
      if (one_in(10)) contact.min_normal_force = contact.max_normal_force = 0.0;
    }
    return grasp;
  }

  Wrench wrench() { return {numbers<3>(2.0), numbers<3>(0.04)}; }

  /// Returns limits of a lever of 25 cm and motors of a third of a newton metre.
  TorqueLimits torques() {
    TorqueLimits torques;
    torques.jacobians.setZero();
    for (int i = 0; i < kContacts; ++i)
      torques.jacobians.block<3, 3>(3 * i, 3 * i) = numbers<3, 3>(0.2);
    torques.bias = numbers<kMaxJoints>(0.15);
    torques.limits.setConstant(between(0.16, 0.4));
    return torques;
  }

 private:
  std::mt19937_64 generator_;
};

}  // namespace trifinger::control::test
