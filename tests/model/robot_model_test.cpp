// SPDX-License-Identifier: BSD-3-Clause
#include "trifinger/model/robot_model.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <mujoco/mujoco.h>

#include <algorithm>
#include <cmath>
#include <optional>
#include <random>
#include <set>
#include <string>
#include <tuple>
#include <utility>

#include "scenes.hpp"
#include "trifinger/base/error.hpp"
#include "trifinger/model/kinematics.hpp"

namespace trifinger {
namespace {

using test::label;

struct DeleteData {
  void operator()(mjData* data) const { mj_deleteData(data); }
};
using Data = std::unique_ptr<mjData, DeleteData>;

Data initial_data(const RobotModel& model) {
  Data data(mj_makeData(model.mujoco()));
  mj_resetDataKeyframe(model.mujoco(), data.get(), 0);
  mj_forward(model.mujoco(), data.get());
  return data;
}

std::string body_of(const mjModel* model, int geom) {
  return mj_id2name(model, mjOBJ_BODY, model->geom_bodyid[geom]);
}

void drive_towards(const RobotModel& model, mjData* data, const std::vector<double>& position) {
  for (int i = 0; i < model.num_joints(); ++i)
    data->ctrl[i] =
        10 * (position[static_cast<std::size_t>(i)] - data->qpos[i]) - 0.1 * data->qvel[i];
}

bool touch(const RobotModel& model, const mjData* data, const std::string& first,
           const std::string& second) {
  for (int i = 0; i < data->ncon; ++i) {
    const std::string one = body_of(model.mujoco(), data->contact[i].geom[0]);
    const std::string other = body_of(model.mujoco(), data->contact[i].geom[1]);
    if ((one == first && other == second) || (one == second && other == first)) return true;
  }
  return false;
}

TEST(RobotModel, BuildsEveryVariantWithEveryOption) {
  for (RobotDescription robot : test::all_robots()) {
    for (const bool boundary : {false, true})
      for (const bool soft_tips : {false, true})
        for (const Detail detail : {Detail::kPhysics, Detail::kPictures}) {
          robot.boundary = boundary;
          robot.soft_tips = soft_tips;
          const RobotModel model(robot, detail);
          EXPECT_EQ(model.num_joints(), num_joints(robot));
          EXPECT_EQ(model.camera_names().size(), detail == Detail::kPictures ? 3U : 0U);
          EXPECT_EQ(static_cast<int>(model.mujoco()->ncam),
                    static_cast<int>(model.camera_names().size()));
        }
  }
}

TEST(RobotModel, StartsWithNothingTouchingButObjectsOnTheTable) {
  for (RobotDescription robot : test::all_robots()) {
    const std::vector<ObjectDescription> all_kinds = robot.objects;
    for (const auto& objects : {all_kinds, {cube("a"), cube("b"), cube("c"), cube("d")}}) {
      robot.objects = objects;
      const RobotModel model(robot);
      const Data data = initial_data(model);
      for (int i = 0; i < data->ncon; ++i) {
        const mjContact& contact = data->contact[i];
        EXPECT_EQ(body_of(model.mujoco(), contact.geom[0]), "world")
            << label(robot) << ": " << body_of(model.mujoco(), contact.geom[0]) << " touches "
            << body_of(model.mujoco(), contact.geom[1]);
        EXPECT_GT(contact.dist, -1e-6) << label(robot);
      }
    }
  }
}

TEST(RobotModel, HasTheStopsAndTheStiffnessOfTheDescription) {
  const RobotModel model(
      {.stops = {.margin = 0.1, .time_constant = 0.01},
       .contact = {.time_constant = 0.004, .tip_time_constant = 0.008, .tip_damping_ratio = 0.5}});
  const mjModel* mujoco = model.mujoco();
  const VariantFigures& limits = figures(model.description());
  for (std::size_t i = 0; i < 9; ++i) {
    EXPECT_DOUBLE_EQ(mujoco->jnt_range[2 * i], limits.hard_lower[i % 3] - 0.1);
    EXPECT_DOUBLE_EQ(mujoco->jnt_range[2 * i + 1], limits.hard_upper[i % 3] + 0.1);
    EXPECT_EQ(mujoco->jnt_solref[mjNREF * i], 0.01);
  }
  for (std::size_t geom = 0; geom < model.surfaces().size(); ++geom) {
    if (!model.surfaces()[geom]) continue;
    const bool is_tip = model.surfaces()[geom] == Surface::kTip;
    const double* const solref = mujoco->geom_solref + mjNREF * geom;
    EXPECT_EQ(solref[0], is_tip ? 0.008 : 0.004);
    EXPECT_EQ(solref[1] == 0.5, is_tip);
  }
}

TEST(RobotModel, PutsTheJointsFirstInStateAndControls) {
  for (const RobotDescription& robot : test::all_robots()) {
    const RobotModel model(robot);
    const mjModel* mujoco = model.mujoco();
    const std::vector<std::string> names = joint_names(robot);
    for (int i = 0; i < model.num_joints(); ++i) {
      const char* name = names[static_cast<std::size_t>(i)].c_str();
      const int joint = mj_name2id(mujoco, mjOBJ_JOINT, name);
      EXPECT_EQ(mujoco->jnt_qposadr[joint], i);
      EXPECT_EQ(mujoco->jnt_dofadr[joint], i);
      EXPECT_EQ(mj_name2id(mujoco, mjOBJ_ACTUATOR, name), i);
    }
    EXPECT_EQ(static_cast<int>(mujoco->nu), model.num_joints());
  }
}

TEST(RobotModel, DrivesEachJointWithTheTorqueOfItsControl) {
  const RobotModel model({.objects = {}});
  const Data data = initial_data(model);
  for (int i = 0; i < 9; ++i) data->ctrl[i] = 0.01 * (i + 1);
  data->ctrl[8] = 5;  // Beyond the limit.
  mj_forward(model.mujoco(), data.get());
  for (int i = 0; i < 8; ++i) EXPECT_DOUBLE_EQ(data->qfrc_actuator[i], 0.01 * (i + 1));
  EXPECT_DOUBLE_EQ(data->qfrc_actuator[8], 0.36);
}

TEST(RobotModel, TakesItsMotorsFromTheDescription) {
  const ActuatorParameters drive{
      .torque_limit = 0.25, .rotor_inertia = 1e-6, .damping = 0.02, .friction = 0.01};
  const RobotModel model({.actuator = drive});
  for (int i = 0; i < 9; ++i) {
    EXPECT_DOUBLE_EQ(model.mujoco()->dof_armature[i], 81e-6);
    EXPECT_DOUBLE_EQ(model.mujoco()->dof_damping[i], 0.02);
    EXPECT_DOUBLE_EQ(model.mujoco()->dof_frictionloss[i], 0.01);
    EXPECT_DOUBLE_EQ(model.mujoco()->actuator_ctrlrange[2 * i + 1], 0.25);
  }
}

TEST(RobotModel, StopsTheJointsBeyondTheirHardLimits) {
  for (const RobotDescription& robot : test::all_robots()) {
    const RobotModel model(robot);
    for (int i = 0; i < model.num_joints(); ++i) {
      const auto j = static_cast<std::size_t>(i % 3);
      EXPECT_DOUBLE_EQ(model.mujoco()->jnt_range[2 * i], figures(robot).hard_lower[j] - 0.2);
      EXPECT_DOUBLE_EQ(model.mujoco()->jnt_range[2 * i + 1], figures(robot).hard_upper[j] + 0.2);
    }
  }
}

TEST(RobotModel, WeighsWhatThePublishedLinksWeigh) {
  // Moving mass of one finger [kg].
  const auto expected = [](const RobotDescription& robot) {
    if (robot.variant == Variant::kEdu) return 0.33778;
    if (robot.variant == Variant::kPro) return 0.60341;
    return robot.arrangement == Arrangement::kSingleFinger ? 0.412 : 0.430;
  };
  for (RobotDescription robot : test::all_robots()) {
    robot.objects.clear();
    const RobotModel model(robot);
    EXPECT_NEAR(mj_getTotalmass(model.mujoco()), num_fingers(robot) * expected(robot), 1e-5)
        << label(robot);
  }
}

TEST(RobotModel, GivesObjectsTheirMassAndSizeAndInertia) {
  const RobotModel model({.objects = {cube(), ball(), stick()}});
  const mjModel* mujoco = model.mujoco();
  const int cube_body = model.object("cube").body;
  EXPECT_DOUBLE_EQ(mujoco->body_mass[cube_body], 0.094);
  for (int i = 0; i < 3; ++i) EXPECT_NEAR(mujoco->body_inertia[3 * cube_body + i], 6.619e-5, 1e-8);
  const int ball_body = model.object("ball").body;
  EXPECT_DOUBLE_EQ(mujoco->body_mass[ball_body], 0.05);
  EXPECT_NEAR(mujoco->body_inertia[3 * ball_body], 0.4 * 0.05 * 0.03 * 0.03, 1e-12);
  EXPECT_NEAR(mujoco->body_mass[model.object("stick").body], 0.012, 1e-15);
}

TEST(RobotModel, FindsObjectsByNameAndWhereTheyLiveInTheState) {
  ObjectDescription placed = cube("placed");
  placed.position = {{0.05, -0.04, 0.2}};
  const RobotModel model({.objects = {cuboid(), placed}});
  const Data data = initial_data(model);
  const ObjectAddress& address = model.object("placed");
  EXPECT_EQ(address.position, 9 + 7);
  EXPECT_EQ(address.velocity, 9 + 6);
  EXPECT_DOUBLE_EQ(data->qpos[address.position], 0.05);
  EXPECT_DOUBLE_EQ(data->qpos[address.position + 1], -0.04);
  EXPECT_DOUBLE_EQ(data->qpos[address.position + 2], 0.2);
  EXPECT_DOUBLE_EQ(data->qpos[address.position + 3], 1);
  EXPECT_DOUBLE_EQ(data->xpos[3 * address.body + 2], 0.2);
}

TEST(RobotModel, NamesTheObjectsThatExistWhenAskedForAnother) {
  const RobotModel model({.objects = {cube("red"), ball("blue")}});
  try {
    (void)model.object("green");
    FAIL() << "found an object that is not there";
  } catch (const InvalidArgument& error) {
    EXPECT_THAT(error.what(), ::testing::HasSubstr("'green'"));
    EXPECT_THAT(error.what(), ::testing::HasSubstr("red, blue"));
  }
}

TEST(RobotModel, MovesAlikeForPhysicsAndForPictures) {
  for (const RobotDescription& robot : test::all_robots()) {
    const RobotModel bare(robot, Detail::kPhysics);
    const RobotModel full(robot, Detail::kPictures);
    const Data first = initial_data(bare);
    const Data second = initial_data(full);
    ASSERT_EQ(bare.mujoco()->nq, full.mujoco()->nq);
    std::mt19937_64 generator(3);
    std::uniform_real_distribution<double> torque(-0.3, 0.3);
    for (int step = 0; step < 500; ++step) {
      for (int i = 0; i < bare.num_joints(); ++i)
        first->ctrl[i] = second->ctrl[i] = torque(generator);
      mj_step(bare.mujoco(), first.get());
      mj_step(full.mujoco(), second.get());
    }
    EXPECT_TRUE(std::equal(first->qpos, first->qpos + bare.mujoco()->nq, second->qpos))
        << label(robot);
  }
}

TEST(RobotModel, KeepsObjectsInsideTheBoundary) {
  for (const Variant variant : test::kVariants) {
    const RobotModel model({.variant = variant, .objects = {ball()}});
    for (double azimuth = 0; azimuth < 6.28; azimuth += 0.31) {
      const Data data = initial_data(model);
      const ObjectAddress& ball = model.object("ball");
      // The ball rolls on the floor, under the fingers, at half a metre per second.
      data->qvel[ball.velocity] = 0.5 * std::cos(azimuth);
      data->qvel[ball.velocity + 1] = 0.5 * std::sin(azimuth);
      double furthest = 0;
      for (int step = 0; step < 1000; ++step) {
        // The fingers stay out of the way.
        drive_towards(model, data.get(), model.initial_position());
        mj_step(model.mujoco(), data.get());
        furthest = std::max(furthest,
                            std::hypot(data->qpos[ball.position], data->qpos[ball.position + 1]));
      }
      EXPECT_LT(furthest, 0.250 - 0.02);
      EXPECT_GT(furthest, 0.10) << "it never came near the wall";
    }
  }
}

TEST(RobotModel, HasRoomForManyMoreContactsThanAHeapOfObjectsMakes) {
  const RobotModel model({.objects = {cube(), cuboid(), stick(), ball()}});
  const Data data = initial_data(model);
  // The objects lie above each other, between the fingers.
  double height = 0.04;
  for (const ObjectDescription& object : model.description().objects) {
    double* const position = data->qpos + model.object(object.name).position;
    position[0] = position[1] = 0.0;
    position[2] = height;
    height += 0.04;
  }
  // The fingers move inwards and down.
  const std::vector<double> target{0, 0, -2.7, 0, 0, -2.7, 0, 0, -2.7};
  int contacts = 0;
  for (int step = 0; step < 2000; ++step) {
    drive_towards(model, data.get(), target);
    mj_step(model.mujoco(), data.get());
    contacts = std::max(contacts, data->ncon);
  }
  EXPECT_GT(contacts, 12);
  EXPECT_LT(10 * data->maxuse_arena, data->narena);
}

TEST(RobotModel, KeepsTipsInsideTheBoundary) {
  // The object is outside the wall and low enough to meet it, for each variant.
  for (const Variant variant : test::kVariants) {
    const double outward = variant == Variant::kOne ? -0.785 : 0.785;
    std::vector<double> target;
    for (int finger = 0; finger < 3; ++finger) target.insert(target.end(), {0, outward, 0});
    for (const bool boundary : {true, false}) {
      // The fingers are raised, so that the tips do not meet the table on their way.
      const RobotModel model({.variant = variant,
                              .finger_height = variant_figures(variant).finger_height + 0.03,
                              .boundary = boundary,
                              .objects = {}});
      const Data data = initial_data(model);
      for (int step = 0; step < 2000; ++step) {
        drive_towards(model, data.get(), target);
        mj_step(model.mujoco(), data.get());
      }
      for (const int site : model.tip_sites()) {
        const double* tip = data->site_xpos + 3 * site;
        const double radius = std::hypot(tip[0], tip[1]);
        EXPECT_EQ(radius < 0.245, boundary) << label(model.description()) << ' ' << radius;
      }
    }
  }
}

TEST(RobotModel, LetsFingersTouchEachOtherTheObjectsAndTheTable) {
  for (const Variant variant : test::kVariants) {
    ObjectDescription held = ball();
    held.position = {{0, 0, 0.15}};
    const RobotModel model({.variant = variant, .objects = {held}});
    const Kinematics kinematics(model.description());
    const Data data = initial_data(model);
    const auto move_tip = [&](int finger, const Eigen::Vector3d& tip) {
      const FingerPose pose = kinematics.inverse_kinematics(finger, tip);
      ASSERT_TRUE(pose) << label(model.description());
      std::copy_n(pose.position.data(), 3, data->qpos + 3 * finger);
      mj_forward(model.mujoco(), data.get());
    };
    move_tip(0, {0, 0, 0.1});
    move_tip(1, {0.005, 0, 0.1});
    EXPECT_TRUE(touch(model, data.get(), "finger_lower_link_0", "finger_lower_link_120"));
    move_tip(0, {0, 0.03, 0.15});
    EXPECT_TRUE(touch(model, data.get(), "finger_lower_link_0", "ball"));
    move_tip(2, {-0.02, -0.02, 0.009});
    EXPECT_TRUE(touch(model, data.get(), "finger_lower_link_240", "world"));
  }
}

TEST(RobotModel, GivesContactsOfTheTipsTheTipsFriction) {
  const RobotModel model(
      {.contact = {.tip_friction = 0.8, .tip_torsional_friction = 0.003, .floor_friction = 0.3}});
  const Kinematics kinematics(model.description());
  const Data data = initial_data(model);
  const FingerPose pose = kinematics.inverse_kinematics(0, {-0.06, 0.06, 0.009});
  ASSERT_TRUE(pose);
  std::copy_n(pose.position.data(), 3, data->qpos);
  mj_forward(model.mujoco(), data.get());
  int of_tips = 0;
  int of_floor = 0;
  for (int i = 0; i < data->ncon; ++i) {
    const mjContact& contact = data->contact[i];
    const int tip_geom = model.tip_geoms()[0];
    const bool tip = contact.geom[0] == tip_geom || contact.geom[1] == tip_geom;
    ++(tip ? of_tips : of_floor);
    EXPECT_EQ(contact.dim, tip ? 4 : 3);
    EXPECT_DOUBLE_EQ(contact.friction[0], tip ? 0.8 : 0.3);
    EXPECT_DOUBLE_EQ(contact.friction[2], tip ? 0.003 : 0.005);
  }
  EXPECT_EQ(of_tips, 1);
  EXPECT_EQ(of_floor, 4);
}

// --- Friction of pairs

OfSurfacePairs<std::optional<double>> distinct_frictions() {
  OfSurfacePairs<std::optional<double>> frictions;
  double friction = 0.1;
  for (const SurfacePair pair : all_surface_pairs()) frictions[pair] = friction += 0.05;
  return frictions;
}

TEST(SurfacePairs, HaveTheNamesOfTheirSurfaces) {
  constexpr std::pair<Surface, std::string_view> kSurfaces[] = {{Surface::kTip, "tip"},
                                                                {Surface::kLink, "link"},
                                                                {Surface::kObject, "object"},
                                                                {Surface::kTable, "table"},
                                                                {Surface::kBoundary, "boundary"}};
  std::size_t count = 0;
  for (std::size_t i = 0; i < std::size(kSurfaces); ++i)
    for (std::size_t j = i; j < std::size(kSurfaces); ++j) {
      if (kSurfaces[i].first >= Surface::kTable) continue;
      const SurfacePair pair = pair_of(kSurfaces[i].first, kSurfaces[j].first);
      EXPECT_EQ(pair, pair_of(kSurfaces[j].first, kSurfaces[i].first));
      EXPECT_EQ(pair, all_surface_pairs()[count++]);
      const std::string name =
          std::string(kSurfaces[i].second) + "_" + std::string(kSurfaces[j].second);
      EXPECT_EQ(name_of(pair), name);
      EXPECT_EQ(surface_pair_from_name(name), pair);
    }
  EXPECT_EQ(count, kNumSurfacePairs);
  EXPECT_THROW((void)surface_pair_from_name("tip_floor"), InvalidArgument);
}

TEST(SurfacePairs, AreNotInTheModelUnlessTheirFrictionIsGiven) {
  EXPECT_EQ(static_cast<int>(RobotModel().mujoco()->npair), 0);
  const RobotModel model({.contact = {.friction = {{SurfacePair::kTipObject, 0.8},
                                                   {SurfacePair::kObjectTable, 0.3}}}});
  EXPECT_EQ(static_cast<int>(model.mujoco()->npair), 3 + 1);
}

// Tests contacts of everything with everything, in a heap.
TEST(SurfacePairs, HaveTheFrictionThatIsGivenAndNothingElseOfTheirOwn) {
  for (RobotDescription robot : test::all_robots()) {
    const RobotModel usual(robot);
    robot.contact.friction = distinct_frictions();
    const RobotModel paired(robot);
    const Data of_usual = initial_data(usual);
    const Data of_paired = initial_data(paired);
    std::mt19937 random(1);
    std::set<SurfacePair> seen;
    const bool meets_all = robot.arrangement == Arrangement::kTriFinger && !robot.flipped;
    const auto is_missing = [&] { return meets_all && seen.size() < kNumSurfacePairs; };
    for (int trial = 0; trial < 2000 || (is_missing() && trial < 100'000); ++trial) {
      // The poses are arbitrary, because nothing is simulated.
      for (int i = 0; i < static_cast<int>(usual.mujoco()->nq); ++i)
        of_usual->qpos[i] = std::uniform_real_distribution<double>(-1.5, 1.5)(random);
      for (const ObjectAddress& object : usual.objects())
        for (int i = 0; i < 3; ++i) of_usual->qpos[object.position + i] *= i < 2 ? 0.15 : 0.08;
      std::copy_n(of_usual->qpos, usual.mujoco()->nq, of_paired->qpos);
      using Contact =
          std::tuple<int, int, double, int, double, double, double, double, double, double>;
      const auto contacts = [&](const RobotModel& model, mjData* data) {
        mj_fwdPosition(model.mujoco(), data);
        std::multiset<Contact> all;
        for (int i = 0; i < data->ncon; ++i) {
          const mjContact& contact = data->contact[i];
          const auto [first, second] = std::minmax(contact.geom[0], contact.geom[1]);
          all.emplace(first, second, contact.dist, contact.dim, contact.friction[2],
                      contact.friction[3], contact.solref[0], contact.solref[1], contact.solimp[0],
                      contact.solimp[2]);
          if (model.mujoco()->npair == 0) continue;
          const auto surface = [&](int geom) {
            return *model.surfaces()[static_cast<std::size_t>(geom)];
          };
          const SurfacePair pair = pair_of(surface(first), surface(second));
          seen.insert(pair);
          EXPECT_EQ(contact.friction[0], robot.contact.friction[pair]) << name_of(pair);
          EXPECT_EQ(contact.friction[1], robot.contact.friction[pair]) << name_of(pair);
        }
        return all;
      };
      EXPECT_EQ(contacts(usual, of_usual.get()), contacts(paired, of_paired.get())) << label(robot);
    }
    for (const SurfacePair pair : all_surface_pairs()) {
      EXPECT_TRUE(!meets_all || seen.contains(pair)) << name_of(pair) << ' ' << label(robot);
    }
  }
}

TEST(CollisionMasks, IgnoreOnlyPairsThatCannotMeet) {
  for (RobotDescription robot : test::all_robots()) {
    robot.objects.clear();
    for (const double height : {0.2, figures(robot).finger_height, 0.6}) {
      robot.finger_height = height;
      const RobotModel model(robot);
      const mjModel* mujoco = model.mujoco();
      const Data data = initial_data(model);
      const auto masked = [&](int one, int other) {
        return (mujoco->geom_contype[one] & mujoco->geom_conaffinity[other]) == 0 &&
               (mujoco->geom_contype[other] & mujoco->geom_conaffinity[one]) == 0;
      };
      std::vector<std::pair<int, int>> ignored;
      for (int wall = 0; wall < mujoco->ngeom; ++wall)
        for (int link = 0; link < mujoco->ngeom; ++link) {
          const std::string body = body_of(mujoco, wall);
          const bool fixed = body == "platform" || body == "world";
          if (fixed && body_of(mujoco, link).starts_with("finger") && masked(wall, link))
            ignored.emplace_back(link, wall);
        }
      ASSERT_FALSE(ignored.empty());
      std::mt19937_64 generator(4);
      for (int sample = 0; sample < 200; ++sample) {
        for (int i = 0; i < model.num_joints(); ++i)
          data->qpos[i] = std::uniform_real_distribution(mujoco->jnt_range[2 * i],
                                                         mujoco->jnt_range[2 * i + 1])(generator);
        mj_kinematics(mujoco, data.get());
        for (const auto& [link, wall] : ignored) {
          double nearest[6];
          EXPECT_GT(mj_geomDistance(mujoco, data.get(), link, wall, 0.01, nearest), 0)
              << label(robot) << " height " << height << ' ' << body_of(mujoco, link);
        }
      }
    }
  }
}

}  // namespace
}  // namespace trifinger
