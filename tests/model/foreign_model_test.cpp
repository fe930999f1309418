// SPDX-License-Identifier: BSD-3-Clause
// Untrusted models: what they ask for, which files they name, and what MuJoCo may not do.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <mujoco/mujoco.h>
#include <sys/stat.h>

#include <cstring>
#include <filesystem>
#include <string>
#include <utility>
#include <vector>

#include "base/text_of.hpp"
#include "model/file_robots.hpp"
#include "model/model_text.hpp"
#include "support/folder.hpp"
#include "support/message_of.hpp"
#include "trifinger/base/error.hpp"
#include "trifinger/model/model_file.hpp"

namespace trifinger::test {
namespace {

using testing::AllOf;
using testing::HasSubstr;

class ForeignModels : public testing::Test {
 protected:
  [[nodiscard]] std::filesystem::path file(const std::string& text,
                                           const std::string& name = "arm.xml") const {
    write(folder_ / name, text);
    return folder_ / name;
  }
  [[nodiscard]] std::string refusal(const std::string& text) const {
    const ModelFileOptions options{.path = file(text)};
    return message_of<InvalidArgument>([&] { return ModelFile(options); });
  }

  Folder folder_;
};

// A joint that can be driven, and whatever `more` and `inside` say.
std::string joint_and(const std::string& more, const std::string& inside = "") {
  return "<mujoco>\n" + more + R"(<worldbody><body name="b"><joint name="a"/><geom size="0.1"/>)" +
         inside + "</body></worldbody></mujoco>";
}

std::string repeated(const std::string& text, int times) {
  std::string all;
  for (int i = 0; i < times; ++i) all += text;
  return all;
}

TEST_F(ForeignModels, fault_77_AskForNumbersThatAreJudgedBeforeMuJoCoObeysThem) {
  const std::vector<std::pair<std::string, std::string>> asked{
      {R"(<size nuser_body="2000000000"/>)",
       "'nuser_body' of <size> is 2e+09, may be at most 1000"},
      {R"(<size nkey="1e9"/>)", "'nkey' of <size> is 1e+09, may be at most 10000"},
      {R"(<size nuserdata="0x7fffffff"/>)", "'nuserdata'"},
      {R"(<option iterations="2000000000" tolerance="0"/>)", "'iterations' of <option>"},
      {R"(<asset><texture name="t" type="2d" builtin="flat" width="100000" height="100000"/></asset>)",
       "'width' of <texture> is 100000, may be at most 16384"},
      {R"(<asset><hfield name="h" nrow="16000" ncol="16000" size="1 1 1 1"/></asset>)",
       "bytes of memory"},
      {R"(<asset><mesh name="m" builtin="supersphere" params="100000 1 1"/></asset>)",
       "'params' of <mesh>"},
      {R"(<custom><numeric name="n" size="2000000000" data="1"/></custom>)", "'size' of <numeric>"},
      {R"(<compiler><lengthrange mode="all" inttotal="1e12"/></compiler>)", "1e+14 steps"},
      {R"(<visual><quality shadowsize="1000000"/></visual>)", "'shadowsize' of <quality>"},
      {R"(<sensor><user dim="2000000000"/></sensor>)", "'dim' of <user>"},
  };
  for (const auto& [text, problem] : asked) {
    // The element that asks is in the second line.
    EXPECT_THAT(refusal(joint_and(text)), HasSubstr(problem)) << text;
    if (problem.starts_with('\'')) {
      EXPECT_THAT(refusal(joint_and(text)), HasSubstr("arm.xml:2: ")) << text;
    }
  }
}

TEST_F(ForeignModels, fault_77_CannotMultiplyThemselves) {
  const std::string copies = "copies of elements";
  EXPECT_THAT(
      refusal(joint_and("", R"(<replicate count="1000000000"><geom size="1"/></replicate>)")),
      HasSubstr("'count' of <replicate> is 1e+09, may be at most 10000"));
  EXPECT_THAT(refusal(joint_and("", repeated(R"(<replicate count="100">)", 6) +
                                        R"(<geom size="1"/>)" + repeated("</replicate>", 6))),
              HasSubstr(copies));
  // Each body is twice the one before.
  std::string doubled = R"(<body name="b0"><geom size="1"/></body>)";
  for (int i = 1; i < 40; ++i) {
    const std::string last = detail::text_of(R"(<attach body="b)", i - 1, R"(" prefix=")");
    doubled +=
        detail::text_of(R"(<body name="b)", i, R"(">)", last, R"(x"/>)", last, R"(y"/></body>)");
  }
  EXPECT_THAT(refusal(joint_and("", doubled)), HasSubstr(copies));
  EXPECT_THAT(refusal(joint_and("", R"(<body name="c"><attach body="c" prefix="x"/></body>)")),
              HasSubstr("'c' is attached to itself"));
  // Each file attaches the one before twice.
  write(folder_ / "m0.xml", joint_and(""));
  for (int i = 1; i < 15; ++i) {
    const std::string attached = R"(<attach model="m" body="b" prefix=")";
    write(
        folder_ / detail::text_of("m", i, ".xml"),
        joint_and(detail::text_of(R"(<asset><model name="m" file="m)", i - 1, R"(.xml"/></asset>)"),
                  detail::text_of(attached, R"(x"/>)", attached, R"(y"/>)")));
  }
  EXPECT_THAT(refusal(joint_and(R"(<asset><model name="m" file="m14.xml"/></asset>)",
                                R"(<attach model="m" body="b" prefix="z"/>)")),
              HasSubstr(copies));
  EXPECT_THAT(refusal(joint_and(R"(<asset><model name="m" file="arm.xml"/></asset>)")),
              HasSubstr("the model attaches itself"));
  EXPECT_THAT(
      refusal(joint_and("", R"(<flexcomp name="f" type="grid" count="900 900 900" mass="1"/>)")),
      HasSubstr(copies));
  EXPECT_THAT(refusal(joint_and("", repeated("<body>", 600) + repeated("</body>", 600))),
              HasSubstr("inside each other more than 500 deep"));
  EXPECT_THAT(refusal(joint_and("", repeated(R"(<geom size="1"/>)", 60'000))),
              HasSubstr("more elements than are allowed"));
  EXPECT_THAT(refusal(joint_and("", repeated(R"(<body><joint/><geom size="1"/></body>)", 5'000))),
              HasSubstr("degrees of freedom"));
  // One long list of numbers gives every other geom a list of the same length.
  EXPECT_THAT(refusal(joint_and("", "<geom size=\"1\" user=\"" + repeated("1 ", 100'000) + "\"/>" +
                                        repeated(R"(<geom size="1"/>)", 10'000))),
              HasSubstr("bytes of memory"));
}

TEST_F(ForeignModels, fault_77_WaitForNoFifo) {
  ASSERT_EQ(::mkfifo((folder_ / "fifo.xml").c_str(), 0600), 0);
  ASSERT_EQ(::mkfifo((folder_ / "fifo.stl").c_str(), 0600), 0);
  ASSERT_EQ(::mkfifo((folder_ / "fifo.png").c_str(), 0600), 0);
  ASSERT_EQ(::mkfifo((folder_ / "fifo.skn").c_str(), 0600), 0);
  const std::string fifo = "which is a FIFO";
  EXPECT_THAT(
      message_of<InvalidArgument>([&] { return ModelFile({.path = folder_ / "fifo.xml"}); }),
      HasSubstr(fifo));
  const std::vector<std::string> named{
      R"(<include file="fifo.xml"/>)",
      R"(<asset><model name="m" file="fifo.xml"/></asset>)",
      R"(<asset><mesh name="m" file="fifo.stl"/></asset>)",
      R"(<asset><hfield name="h" file="fifo.png" size="1 1 1 1"/></asset>)",
      R"(<asset><texture name="t" type="2d" file="fifo.png"/></asset>)",
      R"(<asset><texture name="t" type="cube" fileright="fifo.png"/></asset>)",
      R"(<asset><skin name="s" file="fifo.skn"/></asset>)",
  };
  for (const std::string& text : named)
    EXPECT_THAT(refusal(joint_and(text)), HasSubstr(fifo)) << text;
  EXPECT_THAT(
      refusal(joint_and("", R"(<flexcomp name="f" type="mesh" file="fifo.stl" mass="1"/>)")),
      HasSubstr(fifo));
  EXPECT_THAT(refusal(R"(<robot name="r"><link name="l"><collision><geometry>
                          <mesh filename="fifo.stl"/></geometry></collision></link></robot>)"),
              HasSubstr(fifo));
}

TEST_F(ForeignModels, fault_77_OpenNothingBehindOurBack) {
  write(folder_ / "ball.obj",
        "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n");
  write(folder_ / "inner.xml", R"(<mujoco><geom type="mesh" mesh="ball"/></mujoco>)");
  const std::string text =
      joint_and(R"(<asset><mesh file="ball.obj"/><mesh name="same" file="./ball.obj"/></asset>)",
                R"(<include file="inner.xml"/>)");
  const ModelFile model({.path = file(text)});
  EXPECT_EQ(model.mujoco()->nmesh, 2);
  // With the same text in another folder, none of the first one's files is used.
  std::filesystem::create_directories(folder_ / "other");
  write(folder_ / "other/ball.obj",
        "v 0 0 0\nv 2 0 0\nv 0 2 0\nv 0 0 2\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n");
  write(folder_ / "other/inner.xml", R"(<mujoco><geom type="mesh" mesh="ball"/></mujoco>)");
  const ModelFile other({.path = file(text, "other/arm.xml")});
  EXPECT_GT(other.mujoco()->geom_rbound[1], 1.5 * model.mujoco()->geom_rbound[1]);
  // A file that changes is read again.
  std::filesystem::copy_file(folder_ / "other/ball.obj", folder_ / "ball.obj",
                             std::filesystem::copy_options::overwrite_existing);
  const ModelFile changed({.path = folder_ / "arm.xml"});
  EXPECT_EQ(changed.mujoco()->geom_rbound[1], other.mujoco()->geom_rbound[1]);
}

std::string binary(std::initializer_list<int> numbers, std::size_t more = 0) {
  std::string bytes(numbers.size() * sizeof(int) + more, '\0');
  std::memcpy(bytes.data(), std::data(numbers), numbers.size() * sizeof(int));
  return bytes;
}

TEST_F(ForeignModels, fault_77_HaveFilesWhoseFirstNumbersAreNotBelieved) {
  // 65536 * 65536 * 4 is 0 in 32 bits.
  write(folder_ / "huge.hf", binary({65536, 65536}));
  EXPECT_THAT(
      refusal(joint_and(R"(<asset><hfield name="h" file="huge.hf" size="1 1 1 1"/></asset>)")),
      HasSubstr("it has 8 bytes, but its first numbers say"));
  write(folder_ / "huge.msh", binary({1 << 30, 0, 0, 0}, 100));
  EXPECT_THAT(refusal(joint_and(R"(<asset><mesh name="m" file="huge.msh"/></asset>)")),
              HasSubstr("its first numbers"));
  write(folder_ / "huge.skn", binary({-1, 0, 0, 0}, 100));
  EXPECT_THAT(refusal(joint_and(R"(<asset><skin name="m" file="huge.skn"/></asset>)")),
              HasSubstr("its first numbers"));
  // A picture of 60000 by 60000 pixels in a few bytes.
  const std::string png = std::string("\x89PNG\r\n\x1a\n", 8) + std::string("\0\0\0\rIHDR", 8) +
                          std::string("\0\0\xEA\x60\0\0\xEA\x60\x08\x02\0\0\0", 13);
  write(folder_ / "huge.png", png);
  EXPECT_THAT(refusal(joint_and(R"(<asset><texture name="t" type="2d" file="huge.png"/></asset>)")),
              HasSubstr("bytes of memory"));
}

TEST_F(ForeignModels, fault_77_NestNoDeeperByAttaching) {
  const auto body = [](int number, int attached) {
    return detail::text_of(R"(<body name="b)", number, R"("><attach body="b)", attached,
                           R"(" prefix="x"/></body>)");
  };
  std::string down;
  std::string up = R"(<body name="b0"/>)";
  for (int i = 0; i < 16'000; ++i) down += body(i, i + 1);
  for (int i = 1; i < 16'000; ++i) up += body(i, i - 1);
  EXPECT_THAT(refusal(joint_and("", down + R"(<body name="b16000"/>)")), HasSubstr("'b1'"));
  EXPECT_THAT(refusal(joint_and("", up)), HasSubstr("copies of elements"));
  // Half of the levels are in what is attached.
  const std::string deep =
      R"(<body name="d">)" + repeated("<body>", 300) + repeated("</body>", 301);
  EXPECT_THAT(
      refusal(joint_and("", deep + repeated("<body>", 300) + R"(<attach body="d" prefix="x"/>)" +
                                repeated("</body>", 300))),
      HasSubstr("inside each other more than 500 deep, with what is attached"));
}

TEST_F(ForeignModels, fault_77_HaveNoMoreAttributesThanMuJoCoKnows) {
  std::string many = "<geom";
  for (int i = 0; i < 40'000; ++i) many += " a" + std::to_string(i) + "=\"\"";
  EXPECT_THAT(refusal(joint_and("", many + "/>")),
              HasSubstr("<geom> has more than 100 attributes"));
}

TEST_F(ForeignModels, fault_77_HideNoNumbersInDefaults) {
  const std::string free_joints = repeated(R"(<body><joint/><geom size="1"/></body>)", 3'900);
  EXPECT_THAT(refusal(joint_and(R"(<default><joint type="free"/></default>)", free_joints)),
              HasSubstr("degrees of freedom"));
  EXPECT_THAT(refusal(joint_and(R"(<default><default class="x"><joint type="ball"/></default>)"
                                "</default>",
                                free_joints)),
              HasSubstr("degrees of freedom"));
  EXPECT_THAT(refusal(joint_and(R"(<default><motor nsample="100000"/></default><actuator>)" +
                                repeated(R"(<position joint="a"/>)", 40'000) + "</actuator>")),
              HasSubstr("bytes of memory"));
  EXPECT_THAT(refusal(joint_and(
                  R"(<default><texture type="2d" width="5000" height="5000"/></default><asset>)" +
                  repeated(R"(<texture type="2d" builtin="flat"/>)", 30) + "</asset>")),
              HasSubstr("bytes of memory"));
  // An element's own values count, not those of the defaults.
  const ModelFile model(
      {.path = file(
           joint_and(R"(<default><joint type="free"/></default>)",
                     repeated(R"(<body><joint type="hinge"/><geom size="1"/></body>)", 700)))});
  EXPECT_EQ(model.mujoco()->njnt, 701);
}

TEST_F(ForeignModels, fault_77_CountThePointsOfFlexibleThings) {
  const std::string many = "degrees of freedom";
  const std::string points = repeated("1 2 3 ", 1'400);
  EXPECT_THAT(refusal(joint_and("", R"(<flexcomp name="f" type="direct" point=")" + points +
                                        R"(" element="0 1" dim="1"/>)")),
              HasSubstr(many));
  EXPECT_THAT(refusal(joint_and("", repeated(R"(<flexcomp type="grid"/>)", 2))), HasSubstr(many));
  EXPECT_THAT(refusal(joint_and("", R"(<flexcomp name="f" type="grid" count="10 10 10"
                                         dof="quadratic" cellcount="10 10 10"/>)")),
              HasSubstr(many));
  write(folder_ / "f.obj", repeated("v 1 2 3\n", 1'400));
  EXPECT_THAT(refusal(joint_and("", R"(<flexcomp name="f" type="mesh" file="f.obj" dim="2"/>)")),
              HasSubstr(many));
  write(folder_ / "f.msh", std::string(100'000, ' '));
  EXPECT_THAT(refusal(joint_and("", R"(<flexcomp name="f" type="gmsh" file="f.msh" dim="2"/>)")),
              HasSubstr("copies of elements"));
  // What is rigid, or moves by a few corners only, is small.
  for (const std::string more : {R"(rigid="true")", R"(dof="trilinear")"}) {
    const ModelFile model(
        {.path = file(joint_and(R"(<worldbody><flexcomp name="f" type="grid" count="14 14 14"
                                   dim="3" mass="1" )" +
                                more + "/></worldbody>"))});
    EXPECT_EQ(model.mujoco()->nflex, 1);
  }
}

TEST_F(ForeignModels, fault_77_AttachOnlyWhatCanBeCounted) {
  write(folder_ / "big.xml", R"(<mujoco model="bb"><worldbody><body name="b">)" +
                                 repeated(R"(<geom size="1"/>)", 6'000) +
                                 "</body></worldbody></mujoco>");
  const std::string twice = R"(<attach model="bb" body="b" prefix="x"/>
                               <attach model="bb" body="b" prefix="y"/>)";
  const std::string nameless = R"(<asset><model file="big.xml"/></asset>)";
  EXPECT_THAT(refusal(joint_and(nameless, twice)), HasSubstr("copies of elements"));
  EXPECT_THAT(refusal(joint_and("", "\n" + twice)),
              HasSubstr("arm.xml:3: <attach> names the model 'bb', which no <model> has"));
  // Only some bodies have names in the text, and MuJoCo does not look further down.
  for (const std::string name : {"world", "xb0", "later", "copy"}) {
    EXPECT_THAT(
        refusal(joint_and("", R"(<body name="b0"/><body><attach body="b0" prefix="x"/></body>
                                         <replicate count="2"><body name="copy"/></replicate>
                                         <body><attach body=")" +
                                  name + R"(" prefix="y"/></body><body name="later"/>)")),
        HasSubstr("<attach> names the body '" + name + "', which is not above it in this file"));
  }
  // A frame and a body may have the same name.
  EXPECT_THAT(refusal(joint_and("", R"(<body name="x">)" + repeated(R"(<geom size="1"/>)", 6'000) +
                                        R"(</body><body><attach body="x" prefix="y"/></body>
                                        <body><attach body="x" prefix="z"/></body>
                                        <frame name="x"/>)")),
              HasSubstr("copies of elements"));
  // Models without names are known by those that they give themselves, if they do.
  write(folder_ / "nobody.xml", joint_and(""));
  write(folder_ / "link.urdf", R"(<robot name="rr"><link name="b"/></robot>)");
  const ModelFile model({.path = file(joint_and(
                             R"(<asset><model file="big.xml"/><model file="nobody.xml"/>
                                <model file="link.urdf"/></asset>)",
                             R"(<attach model="bb" body="b" prefix="x"/>
                                <attach model="MuJoCo Model" body="b" prefix="y"/>
                                <attach model="rr" body="b" prefix="z"/>)"))});
  EXPECT_EQ(model.mujoco()->ngeom, 6'002);
}

TEST_F(ForeignModels, fault_77_HaveFilesOfGmshThatAreAsLargeAsTheySay) {
  const auto with = [](const std::string& format, const std::string& nodes,
                       const std::string& elements) {
    return "$MeshFormat\n" + format + "\n$EndMeshFormat\n$Nodes\n" + nodes +
           "\n$EndNodes\n$Elements\n" + elements + "\n$EndElements\n";
  };
  const std::string new_nodes = "\n3 1 0 4\n1\n2\n3\n4\n0 0 0\n1 0 0\n0 1 0\n0 0 1";
  const std::string new_elements = "\n3 1 4 1\n1 1 2 3 4";
  const std::string old_nodes = "\n1 0 0 0\n2 1 0 0\n3 0 1 0\n4 0 0 1";
  const std::string old_elements = "\n1 4 0 1 2 3 4";
  const std::string flexible = joint_and(R"(<worldbody><flexcomp name="f" type="gmsh" file="f.msh"
                                            dim="3" mass="1"/></worldbody>)");
  for (const std::string& honest :
       {with("4.1 0 8", "1 4 1 4" + new_nodes, "1 1 1 1" + new_elements),
        with("2.2 0 8", "4" + old_nodes, "1" + old_elements)}) {
    write(folder_ / "f.msh", honest);
    EXPECT_EQ(ModelFile({.path = file(flexible)}).mujoco()->nflexvert, 4);
  }
  std::string binary_nodes(32, '\0');
  binary_nodes[12] = '\1';  // 2^32 of them
  for (const std::string& lie :
       {with("4.1 0 8", "1 100000000 1 100000000" + new_nodes, "1 1 1 1" + new_elements),
        with("4.1 0 8", "1 4 1 4" + new_nodes, "1 100000000 1 1" + new_elements),
        with("2.2 0 8", "100000000" + old_nodes, "1" + old_elements),
        with("2.2 0 8", "-1" + old_nodes, "1" + old_elements), with("4.1 1 8", binary_nodes, ""),
        "\n" + with("2.2 0 8", "100000000" + old_nodes, "1" + old_elements)}) {
    write(folder_ / "f.msh", lie);
    EXPECT_THAT(refusal(flexible), HasSubstr("but its first numbers say")) << lie;
  }
}

TEST_F(ForeignModels, fault_77_AreXmlOrAnErrorWithALine) {
  const std::vector<std::pair<std::string, std::string>> texts{
      {"", "it has no element"},
      {"junk <mujoco/>", "it does not begin with an element"},
      {"<mujoco>\n<worldbody>\n</mujoco>", "arm.xml:3: it is no XML: </mujoco> ends"},
      {"<mujoco a=1/>", "the value of 'a' has no quotes"},
      {"<mujoco a='1' a='2'/>", "two attributes 'a'"},
      {"<mujoco", "a name is missing"},
      {"<mujoco><!-- ", "the end of a comment is missing"},
      {std::string("<mujoco model='\0'/>", 19), "a byte 0"},
      {"\xFF\xFE<\0m\0", "it does not begin with an element"},
  };
  for (const auto& [text, problem] : texts) EXPECT_THAT(refusal(text), HasSubstr(problem)) << text;
  // What a document type declares cannot grow, and what MuJoCo's own reader accepts is accepted.
  const std::string odd =
      R"(<?xml version="1.0"?><!DOCTYPE mujoco [<!ENTITY a "bb">]><!-- -- -->)" +
      joint_and("<![CDATA[ <x> ]]>some text");
  EXPECT_EQ(ModelFile({.path = file(odd)}).joints().size(), 1U);
  EXPECT_EQ(ModelFile({.path = file("\xEF\xBB\xBF" + joint_and(""))}).joints().size(), 1U);
  const std::string named =
      R"(<mujoco model="a&#65;&lt;&quot;&amp;&bogus; &#10;b"><worldbody><body><joint name="ä"/>
                               <geom size=".1"/></body></worldbody></mujoco>)";
  const ModelFile model({.path = file(named)});
  EXPECT_EQ(model.name(), "aA<\"&&bogus; \nb");
  EXPECT_EQ(model.joints()[0].name, "ä");
}

TEST_F(ForeignModels, MayIncludeAndAttachAsMuJoCoAllows) {
  std::filesystem::create_directories(folder_ / "parts/meshes");
  write(folder_ / "parts/meshes/a.obj",
        "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n");
  // An included file includes another one from its own folder; meshes count from the main file.
  write(folder_ / "parts/outer.xml", R"(<mujoco><include file="inner.xml"/></mujoco>)");
  write(folder_ / "parts/inner.xml",
        R"(<mujoco><asset><mesh file="meshes/a.obj"/></asset></mujoco>)");
  write(folder_ / "parts/hand.xml",
        joint_and(R"(<compiler meshdir="meshes"/><asset><mesh name="a" file="a.obj"/></asset>)",
                  R"(<geom type="mesh" mesh="a"/>)"));
  const ModelFile model(
      {.path = file(joint_and(
           R"(<compiler assetdir="none" meshdir="parts"/><include file="parts/outer.xml"/>
         <asset><model name="hand" file="parts/hand.xml"/></asset>)",
           R"(<geom type="mesh" mesh="a"/><replicate count="3"><geom size="0.1"/></replicate>
         <attach model="hand" body="b" prefix="h"/>)"))});
  EXPECT_EQ(model.joints().size(), 2U);
  EXPECT_EQ(model.mujoco()->nmesh, 2);
  EXPECT_EQ(model.mujoco()->ngeom, 7);
  EXPECT_THAT(
      refusal(joint_and(
          R"(<include file="parts/outer.xml"/><include file="parts/../parts/outer.xml"/>)")),
      HasSubstr("is included already"));
  EXPECT_THAT(refusal(joint_and("", R"(<geom size="x"/>)")), HasSubstr("line 2"));
}

TEST_F(ForeignModels, fault_77_WriteNoFileIntoTheWorkingFolder) {
  const std::filesystem::path before = std::filesystem::current_path();
  std::filesystem::current_path(folder_.path());
  static_cast<void>(ModelFile({.path = file(joint_and("", R"(<camera fovy="nan"/>)"))}));
  mju_warning("something");
  EXPECT_THROW(mju_error("something"), Error);
  std::filesystem::current_path(before);
  EXPECT_FALSE(std::filesystem::exists(folder_ / "MUJOCO_LOG.TXT"));
}

TEST(CheckedModelText, fault_77_NamesNoFilesOfTheMachineThatReadsIt) {
  const auto refusal = [](const std::string& text) {
    return message_of<InvalidArgument>([&] { return checked_model_text(text); });
  };
  for (const std::string text :
       {R"(<include file="/etc/passwd"/>)", R"(<asset><mesh name="m" file="/tmp/x.stl"/></asset>)",
        R"(<asset><texture name="m" type="cube" fileback="x.png"/></asset>)",
        R"(<asset><model name="m" file="x.xml"/></asset>)"}) {
    EXPECT_THAT(refusal(joint_and(text)),
                AllOf(HasSubstr("model.xml:2: "), HasSubstr("a text on its own has no files")));
  }
  EXPECT_THAT(refusal(joint_and(R"(<extension><plugin plugin="mujoco.pid"/></extension>)")),
              HasSubstr("<plugin>"));
  EXPECT_THAT(refusal(joint_and(R"(<size nuser_body="2000000000"/>)")),
              HasSubstr("may be at most"));
  // Nobody's figure for the memory of a simulation is believed.
  EXPECT_THAT(checked_model_text(R"(<mujoco><size memory="1000G" nkey="2"/></mujoco>)"),
              R"(<mujoco><size nkey="2"/></mujoco>)");
}

}  // namespace
}  // namespace trifinger::test
