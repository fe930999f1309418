// SPDX-License-Identifier: BSD-3-Clause
#include "trifinger/core/description.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cstdint>
#include <random>
#include <string>
#include <vector>

#include "core/fake_robot.hpp"
#include "core/odd_robot.hpp"
#include "trifinger/base/error.hpp"
#include "trifinger/core/status.hpp"

namespace trifinger {
namespace {

// --- What the compiler says
// -------------------------------------------------------------------------------

struct Padded {
  std::int8_t small{0};
  double large{0.0};

  static constexpr auto fields() {
    return std::tuple{field("small", &Padded::small), field("large", &Padded::large)};
  }
};
struct Incomplete {
  float listed{0.0F};
  float forgotten{0.0F};

  static constexpr auto fields() { return std::tuple{field("listed", &Incomplete::listed)}; }
};
struct Swapped {
  float first{0.0F};
  float second{0.0F};

  static constexpr auto fields() {
    return std::tuple{field("second", &Swapped::second), field("first", &Swapped::first)};
  }
};
struct WithoutFields {
  double value{0.0};
};

static_assert(Described<test::OddAction> && Described<test::OddObservation> && Described<Status> &&
              Described<FakeSensorReading>);
static_assert(!Described<WithoutFields>);
static_assert(!Described<double>);

static_assert(detail::fields_fill_struct<test::OddAction>());
static_assert(!detail::fields_fill_struct<Padded>(), "padding would carry bytes that nobody wrote");
static_assert(!detail::fields_fill_struct<Incomplete>());
static_assert(detail::fields_are_ordered<test::OddAction>());
#if !defined(__clang__)
static_assert(!detail::fields_are_ordered<Swapped>());
#else
TEST(Describe, RefusesFieldsInAnotherOrderAtItsFirstCall) {
  EXPECT_THROW(static_cast<void>(describe<Swapped>()), InvalidArgument);
}
#endif

// --- What it describes
// ------------------------------------------------------------------------------------

TEST(Describe, GivesNameTypeShapeUnitAndPlaceOfEveryField) {
  const std::vector<FieldDescription> expected{
      {.name = "speed", .type = ScalarType::kFloat32, .shape = {2}, .unit = "rad/s", .offset = 0},
      {.name = "gear", .type = ScalarType::kInt8, .shape = {2}, .unit = "", .offset = 8},
      {.name = "colour", .type = ScalarType::kUint16, .shape = {}, .unit = "", .offset = 10}};
  EXPECT_EQ(describe<test::OddAction>().fields(), expected);
  EXPECT_EQ(describe<test::OddAction>().size(), sizeof(test::OddAction));
}

TEST(Describe, FlattensNestedStructsWithDots) {
  EXPECT_EQ(describe<test::OddObservation>().text(),
            "left.angle float32 rad\n"
            "left.speed float32 rad/s\n"
            "right.angle float32 rad\n"
            "right.speed float32 rad/s\n"
            "gears int8[2,2]\n");
}

struct AllScalars {
  std::int64_t a{0};
  std::uint64_t b{0};
  double c{0.0};
  std::int32_t d{0};
  std::uint32_t e{0};
  float f{0.0F};
  std::int16_t g{0};
  std::uint16_t h{0};
  std::int8_t i{0};
  std::uint8_t j{0};
  std::array<std::uint8_t, 6> rest{};

