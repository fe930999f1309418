// SPDX-License-Identifier: BSD-3-Clause
#include "manipulation/taught_motion.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <fstream>
#include <memory>
#include <numbers>
#include <string>

#include "support/allocation_counter.hpp"
#include "support/folder.hpp"
#include "trifinger/base/error.hpp"
#include "trifinger/manipulation/run_skill.hpp"
#include "trifinger/sim/robot_config.hpp"
#include "trifinger/sim/simulation.hpp"

namespace trifinger::manipulation {
namespace {

using ::testing::HasSubstr;

// A slow wave of all joints about `centre`, from rest to rest.
TaughtMotion wave(const JointValues& centre, double amplitude = 0.1) {
  TaughtMotion motion;
  constexpr int kSamples = 200;
  for (int i = 0; i <= kSamples; ++i) {
    const double phase = 2 * std::numbers::pi * i / kSamples;
    const double level = amplitude * (1 - std::cos(phase));
    motion.positions.emplace_back(centre + JointValues::Constant(kMaxJoints, level));
    motion.torques.emplace_back(JointValues::Constant(kMaxJoints, 0.01 * level));
  }
  return motion;
}

TEST(TaughtMotion, GoesThroughItsSamplesWithoutAJump) {
  const TaughtMotion motion = wave(JointValues::Zero(kMaxJoints));
  for (std::size_t i = 0; i < motion.positions.size(); ++i) {
    const auto at = motion.at(motion.interval * static_cast<double>(i));
    EXPECT_TRUE(at.position.isApprox(motion.positions[i], 1e-9) ||
                (at.position - motion.positions[i]).norm() < 1e-12);
    EXPECT_NEAR((at.torque - motion.torques[i]).norm(), 0.0, 1e-12);
  }
  constexpr double kStep = 1e-4;
  for (double time = kStep; time < motion.duration().count() - kStep; time += 0.0037) {
    const auto before = motion.at(Seconds(time - kStep));
    const auto after = motion.at(Seconds(time + kStep));
    const JointValues slope = (after.position - before.position) / (2 * kStep);
    EXPECT_NEAR((motion.at(Seconds(time)).velocity - slope).norm(), 0.0, 1e-2);
  }
  EXPECT_EQ(motion.at(Seconds(-1)).velocity.norm(), 0.0);
  const auto end = motion.at(motion.duration() + Seconds(1));
  EXPECT_NEAR((end.position - motion.positions.back()).norm(), 0.0, 1e-12);
}

TEST(TaughtMotion, IsReadAsItWasWritten) {
  const TaughtMotion motion = wave(JointValues::LinSpaced(kMaxJoints, -1.0, 1.0));
  const test::Folder folder;
  const auto path = folder / "wave.csv";
  std::ofstream(path) << text_of(motion);
  const TaughtMotion read = load_taught_motion(path);
  ASSERT_EQ(read.positions.size(), motion.positions.size());
  EXPECT_NEAR(read.interval.count(), motion.interval.count(), 1e-9);
  for (std::size_t i = 0; i < read.positions.size(); ++i) {
    EXPECT_NEAR((read.positions[i] - motion.positions[i]).cwiseAbs().maxCoeff(), 0.0, 0.51e-5);
    EXPECT_NEAR((read.torques[i] - motion.torques[i]).cwiseAbs().maxCoeff(), 0.0, 0.51e-4);
  }
  EXPECT_EQ(text_of(read), text_of(motion));
}

TEST(TaughtMotion, NamesTheLineThatIsWrong) {
  const std::string text = text_of(wave(JointValues::Zero(kMaxJoints)));
  const std::size_t third = text.find('\n', text.find('\n') + 1) + 1;
  const test::Folder folder;
  const auto path = folder / "wrong.csv";
  const auto refused = [&](const std::string& wrong) {
    std::ofstream(path) << wrong;
    try {
      (void)load_taught_motion(path);
    } catch (const InvalidArgument& error) {
      return std::string(error.what());
    }
    return std::string("nothing is wrong");
  };
  EXPECT_THAT(refused(text.substr(0, third) + "x" + text.substr(third)), HasSubstr(":3 "));
  EXPECT_THAT(refused(text.substr(0, third) + "nan," + text.substr(third)), HasSubstr(":3 "));
  EXPECT_THAT(refused(text.substr(0, third) + "1,2\n" + text.substr(third)), HasSubstr(":3 "));
  EXPECT_THAT(refused(text.substr(0, text.find('\n') + 1)), HasSubstr("fewer than two"));
  // A row that is missing leaves a gap in time.
  EXPECT_THAT(refused(text.substr(0, third) + text.substr(text.find('\n', third) + 1)),
              HasSubstr("even interval"));
  EXPECT_THROW((void)load_taught_motion(folder / "absent.csv"), InvalidArgument);
}

// Stands for the skill that is replaced.
class Nothing final : public Skill {
 public:
  [[nodiscard]] std::string_view object() const noexcept override { return "cube"; }
  [[nodiscard]] Seconds max_duration() const noexcept override { return Seconds(1); }
  void see(TimeIndex /*captured*/, const Pose& /*pose*/) noexcept override {}
  [[nodiscard]] const TriFinger::Action& update(
      TimeIndex /*step*/, const control::JointState& /*joints*/) noexcept override {
    return action_;
  }
  void stop() noexcept override {}
  [[nodiscard]] const SkillState& state() const noexcept override { return state_; }
  [[nodiscard]] std::vector<Figure> figures(const SkillTrace& /*trace*/,
                                            std::span<const SeenPose> /*poses*/) const override {
    return {};
  }

