// SPDX-License-Identifier: BSD-3-Clause
#include "dynamixel/status.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <set>
#include <string>
#include <vector>

#include "dynamixel/control_table.hpp"
#include "dynamixel/rig.hpp"

namespace trifinger::dynamixel::test {
namespace {

TEST(StatusErrors, HaveANameASentenceAndARemedyEach) {
  std::set<std::string_view> names;
  for (int number = 0; number <= 7; ++number) {
    const ErrorText& text = text_of(static_cast<StatusError>(number));
    EXPECT_TRUE(names.insert(text.name).second) << number;
    EXPECT_FALSE(text.sentence.empty());
    EXPECT_FALSE(text.remedy.empty());
  }
  for (int number = 8; number <= 255; ++number) {
    EXPECT_EQ(text_of(static_cast<StatusError>(number)).name, "unknown");
  }
}

TEST(HardwareErrors, AreNamedBitByBit) {
  for (unsigned bit = 0; bit < 8; ++bit) {
    const auto error = static_cast<HardwareError>(bit);
    const bool is_known = std::ranges::find(kHardwareErrors, error) != kHardwareErrors.end();
    EXPECT_EQ(text_of(error).name != "unknown", is_known) << bit;
    const FixedText text = describe_hardware_errors(bit_of(error));
    EXPECT_NE(text.view().find(text_of(error).sentence), std::string_view::npos);
    EXPECT_NE(text.view().find(text_of(error).remedy), std::string_view::npos);
  }
  EXPECT_EQ(describe_hardware_errors(0).view(), "no hardware error");
}

TEST(HardwareErrors, AreAllSaidBeforeTheRemedies) {
  const FixedText text = describe_hardware_errors(bit_of(HardwareError::kOverheating) |
                                                  bit_of(HardwareError::kOverload));
  const auto first = text.view().find(text_of(HardwareError::kOverheating).sentence);
  const auto second = text.view().find(text_of(HardwareError::kOverload).sentence);
  const auto remedy = text.view().find(text_of(HardwareError::kOverheating).remedy);
  ASSERT_NE(first, std::string_view::npos);
  ASSERT_NE(second, std::string_view::npos);
  EXPECT_LT(first, second);
  EXPECT_LT(second, remedy);
}

class EveryControlTable : public testing::TestWithParam<MotorModel> {
 protected:
  const std::vector<Register> table = control_table_of(GetParam());
};

INSTANTIATE_TEST_SUITE_P(, EveryControlTable, testing::ValuesIn(kMotorModels), word_of);

TEST_P(EveryControlTable, HasRegistersInOrderThatDoNotOverlap) {
  std::set<std::string_view> names;
  std::size_t end = 0;
  for (const Register& which : table) {
    EXPECT_GE(which.address, end) << which.name;
    end = which.end();
    EXPECT_TRUE(which.size == 1 || which.size == 2 || which.size == 4) << which.name;
    EXPECT_TRUE(names.insert(which.name).second) << which.name;
    for (std::size_t i = which.address; i < end; ++i) {
      EXPECT_EQ(register_at(table, i)->name, which.name);
    }
  }
  EXPECT_LE(end, GetParam().series->indirect_blocks[0].first_address);
  EXPECT_EQ(register_at(table, end), nullptr);
}

TEST_P(EveryControlTable, LetsInitialValuesBeWritten) {
  for (const Register& which : table) {
    if (which.access == Register::Access::kRead) continue;
    EXPECT_LE(which.lowest, which.initial) << which.name;
    EXPECT_GE(which.highest, which.initial) << which.name;
  }
}

TEST(ControlTable, ReadsCurrentVelocityAndPositionAsTenBytesInARow) {
  EXPECT_EQ(registers::kPresentCurrent.address, 126);
  EXPECT_EQ(registers::kPresentCurrent.end(), registers::kPresentVelocity.address);
  EXPECT_EQ(registers::kPresentVelocity.end(), registers::kPresentPosition.address);
  EXPECT_EQ(registers::kPresentPosition.end(), 136U);
}

TEST(MotorModels, AreFoundByNameAndNumber) {
  for (const MotorModel& model : kMotorModels) {
    EXPECT_EQ(find_model(model.name)->number, model.number);
    EXPECT_EQ(find_model(model.number)->name, model.name);
  }
  EXPECT_EQ(find_model("AX-12"), nullptr);
  EXPECT_EQ(find_model(std::uint16_t{12}), nullptr);
}

TEST(Units, AreThoseOfTheDataSheet) {
  EXPECT_NEAR(kPositionUnit, 1.53398e-3, 1e-8);
  EXPECT_NEAR(kVelocityUnit, 0.0239808, 1e-7);
}

}  // namespace
}  // namespace trifinger::dynamixel::test
