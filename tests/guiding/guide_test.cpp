// SPDX-License-Identifier: BSD-3-Clause
#include "trifinger/guiding/guide.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cmath>
#include <cstring>
#include <exception>
#include <functional>
#include <future>
#include <limits>
#include <memory>
#include <span>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "core/fake_robot.hpp"
#include "guiding/frame_kinematics.hpp"
#include "guiding/robots.hpp"
#include "support/child_process.hpp"
#include "support/message_of.hpp"
#include "trifinger/realtime/clock.hpp"
#include "trifinger/sim/robot_config.hpp"
#include "trifinger/sim/simulation.hpp"

namespace trifinger::test {
namespace {

using namespace guiding;
using namespace std::chrono_literals;
using ::testing::TestWithParam;
using ::testing::ValuesIn;

// Real time that forgives a busy machine everything.
BackendOptions patient(Nanoseconds period) {
  return {.mode = BackendOptions::Mode::kRealTime,
          .period = period,
          .max_action_repeats = BackendOptions::kUnlimited,
          .max_skipped_ticks = BackendOptions::kUnlimited,
          .driver_timeout = 60s};
}

GuideOptions ordinary_thread() { return {.realtime = {.demand = Demand::kOff}}; }

// A simulated robot that homes until somebody lets it, and breaks when somebody wants it to.
class Breakable final : public UntypedDriver {
 public:
  Breakable(std::string_view name, const std::vector<double>& begin) : robot(guided_options(name)) {
    robot.reset(begin, Random{1});
  }

  [[nodiscard]] const RobotTypes& description() const noexcept override {
    return robot.description();
  }
  [[nodiscard]] std::span<const CompanionDescription> companions() const noexcept override {
    return robot.companions();
  }
  [[nodiscard]] bool get_companion_element(std::size_t index, TimeIndex time_index,
                                           void* element) noexcept override {
    return robot.get_companion_element(index, time_index, element);
  }
  [[nodiscard]] DriverReport prepare(TimeIndex step) noexcept override {
    return is_homing ? DriverReport::busy() : robot.prepare(step);
  }
  [[nodiscard]] DriverReport get_latest_observation(void* observation) noexcept override {
    const DriverReport report = robot.get_latest_observation(observation);
    copy_joints(observation, measured_);
    if (measures_nothing) {
      // The positions come first.
      std::ranges::fill(std::span(static_cast<double*>(observation), robot.model().joints().size()),
                        std::numeric_limits<double>::quiet_NaN());
    }
    return report;
  }
  [[nodiscard]] DriverReport apply_action(const void* desired, void* applied) noexcept override {
    watch(desired);
    return breaks ? DriverReport::fault(7) : robot.apply_action(desired, applied);
  }
  [[nodiscard]] DriverReport hold(const void* observation, void* action) noexcept override {
    return robot.hold(observation, action);
  }
  [[nodiscard]] DriverReport stop(TimeIndex step) noexcept override {
    // The next session begins elsewhere.
    std::ranges::fill(last_, std::numeric_limits<double>::quiet_NaN());
    return robot.stop(step);
  }
  void cut() noexcept override {}
  [[nodiscard]] std::string_view fault_text(std::int32_t) const noexcept override {
    return "a cable broke";
  }

  std::atomic<bool> is_homing{false};
  std::atomic<bool> breaks{false};
  std::atomic<bool> measures_nothing{false};
  // The largest change of a desired position from one step to the next [rad]. A slide's 0.1 m count
  // as 1 rad.
  std::atomic<double> largest_jump{0.0};
  SimulatedRobot robot;

 private:
  // Copies the joints' positions, or torques, with which an element begins.
  static void copy_joints(const void* element, std::vector<double>& joints) {
    std::memcpy(joints.data(), element, joints.size() * sizeof(double));
  }
  // A late step takes the action that was appended one step earlier, so nothing jumps then either.
  void watch(const void* desired) {
    std::vector<double> position(measured_.size());
    copy_joints(static_cast<const std::byte*>(desired) +
                    robot.description().action.find("position")->offset,
                position);
    for (std::size_t i = 0; i < position.size(); ++i) {
      // Where a hand has led the joint, or the robot has begun.
      if (std::isnan(last_[i])) last_[i] = measured_[i];
      if (std::isnan(position[i]) || std::isnan(last_[i])) continue;
      const double radian = robot.model().joints()[i].is_slide ? 0.1 : 1.0;
      largest_jump = std::max(largest_jump.load(), std::abs(position[i] - last_[i]) / radian);
    }
    last_ = std::move(position);
  }

