// SPDX-License-Identifier: BSD-3-Clause
// What URDF files of others have: joints that follow, meshes of COLLADA, inertias that no body has.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <mujoco/mujoco.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <optional>
#include <random>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "base/text_of.hpp"
#include "model/file_robots.hpp"
#include "model/mesh_conversion.hpp"
#include "support/folder.hpp"
#include "support/message_of.hpp"
#include "trifinger/base/error.hpp"
#include "trifinger/model/model_file.hpp"

namespace trifinger::test {
namespace {

using detail::text_of;
using testing::AllOf;
using testing::ElementsAre;
using testing::HasSubstr;

constexpr const char* kMass =
    R"(<mass value="1"/><inertia ixx="0.1" iyy="0.1" izz="0.1" ixy="0" ixz="0" iyz="0"/>)";

std::string mesh(const std::string& kind, const std::string& file) {
  return text_of("<", kind, R"(><geometry><mesh filename=")", file, R"("/></geometry></)", kind,
                 ">");
}

// An arm that turns on its base. `inertial` and `shapes` are those of the arm.
std::string lever(const std::string& shapes, const std::string& inertial = kMass,
                  const std::string& more = "") {
  return text_of(R"(<robot name="lever"><link name="base"/><link name="arm"><inertial>)", inertial,
                 "</inertial>", shapes, R"(</link>
<joint name="turn" type="revolute"><parent link="base"/><child link="arm"/><axis xyz="0 1 0"/>
<limit lower="-1" upper="2" effort="7" velocity="3"/>
<safety_controller soft_lower_limit="-0.9" soft_upper_limit="9" k_velocity="1"/></joint>)",
                 more, "</robot>");
}

// A triangle and a square that is twice as large, of a colour each, in centimetres.
constexpr const char* kCollada = R"(<?xml version="1.0"?>
<COLLADA version="1.4.1"><asset><unit name="cm" meter="0.01"/><up_axis>Y_UP</up_axis></asset>
<library_effects>
 <effect id="red"><profile_COMMON><technique sid="t"><phong><diffuse><color>1 0 0 1</color></diffuse></phong></technique></profile_COMMON></effect>
 <effect id="blue"><profile_COMMON><technique sid="t"><lambert><diffuse><color>0 0 1 1</color></diffuse></lambert></technique></profile_COMMON></effect>
</library_effects>
<library_materials>
 <material id="m1"><instance_effect url="#red"/></material>
 <material id="m2"><instance_effect url="#blue"/></material>
</library_materials>
<library_geometries><geometry id="g"><mesh>
 <source id="s"><float_array id="a" count="18">0 0 0 10 0 0 0 10 0 0 0 10 1e3 1e3 1e3 10 10 0</float_array>
  <technique_common><accessor source="#a" count="6" stride="3"/></technique_common></source>
 <vertices id="v"><input semantic="POSITION" source="#s"/></vertices>
 <triangles material="one" count="2"><input semantic="VERTEX" source="#v" offset="0"/><input semantic="NORMAL" source="#s" offset="1"/>
  <p>0 0 1 0 3 0 0 0 3 0 2 0</p></triangles>
 <polylist material="two" count="2"><input semantic="VERTEX" source="#v" offset="0"/>
  <vcount>4 4</vcount><p>0 2 5 1 1 5 2 3</p></polylist>
</mesh></geometry></library_geometries>
<library_visual_scenes><visual_scene id="w"><node><translate>0 0 100</translate><node><scale>2 2 2</scale>
 <instance_geometry url="#g"><bind_material><technique_common>
  <instance_material symbol="one" target="#m1"/><instance_material symbol="two" target="#m2"/>
 </technique_common></bind_material></instance_geometry></node></node></visual_scene></library_visual_scenes>
<scene><instance_visual_scene url="#w"/></scene></COLLADA>)";

std::string replaced(std::string text, const std::string& from, const std::string& to) {
  const std::size_t at = text.find(from);
  EXPECT_NE(at, std::string::npos) << from;
  return text.replace(at, from.size(), to);
}

