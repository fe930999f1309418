// SPDX-License-Identifier: BSD-3-Clause
#include "trifinger/control/grasp.hpp"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>
#include <numbers>

#include "random_grasps.hpp"
#include "trifinger/base/error.hpp"

namespace trifinger::control {
namespace {

using test::Random;

TEST(GraspMap, DoesTheWorkOfTheForces) {
  Random random(1);
  for (int i = 0; i < 1000; ++i) {
    const Eigen::Vector3d centre = random.numbers<3>(0.2);
    const Grasp grasp = random.grasp(centre);
    const ContactForces forces = random.numbers<9>(5.0);
    const Twist twist{random.numbers<3>(1.0), random.numbers<3>(5.0)};
    // The power at the contacts, which move with the body.
    double power = 0;
    for (int c = 0; c < kContacts; ++c) {
      const Motion body{.pose = {.position = centre}, .twist = twist};
      const Eigen::Vector3d arm = grasp[static_cast<std::size_t>(c)].position - centre;
      power += forces.segment<3>(3 * c).dot(point_of_body(body, arm).velocity);
    }
    const Eigen::Matrix<double, 6, 1> wrench = grasp_map(grasp, centre) * forces;
    EXPECT_NEAR(wrench.head<3>().dot(twist.linear) + wrench.tail<3>().dot(twist.angular), power,
                1e-12);
  }
}

TEST(TwistOf, FindsTheMotionOfABodyFromThreeOfItsPoints) {
  Random random(7);
  for (int i = 0; i < 1000; ++i) {
    const Eigen::Vector3d centre = random.numbers<3>(0.2);
    const Grasp grasp = random.grasp(centre);
    const Motion body{.pose = {.position = centre},
                      .twist = {random.numbers<3>(1.0), random.numbers<3>(5.0)}};
    ContactForces velocities;
    for (int c = 0; c < kContacts; ++c) {
      const Eigen::Vector3d arm = grasp[static_cast<std::size_t>(c)].position - centre;
      velocities.segment<3>(3 * c) = point_of_body(body, arm).velocity;
    }
    const Twist found = twist_of(grasp, centre, velocities);
    EXPECT_LT((found.linear - body.twist.linear).norm(), 1e-9);
    EXPECT_LT((found.angular - body.twist.angular).norm(), 1e-6);
    // What no motion of a body explains does not count.
    const Eigen::Vector3d along = (grasp[1].position - grasp[0].position).normalized();
    velocities.segment<3>(0) -= along;
    velocities.segment<3>(3) += along;
    const Twist stretched = twist_of(grasp, centre, velocities);
    const Eigen::Matrix<double, 6, 1> change =
        grasp_map(grasp, centre) *
        (grasp_map(grasp, centre).transpose() *
             (Eigen::Matrix<double, 6, 1>() << stretched.linear, stretched.angular).finished() -
         velocities);
    EXPECT_LT(change.norm(), 1e-9);  // the rest is perpendicular to all motions
  }
}

TEST(GraspMap, SumsForcesAndTheirMoments) {
  Random random(2);
  for (int i = 0; i < 1000; ++i) {
    const Eigen::Vector3d centre = random.numbers<3>(0.2);
    const Grasp grasp = random.grasp(centre);
    const ContactForces forces = random.numbers<9>(5.0);
    const Eigen::Matrix<double, 6, 1> wrench = grasp_map(grasp, centre) * forces;
    Eigen::Vector3d force = Eigen::Vector3d::Zero();
    Eigen::Vector3d moment = Eigen::Vector3d::Zero();
    for (int c = 0; c < kContacts; ++c) {
      const Eigen::Vector3d r = grasp[static_cast<std::size_t>(c)].position - centre;
      const Eigen::Vector3d f = forces.segment<3>(3 * c);
      force += f;
      moment += Eigen::Vector3d(r.y() * f.z() - r.z() * f.y(), r.z() * f.x() - r.x() * f.z(),
                                r.x() * f.y() - r.y() * f.x());
    }
    EXPECT_LT((wrench.head<3>() - force).norm(), 1e-14);
    EXPECT_LT((wrench.tail<3>() - moment).norm(), 1e-14);
    const Wrench sum = wrench_of(grasp, centre, forces);
    EXPECT_LT((sum.force - force).norm(), 1e-14);
    EXPECT_LT((sum.moment - moment).norm(), 1e-14);
  }
}

TEST(ContactFrame, IsARotationWhoseThirdAxisIsTheNormal) {
  Random random(3);
  for (int i = 0; i < 1000; ++i) {
    const Eigen::Vector3d direction = random.direction();
    for (const double length : {1e-200, 0.1, 1.0, 1e200}) {
      const Eigen::Matrix3d frame = contact_frame(length * direction);
      EXPECT_LT((frame.col(2) - direction).norm(), 1e-14);
      EXPECT_LT((frame.transpose() * frame - Eigen::Matrix3d::Identity()).norm(), 1e-14);
      EXPECT_NEAR(frame.determinant(), 1, 1e-14);
    }
  }
  for (const double up : {-1.0, 1.0})
    EXPECT_NEAR(contact_frame({0, 0, up}).determinant(), 1, 1e-15);
}

TEST(FrictionPyramid, LiesInsideTheConeAndTouchesItAtItsEdges) {
  Random random(4);
  for (int sides = FrictionPyramid::kMinSides; sides <= FrictionPyramid::kMaxSides; ++sides) {
    const FrictionPyramid pyramid(sides);
    double widest = 0;
    for (int i = 0; i < 20'000; ++i) {
      const double friction = random.between(0.05, 2);
      const double normal = random.between(0, 5);
      const Eigen::Vector2d tangential = random.numbers<2>(1.1 * friction * normal);
      const bool is_inside =
          pyramid.margin({tangential.x(), tangential.y(), normal}, friction) >= 0;
      if (!is_inside) {
        // The circle is the largest that fits into the polygon.
        EXPECT_GE(tangential.norm(),
                  friction * normal * std::cos(std::numbers::pi / sides) - 1e-12);
        continue;
      }
      EXPECT_LE(tangential.norm(), friction * normal + 1e-12);
      widest = std::max(widest, tangential.norm() / (friction * normal));
    }
    EXPECT_GT(widest, 0.98) << sides;
  }
}

TEST(FrictionPyramid, HasThePapersFourSides) {
  Random random(5);
  const FrictionPyramid pyramid;
  for (int i = 0; i < 10'000; ++i) {
    const Eigen::Vector3d force(random.between(-1, 1), random.between(-1, 1),
                                random.between(-1, 3));
    const double room = 0.7 / std::numbers::sqrt2 * force.z();
    EXPECT_NEAR(pyramid.margin(force, 0.7),
                std::min(room - std::abs(force.x()), room - std::abs(force.y())), 1e-15);
  }
}

TEST(FrictionPyramid, AllowsNoPulling) {
  for (int sides = FrictionPyramid::kMinSides; sides <= FrictionPyramid::kMaxSides; ++sides)
    EXPECT_LT(FrictionPyramid(sides).margin({0, 0, -1}, 0.5), 0);
}

TEST(FrictionPyramid, RefusesOtherNumbersOfSides) {
  EXPECT_THROW(FrictionPyramid(2), InvalidArgument);
  EXPECT_THROW(FrictionPyramid(9), InvalidArgument);
}

}  // namespace
}  // namespace trifinger::control
