// SPDX-License-Identifier: BSD-3-Clause
#include "dynamixel/motor_group.hpp"

#include <gtest/gtest.h>

#include <array>
#include <chrono>
#include <cmath>
#include <cstdint>
#include <functional>
#include <limits>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "dynamixel/rig.hpp"
#include "support/allocation_counter.hpp"
#include "support/message_of.hpp"

namespace trifinger::dynamixel::test {
namespace {

using namespace std::chrono_literals;
namespace regs = registers;

MotorGroupOptions claw(OperatingMode mode) { return {.ids = kClawIds, .mode = mode}; }

// The port of a line, which tells of everything that the host sends before the line has it.
class ToldPort final : public Port {
 public:
  using Told = std::function<void(std::span<const std::uint8_t>)>;

  ToldPort(std::unique_ptr<Port> port, const Told& told) : port_(std::move(port)), told_(told) {}

  [[nodiscard]] Instant now() const noexcept override { return port_->now(); }
  [[nodiscard]] int baud() const noexcept override { return port_->baud(); }
  [[nodiscard]] bool is_open() const noexcept override { return port_->is_open(); }
  void reopen() override { port_->reopen(); }
  [[nodiscard]] bool write(std::span<const std::uint8_t> bytes,
                           Instant deadline) noexcept override {
    if (told_) told_(bytes);
    return port_->write(bytes, deadline);
  }
  [[nodiscard]] std::size_t read(std::span<std::uint8_t> bytes,
                                 Instant deadline) noexcept override {
    return port_->read(bytes, deadline);
  }
  void sleep_until(Instant instant) noexcept override { port_->sleep_until(instant); }

 private:
  std::unique_ptr<Port> port_;
  const Told& told_;
};

// What a packet asks of whom.
MotorId id_in(std::span<const std::uint8_t> packet) { return packet[4]; }
Instruction instruction_in(std::span<const std::uint8_t> packet) {
  return static_cast<Instruction>(packet[7]);
}
bool is_read_of(const Register& which, std::span<const std::uint8_t> packet) {
  return instruction_in(packet) == Instruction::kRead &&
         number_in(packet.subspan(8, 2)) == which.address;
}

// Nine emulated motors and a group of them, in simulated time.
class GroupRig {
 public:
  explicit GroupRig(MotorGroupOptions options, const EmulatedBusOptions& bus = {},
                    const std::vector<EmulatedMotorOptions>& motors = motors_of(kClawIds, 4'000'000,
                                                                                500us))
      : plant(motors.size()), line(motors, plant, kBegin, bus) {
    auto made = std::make_unique<EmulatedPort>(line, 4'000'000, kBegin);
    port = made.get();
    group = std::make_unique<MotorGroup>(std::make_unique<ToldPort>(std::move(made), before_packet),
                                         std::move(options));
  }

