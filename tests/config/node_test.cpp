// SPDX-License-Identifier: BSD-3-Clause
#include "trifinger/config/node.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <array>
#include <cstdint>
#include <limits>
#include <string>
#include <vector>

#include "support/config_message.hpp"
#include "trifinger/config/file.hpp"

namespace trifinger::config {
namespace {

using test::message_of;
using testing::ElementsAre;

constexpr Range kHeight{.unit = "m", .min = 0.2, .max = 0.5};
constexpr double kInfinity = std::numeric_limits<double>::infinity();

// Returns the section "fingers" of robot.yml, with `line` as its only line.
Node fingers(const std::string& line) {
  return File::parse("fingers:\n  " + line + "\n", "robot.yml").root().section("fingers");
}

std::string problem_with_height(const std::string& line, const Range& range = kHeight) {
  return message_of([&] { (void)fingers(line).required<double>("height", range); });
}

TEST(Node, ReadsNumbers) {
  EXPECT_EQ(fingers("height: 0.3").required<double>("height", kHeight), 0.3);
  EXPECT_EQ(fingers("height: +3e-1").required<double>("height", kHeight), 0.3);
  EXPECT_EQ(fingers("count: 3").required<int>("count"), 3);
  EXPECT_EQ(fingers("count: -3").required<std::int64_t>("count"), -3);
  EXPECT_EQ(fingers("seed: 9223372036854775807").required<std::uint64_t>("seed"),
            9223372036854775807U);
}

TEST(Node, ReadsTextsTruthAndLists) {
  EXPECT_EQ(fingers("name: '3'").required<std::string>("name"), "3");
  EXPECT_TRUE(fingers("soft: true").required<bool>("soft"));
  EXPECT_FALSE(fingers("soft: false").required<bool>("soft"));
  EXPECT_THAT((fingers("pose: [0, 0.9, -1.7]").required<std::array<double, 3>>("pose")),
              ElementsAre(0.0, 0.9, -1.7));
  EXPECT_THAT(fingers("names: [a, b]").required<std::vector<std::string>>("names"),
              ElementsAre("a", "b"));
  EXPECT_THAT((fingers("m: [[1, 2], [3, 4]]").required<std::array<std::array<int, 2>, 2>>("m")),
              ElementsAre(ElementsAre(1, 2), ElementsAre(3, 4)));
}

TEST(Node, AcceptsTheUnitAfterANumber) {
  EXPECT_EQ(fingers("height: 0.3 m").required<double>("height", kHeight), 0.3);
  EXPECT_EQ(fingers("steps: 5 steps").required<int>("steps", {.unit = "steps"}), 5);
}

TEST(Node, fault_59_RefusesAnotherUnit) {
  EXPECT_EQ(problem_with_height("height: 300 mm"),
            "robot.yml:2:11: fingers.height has the unit 'mm', must be in 'm'");
  EXPECT_EQ(problem_with_height("height: 0.3 m", {}),
            "robot.yml:2:11: fingers.height has the unit 'm', must have none");
}

TEST(Node, TellsTheValueFoundAndTheValueAllowed) {
  EXPECT_EQ(problem_with_height("height: 3"),
            "robot.yml:2:11: fingers.height is 3 m, must be 0.2 to 0.5 m");
  EXPECT_EQ(problem_with_height("height: 0", {.unit = "m", .min = 0.0, .above_min = true}),
            "robot.yml:2:11: fingers.height is 0 m, must be more than 0 m");
  EXPECT_EQ(
      problem_with_height("height: 9", {.unit = "m", .min = 0.0, .max = 1.0, .above_min = true}),
      "robot.yml:2:11: fingers.height is 9 m, must be more than 0 and at most 1 m");
  EXPECT_EQ(problem_with_height("height: -1", {.min = 0.0}),
            "robot.yml:2:11: fingers.height is -1, must be at least 0");
  EXPECT_EQ(problem_with_height("height: 2", {.max = 1.0}),
            "robot.yml:2:11: fingers.height is 2, must be at most 1");
}

TEST(Node, RefusesWhatIsNoNumber) {
  EXPECT_EQ(problem_with_height("height: tall"),
            "robot.yml:2:11: fingers.height is 'tall', must be a number [m]");
  EXPECT_EQ(problem_with_height("height: '0.3'"),
            "robot.yml:2:11: fingers.height is '0.3', must be a number [m]");
  EXPECT_EQ(problem_with_height("height: 0,3"),
            "robot.yml:2:11: fingers.height is '0,3', must be a number [m]");
  EXPECT_EQ(problem_with_height("height: [0.3]"),
            "robot.yml:2:11: fingers.height is a list, must be a number [m]");
  EXPECT_EQ(problem_with_height("height: {a: 1}"),
            "robot.yml:2:11: fingers.height is a section, must be a number [m]");
  EXPECT_EQ(problem_with_height("height: 1e999", {}),
            "robot.yml:2:11: fingers.height is '1e999', must be a number");
  EXPECT_THAT(problem_with_height("height:"),
              testing::HasSubstr("fingers.height is empty, must be a number [m]"));
}

TEST(Node, fault_59_RefusesNanAndInfinityUnlessInfinityIsAllowed) {
  EXPECT_EQ(problem_with_height("height: .inf", {.unit = "m"}),
            "robot.yml:2:11: fingers.height is .inf m, must be a finite number [m]");
  EXPECT_EQ(problem_with_height("height: .nan", {.unit = "m"}),
            "robot.yml:2:11: fingers.height is .nan m, must be a finite number [m]");
  EXPECT_EQ(fingers("limit: -.inf").required<double>("limit", {.allow_infinite = true}),
            -kInfinity);
  EXPECT_NE(problem_with_height("height: .nan", {.allow_infinite = true}), "no error");
}

TEST(Node, RefusesIntegersThatDoNotFit) {
  EXPECT_EQ(message_of([] { (void)fingers("count: 300").required<std::uint8_t>("count"); }),
            "robot.yml:2:10: fingers.count is 300, must be 0 to 255");
  EXPECT_EQ(message_of([] { (void)fingers("count: -1").required<std::uint64_t>("count"); }),
            "robot.yml:2:10: fingers.count is -1, must be 0 to 9223372036854775807");
  EXPECT_EQ(message_of([] { (void)fingers("count: 9").required<int>("count", {.max = 5}); }),
            "robot.yml:2:10: fingers.count is 9, must be at most 5");
  EXPECT_EQ(message_of([] { (void)fingers("count: 1.5").required<int>("count"); }),
            "robot.yml:2:10: fingers.count is '1.5', must be a whole number");
}

TEST(Node, RefusesOtherSpellingsOfTruth) {
  EXPECT_EQ(message_of([] { (void)fingers("soft: yes").required<bool>("soft"); }),
            "robot.yml:2:9: fingers.soft is 'yes', must be true or false");
}

TEST(Node, NamesTheEntryOfAListThatIsWrong) {
  EXPECT_EQ(message_of([] {
              (void)fingers("pose: [0, 0.9, low]")
                  .required<std::array<double, 3>>("pose", {.unit = "rad"});
            }),
            "robot.yml:2:18: fingers.pose.2 is 'low', must be a number [rad]");
  EXPECT_EQ(
      message_of([] { (void)fingers("pose: [0, 0.9]").required<std::array<double, 3>>("pose"); }),
      "robot.yml:2:9: fingers.pose has 2 entries, must have 3");
  EXPECT_EQ(message_of([] { (void)fingers("pose: 1").required<std::array<double, 3>>("pose"); }),
            "robot.yml:2:9: fingers.pose is '1', must be a list");
}

enum class Policy : std::uint8_t { kStop, kRepeat };

TEST(Node, ReadsChoicesByName) {
  const std::vector<std::pair<std::string_view, Policy>> policies{{"stop", Policy::kStop},
                                                                  {"repeat", Policy::kRepeat}};
  EXPECT_EQ(fingers("policy: repeat").required_choice("policy", policies), Policy::kRepeat);
  EXPECT_EQ(fingers("other: 1").optional_choice("policy", Policy::kStop, policies), Policy::kStop);
  EXPECT_EQ(
      message_of([&] { (void)fingers("policy: repaet").required_choice("policy", policies); }),
      "robot.yml:2:11: fingers.policy is 'repaet', must be 'stop' or 'repeat'; did you mean "
      "'repeat'?");
  EXPECT_EQ(message_of([&] { (void)fingers("policy: 7").required_choice("policy", policies); }),
            "robot.yml:2:11: fingers.policy is '7', must be 'stop' or 'repeat'");
}

TEST(Node, TellsWhatIsMissing) {
  EXPECT_EQ(problem_with_height("count: 3"), "robot.yml:2:3: fingers.height [m] is missing");
  EXPECT_EQ(problem_with_height("heigth: 0.3"),
            "robot.yml:2:3: fingers.height [m] is missing; is 'heigth' a misspelling of it?");
  EXPECT_EQ(message_of([] { (void)fingers("a: 1").section("b"); }),
            "robot.yml:2:3: fingers.b is missing");
}

TEST(Node, UsesTheFallbackOnlyWhereNothingIsGiven) {
  EXPECT_EQ(fingers("count: 3").optional<double>("height", 0.25, kHeight), 0.25);
  EXPECT_EQ(fingers("height: 0.3").optional<double>("height", 0.25, kHeight), 0.3);
  EXPECT_THROW((void)fingers("height: 3").optional<double>("height", 0.25, kHeight), ConfigError);
  EXPECT_THROW((void)fingers("height:").optional<double>("height", 0.25, kHeight), ConfigError);
  EXPECT_FALSE(fingers("count: 3").optional_section("tip").has_value());
}

TEST(Node, RefusesAValueWhereASectionBelongs) {
  EXPECT_EQ(message_of([] { (void)fingers("tip: 3").section("tip"); }),
            "robot.yml:2:8: fingers.tip is '3', must be a section");
}

TEST(Node, OutlivesItsFile) {
  const Node node = fingers("height: 0.3");
  EXPECT_EQ(node.required<double>("height"), 0.3);
  EXPECT_EQ(node.path(), "fingers");
}

// Reads the keys that a tiny robot knows.
void read_robot(const File& file) {
  const Node root = file.root();
  (void)root.optional<std::string>("name", "sim");
  if (const auto fingers = root.optional_section("fingers"))
    (void)fingers->optional<double>("height", 0.3);
  if (const auto objects = root.find("objects")) {
    for (const Node& object : objects->items()) (void)object.required<double>("mass");
  }
  file.reject_unknown_keys();
}

TEST(UnknownKeys, fault_59_AreErrorsThatNameWhatWasMeant) {
  EXPECT_EQ(message_of([] { read_robot(File::parse("fingers:\n  heigth: 0.3\n", "robot.yml")); }),
            "robot.yml:2:3: fingers.heigth is not a known key; did you mean 'height'?");
  EXPECT_EQ(message_of([] { read_robot(File::parse("speed: 3\n", "robot.yml")); }),
            "robot.yml:1:1: speed is not a known key; known are 'fingers', 'name' and 'objects'");
  EXPECT_EQ(message_of([] {
              read_robot(File::parse("objects:\n  - mass: 1\n    Mass: 2\n", "robot.yml"));
            }),
            "robot.yml:3:5: objects.0.Mass is not a known key; did you mean 'mass'?");
}

TEST(UnknownKeys, AreAllReportedAtOnce) {
  EXPECT_EQ(message_of(
                [] { read_robot(File::parse("nmae: a\nfingers:\n  heigth: 0.3\n", "robot.yml")); }),
            "robot.yml:1:1: nmae is not a known key; did you mean 'name'?\n"
            "robot.yml:3:3: fingers.heigth is not a known key; did you mean 'height'?");
}

TEST(UnknownKeys, AreNoneWhereEverythingWasRead) {
  EXPECT_NO_THROW(read_robot(
      File::parse("name: a\nfingers: {height: 1}\nobjects: [{mass: 1}]\n", "robot.yml")));
}

TEST(Values, AreWrittenInOneWay) {
  const File file = File::parse(
      "name: a\n"
      "fingers: {height: 0.30 m, position: [0, 0.9, -1.7]}\n"
      "safety: {kp: [9, 9.0, 9], limit: .inf, margins: []}\n"
      "text: \"1.0\"\n"
      "motors: [[1, 0], [0, 0.0]]\n"
      "objects: [{mass: 1}]\n",
      "robot.yml");
  EXPECT_THAT(
      file.values(),
      testing::UnorderedElementsAre(
          testing::Pair("name", "a"), testing::Pair("fingers.height", "0.3"),
          testing::Pair("fingers.position", "[0, 0.9, -1.7]"), testing::Pair("safety.kp", "9"),
          testing::Pair("safety.limit", "inf"), testing::Pair("safety.margins", "[]"),
          testing::Pair("text", "1.0"), testing::Pair("motors", "[[1, 0], [0, 0]]")));
}

TEST(Keys, HaveWhatTheirReadersAllow) {
  const File file = File::parse("height: 0.3 m\nmotors: [[1, 0], [0, 0]]\n", "robot.yml");
  (void)file.root().required<double>("height", {.unit = "m", .min = 0, .max = 1});
  for (const Node& pair : file.root().at("motors").items()) {
    (void)pair.as<std::array<std::size_t, 2>>({.min = 0, .max = 9});
  }
  std::vector<std::array<std::string, 3>> keys;
  for (const auto& [path, value, allowed] : file.keys()) keys.push_back({path, value, allowed});
  EXPECT_THAT(keys, testing::ElementsAre(
                        std::array<std::string, 3>{"height", "0.3 m", "0 to 1 m"},
                        std::array<std::string, 3>{"motors", "[[1, 0], [0, 0]]", "0 to 9"}));
}

}  // namespace
}  // namespace trifinger::config