class Urdf : public testing::Test {
 protected:
  [[nodiscard]] ModelFileOptions file(const std::string& text) const {
    write(folder_ / "lever.urdf", text);
    return {.path = folder_ / "lever.urdf"};
  }
  [[nodiscard]] std::string refusal(const ModelFileOptions& options) const {
    std::string text = message_of<InvalidArgument>([&] { return ModelFile(options); });
    const std::string folder = folder_.path().string() + "/";
    for (std::size_t at = text.find(folder); at != std::string::npos; at = text.find(folder)) {
      text.erase(at, folder.size());
    }
    return text;
  }
  // Why a mesh of COLLADA is refused.
  [[nodiscard]] std::string refusal_of_mesh(const std::string& collada) const {
    write(folder_ / "arm.dae", collada);
    return refusal(file(lever(mesh("collision", "arm.dae"))));
  }

  Folder folder_;
};

std::vector<std::string> driven(const ModelFile& model) { return model.joint_names(); }

// Where the points of the only mesh are, in the frame of its body.
std::array<std::array<double, 2>, 3> extents_of(const ModelFile& file) {
  const mjModel& model = *file.mujoco();
  std::array<std::array<double, 2>, 3> extents{{{1e9, -1e9}, {1e9, -1e9}, {1e9, -1e9}}};
  for (int i = 0; i < model.mesh_vertnum[0]; ++i) {
    std::array<double, 3> point{};
    std::copy_n(model.mesh_vert + 3 * i, 3, point.begin());
    std::array<double, 3> moved{};
    mju_rotVecQuat(moved.data(), point.data(), model.mesh_quat);
    mju_addTo3(moved.data(), model.mesh_pos);
    for (std::size_t axis = 0; axis < 3; ++axis) {
      extents[axis][0] = std::min(extents[axis][0], moved[axis]);
      extents[axis][1] = std::max(extents[axis][1], moved[axis]);
    }
  }
  return extents;
}

TEST_F(Urdf, SaysVelocityAndSoftLimitsOfAJoint) {
  const ModelFile model(file(lever("")));
  EXPECT_EQ(model.joints()[0].max_velocity, 3.0);
  // Not beyond its stops, whatever the file says.
  EXPECT_EQ(model.joints()[0].soft_range, (std::array{-0.9, 2.0}));
  EXPECT_EQ(model.period(), std::chrono::milliseconds(1));
  const ModelFile slower(file(lever("", kMass, R"(<mujoco><option timestep="0.004"/></mujoco>)")));
  EXPECT_EQ(slower.period(), std::chrono::milliseconds(4));
}

TEST_F(Urdf, DrivesNoJointThatFollowsAnotherOne) {
  const std::string second = text_of(R"(<link name="tip"><inertial>)", kMass, R"(</inertial></link>
    <joint name="copy" type="revolute"><parent link="arm"/><child link="tip"/><axis xyz="0 1 0"/>
    <limit lower="-1" upper="1" effort="1" velocity="1"/><mimic joint="turn" multiplier="0.5"/></joint>)");
  ModelFileOptions options = file(lever("", kMass, second));
  const ModelFile model(options);
  EXPECT_THAT(driven(model), ElementsAre("turn"));
  EXPECT_FALSE(model.drives_all());
  options.joints = {"copy"};
  EXPECT_THAT(driven(ModelFile(options)), ElementsAre("copy"));
}

TEST_F(Urdf, DrivesNoFollowerOfMjcfEither) {
  const auto with = [&](const std::string& equalities) {
    write(folder_ / "pair.xml",
          R"(<mujoco><worldbody><body><joint name="a"/><geom size="0.1"/></body>
             <body><joint name="b"/><geom size="0.1"/></body></worldbody><equality>)" +
              equalities + "</equality></mujoco>");
    return ModelFileOptions{.path = folder_ / "pair.xml"};
  };
  const std::string one = R"(<joint joint1="b" joint2="a"/>)";
  EXPECT_THAT(driven(ModelFile(with(one))), ElementsAre("a"));
  EXPECT_THAT(driven(ModelFile(with(R"(<joint joint1="b" joint2="a" active="false"/>)"))),
              ElementsAre("a", "b"));
  EXPECT_THAT(driven(ModelFile(with(R"(<joint joint1="b"/>)"))), ElementsAre("a", "b"));
  EXPECT_THAT(refusal(with(one + R"(<joint joint1="a" joint2="b"/>)")),
              HasSubstr("each joint follows another one"));
}

