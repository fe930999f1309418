// SPDX-License-Identifier: BSD-3-Clause
#include "dynamixel/emulator.hpp"

#include <fcntl.h>
#include <gtest/gtest.h>
#include <termios.h>

#include <array>
#include <chrono>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <memory>
#include <string>
#include <vector>

#include "dynamixel/port.hpp"
#include "dynamixel/rig.hpp"
#include "support/folder.hpp"
#include "support/message_of.hpp"
#include "trifinger/ipc/file_descriptor.hpp"

namespace trifinger::dynamixel::test {
namespace {

using namespace std::chrono_literals;

// A busy machine may stop a thread for long; only silence that is expected waits for less.
constexpr BusOptions kPatient{.slack = 20s, .return_delay = 0us};

class Terminal : public ::testing::Test {
 protected:
  static Bus connect(const std::string& path, int baud = 4'000'000,
                     const BusOptions& options = kPatient) {
    return Bus(std::make_unique<SerialPort>(path, SerialOptions{.baud = baud}), options);
  }

  InertiaPlant plant_{kClawIds.size()};
  Emulator emulator_{motors_of(kClawIds, 4'000'000, 0us), plant_};
};

TEST_F(Terminal, HasNineMotorsThatAnswerInOrder) {
  Bus bus = connect(emulator_.path());
  std::vector<MotorAnswer> answers(kClawIds.size());
  for (const bool is_fast : {false, true}) {
    for (int i = 0; i < 20; ++i) {
      ASSERT_EQ(bus.sync_read(kClawIds, 126, 10, answers, is_fast), kClawIds.size());
    }
  }
  EXPECT_EQ(bus.counts().damaged, 0U);
  EXPECT_EQ(bus.counts().late, 0U);
}

TEST_F(Terminal, IsNeverFasterThanALine) {
  Bus bus = connect(emulator_.path());
  std::vector<MotorAnswer> answers(kClawIds.size());
  const std::vector<std::uint8_t> goals(36, 0);
  constexpr int kCycles = 50;
  const Instant begin = bus.port().now();
  for (int i = 0; i < kCycles; ++i) {
    ASSERT_EQ(bus.sync_read(kClawIds, 126, 10, answers), kClawIds.size());
    ASSERT_EQ(bus.sync_write(kClawIds, 116, 4, goals), Outcome::kDone);
  }
  bus.wait_until_sent();
  // 23 bytes of request, 21 of each motor, and 59 of goals.
  EXPECT_GE(bus.port().now() - begin, kCycles * bus.port().time_of(23 + 9 * 21 + 59));
}

TEST_F(Terminal, MovesItsMotors) {
  Bus bus = connect(emulator_.path());
  ASSERT_TRUE(bus.write(10, registers::kTorqueEnable, 1));
  ASSERT_TRUE(bus.write(10, registers::kGoalPosition, 2500));
  std::int32_t position = 0;
  while (position < 2450) ASSERT_TRUE(bus.read(10, registers::kPresentPosition, position));
}

TEST_F(Terminal, IsSilentAtAnotherRate) {
  Bus bus = connect(emulator_.path(), 1'000'000, {.slack = 50ms});
  Identity identity;
  EXPECT_EQ(bus.ping(10, identity).outcome, Outcome::kNoAnswer);
}

TEST_F(Terminal, IsChangedInItsThread) {
  Bus bus = connect(emulator_.path());
  emulator_.change([](EmulatedBus& line) { line.motor(3).fail(HardwareError::kEncoder); });
  std::int32_t bits = 0;
  const Answer answer = bus.read(20, registers::kHardwareErrorStatus, bits);
  EXPECT_TRUE(answer);
  EXPECT_TRUE(answer.alert);
  EXPECT_EQ(bits, bit_of(HardwareError::kEncoder));
}

TEST_F(Terminal, CanBeOpenedByOneProgramAtATime) {
  {
    const SerialPort first(emulator_.path());
    const std::string text = trifinger::test::message_of<Error>(
        [&] { static_cast<void>(SerialPort(emulator_.path())); });
    EXPECT_NE(text.find("another program has it"), std::string::npos) << text;
  }
  EXPECT_NO_THROW(SerialPort(emulator_.path()));
}

TEST(Terminals, TellTheirUserThatTheyHaveGone) {
  InertiaPlant plant(1);
  auto emulator = std::make_unique<Emulator>(motors_of({1}, 4'000'000, 0us), plant);
  Bus bus(std::make_unique<SerialPort>(emulator->path(), SerialOptions{.baud = 4'000'000}),
          kPatient);
  Identity identity;
  ASSERT_TRUE(bus.ping(1, identity));
  emulator.reset();
  EXPECT_EQ(bus.ping(1, identity).outcome, Outcome::kLineGone);
  EXPECT_EQ(bus.ping(1, identity).outcome, Outcome::kLineGone);
}

TEST(Terminals, CanBeOpenedAgainAfterTheyHadGone) {
  const trifinger::test::Folder folder;
  const std::string link = folder.path() / "claw";
  InertiaPlant plant(1);
  auto emulator =
      std::make_unique<Emulator>(motors_of({1}, 4'000'000, 0us), plant, EmulatedBusOptions{}, link);
  Bus bus(std::make_unique<SerialPort>(link, SerialOptions{.baud = 4'000'000}), kPatient);
  emulator.reset();
  Identity identity;
  EXPECT_EQ(bus.ping(1, identity).outcome, Outcome::kLineGone);
  const std::string text =
      trifinger::test::message_of<Error>([&] { return bus.port().reopen(), 0; });
  EXPECT_NE(text.find("check the adapter's plug"), std::string::npos) << text;
  EXPECT_FALSE(bus.port().is_open());
  emulator =
      std::make_unique<Emulator>(motors_of({1}, 4'000'000, 0us), plant, EmulatedBusOptions{}, link);
  bus.port().reopen();
  EXPECT_TRUE(bus.ping(1, identity));
}

TEST(Terminals, HaveALinkAsLongAsTheyLive) {
  const trifinger::test::Folder folder;
  const std::string link = folder.path() / "claw";
  InertiaPlant plant(1);
  {
    const Emulator emulator(motors_of({1}, 4'000'000, 0us), plant, {}, link);
    Bus bus(std::make_unique<SerialPort>(link, SerialOptions{.baud = 4'000'000}), kPatient);
    Identity identity;
    EXPECT_TRUE(bus.ping(1, identity));
  }
  EXPECT_FALSE(std::filesystem::is_symlink(link));
}

std::unique_ptr<Emulator> emulate(Plant& plant, const std::string& link) {
  return std::make_unique<Emulator>(motors_of({1}, 4'000'000, 0us), plant, EmulatedBusOptions{},
                                    link);
}

TEST(Terminals, BelongToOneEmulatorAtATime) {
  const trifinger::test::Folder folder;
  const std::string link = folder.path() / "claw";
  InertiaPlant plant(1);
  InertiaPlant other(1);
  auto emulator = emulate(plant, link);
  const std::string text =
      trifinger::test::message_of<InvalidArgument>([&] { return emulate(other, link); });
  EXPECT_NE(text.find(link + " belongs to motors that are emulated already"), std::string::npos)
      << text;
  EXPECT_EQ(std::filesystem::read_symlink(link), emulator->path());
  EXPECT_TRUE(Emulator::is_at(link));
  emulator.reset();
  EXPECT_FALSE(Emulator::is_at(link));
  EXPECT_NO_THROW(emulator = emulate(other, link));
}

// What a kill leaves: a link to a terminal that has become somebody else's.
TEST(Terminals, OfSomebodyElseAreNotTouchedThroughAnOldLink) {
  const trifinger::test::Folder folder;
  const std::string link = folder.path() / "claw";
  InertiaPlant plant(1);
  auto emulator = emulate(plant, link);
  SerialPort port(link, {.baud = 4'000'000, .is_emulated = true});
  emulator.reset();
  const ipc::FileDescriptor somebody([] { return ::posix_openpt(O_RDWR | O_NOCTTY | O_CLOEXEC); });
  ASSERT_EQ(::unlockpt(somebody.get()), 0);
  std::array<char, 64> name{};
  ASSERT_EQ(::ptsname_r(somebody.get(), name.data(), name.size()), 0);
  std::filesystem::create_symlink(name.data(), link);
  const auto expect_refusal = [](const auto& open) {
    const std::string text = trifinger::test::message_of<InvalidArgument>(open);
    EXPECT_NE(text.find("no motors are emulated at"), std::string::npos) << text;
  };
  expect_refusal([&] { return SerialPort(link, {.is_emulated = true}).is_open(); });
  expect_refusal([&] { port.reopen(); });
  termios settings{};
  ASSERT_EQ(::tcgetattr(somebody.get(), &settings), 0);
  EXPECT_NE(settings.c_lflag & ICANON, 0U);
  // Without the check it becomes raw.
  EXPECT_NO_THROW(SerialPort{link});
  ASSERT_EQ(::tcgetattr(somebody.get(), &settings), 0);
  EXPECT_EQ(settings.c_lflag & ICANON, 0U);
  // The next emulator replaces the link.
  emulator = emulate(plant, link);
  EXPECT_NO_THROW(port.reopen());
}

TEST(SerialPort, SaysWhatToDoIfThereIsNoDevice) {
  using trifinger::test::message_of;
  const auto text_of = [](const std::string& path) {
    return message_of<Error>([&] { static_cast<void>(SerialPort(path)); });
  };
  EXPECT_NE(text_of("/dev/no_such_adapter").find("/dev/serial/by-id"), std::string::npos);
  EXPECT_NE(text_of("/dev/null").find("no serial device"), std::string::npos);
  EXPECT_THROW(SerialPort("/dev/null", {.baud = 1}), InvalidArgument);
}

}  // namespace
}  // namespace trifinger::dynamixel::test
