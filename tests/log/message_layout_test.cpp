// SPDX-License-Identifier: BSD-3-Clause
#include "log/message_layout.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <limits>
#include <random>
#include <string>
#include <vector>

#include "core/fake_robot.hpp"
#include "core/odd_robot.hpp"
#include "trifinger/base/error.hpp"
#include "trifinger/core/status.hpp"

namespace trifinger::log {
namespace {

using test::OddLampReading;
using test::OddRobot;
using Bytes = std::vector<std::byte>;

Bytes random_bytes(std::size_t size, std::mt19937& random) {
  Bytes bytes(size);
  for (std::byte& byte : bytes) byte = static_cast<std::byte>(random());
  return bytes;
}

// Encodes CDR as the standard describes it, number by number: each number is at a multiple of its
// size, counted from the end of the header.
Bytes plain_cdr(const std::vector<MessagePart>& parts, const std::vector<Bytes>& elements,
                Precision precision) {
  Bytes data;
  const auto put = [&data](const auto& number) {
    while (data.size() % sizeof(number) != 0) data.push_back(std::byte{0});
    const auto* bytes = reinterpret_cast<const std::byte*>(&number);
    data.insert(data.end(), bytes, bytes + sizeof(number));
  };
  for (std::size_t i = 0; i < parts.size(); ++i) {
    for (const FieldDescription& field : parts[i].element.fields()) {
      for (std::size_t k = 0; k < field.count(); ++k) {
        const std::byte* place = elements[i].data() + field.offset + k * size_of(field.type);
        if (field.type == ScalarType::kFloat64 && precision == Precision::kSingle) {
          double number;
          std::memcpy(&number, place, sizeof(number));
          put(static_cast<float>(number));
          continue;
        }
        std::uint64_t bits = 0;
        std::memcpy(&bits, place, size_of(field.type));
        switch (size_of(field.type)) {
          case 1:
            put(static_cast<std::uint8_t>(bits));
            break;
          case 2:
            put(static_cast<std::uint16_t>(bits));
            break;
          case 4:
            put(static_cast<std::uint32_t>(bits));
            break;
          default:
            put(bits);
            break;
        }
      }
    }
  }
  constexpr std::array kHeader{std::byte{0}, std::byte{1}, std::byte{0}, std::byte{0}};
  Bytes message(kHeader.size() + data.size());
  std::ranges::copy(data, std::ranges::copy(kHeader, message.begin()).out);
  return message;
}

// Returns an element with a few fields of every kind.
ElementDescription random_element(std::mt19937& random) {
  std::vector<FieldDescription> fields;
  std::size_t offset = 0;
  const std::size_t count = 1 + random() % 8;
  for (std::size_t i = 0; i < count; ++i) {
    FieldDescription field;
    field.name =
        (random() % 3 == 0 ? "inner" + std::to_string(i) + "." : "") + "f" + std::to_string(i);
    field.type = static_cast<ScalarType>(random() % 10);
    while (random() % 3 == 0) field.shape.push_back(1 + random() % 4);
    field.offset = offset;
    offset += field.count() * size_of(field.type);
    fields.push_back(std::move(field));
  }
  return ElementDescription(std::move(fields));
}

Bytes encode(const MessageLayout& layout, const std::vector<Bytes>& elements) {
  Bytes message(layout.size());
  std::vector<const void*> places;
  places.reserve(elements.size());
  for (const Bytes& element : elements) places.push_back(element.data());
  layout.encode(places, message.data());
  return message;
}

TEST(MessageLayout, EncodesWhateverFieldsThereAreAsCdrDoes) {
  std::mt19937 random(1);
  for (int trial = 0; trial < 2000; ++trial) {
    const Precision precision = random() % 2 == 0 ? Precision::kDouble : Precision::kSingle;
    std::vector<MessagePart> parts;
    std::vector<Bytes> elements;
    const std::size_t count = 1 + random() % 4;
    for (std::size_t i = 0; i < count; ++i) {
      parts.push_back(
          {"part" + std::to_string(i), "Part" + std::to_string(i), random_element(random)});
      elements.push_back(random_bytes(parts.back().element.size(), random));
    }
    const MessageLayout layout("Random", parts, precision);
    const Bytes message = encode(layout, elements);
    ASSERT_EQ(message, plain_cdr(parts, elements, precision)) << layout.definition();
  }
}

TEST(MessageLayout, GivesBackWhatItWasGiven) {
  std::mt19937 random(2);
  for (int trial = 0; trial < 2000; ++trial) {
    const std::vector<MessagePart> parts{{"a", "A", random_element(random)},
                                         {"b", "B", random_element(random)}};
    const std::vector<Bytes> elements{random_bytes(parts[0].element.size(), random),
                                      random_bytes(parts[1].element.size(), random)};
    const MessageLayout layout("Random", parts);
    const Bytes message = encode(layout, elements);
    for (std::size_t i = 0; i < parts.size(); ++i) {
      Bytes element(elements[i].size());
      layout.decode(message, i, element.data());
      ASSERT_EQ(element, elements[i]) << layout.definition();
    }
  }
}

TEST(MessageLayout, RoundsToTheNearestFloatInSinglePrecisionAndNothingElse) {
  const RobotTypes& robot = describe_robot<FakeRobot>();
  const MessageLayout layout = step_layout(robot, describe<Status>(), Precision::kSingle);
  for (const double number : {0.1, -1e-3, 1e30, 0.0, -0.0, std::numeric_limits<double>::infinity(),
                              std::numeric_limits<double>::quiet_NaN()}) {
    const MessageHead head{.session_id = 1, .index = 2};
    const Status status{.time = std::int64_t{1} << 60U, .tick = 3};
    const FakeObservation observation{.setpoint = number, .applied_actions = (1LL << 60U) + 1};
    const FakeAction action{.setpoint = number};
    const std::array<const void*, 5> elements{&head, &status, &observation, &action, &action};
    Bytes message(layout.size());
    layout.encode(elements, message.data());

    FakeObservation decoded;
    layout.decode(message, kObservation, &decoded);
    const auto nearest = static_cast<double>(static_cast<float>(number));
    EXPECT_EQ(std::memcmp(&decoded.setpoint, &nearest, sizeof(double)), 0) << number;
    EXPECT_EQ(decoded.applied_actions, observation.applied_actions);
    Status decoded_status;
    layout.decode(message, kStatus, &decoded_status);
    EXPECT_EQ(decoded_status.time, status.time);
  }
}

TEST(MessageLayout, DefinesAStepOfTheOddRobot) {
  const MessageLayout layout =
      step_layout(describe_robot<OddRobot>(), describe<Status>(), Precision::kDouble);
  const std::string rule(80, '=');
  EXPECT_EQ(layout.type(), "trifinger_msgs/msg/OddStep");
  EXPECT_EQ(layout.definition(),
            "uint64 session_id\n"
            "int64 time_index\n"
            "Status status\n"
            "OddObservation observation\n"
            "OddAppliedAction applied_action\n"
            "OddAction desired_action\n" +
                rule +
                "\nMSG: trifinger_msgs/Status\n"
                "int64 time  # [ns]\n"
                "int64 tick\n"
                "int64 lateness  # [ns]\n"
                "int64 measurement_age  # [ns]\n"
                "uint32 flags\n"
                "uint32 skipped_ticks\n"
                "uint32 action_repeats\n"
                "uint32 discarded_actions\n"
                "uint32 rejected_actions\n"
                "uint32 lost_frames\n"
                "int32 fault_code\n"
                "int32 fault_detail\n" +
                rule +
                "\nMSG: trifinger_msgs/OddObservationLeft\n"
                "float32 angle  # [rad]\n"
                "float32 speed  # [rad/s]\n" +
                rule +
                "\nMSG: trifinger_msgs/OddObservationRight\n"
                "float32 angle  # [rad]\n"
                "float32 speed  # [rad/s]\n" +
                rule +
                "\nMSG: trifinger_msgs/OddObservation\n"
                "OddObservationLeft left\n"
                "OddObservationRight right\n"
                "int8[4] gears  # 2 x 2\n" +
                rule +
                "\nMSG: trifinger_msgs/OddAppliedAction\n"
                "int8[2] gear\n"
                "uint8 was_clipped\n" +
                rule +
                "\nMSG: trifinger_msgs/OddAction\n"
                "float32[2] speed  # [rad/s]\n"
                "int8[2] gear\n"
                "uint16 colour\n");
}

TEST(MessageLayout, NamesTheMessageOfACompanionAfterItsType) {
  const MessageLayout layout =
      companion_layout("odd_lamp", describe<OddLampReading>(), Precision::kDouble);
  EXPECT_EQ(layout.type(), "trifinger_msgs/msg/OddLamp");
  EXPECT_TRUE(layout.definition().starts_with(
      "uint64 session_id\nint64 index\nOddLampStamp stamp\nuint16[3] colour\nint8[2] gear\n"));
}

TEST(MessageLayout, KeepsApartNamesThatLookTheSameInCamelCase) {
  FieldDescription first;
  first.name = "left.wheel.angle";
  first.type = ScalarType::kInt8;
  FieldDescription second = first;
  second.name = "left_wheel.angle";
  second.offset = 1;
  const MessageLayout layout("Car", {{"", "", ElementDescription({first, second})}});
  EXPECT_NE(layout.definition().find("CarLeftWheel wheel\n"), std::string::npos);
  EXPECT_NE(layout.definition().find("CarLeftWheel2 left_wheel\n"), std::string::npos);
}

ElementDescription fields_called(const std::vector<std::string>& names) {
  std::vector<FieldDescription> fields;
  for (const std::string& name : names) {
    FieldDescription field;
    field.name = name;
    field.type = ScalarType::kInt8;
    field.offset = fields.size();
    fields.push_back(std::move(field));
  }
  return ElementDescription(std::move(fields));
}

TEST(MessageLayout, RefusesNamesThatRos2DoesNotKnow) {
  for (const auto& names : std::vector<std::vector<std::string>>{{"Angle"},
                                                                 {"angle_"},
                                                                 {"left__angle"},
                                                                 {"2nd"},
                                                                 {"a.B"},
                                                                 {"a."},
                                                                 {".a"},
                                                                 {"a..b"},
                                                                 {"angle/x"},
                                                                 {"left", "left.angle"},
                                                                 {"left.a", "right", "left.b"}}) {
    EXPECT_THROW(MessageLayout("Message", {{"", "", fields_called(names)}}), InvalidArgument)
        << names.front();
  }
  EXPECT_THROW(MessageLayout("message", {{"", "", fields_called({"a"})}}), InvalidArgument);
  EXPECT_THROW(MessageLayout("", {{"", "", fields_called({"a"})}}), InvalidArgument);
  RobotTypes robot = describe_robot<FakeRobot>();
  robot.type = "3d printer";
  EXPECT_THROW(static_cast<void>(step_layout(robot, describe<Status>(), Precision::kDouble)),
               InvalidArgument);
}

TEST(MessageLayout, RefusesFieldsThatLieEndlesslyDeep) {
  std::string name = "a";
  for (int i = 0; i < 1'000'000; ++i) name += ".a";
  EXPECT_THROW(MessageLayout("Message", {{"", "", fields_called({name})}}), InvalidArgument);
}

}  // namespace
}  // namespace trifinger::log