TEST_F(Urdf, KeepsFixedLinksAndWhatOnlyLooks) {
  const std::string tool =
      R"(<link name="tool"><visual name="ball"><geometry><sphere radius="0.1"/></geometry></visual>
    <visual name="ball"><geometry><sphere radius="0.2"/></geometry></visual></link>
    <joint name="flange" type="fixed"><parent link="arm"/><child link="tool"/><origin xyz="0 0 1"/></joint>)";
  testing::internal::CaptureStderr();
  const ModelFile model(file(lever("", kMass, tool)));
  EXPECT_EQ(testing::internal::GetCapturedStderr(), "");  // MuJoCo would speak of the name.
  EXPECT_GT(mj_name2id(model.mujoco(), mjOBJ_BODY, "tool"), 0);
  ASSERT_EQ(model.mujoco()->ngeom, 2);
  EXPECT_EQ(model.mujoco()->geom_contype[0], 0);
}

TEST_F(Urdf, LetsTheShapesTouchThatWereAskedFor) {
  const std::string shapes =
      R"(<collision><geometry><box size="1 1 1"/></geometry></collision>
         <visual><geometry><sphere radius="0.1"/></geometry></visual>)";
  ModelFileOptions options = file(lever(shapes));
  const std::vector<std::pair<UrdfCollision, std::vector<int>>> cases{
      {UrdfCollision::kHull, {mjGEOM_BOX}},
      {UrdfCollision::kVisual, {mjGEOM_SPHERE}},
      {UrdfCollision::kNone, {}}};
  for (const auto& [collision, expected] : cases) {
    options.collision = collision;
    const ModelFile model(options);
    std::vector<int> touching;
    for (int i = 0; i < model.mujoco()->ngeom; ++i) {
      if (model.mujoco()->geom_contype[i] != 0) touching.push_back(model.mujoco()->geom_type[i]);
    }
    EXPECT_EQ(touching, expected);
  }
}

