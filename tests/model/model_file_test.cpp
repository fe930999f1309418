// SPDX-License-Identifier: BSD-3-Clause
#include "trifinger/model/model_file.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <mujoco/mujoco.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <fstream>
#include <numbers>
#include <string>
#include <vector>

#include "model/file_robots.hpp"
#include "support/folder.hpp"
#include "support/message_of.hpp"
#include "trifinger/base/error.hpp"

namespace trifinger::test {
namespace {

using std::chrono::microseconds;
using testing::ElementsAre;
using testing::HasSubstr;

class ModelFileTest : public testing::Test {
 protected:
  [[nodiscard]] ModelFileOptions file(const std::string& text,
                                      const std::string& name = "arm.xml") const {
    write(folder_ / name, text);
    return {.path = folder_ / name};
  }
  [[nodiscard]] ModelFile arm() const { return ModelFile(file(kArm)); }
  [[nodiscard]] std::string message(const ModelFileOptions& options) const {
    std::string text = message_of<InvalidArgument>([&] { return ModelFile(options); });
    const std::string folder = folder_.path().string() + "/";
    if (text.starts_with(folder)) text.erase(0, folder.size());
    return text;
  }
  [[nodiscard]] static std::vector<std::string> names(const std::vector<DrivenJoint>& joints) {
    std::vector<std::string> names;
    names.reserve(joints.size());
    for (const DrivenJoint& joint : joints) names.push_back(joint.name);
    return names;
  }