  std::vector<double> measured_ = std::vector<double>(robot.model().joints().size());
  std::vector<double> last_ =
      std::vector<double>(measured_.size(), std::numeric_limits<double>::quiet_NaN());
};

// A robot in real time, in a thread of this process.
struct RunningRobot {
  explicit RunningRobot(const char* robot_name, bool is_homing = false,
                        Clock& clock = MonotonicClock::instance())
      : name(robot_name),
        driver(name, begin_pose(name)),
        backend(driver, host, patient(driver.robot.options().period), clock) {
    driver.is_homing = is_homing;
    thread.emplace(backend);
  }

  // Not the initial pose, so that a jump to it would be seen.
  static std::vector<double> begin_pose(const char* name) {
    const GuidedRobot robot = guided(name);
    std::vector<double> pose;
    for (std::size_t i = 0; i < robot.limits.size(); ++i) {
      const double radian = robot.model->joints()[i].is_slide ? 0.1 : 1.0;
      pose.push_back(robot.home[static_cast<Eigen::Index>(i)] + (i % 3 == 0 ? 0.2 : 0.1) * radian);
    }
    return pose;
  }
  [[nodiscard]] std::shared_ptr<UntypedFrontend> connect() const {
    auto frontend = std::make_shared<UntypedFrontend>(host);
    frontend->set_interrupt([] { static_cast<void>(interrupt_guide()); });
    return frontend;
  }
  [[nodiscard]] std::unique_ptr<Guide> guide(
      const GuideOptions& options = ordinary_thread()) const {
    return std::make_unique<Guide>(connect(), guided(name), options);
  }