  void cycle(int count, double goal) const {
    const std::vector<double> goals(group->size(), goal);
    for (int i = 0; i < count; ++i) group->cycle(goals);
  }
  // Cycles until there is a fault; fails if none comes.
  void cycle_until_fault(double goal = 0.0) const {
    for (int i = 0; i < 100'000 && group->fault().kind == MotorFault::kNone; ++i) cycle(1, goal);
    EXPECT_NE(group->fault().kind, MotorFault::kNone);
  }

  void release_and_expect_no_torque() {
    EXPECT_EQ(group->release(), std::nullopt);
    for (std::size_t i = 0; i < 9; ++i) {
      EXPECT_EQ(line.motor(i).value(regs::kTorqueEnable), 0) << i;
      EXPECT_EQ(line.motor(i).value(regs::kGoalCurrent), 0) << i;
      EXPECT_FALSE(group->readings()[i].has_torque) << i;
    }
  }

  InertiaPlant plant;
  EmulatedBus line;
  ToldPort::Told before_packet{};
  EmulatedPort* port{nullptr};  // the group owns it
  std::unique_ptr<MotorGroup> group;
};

std::string text_of(const GroupFault& fault) { return std::string(describe(fault).view()); }

TEST(MotorGroup, SetsUpMotorsThatAreNew) {
  GroupRig rig(claw(OperatingMode::kCurrent));
  rig.group->start();
  for (std::size_t i = 0; i < rig.group->size(); ++i) {
    EmulatedMotor& motor = rig.line.motor(i);
    EXPECT_EQ(motor.value(regs::kTorqueEnable), 1);
    EXPECT_EQ(motor.value(regs::kOperatingMode), static_cast<int>(OperatingMode::kCurrent));
    EXPECT_EQ(motor.value(regs::kReturnDelay), 0);
    EXPECT_EQ(motor.value(regs::kBusWatchdog), 5);
    EXPECT_EQ(rig.group->model(i).number, kXm430W210.number);
  }
}

// The numbers of these motors.
std::vector<MotorId> ids_of(const std::vector<EmulatedMotorOptions>& motors) {
  std::vector<MotorId> ids;
  for (const EmulatedMotorOptions& motor : motors) ids.push_back(motor.id);
  return ids;
}

TEST(MotorGroup, DrivesMotorsOfAllModelsTogetherToPositions) {
  const auto motors = motors_of_all_models(4'000'000);
  GroupRig rig({.ids = ids_of(motors), .mode = OperatingMode::kPosition}, {}, motors);
  rig.group->start();
  rig.cycle(4000, 0.7);
  ASSERT_EQ(rig.group->fault().kind, MotorFault::kNone) << text_of(rig.group->fault());
  for (std::size_t i = 0; i < motors.size(); ++i) {
    const MotorModel& model = rig.group->model(i);
    const MotorReading& reading = rig.group->readings()[i];
    EXPECT_EQ(model.name, kMotorModels[i].name);
    EXPECT_NEAR(reading.position, 0.7, 0.06) << model.name;
    EXPECT_NEAR(reading.supply, model.voltage, 0.051) << model.name;
    EXPECT_EQ(std::isnan(reading.current), !model.has_current()) << model.name;
  }
  EXPECT_EQ(rig.group->release(), std::nullopt);
}

TEST(MotorGroup, GivesMotorsGainsOnlyForPositions) {
  for (const OperatingMode mode :
       {OperatingMode::kCurrent, OperatingMode::kVelocity, OperatingMode::kPosition,
        OperatingMode::kExtendedPosition, OperatingMode::kCurrentBasedPosition}) {
    MotorGroupOptions options = claw(mode);
    options.position_gains = {.p = 600, .i = 7, .d = 200};
    GroupRig rig(options);
    rig.group->start();
    const bool has_positions = mode != OperatingMode::kCurrent && mode != OperatingMode::kVelocity;
    for (std::size_t i = 0; i < 9; ++i) {
      EXPECT_EQ(rig.line.motor(i).value(regs::kPositionPGain), has_positions ? 600 : 800);
      EXPECT_EQ(rig.line.motor(i).value(regs::kPositionIGain), has_positions ? 7 : 0);
      EXPECT_EQ(rig.line.motor(i).value(regs::kPositionDGain), has_positions ? 200 : 0);
    }
  }
}

TEST(MotorGroup, GivesMotorsOfAllModelsWithCurrentsTheSameCurrent) {
  auto motors = motors_of_all_models(4'000'000);
  std::erase_if(motors, [](const auto& motor) { return !motor.model->has_current(); });
  for (const OperatingMode mode : {OperatingMode::kCurrent, OperatingMode::kCurrentBasedPosition}) {
    GroupRig rig({.ids = ids_of(motors), .mode = mode, .max_current = 0.2}, {}, motors);
    rig.group->start();
    rig.cycle(3, 0.2);
    for (std::size_t i = 0; i < motors.size(); ++i) {
      const double unit = motors[i].model->current_unit;
      const double given = unit * rig.line.motor(i).value(regs::kGoalCurrent);
      EXPECT_LE(given, 0.2 + 1e-12) << motors[i].model->name;
      EXPECT_GT(given, 0.2 - unit) << motors[i].model->name;
    }
  }
}

TEST(MotorGroup, RefusesModesWithCurrentsForMotorsWithoutThem) {
  for (const MotorModel& model : kMotorModels) {
    for (const OperatingMode mode :
         {OperatingMode::kCurrent, OperatingMode::kCurrentBasedPosition, OperatingMode::kVelocity,
          OperatingMode::kPosition, OperatingMode::kExtendedPosition}) {
      GroupRig rig({.ids = {0}, .sensors = {1}, .mode = mode}, {},
                   {{.id = 0, .model = &model, .baud = 4'000'000},
                    {.id = 1, .model = find_model("XL430-W250"), .baud = 4'000'000}});
      const std::string text =
          trifinger::test::message_of<Error>([&] { return rig.group->start(), 0; });
      const std::string refusal =
          "motor 0 (" + std::string(model.name) +
          ") neither measures nor limits its current, so it has no mode \"" +
          std::string(name_of(mode)) + "\"; set mode: position and max_current: .inf";
      EXPECT_EQ(text, model.has(mode) ? "nothing" : refusal);
    }
  }
}

TEST(MotorGroup, NamesTheModelsThatItKnowsIfItFindsAnother) {
  GroupRig rig(claw(OperatingMode::kCurrent));
  rig.line.motor(4).set_value(regs::kModelNumber, 12);
  const std::string text =
      trifinger::test::message_of<Error>([&] { return rig.group->start(), 0; });
  EXPECT_NE(text.find("motor 21 is of model 12, which is not known"), std::string::npos) << text;
  for (const MotorModel& model : kMotorModels) {
    EXPECT_NE(text.find(model.name), std::string::npos) << text;
  }
}

TEST(MotorGroup, RefusesAMotorOfAnotherModelThanWasSaid) {
  MotorGroupOptions options = claw(OperatingMode::kCurrent);
  options.models = {nullptr, &kXm430W210, find_model("XL330-M288")};
  GroupRig rig(options);
  EXPECT_EQ(trifinger::test::message_of<Error>([&] { return rig.group->start(), 0; }),
            "motor 12 is of model XM430-W210, but must be of model XL330-M288; correct the model, "
            "or exchange the motor");
  options.models.pop_back();
  GroupRig other(options);
  other.group->start();
}

TEST(MotorGroup, SetsUpMotorsThatAnswerNothingButPings) {
  for (const std::int32_t level : {0, 1}) {
    GroupRig rig(claw(OperatingMode::kCurrent));
    rig.line.motor(2).set_value(regs::kStatusReturnLevel, level);
    rig.group->start();
    EXPECT_EQ(rig.line.motor(2).value(regs::kStatusReturnLevel), 2);
    EXPECT_EQ(rig.line.motor(2).value(regs::kTorqueEnable), 1);
  }
}

TEST(MotorGroup, DrivesCurrentsAndMeasuresThem) {
  GroupRig rig(claw(OperatingMode::kCurrent));
  rig.group->start();
  rig.cycle(20, 0.5);
  for (const MotorReading& reading : rig.group->readings()) {
    EXPECT_NEAR(reading.current, 0.5, kXm430W210.current_unit);
    EXPECT_GT(reading.velocity, 0.0);
    EXPECT_LE(rig.port->now() - reading.measured, 2ms);
  }
  EXPECT_EQ(rig.group->fault().kind, MotorFault::kNone);
}

TEST(MotorGroup, GoesToPositionsInEveryModeOfPositions) {
  for (const OperatingMode mode : {OperatingMode::kPosition, OperatingMode::kExtendedPosition,
                                   OperatingMode::kCurrentBasedPosition}) {
    MotorGroupOptions options = claw(mode);
    options.max_current = 1.0;
    GroupRig rig(options);
    rig.group->start();
    rig.cycle(4000, 0.7);
    for (const MotorReading& reading : rig.group->readings()) {
      EXPECT_NEAR(reading.position, 0.7, 0.05) << name_of(mode);
    }
  }
}

TEST(MotorGroup, KeepsAVelocity) {
  GroupRig rig(claw(OperatingMode::kVelocity));
  rig.group->start();
  rig.cycle(3000, 2.0);
  for (const MotorReading& reading : rig.group->readings()) EXPECT_NEAR(reading.velocity, 2.0, 0.1);
}

TEST(MotorGroup, StartsWhereTheMotorsAre) {
  GroupRig rig(claw(OperatingMode::kPosition));
  for (std::size_t i = 0; i < 9; ++i) rig.plant.set_position(i, 0.1 * static_cast<double>(i));
  rig.group->start();
  rig.cycle(500, std::nan(""));
  for (std::size_t i = 0; i < 9; ++i) {
    EXPECT_NEAR(rig.plant.position(i), 0.1 * static_cast<double>(i), 2 * kPositionUnit);
  }
}

TEST(MotorGroup, KnowsWhereMotorsAreThoughTheFirstReadOfAllIsLost) {
  for (const OperatingMode mode : {OperatingMode::kCurrent, OperatingMode::kPosition}) {
    GroupRig rig({.ids = {10, 11, 12, 20, 21, 22, 30, 31}, .sensors = {32}, .mode = mode});
    for (std::size_t i = 0; i < 9; ++i) {
      rig.plant.set_position(i, 0.1 * static_cast<double>(i + 1));
    }
    rig.before_packet = [&](std::span<const std::uint8_t> packet) {
      const bool is_of_all = instruction_in(packet) == Instruction::kFastSyncRead;
      rig.line.set_faults({.lost = is_of_all ? 1.0 : 0.0});
    };
    rig.group->start();
    EXPECT_EQ(rig.line.counts().lost, 1U);
    for (std::size_t i = 0; i < 9; ++i) {
      const MotorReading& reading = rig.group->readings()[i];
      EXPECT_EQ(reading.missing, 1U);
      EXPECT_NEAR(reading.position, 0.1 * static_cast<double>(i + 1), 2 * kPositionUnit);
    }
    EXPECT_EQ(rig.group->fault().kind, MotorFault::kNone);
  }
}

TEST(MotorGroup, SendsNoGoalThatIsTooLargeOrNoNumber) {
  MotorGroupOptions options = claw(OperatingMode::kCurrent);
  options.max_current = 0.3;
  GroupRig rig(options);
  rig.group->start();
  const double infinity = std::numeric_limits<double>::infinity();
  for (const double goal : {1e300, -1e300, 0.3, -0.3001, infinity, std::nan("")}) {
    rig.cycle(3, goal);
    rig.port->sleep_until(rig.port->now() + 2ms);
    for (std::size_t i = 0; i < 9; ++i) {
      const double current = rig.line.motor(i).current();
      EXPECT_LE(std::abs(current), 0.3);
      if (!std::isfinite(goal)) {
        EXPECT_EQ(current, 0.0);
      }
    }
  }
}

TEST(MotorGroup, KeepsToTheLimitsThatAreStoredInAMotor) {
  // A motor would refuse a goal beyond them without a word, and go on with the one before.
  struct Case {
    OperatingMode mode;
    Register limit;
    std::int32_t stored;
    Register goal;
  };
  for (const Case& limited :
       {Case{OperatingMode::kCurrent, regs::kCurrentLimit, 50, regs::kGoalCurrent},
        Case{OperatingMode::kVelocity, regs::kVelocityLimit, 40, regs::kGoalVelocity},
        Case{OperatingMode::kPosition, regs::kMaxPositionLimit, 2500, regs::kGoalPosition}}) {
    GroupRig rig(claw(limited.mode));
    rig.line.motor(5).set_value(limited.limit, limited.stored);
    rig.group->start();
    rig.cycle(3, 3.0);
    EXPECT_EQ(rig.line.motor(5).value(limited.goal), limited.stored) << limited.goal.name;
    EXPECT_GT(rig.line.motor(4).value(limited.goal), limited.stored) << limited.goal.name;
  }
}

TEST(MotorGroup, DoesNotStartAMotorThatGivesLessCurrentThanWasAskedFor) {
  for (const OperatingMode mode : {OperatingMode::kCurrent, OperatingMode::kCurrentBasedPosition}) {
    MotorGroupOptions options = claw(mode);
    options.max_current = 0.3;
    GroupRig rig(options);
    rig.line.motor(5).set_value(regs::kCurrentLimit, 100);
    const std::string text =
        trifinger::test::message_of<Error>([&] { return rig.group->start(), 0; });
    EXPECT_NE(text.find("motor 22 (XM430-W210) gives at most 0.269 A"), std::string::npos) << text;
    EXPECT_NE(text.find("but max_current is 0.3 A"), std::string::npos) << text;
    rig.line.motor(5).set_value(regs::kCurrentLimit, 111);
    rig.group->start();
    EXPECT_EQ(rig.line.motor(5).value(regs::kTorqueEnable), 1);
  }
}

// Another program may have left a motor slow, or weak.
TEST(MotorGroup, LeavesNothingOfAnotherProgramInForce) {
  for (const OperatingMode mode : {OperatingMode::kPosition, OperatingMode::kCurrentBasedPosition,
                                   OperatingMode::kVelocity, OperatingMode::kCurrent}) {
    GroupRig rig(claw(mode));
    for (std::size_t i = 0; i < 9; ++i) {
      EmulatedMotor& motor = rig.line.motor(i);
      motor.set_value(regs::kOperatingMode, static_cast<int>(mode));
      motor.set_value(regs::kPwmLimit, 800);
      motor.set_value(regs::kGoalPwm, 20);
      motor.set_value(regs::kGoalCurrent, 1);
      motor.set_value(regs::kProfileVelocity, 1);
      motor.set_value(regs::kProfileAcceleration, 1);
    }
    rig.group->start();
    for (std::size_t i = 0; i < 9; ++i) {
      EmulatedMotor& motor = rig.line.motor(i);
      EXPECT_EQ(motor.value(regs::kGoalPwm), 800);
      EXPECT_EQ(motor.value(regs::kProfileVelocity), 0);
      EXPECT_EQ(motor.value(regs::kProfileAcceleration), 0);
    }
    if (mode == OperatingMode::kVelocity || mode == OperatingMode::kCurrent) continue;
    rig.cycle(4000, 0.7);
    for (const MotorReading& reading : rig.group->readings()) {
      EXPECT_NEAR(reading.position, 0.7, 0.05) << name_of(mode);
    }
  }
}

TEST(MotorGroup, RefusesATimeBasedProfileByName) {
  GroupRig rig(claw(OperatingMode::kCurrent));
  rig.line.motor(3).set_value(regs::kDriveMode, kReversed);
  EXPECT_NO_THROW(rig.group->start());
  rig.line.motor(3).set_value(regs::kDriveMode, kReversed | kTimeBasedProfile);
  const std::string text =
      trifinger::test::message_of<Error>([&] { return rig.group->start(), 0; });
  EXPECT_NE(text.find("motor 20 has a time-based profile"), std::string::npos) << text;
  EXPECT_EQ(rig.line.motor(3).value(regs::kTorqueEnable), 0);
}

TEST(MotorGroup, SaysWhichFirmwareIsTooOldForFastSyncRead) {
  std::vector<EmulatedMotorOptions> motors = motors_of(kClawIds, 4'000'000, 0us);
  motors[7].firmware = 44;
  MotorGroupOptions options = claw(OperatingMode::kCurrent);
  {
    GroupRig rig(options, {}, motors);
    const std::string text =
        trifinger::test::message_of<Error>([&] { return rig.group->start(), 0; });
    EXPECT_NE(text.find("motor 31 has firmware 44, but fast sync read needs 45; set "
                        "fast_sync_read: false, or update the firmware"),
              std::string::npos)
        << text;
  }
  options.is_fast = false;
  GroupRig rig(options, {}, motors);
  rig.group->start();
  rig.cycle(1000, 0.1);
  EXPECT_EQ(rig.group->fault().kind, MotorFault::kNone) << text_of(rig.group->fault());
  EXPECT_EQ(rig.group->counts().missing, 0U);
}

TEST(MotorGroup, WritesWhatIsKeptOnlyOnce) {
  GroupRig rig(claw(OperatingMode::kCurrent));
  rig.group->start();
  const std::uint64_t first = rig.group->counts().instructions;
  rig.group->start();
  // The second start finds return delay and mode as they must be: two writes less per motor.
  EXPECT_EQ(rig.group->counts().instructions - first, first - 2 * rig.group->size());
}

TEST(MotorGroup, ReadsSensorsAndGivesThemNoTorque) {
  GroupRig rig({.ids = {10, 11, 12, 20, 21, 22, 30, 31}, .sensors = {32}});
  rig.line.motor(8).set_value(regs::kTorqueEnable, 1);
  rig.group->start();
  rig.plant.set_position(8, 0.7);
  ASSERT_EQ(rig.group->size(), 9U);
  EXPECT_EQ(rig.group->num_driven(), 8U);
  rig.cycle(2000, 0.1);
  EXPECT_EQ(rig.group->fault().kind, MotorFault::kNone) << text_of(rig.group->fault());
  EXPECT_EQ(rig.line.motor(8).value(regs::kTorqueEnable), 0);
  EXPECT_NEAR(rig.group->readings()[8].position, 0.7, 2e-3);
  EXPECT_GT(rig.group->readings()[7].velocity, 0.1);
  EXPECT_NE(rig.group->readings()[8].supply, 0.0);

  rig.line.motor(8).set_power(false);
  rig.cycle_until_fault();
  EXPECT_EQ(rig.group->fault().motor, 32);
  EXPECT_NE(trifinger::test::message_of<InvalidArgument>([] {
              const GroupRig twice({.ids = {1, 2}, .sensors = {2}});
            }).find("same motor twice"),
            std::string::npos);
}

TEST(MotorGroup, TakesNoLateAnswerForThatToAnotherRead) {
  // The return delay is read twice, because its first answer is late. Both answers are 0, which as
  // an operating mode would mean that the motor follows currents already.
  GroupRig rig(claw(OperatingMode::kCurrent));
  for (std::size_t i = 0; i < 9; ++i) rig.line.motor(i).set_value(regs::kReturnDelay, 0);
  ASSERT_EQ(rig.line.motor(0).value(regs::kOperatingMode),
            static_cast<int>(OperatingMode::kPosition));
  int reads = 0;
  rig.before_packet = [&](std::span<const std::uint8_t> packet) {
    rig.line.set_faults({});
    if (id_in(packet) != 10 || !is_read_of(regs::kReturnDelay, packet)) return;
    // The first one comes shortly after its time limit, the second one shortly after the first.
    ++reads;
    if (reads == 1) rig.line.set_faults({.late = 1.0, .delay = 4700us});
    if (reads == 2) rig.line.set_faults({.late = 1.0, .delay = 2000us});
  };
  rig.group->start();
  EXPECT_GE(reads, 2);
  EXPECT_GT(rig.group->counts().late, 0U);
  EXPECT_EQ(rig.line.motor(0).value(regs::kOperatingMode),
            static_cast<int>(OperatingMode::kCurrent));
}

TEST(MotorGroup, DoesNotUseAMotorThatKeepsAnotherMode) {
  GroupRig rig(claw(OperatingMode::kCurrent));
  int reads = 0;
  rig.before_packet = [&](std::span<const std::uint8_t> packet) {
    if (id_in(packet) != 10 || !is_read_of(regs::kOperatingMode, packet)) return;
    if (++reads == 2) rig.line.motor(0).set_value(regs::kOperatingMode, 1);
  };
  const std::string text =
      trifinger::test::message_of<Error>([&] { return rig.group->start(), 0; });
  EXPECT_NE(text.find("motor 10 is in mode 1, but was set to mode 0"), std::string::npos) << text;
}

TEST(MotorGroup, SaysWhichMotorDoesNotAnswer) {
  GroupRig rig(claw(OperatingMode::kCurrent));
  rig.line.motor(4).set_power(false);
  const std::string text =
      trifinger::test::message_of<Error>([&] { return rig.group->start(), 0; });
  EXPECT_NE(text.find("motor 21 does not answer"), std::string::npos) << text;
}

TEST(MotorGroup, RebootsAMotorWithAnErrorOnlyIfItMay) {
  MotorGroupOptions options = claw(OperatingMode::kCurrent);
  {
    GroupRig rig(options);
    rig.line.motor(2).fail(HardwareError::kOverload);
    EXPECT_NO_THROW(rig.group->start());
    EXPECT_EQ(rig.line.motor(2).value(regs::kTorqueEnable), 1);
  }
  options.reboot_after_error = false;
  GroupRig rig(options);
  rig.line.motor(2).fail(HardwareError::kOverload);
  const std::string text =
      trifinger::test::message_of<Error>([&] { return rig.group->start(), 0; });
  EXPECT_NE(text.find("motor 12"), std::string::npos) << text;
  EXPECT_NE(text.find(dynamixel::text_of(HardwareError::kOverload).sentence), std::string::npos);
}

TEST(MotorGroup, NamesEveryHardwareErrorWhileItRuns) {
  for (const HardwareError error : kHardwareErrors) {
    GroupRig rig(claw(OperatingMode::kCurrent));
    rig.group->start();
    rig.cycle(5, 0.1);
    rig.line.motor(7).fail(error);
    rig.cycle(1, 0.1);
    EXPECT_EQ(rig.group->fault().kind, MotorFault::kHardwareError);
    EXPECT_EQ(rig.group->fault().motor, 31);
    const std::string text = text_of(rig.group->fault());
    EXPECT_NE(text.find(dynamixel::text_of(error).sentence), std::string::npos) << text;
    EXPECT_NE(text.find(dynamixel::text_of(error).remedy), std::string::npos) << text;
  }
}

TEST(MotorGroup, NoticesAMotorThatFallsSilent) {
  GroupRig rig(claw(OperatingMode::kCurrent));
  rig.group->start();
  rig.cycle(5, 0.0);
  rig.line.motor(8).set_power(false);
  const Instant off = rig.port->now();
  rig.cycle_until_fault();
  EXPECT_EQ(rig.group->fault().kind, MotorFault::kSilent);
  EXPECT_EQ(rig.group->fault().motor, 32);
  EXPECT_GE(rig.port->now() - off, rig.group->options().silent_after);
}

TEST(MotorGroup, NoticesAMotorThatHasRestarted) {
  GroupRig rig(claw(OperatingMode::kCurrent));
  rig.group->start();
  rig.cycle(5, 0.0);
  rig.line.motor(3).set_power(false);
  rig.line.motor(3).set_power(true);
  rig.cycle_until_fault();
  EXPECT_EQ(rig.group->fault().kind, MotorFault::kTorqueLost);
  EXPECT_EQ(rig.group->fault().motor, 20);
}

TEST(MotorGroup, StopsByTheWatchdogIfTheHostStalls) {
  GroupRig rig(claw(OperatingMode::kCurrent));
  rig.group->start();
  rig.cycle(5, 0.5);
  rig.port->sleep_until(rig.port->now() + 130ms);
  for (std::size_t i = 0; i < 9; ++i) EXPECT_EQ(rig.line.motor(i).torque(), 0.0);
  rig.cycle_until_fault(0.5);
  EXPECT_EQ(rig.group->fault().kind, MotorFault::kWatchdog);
  // A start makes them work again.
  rig.group->start();
  rig.cycle(5, 0.5);
  EXPECT_EQ(rig.group->fault().kind, MotorFault::kNone);
  EXPECT_GT(rig.line.motor(0).torque(), 0.0);
}

TEST(MotorGroup, NoticesThatTheLineHasGoneAndOpensItAgain) {
  GroupRig rig(claw(OperatingMode::kCurrent));
  rig.group->start();
  rig.port->set_plugged(false);
  rig.cycle(1, 0.0);
  EXPECT_EQ(rig.group->fault().kind, MotorFault::kLineGone);
  EXPECT_THROW(rig.group->start(), Error);
  rig.port->set_plugged(true);
  rig.group->start();
  rig.cycle(5, 0.1);
  EXPECT_EQ(rig.group->fault().kind, MotorFault::kNone);
  EXPECT_GT(rig.line.motor(0).current(), 0.0);
}

TEST(MotorGroup, NoLongerDrivesAfterAFault) {
  GroupRig rig(claw(OperatingMode::kCurrent));
  rig.group->start();
  rig.cycle(5, 0.0);
  rig.line.motor(0).fail(HardwareError::kOverheating);
  rig.cycle(5, 0.5);
  for (std::size_t i = 0; i < 9; ++i) EXPECT_EQ(rig.line.motor(i).current(), 0.0);
}

// Whenever the host sends something, a motor with torque has its watchdog, unless this is the very
// packet that sets it.
TEST(MotorGroup, GivesNoTorqueWithoutAWatchdog) {
  GroupRig rig(claw(OperatingMode::kPosition));
  int without = 0;
  rig.before_packet = [&](std::span<const std::uint8_t> packet) {
    for (std::size_t i = 0; i < 9; ++i) {
      const EmulatedMotor& motor = rig.line.motor(i);
      if (motor.value(regs::kTorqueEnable) == 0 || motor.value(regs::kBusWatchdog) == 5) continue;
      ++without;
      const bool sets_it = instruction_in(packet) == Instruction::kWrite &&
                           id_in(packet) == motor.id() &&
                           number_in(packet.subspan(8, 2)) == regs::kBusWatchdog.address;
      const bool are_goals = instruction_in(packet) == Instruction::kSyncWrite;
      EXPECT_TRUE(sets_it || are_goals) << int{motor.id()};
    }
  };
  rig.group->start();
  EXPECT_GT(without, 0);
}

// An adapter may take milliseconds for each exchange.
TEST(MotorGroup, KeepsWatchdogsQuietWhileItStarts) {
  MotorGroupOptions options = claw(OperatingMode::kPosition);
  options.silent_after = 1s;
  GroupRig rig(options);
  rig.before_packet = [&](std::span<const std::uint8_t>) {
    rig.port->sleep_until(rig.port->now() + 3ms);
  };
  rig.group->start();
  for (std::size_t i = 0; i < 9; ++i) {
    EXPECT_EQ(rig.line.motor(i).value(regs::kBusWatchdog), 5) << i;
    EXPECT_EQ(rig.line.motor(i).value(regs::kTorqueEnable), 1) << i;
  }
}

TEST(MotorGroup, ReleasesMotorsThatDoNotHearEveryInstruction) {
  for (std::uint64_t seed = 0; seed < 20; ++seed) {
    GroupRig rig(claw(OperatingMode::kCurrent));
    rig.group->start();
    rig.cycle(5, 0.5);
    rig.line.set_faults({.unheard = 0.1, .seed = seed});
    rig.release_and_expect_no_torque();
  }
}

TEST(MotorGroup, SaysWhichMotorDoesNotConfirmThatItsTorqueIsOff) {
  GroupRig rig(claw(OperatingMode::kCurrent));
  rig.group->start();
  rig.line.motor(6).set_power(false);
  rig.line.motor(7).set_power(false);
  const Instant begin = rig.port->now();
  EXPECT_EQ(rig.group->release(), MotorId{30});
  EXPECT_GE(rig.port->now() - begin, 250ms);
  for (std::size_t i = 0; i < 9; ++i) {
    EXPECT_EQ(rig.group->readings()[i].has_torque, i == 6 || i == 7) << i;
  }
  // A line that has gone answers nothing any more.
  rig.port->set_plugged(false);
  EXPECT_EQ(rig.group->release(), MotorId{10});
}

// The answer to an earlier read of this motor must not pass for one that it has no torque.
TEST(MotorGroup, TakesNoLateAnswerForTheConfirmation) {
  GroupRig rig(claw(OperatingMode::kCurrent));
  rig.group->start();
  rig.line.set_faults({.late = 1.0, .delay = 6ms});
  std::int32_t torque = 0;
  rig.line.motor(0).set_value(regs::kTorqueEnable, 0);
  EXPECT_EQ(rig.group->bus().read(10, regs::kTorqueEnable, torque).outcome, Outcome::kNoAnswer);
  rig.line.motor(0).set_value(regs::kTorqueEnable, 1);
  // From now on this motor hears nothing.
  rig.line.set_faults({});
  rig.line.motor(0).set_value(regs::kBaudRate, 1);
  EXPECT_EQ(rig.group->release(), MotorId{10});
}

TEST(MotorGroup, ReleasesEveryMotor) {
  GroupRig rig(claw(OperatingMode::kPosition));
  rig.group->start();
  rig.release_and_expect_no_torque();
  rig.cycle(5, 1.0);
  EXPECT_EQ(rig.group->fault().kind, MotorFault::kNone);
}

TEST(MotorGroup, LooksAtSupplyAndTemperatureOfEveryMotor) {
  GroupRig rig(claw(OperatingMode::kCurrent));
  for (std::size_t i = 0; i < 9; ++i) {
    rig.line.motor(i).set_temperature(30.0 + static_cast<double>(i));
  }
  rig.group->start();
  rig.cycle(9 * 3 * rig.group->options().cycles_between_looks, 0.0);
  for (std::size_t i = 0; i < 9; ++i) {
    EXPECT_EQ(rig.group->readings()[i].temperature, 30.0 + static_cast<double>(i));
    EXPECT_DOUBLE_EQ(rig.group->readings()[i].supply, 12.0);
  }
}

TEST(MotorGroup, SurvivesALineThatLosesAndDamages) {
  for (const bool is_fast : {false, true}) {
    MotorGroupOptions options = claw(OperatingMode::kPosition);
    options.is_fast = is_fast;
    GroupRig rig(options, {.faults = {.unheard = 0.003,
                                      .misheard = 0.003,
                                      .lost = 0.003,
                                      .damaged = 0.003,
                                      .byte_lost = 0.003,
                                      .byte_added = 0.003,
                                      .seed = 5}});
    rig.group->start();
    rig.cycle(20'000, 0.5);
    ASSERT_EQ(rig.group->fault().kind, MotorFault::kNone) << text_of(rig.group->fault());
    EXPECT_GT(rig.group->counts().missing, 0U);
    EXPECT_GT(rig.group->counts().damaged, 0U);
    for (const MotorReading& reading : rig.group->readings()) {
      EXPECT_NEAR(reading.position, 0.5, 0.05);
      EXPECT_GT(reading.missing, 0U);
    }
  }
}

TEST(MotorGroup, HasTheRateOfTheArithmeticAtFourMegabaud) {
  for (const bool is_fast : {false, true}) {
    MotorGroupOptions options = claw(OperatingMode::kPosition);
    options.is_fast = is_fast;
    GroupRig rig(options);
    rig.group->start();
    const Instant begin = rig.port->now();
    constexpr int kCycles = 1000;
    rig.cycle(kCycles, 0.0);
    rig.group->bus().wait_until_sent();
    const double hertz = kCycles / std::chrono::duration<double>(rig.port->now() - begin).count();
    EXPECT_NEAR(hertz / (is_fast ? 1852.0 : 1476.0), 1.0, 0.1) << hertz;
  }
}

TEST(MotorGroup, DoesNotAllocateInACycle) {
  GroupRig rig(claw(OperatingMode::kCurrent));
  rig.group->start();
  const std::vector<double> goals(9, 0.1);
  for (int i = 0; i < 100; ++i) rig.group->cycle(goals);  // the emulated line gets its memory
  const trifinger::test::AllocationCounter allocations;
  for (int i = 0; i < 200; ++i) rig.group->cycle(goals);
  EXPECT_EQ(allocations.count(), 0U);
}

TEST(MotorGroup, RefusesOptionsThatMakeNoSense) {
  const auto make = [](MotorGroupOptions options) { GroupRig rig(std::move(options)); };
  EXPECT_THROW(make({}), InvalidArgument);
  EXPECT_THROW(make({.ids = {1, 1}}), InvalidArgument);
  EXPECT_THROW(make({.ids = {253}}), InvalidArgument);
  EXPECT_THROW(make({.ids = std::vector<MotorId>(kMaxMotors + 1)}), InvalidArgument);
  EXPECT_THROW(make({.ids = {1}, .mode = OperatingMode::kPwm}), InvalidArgument);
  EXPECT_THROW(make({.ids = {1}, .max_current = std::nan("")}), InvalidArgument);
  EXPECT_THROW(make({.ids = {1}, .return_delay = 1us}), InvalidArgument);
  EXPECT_THROW(make({.ids = {1}, .watchdog = 30ms}), InvalidArgument);
  EXPECT_THROW(make({.ids = {1}, .silent_after = 0ms}), InvalidArgument);
}

TEST(GroupFaults, HaveASentenceEach) {
  for (const MotorFault kind :
       {MotorFault::kNone, MotorFault::kLineGone, MotorFault::kSilent, MotorFault::kHardwareError,
        MotorFault::kTorqueLost, MotorFault::kWatchdog, MotorFault::kRefused}) {
    EXPECT_GT(describe({.kind = kind, .motor = 7, .detail = 1}).view().size(), 20U);
  }
}

}  // namespace
}  // namespace trifinger::dynamixel::test
