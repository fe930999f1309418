// SPDX-License-Identifier: BSD-3-Clause
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cstddef>
#include <random>
#include <string>

#include "support/config_message.hpp"
#include "trifinger/config/file.hpp"

namespace trifinger::config {
namespace {

using test::message_of;
using testing::HasSubstr;
using testing::StartsWith;

// Returns the error from reading `text` as the file robot.yml.
std::string problem_in(const std::string& text) {
  return message_of([&] { (void)File::parse(text, "robot.yml"); });
}

TEST(Parser, ReadsSectionsListsAndValues) {
  const File file = File::parse(
      "name: sim\nfingers: {height: 0.3}\nobjects:\n  - mass: 0.1\n  - mass: 0.2\n", "robot.yml");
  const Node root = file.root();
  EXPECT_EQ(root.required<std::string>("name"), "sim");
  EXPECT_EQ(root.section("fingers").required<double>("height"), 0.3);
  EXPECT_EQ(root.at("objects").items().at(1).required<double>("mass"), 0.2);
}

TEST(Parser, TakesAnEmptyFileForOneWithoutKeys) {
  for (const std::string text : {"", "# only a comment\n", "---\n"}) {
    EXPECT_FALSE(File::parse(text, "robot.yml").root().find("name").has_value());
  }
}

TEST(Parser, RefusesAKeyThatIsGivenTwice) {
  EXPECT_EQ(problem_in("fingers:\n  height: 0.3\n  count: 3\n  height: 0.4\n"),
            "robot.yml:4:3: 'height' is given twice, first in line 2");
}

// The rest of the message is the parser's own text, which differs between its versions.
TEST(Parser, TellsLineAndColumnOfMalformedYaml) {
  EXPECT_THAT(problem_in("name: sim\nfingers: [1, 2\n"),
              StartsWith("robot.yml:3:1: malformed YAML: "));
  EXPECT_THAT(problem_in("name: sim\n fingers: 3\n"),
              StartsWith("robot.yml:2:9: malformed YAML: "));
  EXPECT_THAT(problem_in("fingers:\n\theight: 3\n"), StartsWith("robot.yml:2:"));
}

TEST(Parser, RefusesAQuoteThatIsNeverClosed) {
  for (const std::string text : {"name: \"sim", "name: \"sim\n", "name: 'sim\nfingers: 3\n\n"}) {
    EXPECT_THAT(problem_in(text), HasSubstr("malformed YAML: ")) << text;
  }
}

TEST(Parser, RefusesAnchorsAliasesAndTags) {
  EXPECT_EQ(problem_in("a: &x 1\nb: 2\n"),
            "robot.yml:1:4: anchors and aliases are not supported, write the value out");
  EXPECT_EQ(problem_in("a: !!str 1\n"),
            "robot.yml:1:4: tags are not supported: 'tag:yaml.org,2002:str'");
}

TEST(Parser, RefusesASecondDocument) {
  EXPECT_EQ(problem_in("a: 1\n---\nb: 2\n"),
            "robot.yml:2:1: a second document begins here, there must be only one");
}

TEST(Parser, RefusesAKeyThatIsNoWord) {
  EXPECT_EQ(
      problem_in("? [a, b]\n: 1\n"),
      "robot.yml:1:3: a key is a list or a section, must be a word; is a bracket not closed?");
  EXPECT_EQ(problem_in("~: 1\n"), "robot.yml:1:1: a key is empty, must be a word");
}

TEST(Parser, RefusesAFileThatIsAListOrAValue) {
  EXPECT_EQ(problem_in("- 1\n- 2\n"),
            "robot.yml:1:1: the file must be made of sections, as in 'fingers:'");
  EXPECT_EQ(problem_in("hello\n"),
            "robot.yml:1:1: the file must be made of sections, as in 'fingers:'");
}

TEST(Parser, SurvivesNestingWithoutEnd) {
  EXPECT_THROW((void)File::parse("a: " + std::string(100'000, '['), "robot.yml"), ConfigError);
}

TEST(Parser, fault_59_AnswersEveryDamagedFileWithAConfigurationOrAConfigError) {
  const std::string whole =
      "# A robot\nextends_not: 'x'\nfingers: {height: 0.283 m, pose: [0, 0.9, -1.7]}\nobjects:\n"
      "  - name: \"cube\"\n    mass: 0.094\n  - name: ball\ntext: |\n  two\n  lines\n";
  const std::string nasty = "{}[]:,#&*!|>'\"%@`-?~ \n\t\\0a\xff\xc3";
  std::mt19937 random(7);
  int refused = 0;
  for (int i = 0; i < 5000; ++i) {
    std::string text = whole;
    for (auto count = 1 + random() % 3; count > 0; --count) {
      const std::size_t place = random() % text.size();
      if (random() % 4 == 0) {
        text.erase(place, 1 + random() % 5);
      } else {
        text.insert(place, 1, nasty[random() % nasty.size()]);
      }
    }
    SCOPED_TRACE(text);
    try {
      (void)File::parse(text, "robot.yml");
    } catch (const ConfigError& error) {
      ++refused;
      ASSERT_GT(error.location().line, 0) << error.what();
    }
  }
  EXPECT_GT(refused, 1000);
}

TEST(Parser, fault_59_RefusesWhatIsNestedDeeperThanAnyConfiguration) {
  const auto nested = [](std::size_t depth) {
    return "a: " + std::string(depth, '[') + std::string(depth, ']') + "\n";
  };
  // The file itself counts as the first level.
  EXPECT_NO_THROW((void)File::parse(nested(31), "robot.yml"));
  EXPECT_EQ(problem_in(nested(32)),
            "robot.yml:1:35: sections and lists are nested deeper than 32 levels, which is "
            "not allowed");
  std::string sections;
  for (std::size_t i = 0; i < 1000; ++i) sections += std::string(i, ' ') + "a:\n";
  for (const std::string& text : {nested(1'000'000), sections, "a: " + std::string(100'000, '{')}) {
    EXPECT_THROW((void)File::parse(text, "robot.yml"), ConfigError) << text.substr(0, 10);
  }
}

TEST(Parser, fault_59_RefusesAliasesBeforeTheyGrow) {
  std::string bomb = "a0: &a0 [1, 1]\n";
  for (int i = 1; i < 64; ++i) {
    const std::string before = "*a" + std::to_string(i - 1);
    const std::string name = "a" + std::to_string(i);
    bomb.append(name).append(": &").append(name).append(" [").append(before).append(", ");
    bomb.append(before).append("]\n");
  }
  EXPECT_EQ(problem_in(bomb),
            "robot.yml:1:5: anchors and aliases are not supported, write the value out");
}

TEST(Parser, fault_59_ReadsAHundredThousandKeysAndNamesTheFirstThatAreNotKnown) {
  constexpr int kKeys = 100'000;
  std::string text;
  for (int i = 0; i < kKeys; ++i) text += "key" + std::to_string(i) + ": 1\n";
  const File file = File::parse(text, "robot.yml");
  const Node root = file.root();
  for (int i = 10; i < kKeys; ++i) {
    ASSERT_EQ(root.required<int>("key" + std::to_string(i)), 1);
  }
  EXPECT_TRUE(message_of([&] {
                file.reject_unknown_keys();
              }).starts_with("robot.yml:1:1: key0 is not a known key; did you mean"));
  const std::string unknown =
      message_of([&] { File::parse(text, "robot.yml").reject_unknown_keys(); });
  EXPECT_EQ(std::ranges::count(unknown, '\n'), 20);
  EXPECT_TRUE(unknown.ends_with("\nand 99980 more keys that are not known"));
}

TEST(Parser, fault_59_RefusesAFileThatIsLargerThanAnyConfiguration) {
  const std::string text(4'000'001, '#');
  EXPECT_EQ(problem_in(text),
            "robot.yml:1:1: the file has 4000001 bytes, a configuration has at most 4000000");
}

TEST(Parser, GivesTheLocationAsData) {
  try {
    (void)File::parse("a: 1\na: 2\n", "robot.yml");
    FAIL() << "nothing thrown";
  } catch (const ConfigError& error) {
    EXPECT_EQ(error.location(), (Location{.source = "robot.yml", .line = 2, .column = 1}));
  }
}

}  // namespace
}  // namespace trifinger::config
