// SPDX-License-Identifier: BSD-3-Clause
#include "dynamixel/emulated_motor.hpp"

#include <gtest/gtest.h>
#include <rapidcheck.h>

#include <array>
#include <chrono>
#include <cmath>
#include <limits>
#include <numbers>

#include "dynamixel/rig.hpp"

namespace trifinger::dynamixel::test {
namespace {

using namespace std::chrono_literals;
namespace regs = registers;

// Motor 1 with a shaft of its own, and a host that speaks to it.
class OneMotor : public ::testing::Test {
 protected:
  explicit OneMotor(const MotorModel& model = kXm430W210) : rig_({.ids = {1}, .model = &model}) {}

  StatusError set(const Register& which, std::int32_t value) {
    return rig_.bus.write(1, which, value).error;
  }
  std::int32_t get(const Register& which) {
    std::int32_t value = 0;
    EXPECT_TRUE(rig_.bus.read(1, which, value)) << which.name;
    return value;
  }
  void begin(OperatingMode mode) {
    ASSERT_EQ(set(regs::kOperatingMode, static_cast<int>(mode)), StatusError::kNone);
    ASSERT_EQ(set(regs::kTorqueEnable, 1), StatusError::kNone);
  }
  void wait(Nanoseconds duration) const { rig_.port->sleep_until(rig_.port->now() + duration); }

