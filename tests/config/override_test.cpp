// SPDX-License-Identifier: BSD-3-Clause
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <array>
#include <string>

#include "support/config_message.hpp"
#include "trifinger/config/file.hpp"

namespace trifinger::config {
namespace {

using test::message_of;
using testing::ElementsAre;

constexpr const char* kText = "name: sim\nfingers:\n  height: 0.3\nobjects:\n  - mass: 0.1\n";

File with(const std::string& assignment) { return File::parse(kText, "robot.yml", {assignment}); }

std::string problem_with(const std::string& assignment) {
  return message_of([&] {
    const File file = with(assignment);
    (void)file.root().required<std::string>("name");
    (void)file.root().section("fingers").required<double>("height", {.unit = "m", .max = 0.5});
    (void)file.root().at("objects").items().at(0).required<double>("mass");
    file.reject_unknown_keys();
  });
}

TEST(Override, ReplacesAValueOfTheFile) {
  EXPECT_EQ(with("fingers.height=0.4").root().section("fingers").required<double>("height"), 0.4);
  EXPECT_EQ(with("objects.0.mass=0.2").root().at("objects").items().at(0).required<double>("mass"),
            0.2);
  EXPECT_EQ(with("name=a=b").root().required<std::string>("name"), "a=b");
}

TEST(Override, fault_59_RefusesAPathThatIsDeeperThanAnyConfiguration) {
  std::string path = "a";
  for (int i = 1; i < 100'000; ++i) path += ".a";
  EXPECT_EQ(problem_with(path + "=1"),
            "--set a.a.a.a.a.a.a.a.a.a.a.a.a.a.a.a.a.a.a.a....: nests 100000 keys, at most 32 "
            "are allowed");
}

TEST(Override, IsInTheTextOfTheWholeConfiguration) {
  const File file = File::parse(
      "name: \"0.3\"\nfingers:\n  height: 0.3\nobjects:\n  - mass: 0.1\n"
      "    size: [0.1, 0.2]\n  - name: 'it''s: a # \\ ball'\nempty: []\nnothing: ~\n",
      "robot.yml", {"fingers.height=[1, \"x\"]", "simulation.seed=7"});
  EXPECT_EQ(file.text(),
            "name: \"0.3\"\nfingers:\n  height: [1, \"x\"]\nobjects:\n  - mass: 0.1\n"
            "    size: [0.1, 0.2]\n  - name: \"it's: a # \\\\ ball\"\nempty: []\nnothing: ~\n"
            "simulation:\n  seed: 7\n");
  EXPECT_EQ(File::parse(file.text(), "again.yml").text(), file.text());
}

TEST(Override, GivesAKeyThatTheFileLeavesOut) {
  EXPECT_EQ(with("simulation.seed=7").root().section("simulation").required<int>("seed"), 7);
}

TEST(Override, TakesLists) {
  EXPECT_THAT((with("fingers.pose=[1, 2]")
                   .root()
                   .section("fingers")
                   .required<std::array<double, 2>>("pose")),
              ElementsAre(1.0, 2.0));
}

TEST(Override, LetsTheLastOfTwoWin) {
  const File file = File::parse(kText, "robot.yml", {"name=a", "name=b"});
  EXPECT_EQ(file.root().required<std::string>("name"), "b");
}

TEST(Override, IsNamedAsThePlaceOfAnError) {
  EXPECT_EQ(problem_with("fingers.height=3"),
            "--set fingers.height: fingers.height is 3 m, must be at most 0.5 m");
  EXPECT_EQ(problem_with("fingers.heigth=0.3"),
            "--set fingers.heigth: fingers.heigth is not a known key; did you mean 'height'?");
  EXPECT_EQ(problem_with("finger.height=0.3"),
            "--set finger.height: finger is not a known key; did you mean 'fingers'?");
}

TEST(Override, IsAlsoATextThatKeepsThePlaceOfTheValue) {
  File file = File::parse(kText, "robot.yml");
  const Node before = file.root().at("name");
  file.replace(before, "it's 3: [new]");
  const Node after = file.root().at("name");
  EXPECT_EQ(after.as<std::string>(), "it's 3: [new]");
  EXPECT_EQ(after.location().text(), before.location().text());
  EXPECT_NE(before.as<std::string>(), after.as<std::string>());
  EXPECT_EQ(File::parse(file.text(), "again.yml").root().required<std::string>("name"),
            after.as<std::string>());
}

TEST(Override, MustHaveAKeyAndAValue) {
  EXPECT_EQ(problem_with("fingers.height"),
            "--set fingers.height: has no key and value, must look like fingers.height=0.3");
  EXPECT_EQ(problem_with("=3"),
            "--set =3: has no key and value, must look like fingers.height=0.3");
  EXPECT_EQ(problem_with("name="), "--set name: has no value, must look like name=0.3");
  EXPECT_EQ(problem_with("fingers..height=3"),
            "--set fingers..height: a key in 'fingers..height' is empty");
  EXPECT_EQ(problem_with("fingers={height: 3}"),
            "--set fingers: the value is a section, must be a value or a list");
  EXPECT_THAT(problem_with("fingers.height=[1}"),
              testing::StartsWith("--set fingers.height: malformed YAML: "));
}

TEST(Override, MustFitTheShapeOfTheFile) {
  EXPECT_EQ(problem_with("name.first=a"),
            "--set name.first: name is not a section, so it has no 'first'");
  EXPECT_EQ(problem_with("objects.1.mass=1"),
            "--set objects.1.mass: objects has no entry '1', it has 1, counted from 0");
  EXPECT_EQ(problem_with("objects.first.mass=1"),
            "--set objects.first.mass: objects has no entry 'first', it has 1, counted from 0");
}

}  // namespace
}  // namespace trifinger::config