  const char* name;
  Breakable driver;
  SessionHost host{SessionHost::anonymous()};
  Backend backend;
  std::optional<BackendThread> thread;
};

void wait_for_step(const Guide& guide, TimeIndex step) {
  while (guide.state().step < step) std::this_thread::yield();
}

class GuideOf : public TestWithParam<const char*> {};
INSTANTIATE_TEST_SUITE_P(Robots, GuideOf, ValuesIn(kGuidedRobots),
                         [](const auto& robot) { return std::string(robot.param); });

TEST_P(GuideOf, FollowsSetpointsOneAfterTheOther) {
  const RunningRobot robot(GetParam());
  const auto guide = robot.guide();
  const GuideState begin = guide->state();
  EXPECT_EQ(begin.mode, Mode::kHold);
  if (const auto displacement = line_of(GetParam())) {
    // Frames that share joints could not all go there.
    const bool are_fingers = GetParam() == std::string("trifinger");
    const int count = are_fingers ? static_cast<int>(begin.frames.cols()) : 1;
    for (int frame = 0; frame < count; ++frame) {
      guide->move_frame(frame, begin.frames.col(frame) + *displacement / 2);
    }
    guide->wait_until_arrived();
    const GuideState moved = guide->state();
    EXPECT_EQ(moved.mode, Mode::kMoveFrame);
    EXPECT_EQ(moved.refusal, "");
    for (int frame = 0; frame < count; ++frame) {
      EXPECT_LT((moved.frames.col(frame) - begin.frames.col(frame) - *displacement / 2).norm(),
                0.004);
    }
  }

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

TEST_P(GuideOf, SaysWhatCannotBeDone) {
  const RunningRobot robot(GetParam());
  const auto guide = robot.guide();
  const auto frames = static_cast<int>(guide->robot().frames.size());
  EXPECT_THROW(guide->move_frame(frames, {0.0, 0.0, 0.1}), InvalidArgument);
  EXPECT_THROW(guide->move_tip(0, {0.0, std::nan(""), 0.1}), InvalidArgument);
  EXPECT_THROW(guide->move_joints(GuidedJoints::Zero(2)), InvalidArgument);
  EXPECT_THROW(guide->move_joint(guide->num_joints(), 0.0), InvalidArgument);
  EXPECT_THROW(guide->move_joint(0, std::nan("")), InvalidArgument);
  EXPECT_THROW(guide->move_joints(GuidedJoints::Constant(guide->num_joints(), std::nan(""))),
               InvalidArgument);
  guide->move_tip(0, {2.0, 0.0, 3.0});
  // The robot arrives where its frame is nearest, and the state shows that point.
  while (guide->state().refusal.empty()) std::this_thread::yield();
  EXPECT_NE(guide->state().refusal.find(guide->robot().frames[0] + " goes only to ("),
            std::string::npos);
  EXPECT_LT(guide->state().target_frames.col(0).norm(), 2.0);
}

TEST_P(GuideOf, ActionsNeverJump) {
  const RunningRobot robot(GetParam());
  const auto guide = robot.guide();
  // Put before anything is measured.
  const std::vector<double> pose = RunningRobot::begin_pose(GetParam());
  guiding::detail::FrameKinematics kinematics(guided(GetParam()));
  const Eigen::Vector3d point =
      kinematics.point(0, GuidedJoints::Map(pose.data(), std::ssize(pose)));
  guide->move_frame(0, point + line_of(GetParam()).value_or(Eigen::Vector3d(0.1, 0.0, 0.1)) / 2);
  guide->wait_until_arrived();
  guide->float_freely();
  while (guide->state().mode != Mode::kFloat) std::this_thread::yield();
  guide->home();
  guide->wait_until_arrived();
  guide->finish();
  // After floating, the measurement of this step is not exactly that of the first reference.
  EXPECT_GT(robot.driver.largest_jump, 0.0);
  EXPECT_LT(robot.driver.largest_jump, 2.0 * period_of(guided_options(GetParam())));
}

TEST_P(GuideOf, TellsOfAFaultEverywhere) {
  RunningRobot robot(GetParam());
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

TEST_P(GuideOf, HoldsAfterMeasurementsFailedWhileItFloated) {
  RunningRobot robot(GetParam());
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

// Time that goes on in a thread of its own until somebody wants it to stand still.
class RunningTime {
 public:
  explicit RunningTime(ManualClock& clock) {
    thread_ = std::thread([this, &clock] {
      while (!stands_still_) clock.tick(1ms);
    });
  }
  RunningTime(const RunningTime&) = delete;
  RunningTime& operator=(const RunningTime&) = delete;
  ~RunningTime() { stand_still(); }
  void stand_still() {
    stands_still_ = true;
    if (thread_.joinable()) thread_.join();
  }

 private:
  std::atomic<bool> stands_still_{false};
  std::thread thread_;
};

TEST(Guide, TakesSetpointsInTheirOrder) {
  ManualClock clock;
  const RunningRobot robot("trifinger", false, clock);
  RunningTime time(clock);
  const auto guide = robot.guide();
  const GuideState begin = guide->state();
  time.stand_still();
  const auto go_on_until = [&](const auto& is_done) {
    while (!is_done(guide->state())) clock.tick(1ms);
  };
  guide->move_joints(begin.joints.array() + 0.3);
  go_on_until(
      [&](const GuideState& state) { return state.reference_joints[1] > begin.joints[1] + 0.1; });
  // Time stands still, so all of these are taken in one step.
  const Eigen::Vector3d up(0.0, 0.0, 0.02);
  guide->move_frame(2, begin.frames.col(2));
  guide->hold();
  guide->move_frame(0, begin.frames.col(0));
  guide->move_frame(1, begin.frames.col(1));
  guide->move_joint(0, begin.joints[0]);
  guide->move_joint(0, begin.joints[0] + 0.1);
  guide->move_joint(8, begin.joints[8]);
  guide->move_frame(1, begin.frames.col(1) + up);
  go_on_until([](const GuideState& state) { return state.has_arrived; });
  const GuideState end = guide->state();
  EXPECT_EQ(end.target_joints[0], begin.joints[0] + 0.1);
  // The joint came after the frame of its finger, which so holds where it has braked, as a finger
  // without a frame on its way does.
  EXPECT_GT(end.target_joints[7], begin.joints[7] + 0.05);
  EXPECT_LT(end.target_joints[7], begin.joints[7] + 0.25);
  EXPECT_NEAR(end.target_joints[1] - begin.joints[1], end.target_joints[7] - begin.joints[7], 1e-9);
  EXPECT_EQ(end.target_joints[8], begin.joints[8]);
  EXPECT_LT((end.target_frames.col(1) - begin.frames.col(1) - up).norm(), 1e-6);
  clock.run_free();
}

TEST(Guide, SaysWhyARobotCannotFloat) {
  const RunningRobot robot("finger");
  GuidedRobot known = guided("finger");
  known.refuses_torques = true;
  Guide guide(robot.connect(), known, ordinary_thread());
  EXPECT_NE(message_of<InvalidArgument>([&] {
              guide.float_freely();
              return 0;
            }).find("(dynamixel.mode: position)"),
            std::string::npos);
  EXPECT_EQ(guide.state().mode, Mode::kHold);
}

TEST(Guide, EndsDuringHoming) {
  const RunningRobot robot("finger", true);
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
  RunningRobot robot("finger", false, clock);
  {
    auto guide = robot.guide();
    RunningTime time(clock);
    wait_for_step(*guide, 5);
    time.stand_still();
    EXPECT_THROW(guide->finish(50ms), TimedOut);
    EXPECT_FALSE(guide->is_running());
    EXPECT_THROW(guide->stop(), TimedOut);
  }
  clock.run_free();
}

TEST(Guide, StopsWhateverOthersWaitFor) {
  const RunningRobot robot("finger");
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
  const RunningRobot robot("finger", true);
  struct Interrupt : std::exception {};
  GuideOptions options = ordinary_thread();
  options.interrupt = [] { throw Interrupt(); };
  const auto guide = robot.guide(options);
  EXPECT_THROW(static_cast<void>(guide->state()), Interrupt);
  EXPECT_THROW(guide->wait_until_arrived(), Interrupt);
}

TEST(Guide, ReleasesTheRobotForTheNextOne) {
  const RunningRobot robot("finger");
  for (int i = 0; i < 3; ++i) {
    const auto guide = robot.guide();
    guide->wait_until_arrived();
    if (i == 1) guide->finish();
  }
}

TEST(Guide, DrivesOnlyRobotsThatItCanSteer) {
  const GuidedRobot known = guided("finger");
  const auto refusal_of = [&](std::shared_ptr<UntypedFrontend> frontend) {
    return message_of<InvalidArgument>(
        [&] { return std::make_unique<Guide>(std::move(frontend), known, ordinary_thread()); });
  };
  SimulatedRobot simulation{guided_options("finger")};
  SessionHost host{SessionHost::anonymous()};
  Backend backend(simulation, host);
  EXPECT_NE(refusal_of(std::make_shared<UntypedFrontend>(backend)).find("not in real-time mode"),
            std::string::npos);

  const RunningRobot other("trifinger");
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
  const RunningRobot robot("finger");
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
  const RunningRobot robot("finger");
  EXPECT_THROW(static_cast<void>(guided_robot(robot.connect()->session())), InvalidArgument);
}

TEST(GuidedRobot, MayBeFromAFile) {
  const Folder folder;
  write(folder / "arm.xml", kArm);
  write(folder / "arm.yml",
        std::string("name: arm\ndriver: simulation\nrobot: {mjcf: arm.xml, initial_position: "
                    "{elbow: 0.7}}\n") +
            kArmSafety);
  const RobotConfig config = load_robot_config((folder / "arm.yml").string());
  const Simulation simulation(config.simulation, config.session);
  const UntypedFrontend frontend = simulation.connect_untyped();
  const GuidedRobot arm = guided_robot(frontend.session());
  EXPECT_EQ(arm.home[1], 0.7);
  EXPECT_EQ(arm.limits[0].default_kp, 20.0);
  EXPECT_EQ(arm.frames, std::vector<std::string>{"flap"});
  const auto refusal_of = [&](const char* frame) {
    return message_of<InvalidArgument>([&] {
      const std::vector<std::string> frames{frame};
      return std::make_unique<GuideController>(guided_robot(frontend.session(), frames),
                                               GuideSpeeds{});
    });
  };
  EXPECT_EQ(refusal_of("ball"), "no motor moves the frame 'ball'");
  EXPECT_NE(refusal_of("hand").find("the model has no frame 'hand'"), std::string::npos);
}

TEST(GuidedRobot, BeginsWhereItsSessionsBegin) {
  SimulationOptions options = guided_options("finger");
  options.initial_position = {0.1, 1.0, -1.5};
  EXPECT_EQ(guided_robot(options).home, Eigen::Vector3d(0.1, 1.0, -1.5));
  EXPECT_EQ(guided("finger").home, Eigen::Vector3d(0.0, 0.9, -1.7));
}

TEST(Guide, SaysWhyItSteersOnlyJoints) {
  FakeDriver driver;
  SessionHost host{SessionHost::anonymous()};
  Backend backend(driver, host, patient(std::chrono::milliseconds(1)));
  const BackendThread thread(backend);
  const std::string refusal = message_of<InvalidArgument>([&] {
    return std::make_unique<Guide>(std::make_shared<UntypedFrontend>(host), guided("finger"),
                                   ordinary_thread());
  });
  EXPECT_NE(refusal.find("a guide steers joints by torques and positions"), std::string::npos)
      << refusal;
}

}  // namespace
}  // namespace trifinger::test
