// SPDX-License-Identifier: BSD-3-Clause
#include "shared_robot/cube_recovery.hpp"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <exception>
#include <limits>
#include <memory>
#include <optional>
#include <string>
#include <utility>

#include "shared_robot/robot_preparation.hpp"
#include "support/session_folder.hpp"
#include "trifinger/core/backend.hpp"
#include "trifinger/core/frontend.hpp"
#include "trifinger/sim/object_observation.hpp"
#include "trifinger/sim/robot_config.hpp"
#include "trifinger/sim/simulated_robot.hpp"

namespace trifinger::apps {
namespace {

TEST(IsInMiddle, LooksAtTheTableFromAbove) {
  EXPECT_TRUE(is_in_middle({0.02, -0.02, 0.0325}));
  EXPECT_FALSE(is_in_middle({0.02, -0.03, 0.0325}));
  EXPECT_FALSE(is_in_middle({std::numeric_limits<double>::quiet_NaN(), 0.0, 0.0}));
}

// A simulation that waits for its actions, with a cube at a place of ours.
class RobotWithCube {
 public:
  explicit RobotWithCube(const std::string& place)
      : config_(load_robot_config("sim", {"objects.0.position=" + place})),
        driver_(config_.simulation),
        host_(SessionHost::named(kName, config_.session)),
        backend_(driver_, host_, options(config_)),
        loop_(backend_) {
    EXPECT_TRUE(wait_until_free(kName, {}).is_fit);
  }

  static constexpr const char* kName = "cube-preparation";

 private:
  static BackendOptions options(const RobotConfig& config) {
    BackendOptions backend = config.backend;
    backend.mode = BackendOptions::Mode::kNonRealTime;
    return backend;
  }

  test::SessionFolder folder_;
  RobotConfig config_;
  SimulatedRobot driver_;
  SessionHost host_;
  Backend backend_;
  BackendThread loop_;
};

// Where the cube was when the session ended in which `bring_to_middle` drove the robot.
struct Brought {
  std::string problem;
  std::array<double, 3> place{};
};

Brought bring(const std::string& place) {
  const RobotWithCube robot(place);
  std::optional<UntypedFrontend> object;
  CubeObservation seen;
  const auto look = [&] {
    if (!object) object.emplace(Session::open(std::string(RobotWithCube::kName) + ".object"));
    const auto [first, end] = object->range(Series::kObservation);
    if (end > first) static_cast<void>(object->try_get(Series::kObservation, end - 1, &seen));
  };
  std::string problem = bring_to_middle(RobotWithCube::kName, look);
  return {.problem = std::move(problem), .place = seen.cube.position};
}

TEST(BringToMiddle, LeadsACubeThereFromAllSides) {
  for (const char* const place : {"[0.07, 0.04, 0.0325]", "[-0.06, 0.05, 0.0325]"}) {
    const Brought brought = bring(place);
    EXPECT_EQ(brought.problem, "") << place;
    EXPECT_LT(std::hypot(brought.place[0], brought.place[1]), 0.01) << place;
    EXPECT_NEAR(brought.place[2], 0.0325, 0.005) << place;
  }
}

TEST(BringToMiddle, SaysIfNoGraspReachesTheCube) {
  const Brought brought = bring("[0.175, 0, 0.0325]");
  EXPECT_NE(brought.problem.find("no grasp"), std::string::npos) << brought.problem;
}

TEST(BringToMiddle, PutsTheCubeDownWhenItIsInterrupted) {
  struct Interrupted : std::exception {};
  const RobotWithCube robot("[0.07, 0.04, 0.0325]");
  int steps = 0;
  const auto look = [&steps] {
    if (++steps == 2000) throw Interrupted();
  };
  EXPECT_THROW(static_cast<void>(bring_to_middle(RobotWithCube::kName, look)), Interrupted);
  EXPECT_EQ(steps, 2000);
  // The robot waits for the next user.
  const auto next = connect<TriFinger>(RobotWithCube::kName);
  EXPECT_EQ(next.current_time_index(), -1);
}

}  // namespace
}  // namespace trifinger::apps