  Rig rig_;
  EmulatedMotor& motor_{rig_.line.motor(0)};
};

class EveryMotor : public OneMotor, public testing::WithParamInterface<MotorModel> {
 protected:
  EveryMotor() : OneMotor(*find_model(GetParam().number)) {}
};

INSTANTIATE_TEST_SUITE_P(, EveryMotor, testing::ValuesIn(kMotorModels), word_of);

TEST_P(EveryMotor, BeginsWithTheInitialValuesOfItsModel) {
  for (const Register& which : control_table_of(GetParam())) {
    if (which.access == Register::Access::kRead || which.name == regs::kReturnDelay.name ||
        which.name == regs::kBaudRate.name) {
      continue;
    }
    EXPECT_EQ(get(which), which.initial) << which.name;
  }
  EXPECT_EQ(get(regs::kPresentPosition), kPositionMiddle);
  Identity identity;
  ASSERT_TRUE(rig_.bus.ping(1, identity));
  EXPECT_EQ(identity.model_number, GetParam().number);
}

TEST_P(EveryMotor, RefusesWhatItsModelDoesNotAllow) {
  for (const Register& which : control_table_of(GetParam())) {
    const bool has_larger = which.size > 1 || which.highest < 255;
    if (!which.is_kept() || which.access == Register::Access::kRead || !has_larger) continue;
    EXPECT_EQ(set(which, static_cast<int>(which.highest) + 1), StatusError::kDataRange)
        << which.name;
  }
  for (int mode = 0; mode < 17; ++mode) {
    const bool is_allowed = GetParam().has(static_cast<OperatingMode>(mode));
    EXPECT_EQ(set(regs::kOperatingMode, mode),
              is_allowed ? StatusError::kNone : StatusError::kDataRange)
        << mode;
  }
}

TEST_P(EveryMotor, HasItsStallTorqueAndItsSpeedAtTheSupplyOfItsFigures) {
  begin(OperatingMode::kPwm);
  motor_.tick(1ms, 0.0, 0.0);
  EXPECT_DOUBLE_EQ(motor_.torque(), GetParam().stall_torque);
  motor_.tick(1ms, 0.0, GetParam().no_load_speed);
  EXPECT_NEAR(motor_.torque(), 0.0, 1e-12);
  EXPECT_EQ(get(regs::kHardwareErrorStatus), 0);
  for (const double beyond : {-0.1, 0.1}) {
    motor_.set_supply(0.1 * GetParam().supply_limits[beyond < 0.0 ? 0 : 1] + beyond);
    motor_.tick(1ms, 0.0, 0.0);
    EXPECT_EQ(get(regs::kHardwareErrorStatus), bit_of(HardwareError::kInputVoltage));
    motor_.set_supply(GetParam().voltage);
    ASSERT_TRUE(rig_.bus.reboot(1));
    EXPECT_EQ(get(regs::kHardwareErrorStatus), 0);
  }
}

TEST_P(EveryMotor, GoesToAGoalPositionAndShowsItsEffort) {
  begin(OperatingMode::kPosition);
  ASSERT_EQ(set(regs::kGoalPosition, 2700), StatusError::kNone);
  std::int32_t most = 0;
  for (int i = 0; i < 4000; ++i) {
    wait(1ms);
    most = std::max(most, motor_.value(regs::kPresentCurrent));
  }
  EXPECT_NEAR(get(regs::kPresentPosition), 2700, 40);
  // A step is a thousandth of the stall torque, if the motor has no currents.
  const MotorModel& model = GetParam();
  const double unit = model.has_current() ? model.current_unit : model.stall_current / 1000.0;
  EXPECT_GT(most * unit, 0.2 * model.stall_current);
  EXPECT_LE(most * unit, 1.01 * model.stall_current);
}

TEST_F(OneMotor, LocksWhatIsKeptWhileTorqueIsOn) {
  for (const bool has_torque : {false, true}) {
    ASSERT_EQ(set(regs::kTorqueEnable, has_torque ? 1 : 0), StatusError::kNone);
    for (const Register& which : kControlTable) {
      if (which.access == Register::Access::kRead || !which.is_kept()) continue;
      EXPECT_EQ(set(which, get(which)), has_torque ? StatusError::kAccess : StatusError::kNone)
          << which.name;
    }
  }
}

TEST_F(OneMotor, RefusesEveryValueOutsideOfARegister) {
  for (const Register& which : kControlTable) {
    if (which.access == Register::Access::kRead || which.name == regs::kTorqueEnable.name) continue;
    const std::int32_t before = get(which);
    const double most = which.is_signed ? std::ldexp(1.0, 8 * which.size - 1) - 1.0
                                        : std::ldexp(1.0, 8 * which.size) - 1.0;
    if (static_cast<double>(which.highest) >= most) continue;
    EXPECT_EQ(set(which, static_cast<std::int32_t>(which.highest + 1)), StatusError::kDataRange)
        << which.name;
    EXPECT_EQ(get(which), before) << which.name;
  }
}

TEST_F(OneMotor, KeepsGoalsWithinItsLimits) {
  ASSERT_EQ(set(regs::kCurrentLimit, 100), StatusError::kNone);
  ASSERT_EQ(set(regs::kVelocityLimit, 50), StatusError::kNone);
  ASSERT_EQ(set(regs::kMaxPositionLimit, 3000), StatusError::kNone);
  EXPECT_EQ(set(regs::kGoalCurrent, 100), StatusError::kNone);
  EXPECT_EQ(set(regs::kGoalCurrent, -101), StatusError::kDataLimit);
  EXPECT_EQ(set(regs::kGoalVelocity, 51), StatusError::kDataLimit);
  EXPECT_EQ(set(regs::kGoalPosition, 3001), StatusError::kDataLimit);
  EXPECT_EQ(set(regs::kGoalPosition, 3000), StatusError::kNone);
}

TEST_F(OneMotor, ChangesNothingIfAnyPartOfAWriteIsRefused) {
  // Torque enable and LED side by side; the LED has no value 9.
  const std::array<std::uint8_t, 2> bytes{1, 9};
  EXPECT_EQ(rig_.bus.write(1, regs::kTorqueEnable.address, bytes).error, StatusError::kDataRange);
  EXPECT_EQ(get(regs::kTorqueEnable), 0);
}

TEST_F(OneMotor, HasTheTorqueOfItsCurrent) {
  begin(OperatingMode::kCurrent);
  ASSERT_EQ(set(regs::kGoalCurrent, 100), StatusError::kNone);
  wait(1ms);
  EXPECT_DOUBLE_EQ(motor_.torque(), 100 * kXm430W210.current_unit * kXm430W210.torque_constant());
  EXPECT_EQ(get(regs::kPresentCurrent), 100);
  ASSERT_EQ(set(regs::kTorqueEnable, 0), StatusError::kNone);
  wait(1ms);
  EXPECT_EQ(motor_.torque(), 0.0);
}

TEST_F(OneMotor, CannotTurnFasterThanItsVoltageAllows) {
  begin(OperatingMode::kCurrent);
  ASSERT_EQ(set(regs::kGoalCurrent, 1193), StatusError::kNone);
  double fastest = 0.0;
  for (int i = 0; i < 2000; ++i) {
    wait(1ms);
    fastest = std::max(fastest, rig_.plant.velocity(0));
  }
  EXPECT_LE(fastest, kXm430W210.no_load_speed);
  EXPECT_GE(fastest, 0.7 * kXm430W210.no_load_speed);
}

TEST_F(OneMotor, GoesToAGoalPosition) {
  begin(OperatingMode::kPosition);
  ASSERT_EQ(set(regs::kGoalPosition, 3000), StatusError::kNone);
  wait(2s);
  EXPECT_NEAR(get(regs::kPresentPosition), 3000, 12);  // dry friction, no integral gain
  EXPECT_EQ(get(regs::kMoving), 0);
  EXPECT_EQ(get(regs::kMovingStatus) & 1, 1);
}

TEST_F(OneMotor, FollowsAProfile) {
  begin(OperatingMode::kPosition);
  ASSERT_EQ(set(regs::kProfileVelocity, 20), StatusError::kNone);
  ASSERT_EQ(set(regs::kProfileAcceleration, 10), StatusError::kNone);
  ASSERT_EQ(set(regs::kGoalPosition, 3000), StatusError::kNone);
  double fastest = 0.0;
  double before = get(regs::kPositionTrajectory);
  for (int i = 0; i < 6000; ++i) {
    wait(1ms);
    const double now = motor_.value(regs::kPositionTrajectory);
    fastest = std::max(fastest, (now - before) * kPositionUnit * 1e3);
    before = now;
  }
  // The trajectory is rounded to steps.
  EXPECT_LE(fastest, 20 * kVelocityUnit + 2e3 * kPositionUnit);
  EXPECT_NEAR(get(regs::kPositionTrajectory), 3000, 2);
  EXPECT_NEAR(get(regs::kPresentPosition), 3000, 12);
}

TEST_F(OneMotor, KeepsAGoalVelocity) {
  begin(OperatingMode::kVelocity);
  ASSERT_EQ(set(regs::kGoalVelocity, -100), StatusError::kNone);
  wait(3s);
  EXPECT_NEAR(get(regs::kPresentVelocity), -100, 3);
}

TEST_F(OneMotor, GoesToAPositionWithNoMoreThanItsGoalCurrent) {
  begin(OperatingMode::kCurrentBasedPosition);
  ASSERT_EQ(set(regs::kGoalCurrent, 60), StatusError::kNone);
  ASSERT_EQ(set(regs::kGoalPosition, 3000), StatusError::kNone);
  for (int i = 0; i < 3000; ++i) {
    wait(1ms);
    ASSERT_LE(std::abs(motor_.value(regs::kPresentCurrent)), 60);
  }
  EXPECT_NEAR(get(regs::kPresentPosition), 3000, 40);
}

TEST_F(OneMotor, TurnsTheOtherWayInReverse) {
  ASSERT_EQ(set(regs::kDriveMode, 1), StatusError::kNone);
  begin(OperatingMode::kCurrent);
  ASSERT_EQ(set(regs::kGoalCurrent, 100), StatusError::kNone);
  wait(100ms);
  EXPECT_LT(rig_.plant.position(0), 0.0);
  EXPECT_GT(get(regs::kPresentPosition), kPositionMiddle);
  EXPECT_GT(get(regs::kPresentVelocity), 0);
}

TEST_F(OneMotor, StopsWhenTheHostIsSilentAndSaysSo) {
  begin(OperatingMode::kCurrent);
  ASSERT_EQ(set(regs::kBusWatchdog, 5), StatusError::kNone);
  ASSERT_EQ(set(regs::kGoalCurrent, 100), StatusError::kNone);
  wait(90ms);
  EXPECT_NE(motor_.torque(), 0.0);
  wait(20ms);
  EXPECT_EQ(motor_.torque(), 0.0);
  EXPECT_EQ(get(regs::kBusWatchdog), -1);
  EXPECT_EQ(set(regs::kGoalCurrent, 100), StatusError::kDataRange);
  EXPECT_EQ(set(regs::kBusWatchdog, 0), StatusError::kNone);
  EXPECT_EQ(set(regs::kGoalCurrent, 100), StatusError::kNone);
}

TEST_F(OneMotor, ShutsDownForTheErrorsOfItsMaskUntilAReboot) {
  for (const HardwareError error : kHardwareErrors) {
    ASSERT_TRUE(rig_.bus.reboot(1));
    ASSERT_EQ(set(regs::kTorqueEnable, 1), StatusError::kNone);
    motor_.fail(error);
    EXPECT_EQ(get(regs::kHardwareErrorStatus), bit_of(error));
    const bool is_masked = (regs::kShutdown.initial & bit_of(error)) != 0;
    EXPECT_EQ(get(regs::kTorqueEnable), is_masked ? 0 : 1);
    EXPECT_EQ(set(regs::kTorqueEnable, 1),
              is_masked ? StatusError::kResultFail : StatusError::kNone);
  }
  ASSERT_TRUE(rig_.bus.reboot(1));
  EXPECT_EQ(get(regs::kHardwareErrorStatus), 0);
}

TEST_F(OneMotor, ReportsItsSupplyAndItsHeat) {
  motor_.set_supply(8.0);
  wait(1ms);
  EXPECT_EQ(get(regs::kPresentInputVoltage), 80);
  EXPECT_EQ(get(regs::kHardwareErrorStatus), bit_of(HardwareError::kInputVoltage));
  motor_.set_supply(12.0);
  motor_.set_temperature(90.0);
  ASSERT_TRUE(rig_.bus.reboot(1));
  wait(1ms);
  EXPECT_EQ(get(regs::kPresentTemperature), 90);
  EXPECT_EQ(get(regs::kHardwareErrorStatus), bit_of(HardwareError::kOverheating));
}

TEST_F(OneMotor, KeepsWhatIsKeptWithoutSupply) {
  ASSERT_EQ(set(regs::kCurrentLimit, 500), StatusError::kNone);
  ASSERT_EQ(set(regs::kPositionPGain, 400), StatusError::kNone);
  ASSERT_EQ(set(regs::kTorqueEnable, 1), StatusError::kNone);
  motor_.set_power(false);
  Identity identity;
  EXPECT_EQ(rig_.bus.ping(1, identity).outcome, Outcome::kNoAnswer);
  motor_.set_power(true);
  EXPECT_EQ(get(regs::kCurrentLimit), 500);
  EXPECT_EQ(get(regs::kPositionPGain), regs::kPositionPGain.initial);
  EXPECT_EQ(get(regs::kTorqueEnable), 0);
}

// Wherever the shaft was and however far it is turned meanwhile.
TEST_F(OneMotor, KnowsItsPositionWithinOneTurnAfterItIsSwitchedOn) {
  EXPECT_TRUE(rc::check([this] {
    const auto position = *rc::gen::inRange(-20'000, 20'000);
    const auto turned = *rc::gen::inRange(-20'000, 20'000);
    rig_.plant.set_position(0, position * kPositionUnit);
    motor_.set_power(false);
    wait(1ms);
    motor_.set_power(true);
    wait(1ms);
    const std::int32_t before = get(regs::kPresentPosition);
    RC_ASSERT(before >= 0 && before < kStepsPerTurn);
    RC_ASSERT((before - position - kPositionMiddle) % kStepsPerTurn == 0);
    // As long as it is on, it counts turns.
    rig_.plant.set_position(0, turned * kPositionUnit);
    wait(1ms);
    RC_ASSERT(get(regs::kPresentPosition) - before == turned - position);
    const bool has_supply = *rc::gen::arbitrary<bool>();
    if (has_supply) {
      RC_ASSERT(rig_.bus.reboot(1).outcome == Outcome::kDone);
    } else {
      motor_.set_power(false);
      wait(1ms);
      motor_.set_power(true);
    }
    wait(1ms);
    const std::int32_t after = get(regs::kPresentPosition);
    RC_ASSERT(after >= 0 && after < kStepsPerTurn);
    RC_ASSERT(get(regs::kGoalPosition) == after);
  }));
}

TEST_F(OneMotor, ForgetsItsTurnsOnRequest) {
  rig_.plant.set_position(0, 3.0 * std::numbers::pi);
  wait(1ms);
  EXPECT_EQ(get(regs::kPresentPosition), kPositionMiddle + 3 * kStepsPerTurn / 2);
  std::array<std::uint8_t, kTableSize> data{};
  constexpr std::array<std::uint8_t, 5> kKey{0x01, 0x44, 0x58, 0x4C, 0x22};
  EXPECT_EQ(motor_.execute(Instruction::kClear, kKey, data).error, 0);
  wait(1ms);
  EXPECT_EQ(get(regs::kPresentPosition), kPositionMiddle - kStepsPerTurn / 2);
}

TEST_P(EveryMotor, ShowsOtherRegistersAsIndirectData) {
  const IndirectBlock& block = GetParam().series->indirect_blocks[0];
  const std::uint16_t first = block.first_address;
  const std::array<std::uint8_t, 2> led{static_cast<std::uint8_t>(regs::kLed.address), 0};
  ASSERT_TRUE(rig_.bus.write(1, first, led));
  const std::array<std::uint8_t, 1> on{1};
  ASSERT_TRUE(rig_.bus.write(1, block.first_data, on));
  EXPECT_EQ(get(regs::kLed), 1);
  const std::array<std::uint8_t, 1> wrong{2};
  EXPECT_EQ(rig_.bus.write(1, block.first_data, wrong).error, StatusError::kDataRange);
}

TEST_F(OneMotor, ChangesItsNumberAndItsRate) {
  ASSERT_EQ(set(regs::kId, 9), StatusError::kNone);
  Identity identity;
  EXPECT_FALSE(rig_.bus.ping(1, identity));
  EXPECT_TRUE(rig_.bus.ping(9, identity));
  ASSERT_TRUE(rig_.bus.write(9, regs::kBaudRate, 3));
  EXPECT_FALSE(rig_.bus.ping(9, identity));
  EXPECT_EQ(motor_.baud(), 1'000'000);
}

TEST_F(OneMotor, AnswersNoMoreThanItsReturnLevelSays) {
  ASSERT_EQ(set(regs::kStatusReturnLevel, 1), StatusError::kNone);
  EXPECT_EQ(rig_.bus.write(1, regs::kLed, 1).outcome, Outcome::kNoAnswer);
  EXPECT_EQ(get(regs::kLed), 1);
}

TEST_F(OneMotor, WaitsForTheActionOfARegisteredWrite) {
  std::array<std::uint8_t, kTableSize> data{};
  const std::array<std::uint8_t, 3> led{65, 0, 1};
  EXPECT_EQ(motor_.execute(Instruction::kAction, {}, data).error,
            static_cast<int>(StatusError::kInstruction));
  EXPECT_EQ(motor_.execute(Instruction::kRegWrite, led, data).error, 0);
  EXPECT_EQ(get(regs::kLed), 0);
  EXPECT_EQ(get(regs::kRegisteredInstruction), 1);
  EXPECT_EQ(motor_.execute(Instruction::kAction, {}, data).error, 0);
  EXPECT_EQ(get(regs::kLed), 1);
}

TEST(EmulatedMotor, SurvivesAnyInstruction) {
  EXPECT_TRUE(rc::check([] {
    EmulatedMotor motor({.id = 1});
    std::array<std::uint8_t, kTableSize> data{};
    for (int i = 0; i < 20; ++i) {
      const auto instruction = static_cast<Instruction>(*rc::gen::arbitrary<std::uint8_t>());
      auto parameters = *rc::gen::arbitrary<std::vector<std::uint8_t>>();
      // Addresses inside of the table are more interesting than others.
      if (parameters.size() > 1) parameters[1] = static_cast<std::uint8_t>(parameters[1] % 4);
      const auto reply = motor.execute(instruction, parameters, data);
      RC_ASSERT(reply.size <= data.size());
      motor.tick(1ms, 1e3, -50.0);
      RC_ASSERT(std::isfinite(motor.torque()));
    }
  }));
}

TEST(EmulatedMotor, RefusesOptionsThatNoMotorHas) {
  EXPECT_THROW(EmulatedMotor({.id = 253}), InvalidArgument);
  EXPECT_THROW(EmulatedMotor({.id = 1, .baud = 1'000'001}), InvalidArgument);
  EXPECT_THROW(EmulatedMotor({.id = 1, .return_delay = 510us}), InvalidArgument);
  EXPECT_THROW(EmulatedMotor({.id = 1, .model = nullptr}), InvalidArgument);
}

}  // namespace
}  // namespace trifinger::dynamixel::test