  Folder folder_;
};

// The forces of all motors on the degrees of freedom, for a torque of 1 at joint `joint`.
std::vector<double> forces_of(const ModelFile& model, std::size_t joint) {
  const SceneModel::Data data = model.make_data();
  model.set_torque(joint, 1.0, *data);
  mj_forward(model.mujoco(), data.get());
  return {data->qfrc_actuator, data->qfrc_actuator + model.mujoco()->nv};
}

TEST_F(ModelFileTest, SaysWhatTheFileSaysOfEachDrivenJoint) {
  const ModelFile model = arm();
  EXPECT_EQ(model.name(), "some arm");
  ASSERT_THAT(names(model.joints()), ElementsAre("shoulder", "elbow", "finger", "rail"));
  const DrivenJoint& shoulder = model.joints()[0];
  EXPECT_EQ(shoulder.range, (std::array{-2.0, 2.0}));
  // With a gear of 2 a force of 6 N is a torque of 12 Nm, and gains act with its square.
  EXPECT_EQ(shoulder.max_torque, 12.0);
  EXPECT_EQ(shoulder.kp, 40.0);
  EXPECT_EQ(shoulder.kd, 4.0);
  const DrivenJoint& elbow = model.joints()[1];
  EXPECT_EQ(elbow.max_torque, 8.0);
  EXPECT_FALSE(elbow.kp || elbow.kd);
  const DrivenJoint& finger = model.joints()[2];
  EXPECT_EQ(finger.range, (std::array{0.0, 1.5}));
  EXPECT_EQ(finger.kp, 3.0);
  EXPECT_EQ(finger.kd, 0.0);
  EXPECT_FALSE(finger.is_slide);
  const DrivenJoint& rail = model.joints()[3];
  EXPECT_TRUE(rail.is_slide);
  EXPECT_FALSE(rail.range);
  // Its force limits differ, and a motor has one.
  EXPECT_FALSE(rail.max_torque);
}

TEST_F(ModelFileTest, KnowsAllJointsAndFreeBodies) {
  const ModelFile model = arm();
  ASSERT_EQ(model.model_joints().size(), 6U);
  EXPECT_EQ(model.model_joints()[0].name, "rail");
  EXPECT_TRUE(model.model_joints()[0].is_slide);
  EXPECT_EQ(model.model_joints()[5].name, "flap");
  EXPECT_FALSE(model.drives_all());
  ASSERT_EQ(model.objects().size(), 2U);
  EXPECT_EQ(model.objects()[0].name, "ball");
  EXPECT_EQ(model.objects()[1].position, 6 + 7);
}

TEST_F(ModelFileTest, HasMotorsWhoseTorqueActsOnTheJointWhateverItsActuatorWas) {
  const ModelFile model = arm();
  // The degrees of freedom are rail, shoulder, elbow, near, far, flap, then the objects.
  EXPECT_THAT(forces_of(model, 0), testing::Contains(1.0).Times(1));
  EXPECT_EQ(forces_of(model, 0)[1], 1.0);
  EXPECT_EQ(forces_of(model, 1)[2], 1.0);
  EXPECT_EQ(forces_of(model, 2)[3], 0.5);
  EXPECT_EQ(forces_of(model, 2)[4], 0.5);
  EXPECT_EQ(forces_of(model, 3)[0], 1.0);
  EXPECT_EQ(model.mujoco()->nu, 4);
}

// Two joints, and whatever `more` says.
std::string two_joints(const std::string& more) {
  return R"(<mujoco><compiler angle="radian"/><option timestep="0.002"/><worldbody>
    <body name="one"><joint name="a" axis="0 1 0"/><geom size="0.1"/>
      <body name="two" pos="0 0 0.3"><joint name="b" axis="0 1 0"/><geom size="0.1"/></body></body>
  </worldbody>)" +
         more + "</mujoco>";
}

TEST_F(ModelFileTest, GivesNothingOfTheDefaultsOfActuatorsToItsOwnMotors) {
  const ModelFile model(file(two_joints(
      R"(<default><motor gear="50" armature="2" damping="3" ctrlrange="-0.1 0.1"/></default>)")));
  EXPECT_THAT(forces_of(model, 0), ElementsAre(1.0, 0.0));
  EXPECT_THAT(forces_of(model, 1), ElementsAre(0.0, 1.0));
  EXPECT_EQ(model.mujoco()->actuator_armature[0], 0.0);
  EXPECT_EQ(model.mujoco()->actuator_damping[0], 0.0);
}

TEST_F(ModelFileTest, MakesMotorsOfActuatorsWithSeveralInputsOrNone) {
  const ModelFile several(file(two_joints(
      R"(<actuator><pid name="p" joint="a" kp="5" forcerange="-3 3"/>
           <motor name="m" joint="b" gear="4" ctrlrange="-2 2" ctrllimited="true"/></actuator>)")));
  ASSERT_THAT(names(several.joints()), ElementsAre("a", "b"));
  EXPECT_EQ(several.joints()[0].max_torque, 3.0);
  EXPECT_EQ(several.joints()[1].max_torque, 8.0);
  EXPECT_EQ(several.mujoco()->nu, 2);
  EXPECT_THAT(forces_of(several, 0), ElementsAre(1.0, 0.0));
  EXPECT_THAT(forces_of(several, 1), ElementsAre(0.0, 1.0));

  ModelFileOptions options = file(two_joints(
      R"(<actuator><dcmotor name="d" joint="a" motorconst="0.1" resistance="2" input="none"/>
                      <motor name="m" joint="b" gear="4" ctrlrange="-2 2" ctrllimited="true"/></actuator>)"));
  const ModelFile none(options);
  ASSERT_THAT(names(none.joints()), ElementsAre("a", "b"));
  EXPECT_EQ(none.joints()[1].max_torque, 8.0);
  EXPECT_THAT(forces_of(none, 0), ElementsAre(1.0, 0.0));
  EXPECT_THAT(forces_of(none, 1), ElementsAre(0.0, 1.0));
  // What it writes is the same robot.
  const ModelFile again(file(several.mjcf(), "again.xml"));
  EXPECT_THAT(forces_of(again, 0), ElementsAre(1.0, 0.0));
}

TEST_F(ModelFileTest, LetsTheAppliedTorqueActAtOnceAndInFull) {
  ModelFileOptions options = file(two_joints(
      R"(<tendon><fixed name="both" actuatorfrcrange="-5 5"><joint joint="a" coef="1"/>
           <joint joint="b" coef="0.5"/></fixed></tendon>
         <actuator><motor name="m" tendon="both" delay="0.02" nsample="12"/></actuator>)"));
  const ModelFile tendon(options);
  EXPECT_EQ(tendon.joints()[0].max_torque, 5.0);
  const auto forces = [](const ModelFile& model) {
    const SceneModel::Data data = model.make_data();
    model.set_torque(0, 10.0, *data);
    mj_forward(model.mujoco(), data.get());
    return std::vector(data->qfrc_actuator, data->qfrc_actuator + model.mujoco()->nv);
  };
  EXPECT_THAT(forces(tendon), ElementsAre(10.0, 5.0));

  const auto with_range = [](std::string text) {
    const std::string joint = R"(name="b")";
    return text.replace(text.find(joint), joint.size(), joint + R"( actuatorfrcrange="-3 3")");
  };
  const ModelFile joint(file(with_range(two_joints("<actuator><motor joint='b'/></actuator>"))));
  EXPECT_EQ(joint.joints()[0].max_torque, 3.0);
  EXPECT_THAT(forces(joint), ElementsAre(0.0, 10.0));
  // A joint that a tendon moves by halves gets half of its torque.
  const ModelFile coupled(file(with_range(two_joints(
      R"(<tendon><fixed name="both"><joint joint="a" coef="1"/><joint joint="b" coef="0.5"/>
                    </fixed></tendon><actuator><motor tendon="both"/></actuator>)"))));
  EXPECT_EQ(coupled.joints()[0].max_torque, 6.0);
  EXPECT_THAT(forces(coupled), ElementsAre(10.0, 5.0));
}

TEST_F(ModelFileTest, DrivesJointsWithoutNamesUnlessAnotherHasTheirs) {
  const auto unnamed = [](const std::string& other) {
    std::string text = two_joints("");
    text.replace(text.find(R"(name="a")"), 8, "");
    return text.replace(text.find(R"(name="b")"), 8, other);
  };
  const ModelFile model(file(unnamed("")));
  ASSERT_THAT(names(model.joints()), ElementsAre("joint0", "joint1"));
  EXPECT_THAT(forces_of(model, 1), ElementsAre(0.0, 1.0));
  ModelFileOptions options = file(unnamed(""));
  options.joints = {"joint1"};
  EXPECT_THAT(forces_of(ModelFile(options), 0), ElementsAre(0.0, 1.0));

  EXPECT_EQ(message(file(unnamed(R"(name="joint0")"))),
            "arm.xml: a joint without a name would be called 'joint0', as another one is; give it "
            "a name");
  EXPECT_EQ(message(file(
                two_joints(R"(<tendon><fixed name="a"><joint joint="b" coef="1"/></fixed></tendon>
                                       <actuator><motor tendon="a"/></actuator>)"))),
            "arm.xml: tendon 'a' has the name of a joint; rename one of them");
}

TEST_F(ModelFileTest, MeasuresACoupledJointAsItsTendonIsLong) {
  const ModelFile model = arm();
  const SceneModel::Data data = model.make_data();
  model.set_model_position(3, 1.0, *data);
  model.set_model_position(4, 0.4, *data);
  EXPECT_DOUBLE_EQ(model.position(2, *data), 0.7);
  model.set_position(2, 0.9, *data);
  EXPECT_DOUBLE_EQ(model.position(2, *data), 0.9);
  EXPECT_DOUBLE_EQ(model.model_position(3, *data), 1.2);
  EXPECT_DOUBLE_EQ(model.model_position(4, *data), 0.6);
}

TEST_F(ModelFileTest, DrivesTheJointsThatAreNamedInTheirOrder) {
  ModelFileOptions options = file(kArm);
  options.joints = {"flap", "shoulder"};
  const ModelFile model(options);
  EXPECT_THAT(names(model.joints()), ElementsAre("flap", "shoulder"));
  EXPECT_EQ(forces_of(model, 0)[5], 1.0);
  EXPECT_EQ(forces_of(model, 1)[1], 1.0);

  // The other actuators of the file do nothing.
  const SceneModel::Data data = model.make_data();
  std::fill(data->ctrl, data->ctrl + model.mujoco()->nu, 0.0);
  model.set_model_position(1, 1.0, *data);
  mj_forward(model.mujoco(), data.get());
  for (int i = 0; i < model.mujoco()->nv; ++i) EXPECT_EQ(data->qfrc_actuator[i], 0.0);
}

TEST_F(ModelFileTest, DrivesEveryJointOfAFileWithoutActuators) {
  const ModelFile model(file(R"(<robot name="two links">
    <link name="base"/>
    <link name="one"><inertial><mass value="1"/><inertia ixx="0.1" iyy="0.1" izz="0.1" ixy="0" ixz="0" iyz="0"/></inertial></link>
    <link name="two"><inertial><mass value="1"/><inertia ixx="0.1" iyy="0.1" izz="0.1" ixy="0" ixz="0" iyz="0"/></inertial></link>
    <joint name="turn" type="revolute"><parent link="base"/><child link="one"/><axis xyz="0 0 1"/>
      <limit lower="-1" upper="2" effort="7" velocity="3"/></joint>
    <joint name="lift" type="prismatic"><parent link="one"/><child link="two"/><axis xyz="0 0 1"/>
      <limit lower="0" upper="0.5" effort="50" velocity="1"/></joint>
  </robot>)",
                             "links.urdf"));
  ASSERT_THAT(names(model.joints()), ElementsAre("turn", "lift"));
  EXPECT_TRUE(model.drives_all());
  EXPECT_EQ(model.joints()[0].range, (std::array{-1.0, 2.0}));
  EXPECT_EQ(model.joints()[0].max_torque, 7.0);
  EXPECT_TRUE(model.joints()[1].is_slide);
  EXPECT_EQ(model.joints()[1].max_torque, 50.0);
  EXPECT_EQ(forces_of(model, 1)[1], 1.0);
}

TEST_F(ModelFileTest, StepsAsTheFileSaysOrInEqualPartsThatAreNotLonger) {
  EXPECT_EQ(arm().period(), microseconds(2000));
  EXPECT_EQ(arm().substeps(), 1);
  for (const auto& [period, substeps] : std::vector<std::pair<microseconds, int>>{
           {microseconds(1000), 1}, {microseconds(4000), 2}, {microseconds(5000), 3}}) {
    ModelFileOptions options = file(kArm);
    options.period = period;
    const ModelFile model(options);
    EXPECT_EQ(model.substeps(), substeps);
    EXPECT_NEAR(model.mujoco()->opt.timestep * substeps,
                std::chrono::duration<double>(period).count(), 1e-12);
  }
}

TEST_F(ModelFileTest, NamesWhatCannotBeUsed) {
  EXPECT_EQ(message({.path = folder_ / "missing.xml"}), "missing.xml: there is no such file");
  EXPECT_THAT(message(file("<mujoco><worldbody><bodi/></worldbody></mujoco>")),
              HasSubstr("arm.xml: MuJoCo cannot read it: "));
  EXPECT_EQ(message(file("<mujoco><worldbody><geom size=\"1\"/></worldbody></mujoco>")),
            "arm.xml: the model has no hinge and no slide, so nothing moves");
  ModelFileOptions options = file(kArm);
  options.joints = {"shoulder", "knee"};
  EXPECT_EQ(message(options),
            "arm.xml: no joint or fixed tendon 'knee' can be driven; there are rail, shoulder, "
            "elbow, near, far, flap, finger");
  options.joints = {"shoulder", "shoulder"};
  EXPECT_EQ(message(options), "arm.xml: joint 'shoulder' is named twice");
  EXPECT_EQ(message(file(R"(<mujoco><worldbody><body><joint name="a"/><geom size="0.1"/>
                            <site name="s"/></body></worldbody>
                            <actuator><general name="jet" site="s"/></actuator></mujoco>)")),
            "arm.xml: no motor can take the place of actuator 'jet', because it acts on a site or "
            "a crank; name the joints to be driven (robot.joints), without it");
}

TEST_F(ModelFileTest, DrivesNothingByActuatorsThatLetBodiesStick) {
  const std::string actuator = R"(<actuator><adhesion body="foot" ctrlrange="0 1"/>)";
  const std::string world = R"(<mujoco><worldbody><body><joint name="a"/><geom size="0.1"/>
                               <body name="foot" pos="0 0 1"><joint name="b"/><geom size="0.1"/>
                               </body></body></worldbody>)";
  EXPECT_THAT(names(ModelFile(file(world + actuator + "</actuator></mujoco>")).joints()),
              ElementsAre("a", "b"));
  EXPECT_THAT(
      names(
          ModelFile(file(world + actuator + R"(<motor joint="b"/></actuator></mujoco>)")).joints()),
      ElementsAre("b"));
}

TEST_F(ModelFileTest, HasTheMemoryItNeedsAndNeverSleeps) {
  const ModelFile model(
      file(two_joints(R"(<size memory="1K"/><option><flag sleep="enable"/></option>)")));
  EXPECT_GT(model.mujoco()->narena, 1'000'000);
  EXPECT_EQ(model.mujoco()->opt.enableflags & mjENBL_SLEEP, 0);
  const ModelFile old(file(two_joints(R"(<size njmax="3" nconmax="1" nstack="10"/>)")));
  EXPECT_EQ(old.mujoco()->narena, model.mujoco()->narena);
}

TEST_F(ModelFileTest, RefusesTimestepsOfAnotherWorld) {
  for (const std::string step : {"1e-9", "1e300", "-0.001", "10"}) {
    std::string text = two_joints("");
    text.replace(text.find("0.002"), 5, step);
    EXPECT_THAT(message(file(text)), testing::AllOf(HasSubstr("arm.xml: its timestep is "),
                                                    HasSubstr(" s, must be 1e-6 to 1")))
        << step;
  }
}

// Writes a ball with many triangles as OBJ, each corner anew for each triangle, off its centre.
void write_ball(const std::filesystem::path& path, int rings) {
  std::ofstream obj(path);
  int next = 1;
  const auto corner = [&](int ring, int column) {
    const double latitude = std::numbers::pi * ring / rings;
    const double angle = 2 * std::numbers::pi * column / rings;
    obj << "v " << 0.3 + 0.1 * std::sin(latitude) * std::cos(angle) << ' '
        << 0.1 * std::sin(latitude) * std::sin(angle) << ' ' << 0.05 * std::cos(latitude) << '\n';
    return next++;
  };
  const auto triangle = [&](int a, int b, int c) {
    obj << "f " << a << ' ' << b << ' ' << c << '\n';
  };
  for (int ring = 0; ring < rings; ++ring) {
    for (int column = 0; column < rings; ++column) {
      if (ring > 0) {
        triangle(corner(ring, column), corner(ring + 1, column), corner(ring, column + 1));
      }
      if (ring < rings - 1) {
        triangle(corner(ring, column + 1), corner(ring + 1, column), corner(ring + 1, column + 1));
      }
    }
  }
}

TEST_F(ModelFileTest, FindsTheMeshesOfAUrdfByTheEndsOfTheirPaths) {
  std::filesystem::create_directories(folder_ / "lever_description" / "meshes");
  write_ball(folder_ / "lever_description" / "meshes" / "lever.obj", 10);
  ModelFileOptions options = file(R"(<robot name="lever"><link name="base"/>
    <link name="arm"><inertial><mass value="1"/><inertia ixx="0.1" iyy="0.1" izz="0.1" ixy="0" ixz="0" iyz="0"/></inertial>
      <collision><geometry><mesh filename="package://lever_description/meshes/lever.obj"/></geometry></collision></link>
    <joint name="turn" type="continuous"><parent link="base"/><child link="arm"/></joint></robot>)",
                                  "lever.urdf");
  EXPECT_THAT(message(options), testing::AllOf(HasSubstr("Error opening file"),
                                               testing::EndsWith("(robot.mesh_folder, --meshes)")));
  for (const char* const folder : {"", "lever_description", "lever_description/meshes"}) {
    options.mesh_folder = folder_ / folder;
    EXPECT_EQ(ModelFile(options).mujoco()->nmesh, 1) << folder;
  }
}

TEST_F(ModelFileTest, BecomesATextThatNeedsNoOtherFile) {
  write_ball(folder_ / "ball.obj", 40);
  const std::string text = R"(<mujoco model="meshes">
    <asset>
      <mesh name="looks" file="ball.obj" scale="2 2 2"/>
      <mesh name="touches" file="ball.obj"/>
    </asset>
    <worldbody><body name="link" pos="0 0 1" euler="10 20 30"><joint name="turn"/>
      <geom type="mesh" mesh="looks" contype="0" conaffinity="0" density="100" pos="0.1 0 0"/>
      <geom type="mesh" mesh="touches" density="300" euler="0 90 0"/>
    </body></worldbody></mujoco>)";
  const ModelFile model(file(text, "meshes.xml"));
  const std::string mjcf = model.mjcf();
  EXPECT_THAT(mjcf, testing::Not(HasSubstr("ball.obj")));

  std::filesystem::create_directory(folder_ / "alone");
  write(folder_ / "alone" / "meshes.xml", mjcf);
  const ModelFile again({.path = folder_ / "alone" / "meshes.xml"});
  const mjModel& one = *model.mujoco();
  const mjModel& other = *again.mujoco();
  ASSERT_EQ(other.ngeom, one.ngeom);
  const SceneModel::Data data = model.make_data();
  const SceneModel::Data other_data = again.make_data();
  mj_kinematics(&one, data.get());
  mj_kinematics(&other, other_data.get());
  for (int body = 0; body < one.nbody; ++body) {
    EXPECT_NEAR(other.body_mass[body], one.body_mass[body], 1e-5 * one.body_mass[body]);
  }
  for (int i = 0; i < 3 * one.ngeom; ++i) {
    EXPECT_NEAR(other_data->geom_xpos[i], data->geom_xpos[i], 1e-3);
  }
  for (int i = 0; i < 6 * one.ngeom; ++i) EXPECT_NEAR(other.geom_aabb[i], one.geom_aabb[i], 1e-3);
  // Corners that triangles share are there once, and the mesh that touches kept every triangle.
  EXPECT_LT(other.mesh_vertnum[1], one.mesh_vertnum[1] / 2);
  EXPECT_EQ(other.mesh_facenum[1], one.mesh_facenum[1]);
}

}  // namespace
}  // namespace trifinger::test