TEST_F(Urdf, LetsPartsPassThroughEachOtherThatOverlapAtTheBeginning) {
  // The first arm turns inside the base. The second one is beside the first, and overlaps it only
  // if it begins at 1 m.
  const std::string ball = R"(<collision><geometry><sphere radius="0.2"/></geometry></collision>)";
  const std::string text = replaced(
      lever(ball, kMass,
            text_of(R"(<link name="cart"><inertial>)", kMass, "</inertial>", ball, R"(</link>
      <joint name="slide" type="prismatic"><parent link="base"/><child link="cart"/>
      <origin xyz="-1 0 0"/><axis xyz="1 0 0"/><limit lower="-1" upper="1" effort="1" velocity="1"/></joint>)")),
      R"(<link name="base"/>)", R"(<link name="base">)" + ball + "</link>");
  const auto contacts_at = [](const ModelFile& model, double slide) {
    const SceneModel::Data data = model.make_data();
    model.reset(*data);
    model.set_position(1, slide, *data);
    mj_forward(model.mujoco(), data.get());
    return data->ncon;
  };
  ModelFileOptions options = file(text);
  const ModelFile apart(options);
  EXPECT_EQ(contacts_at(apart, 0.0), 0);
  EXPECT_EQ(contacts_at(apart, 0.9), 1);  // with the arm; never with the base it slides on
  options.initial_position = [](const ModelJoint& joint) {
    return joint.name == "slide" ? std::optional(0.9) : std::nullopt;
  };
  EXPECT_EQ(contacts_at(ModelFile(options), 0.9), 0);
}

TEST_F(Urdf, ABaseOfAnMjcfDoesNotThrowWhatTurnsOnIt) {
  const auto contacts = [&](const std::string& base) {
    write(folder_ / "hand.xml", "<mujoco><worldbody><geom type=\"plane\" size=\"1 1 1\"/>" + base +
                                    R"(<geom size="0.2" pos="0 0 1"/>
      <body name="thumb" pos="0 0 1"><joint/><geom size="0.1"/></body></body>
      <body name="foot"><joint type="slide" axis="0 0 1"/><geom size="0.1"/></body></worldbody></mujoco>)");
    const ModelFile model({.path = folder_ / "hand.xml"});
    const SceneModel::Data data = model.make_data();
    mj_forward(model.mujoco(), data.get());
    return data->ncon;
  };
  // What stands on a floor touches it as before.
  EXPECT_EQ(contacts(R"(<body name="palm">)"), 1);
  EXPECT_EQ(contacts("<body>"), 1);
}

TEST_F(Urdf, RepairsInertiasIfThatIsAskedFor) {
  struct Case {
    std::string inertial;
    std::string problem;
  };
  const auto inertia = [](const std::string& values) {
    return text_of(R"(<mass value="2"/><inertia )", values, R"( ixy="0" ixz="0" iyz="0"/>)");
  };
  const std::vector<Case> cases{
      {inertia(R"(ixx="0.1" iyy="0.1" izz="0.5")"),
       "lever.urdf: body 'arm' has the moments of inertia 0.1, 0.1 and 0.5 kgm^2"},
      {inertia(R"(ixx="0.1" iyy="-0.1" izz="0.1")"), "-0.1, 0.1 and 0.1 kgm^2"},
      {inertia(R"(ixx="0" iyy="0" izz="0")"), "body 'arm' has the moments of inertia 0, 0 and 0"},
      {R"(<mass value="0"/><inertia ixx="0" iyy="0" izz="0" ixy="0" ixz="0" iyz="0"/>)",
       "body 'arm' moves and has no mass"},
      {R"(<mass value="2"/>)", "lever.urdf:1: link 'arm' has a mass, but no <inertia>"},
      {R"(<mass value="2"/><inertia ixx="0.1" iyy="0.1" izz="0.3" ixy="0.1" ixz="0.02" iyz="0"/>)",
       "body 'arm' has the moments of inertia"},
  };
  for (const auto& [inertial, problem] : cases) {
    ModelFileOptions options = file(lever("", inertial));
    EXPECT_THAT(refusal(options), AllOf(HasSubstr(problem), HasSubstr("--repair-inertia")));
    options.repair_inertia = true;
    const ModelFile model(options);
    const double* const moments = model.mujoco()->body_inertia + 3 * (model.mujoco()->nbody - 1);
    EXPECT_GT(std::min({moments[0], moments[1], moments[2]}), 0.0) << problem;
    EXPECT_LE(2.0 * std::max({moments[0], moments[1], moments[2]}),
              moments[0] + moments[1] + moments[2]);
    EXPECT_EQ(model.repairs().size(), problem.find("<inertia>") == std::string::npos ? 1U : 0U);
  }
  // No moment becomes smaller, and what is possible stays.
  ModelFileOptions options = file(lever("", inertia(R"(ixx="0.1" iyy="0.1" izz="0.5")")));
  options.repair_inertia = true;
  const ModelFile repaired(options);
  const double* const last = repaired.mujoco()->body_inertia + 3 * (repaired.mujoco()->nbody - 1);
  std::vector<double> moments(last, last + 3);
  std::ranges::sort(moments);
  EXPECT_NEAR(moments[0], 0.1, 1e-9);
  EXPECT_NEAR(moments[1], 0.4, 1e-3);
  EXPECT_NEAR(moments[2], 0.5, 1e-9);
  options = file(lever(""));
  options.repair_inertia = true;
  EXPECT_THAT(ModelFile(options).repairs(), ElementsAre());
}

TEST_F(Urdf, LeavesToMuJoCoWhatTheFileAsksItToRepair) {
  write(folder_ / "flat.xml",
        R"(<mujoco><compiler balanceinertia="true" boundmass="0.1" boundinertia="0.01"/>
    <worldbody><body><joint name="a"/><inertial pos="0 0 0" mass="1" diaginertia="1 1 5"/></body>
    <body><joint name="b"/></body></worldbody></mujoco>)");
  EXPECT_EQ(ModelFile({.path = folder_ / "flat.xml"}).repairs().size(), 0U);
}

TEST_F(Urdf, ReadsMeshesOfCollada) {
  write(folder_ / "arm.dae", kCollada);
  const ModelFile model(file(lever(mesh("visual", "arm.dae") + mesh("collision", "arm.dae"))));
  ASSERT_GE(model.mujoco()->nmesh, 1);
  // Two triangles, and two of each square. The point that no face has is not in it.
  EXPECT_EQ(model.mujoco()->mesh_facenum[0], 6);
  const auto extents = extents_of(model);
  EXPECT_NEAR(extents[0][0], 0.0, 1e-6);
  EXPECT_NEAR(extents[0][1], 0.2, 1e-6);
  EXPECT_NEAR(extents[1][1], 0.2, 1e-6);
  // RViz does not turn it upright either.
  EXPECT_NEAR(extents[2][0], 1.0, 1e-6);
  EXPECT_NEAR(extents[2][1], 1.2, 1e-6);
  const float* const colour = model.mujoco()->geom_rgba;
  EXPECT_NEAR(colour[0], 2.0 / 6, 1e-6);
  EXPECT_NEAR(colour[2], 4.0 / 6, 1e-6);
  // Logs embed it.
  write(folder_ / "whole.xml", model.mjcf());
  EXPECT_EQ(ModelFile({.path = folder_ / "whole.xml"}).mujoco()->nmesh, model.mujoco()->nmesh);
}

TEST_F(Urdf, fault_77_MeshesOfColladaAreBounded) {
  const std::string text = kCollada;
  const std::vector<std::pair<std::string, std::string>> cases{
      {replaced(text, "0 2 5 1 1 5 2 3", "0 2 5 1 1 5 2 6"), "a corner is no point"},
      {replaced(text, "0 2 5 1 1 5 2 3", "0 2 5 1 1 5 2"), "corners of a face are missing"},
      {replaced(text, "<vcount>4 4", "<vcount>4 4000000000"), "corners of a face are missing"},
      {replaced(text, "0 0 1 0 3 0", "0 0 1 0"), "corners of a face are missing"},
      {replaced(text, "0 2 5 1 1 5 2 3", "0 2 5 1 1 5 2 4294967296"),
       "<p> has '4294967296' in its numbers"},
      {replaced(text, "url=\"#g\"", "url=\"#h\""), "refers to '#h', which is not in this file"},
      {replaced(text, "url=\"#g\"", "url=\"g\""), "refers to 'g'"},
      {replaced(text, "0.01", "nan"), "its unit is no length"},
      {replaced(text, "2 2 2", "2 2"), "<scale> must have 3 numbers"},
      {replaced(text, "2 2 2", "inf 2 2"), "<scale> must have 3 numbers"},
      {replaced(text, "2 2 2", "1e300 2 2"), "a point is too far away"},
      {replaced(text, "<float_array id=\"a\" count=\"18\">0", "<float_array>nan"),
       "a point is too far away"},
      {replaced(text, "stride=\"3\"", "stride=\"2\""), "fewer than three numbers"},
      {replaced(text, "stride=\"3\"", "stride=\"99999\""), "'stride' is no small number"},
      {replaced(text, "offset=\"1\"", "offset=\"-1\""), "'offset' is no small number"},
      {replaced(text, "<COLLADA", "<Collada"), "</COLLADA> ends what does not begin"},
      {"<a/>", "it is no file of COLLADA"},
      {"<COLLADA/>", "arm.dae: it has no triangles"},
      {replaced(text, "<node><translate>", "<node id=\"n\"><instance_node url=\"#n\"/><translate>"),
       "nodes are inside each other more than 100 deep"},
      {replaced(text, "<instance_geometry", "<instance_controller url=\"#g\"/><instance_geometry"),
       "a skin that bends cannot be a mesh"},
  };
  for (const auto& [collada, problem] : cases) {
    EXPECT_THAT(refusal_of_mesh(collada), AllOf(HasSubstr("arm.dae"), HasSubstr(problem)))
        << problem;
  }
}

TEST_F(Urdf, fault_77_MeshesOfColladaCannotMultiplyThemselves) {
  std::string nodes = R"(<node id="n0"><instance_geometry url="#g"/></node>)";
  for (int i = 1; i < 60; ++i) {
    const std::string last = text_of(R"(<instance_node url="#n)", i - 1, R"("/>)");
    nodes += text_of(R"(<node id="n)", i, R"(">)", last, last, "</node>");
  }
  EXPECT_THAT(refusal_of_mesh(replaced(kCollada, "<node><translate>", nodes + "<node><translate>")),
              HasSubstr("arm.dae"));
  // A long list of numbers, which is read for each of many parts.
  std::string many;
  for (int i = 0; i < 20'000; ++i) many += R"(<instance_geometry url="#g"/>)";
  std::string zeros;
  for (int i = 0; i < 100'000; ++i) zeros += "0 ";
  EXPECT_THAT(refusal_of_mesh(replaced(replaced(kCollada, "1 1 5 2 3", "1 1 5 2 3 " + zeros),
                                       "<instance_geometry", many + "<instance_geometry")),
              HasSubstr("it refers to its parts too often"));
}

TEST_F(Urdf, fault_77_RandomMeshesOfColladaLoadOrAreAnErrorWithASentence) {
  std::mt19937 random(7);
  const std::string_view letters = "<>/\"#0123456789.-e \n=abcdpv";
  for (int i = 0; i < 3000; ++i) {
    std::string text = kCollada;
    for (int change = 0; change <= i % 4; ++change) {
      const std::size_t at = random() % text.size();
      if (random() % 3 == 0) {
        text.erase(at, random() % 40);
      } else if (random() % 3 == 0) {
        text.insert(at, text.substr(random() % text.size(), random() % 200));
      } else {
        text[at] = letters[random() % letters.size()];
      }
    }
    try {
      EXPECT_THAT(detail::convert_collada(text, "a.dae").obj, testing::StartsWith("v "));
    } catch (const InvalidArgument& error) {
      EXPECT_THAT(error.what(), testing::StartsWith("a.dae:"));
    }
  }
}

TEST_F(Urdf, ReadsStlFilesThatAreTexts) {
  const std::string facet = "facet normal 0 0 0\n outer loop\n vertex ";
  const std::string end = "\n endloop\n endfacet\n";
  const std::string solid = "solid the vertex of it\n" + facet +
                            "0 0 0\n vertex 0 1 0\n vertex 1 0 0" + end + facet +
                            "0 0 0\n vertex 1 0 0\n vertex 0 0 +1.0e0" + end + facet +
                            "0 0 0\n vertex 0 0 1\n vertex 0 1 0" + end + facet +
                            "1 0 0\n vertex 0 1 0\n vertex 0 0 1" + end + "endsolid\n";
  write(folder_ / "arm.stl", solid);
  const ModelFile model(file(lever(mesh("collision", "arm.stl"))));
  EXPECT_EQ(model.mujoco()->mesh_facenum[0], 4);
  EXPECT_NEAR(extents_of(model)[2][1], 1.0, 1e-6);
  write(folder_ / "arm.stl", "solid\nvertex 1 2\n");
  EXPECT_THAT(refusal(file(lever(mesh("collision", "arm.stl")))),
              HasSubstr("a vertex of it has fewer than three numbers"));
}

TEST_F(Urdf, NamesTheRemedyForATemplateOfXacro) {
  EXPECT_THAT(refusal(file(lever("", kMass, "<xacro:include filename=\"a\"/>"))),
              AllOf(HasSubstr("lever.urdf:4: <xacro:include>"), HasSubstr("xacro ")));
}

TEST_F(Urdf, RefusesNamesThatNoConfigurationCanHave) {
  for (const char* const name : {"a&#10;b", " ", "&#9;"}) {
    EXPECT_THAT(refusal(file(replaced(lever(""), "name=\"turn\"", text_of("name=\"", name, "\"")))),
                AllOf(HasSubstr("lever.urdf: a joint of body 'arm' cannot be called '"),
                      HasSubstr("rename it")));
  }
  const std::string twice = text_of(R"(<link name="tip"><inertial>)", kMass, R"(</inertial></link>
    <joint name="turn" type="continuous"><parent link="arm"/><child link="tip"/></joint>)");
  EXPECT_THAT(refusal(file(lever("", kMass, twice))),
              HasSubstr("lever.urdf:5: there is another joint 'turn'; rename one of them"));
}

TEST_F(Urdf, AnAttachedUrdfLeavesTheShapesOfTheModelAlone) {
  write(folder_ / "lever.urdf", lever(""));
  write(folder_ / "table.xml", R"(<mujoco><asset><model name="lever" file="lever.urdf"/></asset>
    <worldbody><geom name="table" type="box" size="1 1 1" contype="2"/>
    <body><joint name="a"/><geom size="0.1"/></body></worldbody></mujoco>)");
  const ModelFile model({.path = folder_ / "table.xml"});
  EXPECT_EQ(model.mujoco()->geom_contype[0], 2);
}

}  // namespace
}  // namespace trifinger::test
