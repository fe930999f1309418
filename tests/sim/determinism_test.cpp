// SPDX-License-Identifier: BSD-3-Clause
#include <gtest/gtest.h>

#include <chrono>
#include <memory>
#include <random>
#include <thread>

#include "core/transports.hpp"
#include "sim/recording.hpp"
#include "trifinger/sim/simulation.hpp"

namespace trifinger::test {
namespace {

SimulationOptions noisy_options(std::uint64_t seed = 1) {
  SimulationOptions options;
  options.seed = seed;
  options.object_delay = 23;
  options.object_position_noise = 1e-3;
  options.object_orientation_noise = 1e-2;
  return options;
}

constexpr int kRecordedSteps = 1500;
constexpr Triple kCentre{0, 0, 0.035};

Recording<TriFinger> reference(const SimulationOptions& options) {
  auto robot = simulate(options);
  Poking<TriFinger> poking(options.description, kCentre, 1);
  Recording<TriFinger> recording;
  record(robot, poking, kRecordedSteps, recording);
  return recording;
}

struct NoisyTriFinger {
  using Robot = TriFinger;
  static std::unique_ptr<UntypedDriver> make_driver() {
    return std::make_unique<SimulatedRobot>(noisy_options());
  }
};

template <class Transport>
class Determinism : public testing::Test {};

class Names {
 public:
  template <class Transport>
  static std::string GetName(int) {  // NOLINT(readability-identifier-naming): GoogleTest's
    return std::string(Transport::kName);
  }
};
using Transports = testing::Types<Inline, InProcess, AcrossProcesses>;
TYPED_TEST_SUITE(Determinism, Transports, Names);

TYPED_TEST(Determinism, GivesTheSameSeriesBitForBitWhateverTheDelays) {
  // The back-end sleeps at random; the user sleeps, too.
  typename TypeParam::template Rig<NoisyTriFinger> rig(
      {.session = {.history = 2048}, .injection = {.delay_seed = 5}});
  Frontend<TriFinger> robot = rig.connect();
  Poking<TriFinger> poking({}, kCentre, 1);
  std::minstd_rand random(7);
  const auto slow_poking = [&] {
    if (random() % 8 == 0) std::this_thread::sleep_for(std::chrono::microseconds(random() % 300));
    return poking();
  };
  Recording<TriFinger> recording;
  record(robot, slow_poking, kRecordedSteps, recording);

  EXPECT_EQ(first_difference(recording, reference(noisy_options())), "");
}

TEST(SimulatedRobot, MovesTheCubeInTheseTests) {
  // The recording must contain contacts, because otherwise the other tests would not cover them.
  const Recording<TriFinger> recording = reference(noisy_options());
  const auto& position = recording.cube.back().cube.position;
  EXPECT_GT(std::hypot(position[0], position[1]), 0.01);
}

TEST(SimulatedRobot, OtherSeedsGiveOtherNoiseAndTheSameMotion) {
  const Recording<TriFinger> one = reference(noisy_options(1));
  Recording<TriFinger> other = reference(noisy_options(2));
  EXPECT_EQ(first_difference(one, other), "pose of the cube 0");
  other.cube = one.cube;
  EXPECT_EQ(first_difference(one, other), "");
}

TEST(SimulatedRobot, EverySessionOfARobotIsTheSame) {
  const Simulation simulation(noisy_options());
  std::vector<Recording<TriFinger>> recordings(3);
  for (auto& recording : recordings) {
    auto robot = simulation.connect();
    Poking<TriFinger> poking({}, kCentre, 1);
    record(robot, poking, 300, recording);
    robot.finish();
  }
  EXPECT_EQ(first_difference(recordings[0], recordings[1]), "");
  EXPECT_EQ(first_difference(recordings[0], recordings[2]), "");
}

}  // namespace
}  // namespace trifinger::test