  static constexpr auto fields() {
    return std::tuple{
        field("a", &AllScalars::a), field("b", &AllScalars::b),      field("c", &AllScalars::c),
        field("d", &AllScalars::d), field("e", &AllScalars::e),      field("f", &AllScalars::f),
        field("g", &AllScalars::g), field("h", &AllScalars::h),      field("i", &AllScalars::i),
        field("j", &AllScalars::j), field("rest", &AllScalars::rest)};
  }
};

TEST(Describe, KnowsEveryScalarByNumpysName) {
  std::vector<std::string> names;
  for (const FieldDescription& field : describe<AllScalars>().fields()) {
    names.emplace_back(name_of(field.type));
  }
  EXPECT_THAT(names,
              ::testing::ElementsAre("int64", "uint64", "float64", "int32", "uint32", "float32",
                                     "int16", "uint16", "int8", "uint8", "uint8"));
}

TEST(ElementDescription, FindsFieldsByName) {
  const ElementDescription& element = describe<test::OddObservation>();
  ASSERT_NE(element.find("right.angle"), nullptr);
  EXPECT_EQ(element.find("right.angle")->offset, 8U);
  EXPECT_EQ(element.find("right"), nullptr);
}

TEST(ElementDescription, RefusesGapsOverlapsAndDoubleNames) {
  const FieldDescription first{
      .name = "a", .type = ScalarType::kFloat64, .shape = {}, .unit = "", .offset = 0};
  const auto with = [&](const std::string& name, std::size_t offset) {
    return ElementDescription(
        {first,
         {.name = name, .type = ScalarType::kInt8, .shape = {}, .unit = "", .offset = offset}});
  };
  EXPECT_EQ(with("b", 8).size(), 9U);
  EXPECT_THROW(with("b", 9), InvalidArgument);
  EXPECT_THROW(with("b", 7), InvalidArgument);
  EXPECT_THROW(with("a", 8), InvalidArgument);
  EXPECT_THROW(with("", 8), InvalidArgument);
  EXPECT_THROW(with("two words", 8), InvalidArgument);
}

// --- Text and back
// ----------------------------------------------------------------------------------------

ElementDescription random_description(std::mt19937& random) {
  const auto word = [&](const std::string& letters) {
    std::string text;
    for (std::size_t i = 1 + random() % 12; i > 0; --i) text += letters[random() % letters.size()];
    return text;
  };
  std::vector<FieldDescription> fields;
  std::size_t offset = 0;
  for (std::size_t i = random() % 8; i > 0; --i) {
    FieldDescription field;
    field.name = std::to_string(i) + word("abcXYZ_.[]0\t");
    field.type = static_cast<ScalarType>(random() % 10);
    for (std::size_t dimension = random() % 4; dimension > 0; --dimension) {
      field.shape.push_back(1 + random() % 20);
    }
    if (random() % 2 == 0) field.unit = word("radNms/ ^2[]");
    field.offset = offset;
    offset += field.count() * size_of(field.type);
    fields.push_back(std::move(field));
  }
  return ElementDescription(std::move(fields));
}

TEST(ElementDescription, SurvivesItsText) {
  std::mt19937 random(1);
  for (int i = 0; i < 5'000; ++i) {
    const ElementDescription description = random_description(random);
    ASSERT_EQ(ElementDescription::parse(description.text()), description) << description.text();
  }
}

// Every text is either refused or exactly what the description itself would write.
TEST(ElementDescription, IsParsedFromItsOwnTextOnly) {
  std::mt19937 random(2);
  const std::string letters = "a 1[],.\nfloat64";
  int accepted = 0;
  for (int i = 0; i < 50'000; ++i) {
    std::string text = random_description(random).text();
    for (std::size_t changes = 1 + random() % 3; changes > 0 && !text.empty(); --changes) {
      const std::size_t position = random() % text.size();
      switch (random() % 3) {
        case 0:
          text[position] = letters[random() % letters.size()];
          break;
        case 1:
          text.erase(position, 1);
          break;
        default:
          text.insert(position, 1, letters[random() % letters.size()]);
      }
    }
    try {
      const ElementDescription description = ElementDescription::parse(text);
      ASSERT_EQ(description.text(), text);
      ++accepted;
    } catch (const InvalidArgument&) {
    }
  }
  EXPECT_GT(accepted, 0);
}

TEST(ElementDescription, RefusesTextsThatMeanNothing) {
  for (const std::string text :
       {"x", "x \n", " float64\n", "x float65\n", "x float64[\n", "x float64[]\n", "x float64[0]\n",
        "x float64[-1]\n", "x float64[2,]\n", "x float64[,2]\n", "x float64[02]\n", "x float64 \n",
        "x float64", "x float64\n\n", "x float64[1073741824,1073741824,1073741824]\n",
        "x float64[99999999999999999999999]\n"}) {
    EXPECT_THROW(static_cast<void>(ElementDescription::parse(text)), InvalidArgument) << text;
  }
}

}  // namespace
}  // namespace trifinger