 private:
  TriFinger::Action action_;
  SkillState state_;
};

struct Playing {
  SimulationOptions options = load_robot_config("sim").simulation;
  SkillContext context{.description = options.description,
                       .limits = safety_limits_of(options),
                       .period = options.period};
  JointValues start =
      JointValues::Map(Simulation(options).robot().initial_position().data(), kMaxJoints);

  [[nodiscard]] std::unique_ptr<Skill> skill(TaughtMotion motion) const {
    return play_instead(std::make_unique<Nothing>(), context, std::move(motion));
  }
};

TEST(TaughtSkill, MovesTheRobotAsItWasTaught) {
  const Playing playing;
  // Nobody leads the tips of a robot in free space.
  TaughtMotion motion = wave(playing.start);
  for (JointValues& torque : motion.torques) torque.setZero();
  const auto skill = playing.skill(motion);
  const Simulation simulation(playing.options);
  auto robot = simulation.connect();
  double worst = 0.0;
  Seconds elapsed{0};
  const auto trace = run_skill(
      robot, *skill, {.on_step = [&](TimeIndex t) {
        if (skill->state().phase != "play") return;
        const JointValues position = joint_values(robot.get_observation(t).position);
        worst = std::max(worst, (position - motion.at(elapsed).position).cwiseAbs().maxCoeff());
        elapsed += playing.context.period;
      }});
  EXPECT_TRUE(trace.failure.empty());
  EXPECT_GT(elapsed, motion.duration());
  EXPECT_LT(worst, 0.02);
}

TEST(TaughtSkill, EndsWhenItIsStoppedInAnyPhase) {
  const Playing playing;
  for (const int stop_at : {0, 1, 500, 1500, 3000}) {
    const auto skill = playing.skill(wave(playing.start));
    const control::JointState joints{playing.start, JointValues::Zero(kMaxJoints),
                                     JointValues::Zero(kMaxJoints)};
    int step = 0;
    TriFinger::Action before;
    for (; !skill->state().has_ended && step < 10'000; ++step) {
      if (step >= stop_at) skill->stop();
      if (skill->state().has_ended) break;
      const TriFinger::Action action = skill->update(step, joints);
      // The motion has at most 0.32 rad/s, and comes to rest without a jump.
      for (std::size_t i = 0; step > 0 && i < kMaxJoints; ++i) {
        EXPECT_NEAR(action.position[i], before.position[i], 0.32e-3) << step;
        EXPECT_NEAR(action.torque[i], before.torque[i], 0.005) << step;
      }
      before = action;
    }
    EXPECT_LT(step, stop_at + 400);
    EXPECT_EQ(skill->state().failure, "it was stopped");
  }
}

TEST(TaughtSkill, DoesNotAllocate) {
  const Playing playing;
  const auto skill = playing.skill(wave(playing.start));
  const control::JointState joints{playing.start, JointValues::Zero(kMaxJoints),
                                   JointValues::Zero(kMaxJoints)};
  const test::AllocationCounter allocations;
  for (int step = 0; step < 4000; ++step) (void)skill->update(step, joints);
  EXPECT_EQ(allocations.count(), 0);
}

TEST(TaughtSkill, RefusesAMotionBeyondTheLimits) {
  const Playing playing;
  EXPECT_THROW((void)playing.skill(wave(playing.start, 3.0)), InvalidArgument);
}

}  // namespace
}  // namespace trifinger::manipulation
