// SPDX-License-Identifier: BSD-3-Clause
#include "trifinger/guiding/guide.hpp"

#include <gtest/gtest.h>

#include <atomic>
#include <chrono>
#include <cmath>
#include <exception>
#include <functional>
#include <future>
#include <limits>
#include <memory>
#include <string>
#include <thread>
#include <vector>

#include "core/fake_robot.hpp"
#include "guiding/robots.hpp"
#include "model/file_robots.hpp"
#include "support/child_process.hpp"
#include "support/folder.hpp"
#include "support/message_of.hpp"
#include "trifinger/realtime/clock.hpp"
#include "trifinger/sim/robot_config.hpp"
#include "trifinger/sim/simulation.hpp"

namespace trifinger::test {
namespace {

using namespace guiding;
using namespace std::chrono_literals;
using ::testing::Test;

// Real time that forgives a busy machine everything.
BackendOptions patient() {
  return {.mode = BackendOptions::Mode::kRealTime,
          .max_action_repeats = BackendOptions::kUnlimited,
          .max_skipped_ticks = BackendOptions::kUnlimited,
          .driver_timeout = 60s};
}

GuideOptions ordinary_thread() { return {.realtime = {.demand = Demand::kOff}}; }

// A simulated robot that homes until somebody lets it, and breaks when somebody wants it to.
template <class R>
class Breakable final : public Driver<R> {
 public:
  using Driver<R>::get_latest_observation;
  using Driver<R>::apply_action;
  using Driver<R>::hold;

  explicit Breakable(const JointVector<R::kJoints>& begin) { robot.reset(begin, Random{1}); }

  DriverReport prepare(TimeIndex step) noexcept override {
    return is_homing ? DriverReport::busy() : robot.prepare(step);
  }
  DriverReport get_latest_observation(typename R::Observation& observation) noexcept override {
    DriverReport report = robot.get_latest_observation(&observation);
    if (measures_nothing) observation.position.fill(std::numeric_limits<double>::quiet_NaN());
    return report;
  }
  DriverReport apply_action(const typename R::Action& desired,
                            typename R::AppliedAction& applied) noexcept override {
    if (breaks) return DriverReport::fault(7);
    return robot.apply_action(&desired, &applied);
  }
  DriverReport hold(const typename R::Observation& observation,
                    typename R::Action& action) noexcept override {
    return robot.hold(&observation, &action);
  }
  [[nodiscard]] std::string_view fault_text(std::int32_t) const noexcept override {
    return "a cable broke";
  }

  std::atomic<bool> is_homing{false};
  std::atomic<bool> breaks{false};
  std::atomic<bool> measures_nothing{false};
  SimulatedRobot robot{guided_options<R>()};
};

// A robot in real time, in a thread of this process.
template <class R>
struct RunningRobot {
  explicit RunningRobot(bool is_homing = false, Clock& clock = MonotonicClock::instance())
      : driver(begin_pose()), backend(driver, host, patient(), clock) {
    driver.is_homing = is_homing;
    thread.emplace(backend);
  }

  // Not the initial pose, so that a jump to it would be seen.
  static JointVector<R::kJoints> begin_pose() {
    const GuidedRobot robot = guided_robot(guided_options<R>().description);
    JointVector<R::kJoints> pose{};
    for (std::size_t i = 0; i < R::kJoints; ++i)
      pose[i] = robot.home[static_cast<Eigen::Index>(i)] + (i % 3 == 0 ? 0.2 : 0.1);
    return pose;
  }
  [[nodiscard]] std::shared_ptr<UntypedFrontend> connect() const {
    auto frontend = std::make_shared<UntypedFrontend>(host);
    frontend->set_interrupt([] { static_cast<void>(interrupt_guide()); });
    return frontend;
  }
  [[nodiscard]] std::unique_ptr<Guide> guide(
      const GuideOptions& options = ordinary_thread()) const {
    return std::make_unique<Guide>(connect(), guided_robot(guided_options<R>().description),
                                   options);
  }

