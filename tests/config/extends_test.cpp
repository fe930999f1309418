// SPDX-License-Identifier: BSD-3-Clause
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <string>

#include "support/config_message.hpp"
#include "support/folder.hpp"
#include "trifinger/config/file.hpp"

namespace trifinger::config {
namespace {

using test::message_of;
using testing::AllOf;
using testing::EndsWith;
using testing::HasSubstr;

// Every test has a folder of its own.
class Extends : public testing::Test {
 protected:
  // Returns the path of a new file with `text`.
  [[nodiscard]] std::filesystem::path write(const std::string& name,
                                            const std::string& text) const {
    std::ofstream(folder_ / name) << text;
    return folder_ / name;
  }

  test::Folder folder_;
};

TEST_F(Extends, TakesTheSectionsThatAreNotGiven) {
  (void)write("base.yml", "name: base\nfingers:\n  height: 0.3\n");
  const File file = File::load(write("sim.yml", "extends: base.yml\nname: sim\n"));
  EXPECT_EQ(file.root().required<std::string>("name"), "sim");
  EXPECT_EQ(file.root().section("fingers").required<double>("height"), 0.3);
  EXPECT_NO_THROW(file.reject_unknown_keys());
}

TEST_F(Extends, ReplacesASectionAsAWhole) {
  (void)write("base.yml", "safety:\n  max_torque: 0.3\n  safety_kd: 0.1\n");
  const File file = File::load(write("sim.yml", "extends: base.yml\nsafety:\n  max_torque: 0.4\n"));
  EXPECT_THAT(
      message_of([&] { (void)file.root().section("safety").required<double>("safety_kd"); }),
      EndsWith("sim.yml:3:3: safety.safety_kd is missing"));
}

TEST_F(Extends, FillsTheSectionsInsideASection) {
  (void)write("base.yml", "safety:\n  kd: 0.1\n  jump: {rate: 1, time: 2}\n  still: {time: 3}\n");
  const File file =
      File::load(write("sim.yml", "extends: base.yml\nsafety:\n  kd: 0.2\n  jump:\n    rate: 4\n"));
  const config::Node safety = file.root().section("safety");
  EXPECT_EQ(safety.required<double>("kd"), 0.2);
  EXPECT_EQ(safety.section("jump").required<double>("rate"), 4.0);
  EXPECT_EQ(safety.section("jump").required<double>("time"), 2.0);
  EXPECT_EQ(safety.section("still").required<double>("time"), 3.0);
}

TEST_F(Extends, NamesTheFileThatHoldsTheMistake) {
  (void)write("base.yml", "fingers:\n  height: tall\n");
  const File file = File::load(write("sim.yml", "extends: base.yml\n"));
  EXPECT_THAT(message_of([&] { (void)file.root().section("fingers").required<double>("height"); }),
              HasSubstr("base.yml:2:11: fingers.height is 'tall', must be a number"));
}

TEST_F(Extends, AppliesOverridesToTheResult) {
  (void)write("base.yml", "fingers:\n  height: 0.3\n");
  const File file = File::load(write("sim.yml", "extends: base.yml\n"), {"fingers.height=0.4"});
  EXPECT_EQ(file.root().section("fingers").required<double>("height"), 0.4);
}

TEST_F(Extends, GoesOnWithWhatTheOtherFileExtends) {
  (void)write("third.yml", "name: third\nfingers:\n  height: 0.3\nseed: 3\n");
  (void)write("base.yml", "extends: third.yml\nname: base\nseed: 2\n");
  const File file = File::load(write("sim.yml", "extends: base.yml\nseed: 1\n"));
  EXPECT_EQ(file.root().required<int>("seed"), 1);
  EXPECT_EQ(file.root().required<std::string>("name"), "base");
  EXPECT_EQ(file.root().section("fingers").required<double>("height"), 0.3);
  EXPECT_NO_THROW(file.reject_unknown_keys());
}

TEST_F(Extends, RefusesCircles) {
  (void)write("base.yml", "extends: sim.yml\n");
  EXPECT_THAT(message_of([&] { (void)File::load(write("sim.yml", "extends: base.yml\n")); }),
              AllOf(HasSubstr("base.yml:1:10: extends is 'sim.yml', which is "),
                    HasSubstr("a file must not extend itself, nor one that extends it")));
  EXPECT_THAT(message_of([&] { (void)File::load(write("self.yml", "extends: self.yml\n")); }),
              HasSubstr("self.yml:1:10: extends is 'self.yml', which is "));
}

TEST_F(Extends, NeedsNoSuffix) {
  (void)write("base.yml", "name: base\n");
  const File file = File::load(write("sim.yml", "extends: base\n"));
  EXPECT_EQ(file.root().required<std::string>("name"), "base");
}

TEST_F(Extends, LooksInOtherFoldersForWhatIsNotBesideIt) {
  const std::filesystem::path shared = folder_ / "shared";
  std::filesystem::create_directory(shared);
  (void)write("shared/edu.yml", "name: shared\n");
  (void)write("shared/pro.yml", "extends: edu.yml\nseed: 2\n");
  const auto name_in = [&](const std::filesystem::path& path) {
    return File::load(path, {}, {folder_ / "none", shared}).root().required<std::string>("name");
  };
  EXPECT_EQ(name_in(write("mine.yml", "extends: edu\n")), "shared");
  EXPECT_EQ(name_in(write("mine.yml", "extends: edu.yml\n")), "shared");
  EXPECT_EQ(name_in(write("mine.yml", "extends: pro\n")), "shared");
  (void)write("edu.yml", "name: beside\n");
  EXPECT_EQ(name_in(write("mine.yml", "extends: edu\n")), "beside");
  // The file that is extended is searched first in the folder of the file that extends it.
  EXPECT_EQ(name_in(write("mine.yml", "extends: pro\n")), "shared");
}

TEST_F(Extends, TellsWhichFileIsNotThereAndWhereItWasLookedFor) {
  const auto load = [&](const std::string& text) {
    (void)File::load(write("sim.yml", text), {}, {folder_ / "none", folder_ / "shared"});
  };
  EXPECT_THAT(message_of([&] { load("extends: bsae.yml\n"); }),
              EndsWith("sim.yml:1:10: extends is 'bsae.yml', but there is no such file in " +
                       folder_.path().string()));
  std::filesystem::create_directory(folder_ / "shared");
  (void)write("shared/base.yml", "name: base\n");
  EXPECT_THAT(
      message_of([&] { load("extends: bsae\n"); }),
      EndsWith("sim.yml:1:10: extends is 'bsae', but there is no such file in " +
               folder_.path().string() + ", nor among the files that come with the program in " +
               (folder_ / "shared").string() + "; did you mean 'base'?"));
}

TEST_F(Extends, RefusesANameThatIsNoText) {
  EXPECT_THAT(message_of([&] { (void)File::load(write("sim.yml", "extends: [a.yml]\n")); }),
              EndsWith("sim.yml:1:10: extends is a list, must be a text"));
}

TEST_F(Extends, fault_77_OpensNoFileForATextThatIsInNone) {
  const std::string base = write("base.yml", "name: base\n").string();
  for (const std::string& name : {base, std::string("base"), std::string("none.yml")}) {
    EXPECT_EQ(message_of([&] {
                (void)File::parse("extends: " + name + "\n", folder_ / "configuration.yml");
              }),
              (folder_ / "configuration.yml").string() + ":1:10: extends is '" + name +
                  "', but only a file may extend another one; the configuration in a log, a "
                  "session, a motion or a policy must be whole");
  }
}

TEST_F(Extends, ThrowsSystemErrorForAFileThatCannotBeRead) {
  EXPECT_THROW((void)File::load(folder_ / "none.yml"), SystemError);
  EXPECT_THROW((void)File::load(folder_.path()), SystemError);
}

}  // namespace
}  // namespace trifinger::config