  Breakable<R> driver;
  SessionHost host{SessionHost::anonymous()};
  Backend backend;
  std::optional<BackendThread> thread;
};

void wait_for_step(const Guide& guide, TimeIndex step) {
  while (guide.state().step < step) std::this_thread::yield();
}

template <class R>
class GuideOf : public Test {};
using Robots = ::testing::Types<TriFinger, Finger>;
TYPED_TEST_SUITE(GuideOf, Robots);

TYPED_TEST(GuideOf, FollowsSetpointsOneAfterTheOther) {
  const RunningRobot<TypeParam> robot;
  const auto guide = robot.guide();
  const GuideState begin = guide->state();
  EXPECT_EQ(begin.mode, Mode::kHold);
  for (int finger = 0; finger < guide->num_fingers(); ++finger) {
    const Eigen::Vector3d tip = begin.tips.template segment<3>(3 * finger);
    guide->move_tip(finger, tip + Eigen::Vector3d(0.0, 0.0, 0.03));
  }
  guide->wait_until_arrived();
  const GuideState raised = guide->state();
  EXPECT_EQ(raised.mode, Mode::kMoveTip);
  EXPECT_EQ(raised.refusal, "");
  for (int finger = 0; finger < guide->num_fingers(); ++finger)
    EXPECT_NEAR(raised.tips[3 * finger + 2], begin.tips[3 * finger + 2] + 0.03, 0.004);

  guide->home();
  guide->wait_until_arrived();
  EXPECT_LT((guide->state().joints - guide->state().target_joints).cwiseAbs().maxCoeff(), 0.02);
  guide->move_joints(begin.joints);
  guide->wait_until_arrived();
  EXPECT_LT((guide->state().joints - begin.joints).cwiseAbs().maxCoeff(), 0.02);
  guide->float_freely();
  EXPECT_THROW(guide->wait_until_arrived(), InvalidArgument);
  guide->hold();
  guide->wait_until_arrived();
  guide->finish();
  EXPECT_EQ(guide->frontend().fault()->code, Fault::Code::kFinished);
  EXPECT_FALSE(guide->is_running());
  EXPECT_THROW(guide->hold(), InvalidArgument);
  EXPECT_NO_THROW(guide->check());
}

TYPED_TEST(GuideOf, SaysWhatCannotBeDone) {
  const RunningRobot<TypeParam> robot;
  const auto guide = robot.guide();
  EXPECT_THROW(guide->move_tip(guide->num_fingers(), {0.0, 0.0, 0.1}), InvalidArgument);
  EXPECT_THROW(guide->move_tip(0, {0.0, std::nan(""), 0.1}), InvalidArgument);
  EXPECT_THROW(guide->move_joints(JointValues::Zero(1)), InvalidArgument);
  EXPECT_THROW(guide->move_joints(JointValues::Constant(guide->num_joints(), std::nan(""))),
               InvalidArgument);
  guide->move_tip(0, {0.0, 0.0, 3.0});
  // The robot arrives where its tip is nearest, and the state shows that point.
  while (guide->state().mode != Mode::kMoveTip) std::this_thread::yield();
  EXPECT_NE(guide->state().refusal.find("finger 0 goes only to ("), std::string::npos);
  EXPECT_LT(guide->state().target_tips.template head<3>().norm(), 1.0);
}

TYPED_TEST(GuideOf, ActionsNeverJump) {
  const RunningRobot<TypeParam> robot;
  const auto guide = robot.guide();
  // Put before anything is measured.
  const Kinematics kinematics(guided_options<TypeParam>().description);
  const Eigen::Vector3d tip =
      kinematics.tip_positions(joint_values(RunningRobot<TypeParam>::begin_pose()))
          .template head<3>();
  guide->move_tip(0, tip + Eigen::Vector3d(0.0, 0.02, 0.03));
  guide->wait_until_arrived();
  guide->float_freely();
  while (guide->state().mode != Mode::kFloat) std::this_thread::yield();
  guide->home();
  guide->wait_until_arrived();
  guide->finish();
  // A late step takes the action that was appended one step earlier, so nothing jumps then either.
  const auto& frontend = guide->frontend();
  const auto [first, end] = frontend.range(Series::kDesiredAction);
  ASSERT_EQ(first, 0);
  typename TypeParam::Observation begin;
  JointVector<TypeParam::kJoints> before = RunningRobot<TypeParam>::begin_pose();
  bool is_floating = false;
  for (TimeIndex t = first; t < end; ++t) {
    typename TypeParam::Action action;
    frontend.get(Series::kDesiredAction, t, &action, kForever);
    const bool floats = std::isnan(action.position[0]);
    if (!floats && is_floating) {
      frontend.get(Series::kObservation, t, &begin, kForever);
      before = begin.position;
    }
    is_floating = floats;
    if (floats) continue;
    for (std::size_t i = 0; i < TypeParam::kJoints; ++i) {
      // After floating, the measurement of this step is not exactly that of the first reference.
      ASSERT_NEAR(action.position[i], before[i], 2e-3) << "at step " << t << ", joint " << i;
    }
    before = action.position;
  }
}

TYPED_TEST(GuideOf, TellsOfAFaultEverywhere) {
  RunningRobot<TypeParam> robot;
  const auto guide = robot.guide();
  guide->wait_until_arrived();
  robot.driver.breaks = true;
  EXPECT_THROW(
      while (true) {
        guide->check();
        std::this_thread::yield();
      },
      RobotStopped);
  EXPECT_THROW(guide->hold(), RobotStopped);
  EXPECT_THROW(guide->wait_until_arrived(), RobotStopped);
  EXPECT_NO_THROW(static_cast<void>(guide->state()));
  EXPECT_NO_THROW(guide->stop());
  EXPECT_NE(message_of<RobotStopped>([&] {
              guide->finish();
              return 0;
            }).find("a cable broke"),
            std::string::npos);
}

TYPED_TEST(GuideOf, HoldsAfterMeasurementsFailedWhileItFloated) {
  RunningRobot<TypeParam> robot;
  const auto guide = robot.guide();
  guide->float_freely();
  while (guide->state().mode != Mode::kFloat) std::this_thread::yield();
  robot.driver.measures_nothing = true;
  wait_for_step(*guide, guide->state().step + 20);
  guide->hold();
  while (guide->state().mode != Mode::kHold) std::this_thread::yield();
  EXPECT_TRUE(guide->state().joints.allFinite());
  EXPECT_TRUE(guide->state().reference_joints.allFinite());
  guide->finish();
}

TEST(Guide, EndsDuringHoming) {
  const RunningRobot<Finger> robot(true);
  {
    const auto guide = robot.guide();
    guide->home();
    EXPECT_THROW(static_cast<void>(guide->state(0ns)), TimedOut);
    EXPECT_TRUE(guide->is_running());
  }
  {
    const auto guide = robot.guide();
    guide->stop(kForever);
    EXPECT_FALSE(guide->is_running());
    EXPECT_THROW(static_cast<void>(guide->state()), InvalidArgument);
  }
  // The session has not begun, so it is still there for the next controller.
  EXPECT_FALSE(robot.connect()->fault().has_value());
}

TEST(Guide, GivesUpABackendThatDoesNotAnswer) {
  // Time stands still for this back-end, as if its process had been stopped.
  ManualClock clock;
  RunningRobot<Finger> robot(false, clock);
  {
    auto guide = robot.guide();
    std::atomic<bool> stands_still{false};
    std::thread time([&] {
      while (!stands_still) clock.tick(1ms);
    });
    wait_for_step(*guide, 5);
    stands_still = true;
    time.join();
    EXPECT_THROW(guide->finish(50ms), TimedOut);
    EXPECT_FALSE(guide->is_running());
    EXPECT_THROW(guide->stop(), TimedOut);
  }
  clock.run_free();
}

TEST(Guide, StopsWhateverOthersWaitFor) {
  const RunningRobot<Finger> robot;
  const auto guide = robot.guide();
  wait_for_step(*guide, 0);
  guide->move_tip(0, {0.0, 0.0, 0.4});
  auto arrival = std::async(std::launch::async, [&] { guide->wait_until_arrived(); });
  std::vector<std::future<void>> ends;
  for (int i = 0; i < 3; ++i) {
    ends.push_back(std::async(std::launch::async, [&] { guide->finish(60s); }));
    ends.push_back(std::async(std::launch::async, [&] { guide->stop(60s); }));
  }
  for (std::future<void>& end : ends) EXPECT_NO_THROW(end.get());
  EXPECT_FALSE(guide->is_running());
  try {
    arrival.get();
  } catch (const InvalidArgument& error) {
    EXPECT_NE(std::string(error.what()).find("has ended"), std::string::npos);
  }
  EXPECT_EQ(guide->frontend().fault()->code, Fault::Code::kFinished);
}

TEST(Guide, LetsAnInterruptEndAWait) {
  const RunningRobot<Finger> robot(true);
  struct Interrupt : std::exception {};
  GuideOptions options = ordinary_thread();
  options.interrupt = [] { throw Interrupt(); };
  const auto guide = robot.guide(options);
  EXPECT_THROW(static_cast<void>(guide->state()), Interrupt);
  EXPECT_THROW(guide->wait_until_arrived(), Interrupt);
}

TEST(Guide, ReleasesTheRobotForTheNextOne) {
  const RunningRobot<Finger> robot;
  for (int i = 0; i < 3; ++i) {
    const auto guide = robot.guide();
    guide->wait_until_arrived();
    if (i == 1) guide->finish();
  }
}

TEST(Guide, DrivesOnlyRobotsThatItCanSteer) {
  const GuidedRobot known = guided_robot(guided_options<Finger>().description);
  const auto refusal_of = [&](std::shared_ptr<UntypedFrontend> frontend) {
    return message_of<InvalidArgument>(
        [&] { return std::make_unique<Guide>(std::move(frontend), known, ordinary_thread()); });
  };
  SimulatedRobot simulation{guided_options<Finger>()};
  SessionHost host{SessionHost::anonymous()};
  Backend backend(simulation, host);
  EXPECT_NE(refusal_of(std::make_shared<UntypedFrontend>(backend)).find("not in real-time mode"),
            std::string::npos);

  const RunningRobot<TriFinger> other;
  EXPECT_NE(
      refusal_of(std::make_shared<UntypedFrontend>(other.host, FrontendOptions{.control = false}))
          .find("only observes"),
      std::string::npos);
  EXPECT_NE(refusal_of(other.connect()).find("9 joints, its description 3"), std::string::npos);
  // The refusals have released it.
  EXPECT_NO_THROW(static_cast<void>(other.guide()));

  // Nobody says what robot this is.
  EXPECT_THROW(Guide(other.connect(), ordinary_thread()), InvalidArgument);
}

TEST(Guide, IsOfNoUseInAForkedChild) {
  const RunningRobot<Finger> robot;
  auto guide = robot.guide();
  guide->wait_until_arrived();
  ChildProcess child([&] {
    int refused = 0;
    const std::function<void()> calls[] = {
        [&] { guide->hold(); }, [&] { static_cast<void>(guide->state()); }, [&] { guide->check(); },
        [&] { guide->finish(); }, [&] { guide->stop(); }};
    for (const auto& call : calls) {
      try {
        call();
      } catch (const InheritedHandle&) {
        ++refused;
      }
    }
    guide.reset();
    return refused == 5 ? 0 : 1;
  });
  EXPECT_EQ(child.wait(), 0);
  // The parent's guide goes on.
  guide->home();
  guide->wait_until_arrived();
  guide->finish();
}

TEST(GuidedRobot, NeedsAConfiguration) {
  const RunningRobot<Finger> robot;
  EXPECT_THROW(static_cast<void>(guided_robot(robot.connect()->session())), InvalidArgument);
}

TEST(GuidedRobot, IsNotFromAFile) {
  const Folder folder;
  write(folder / "arm.xml", kArm);
  write(folder / "arm.yml",
        std::string("name: arm\ndriver: simulation\nrobot: {mjcf: arm.xml}\n") + kArmSafety);
  const RobotConfig config = load_robot_config((folder / "arm.yml").string());
  const Simulation simulation(config.simulation, config.session);
  EXPECT_EQ(message_of<InvalidArgument>(
                [&] { return guided_robot(simulation.connect_untyped().session()).home.size(); }),
            "robot 'arm' is from a file; this is for a TriFinger or one of its fingers");
}

}  // namespace
}  // namespace trifinger::test
