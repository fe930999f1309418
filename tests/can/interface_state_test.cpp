// SPDX-License-Identifier: BSD-3-Clause
#include "can/interface_state.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cctype>
#include <string>
#include <string_view>
#include <vector>

#include "trifinger/base/error.hpp"

namespace trifinger::can::test {
namespace {

using std::chrono::milliseconds;
using ::testing::Contains;
using ::testing::HasSubstr;

// What a kernel tells of an interface with 500 kbit/s after bus-off. Numbers are little-endian.
constexpr std::string_view kController = R"(
  ec000000 10000000 00000000 00000000          header: 236 bytes, RTM_NEWLINK
  00001801 03000000 c1000100 00000000          type 280 (CAN), index 3, flags: up
  0900 0300 63616e30 00 000000                 IFLA_IFNAME "can0"
  0800 0d00 0a000000                           IFLA_TXQLEN 10
  0800 0400 10000000                           IFLA_MTU 16
  b000 1200                                    IFLA_LINKINFO
    0800 0100 63616e00                           kind "can"
    1c00 0300                                    statistics
      07000000 06000000 05000000 04000000 03000000 02000000
    8800 0280                                    data
      2400 0100                                    bit timing
        20a10700 6b030000 7d000000 06000000 07000000 02000000 01000000 05000000
      3400 0200                                    limits of bit timing
        7065616b 5f757362 00000000 00000000 01000000 10000000 01000000 08000000
        04000000 01000000 00040000 01000000
      0800 0300 00127a00                           clock
      0800 0400 03000000                           state: bus-off
      0c00 0500 00000000 30000000                  mode: CAN FD and reports of bus errors
      0800 0600 00000000                           restart: never
      0800 0800 8000 0700                          errors: 128 and 7
)";

constexpr std::string_view kVirtual = R"(
  44000000 10000000 00000000 00000000
  00001801 04000000 c1000100 00000000          type CAN, up
  0a00 0300 7663616e 3000 0000                 "vcan0"
  0800 0400 48000000                           MTU 72
  1000 1200 0900 0100 7663616e 00 000000       kind "vcan"
)";

// The bytes of a dump whose lines end in comments, two blanks after the last byte.
std::vector<std::byte> bytes_of(std::string_view dump) {
  std::vector<std::byte> bytes;
  while (!dump.empty()) {
    std::string_view line = dump.substr(0, dump.find('\n'));
    dump.remove_prefix(std::min(line.size() + 1, dump.size()));
    line.remove_prefix(std::min(line.find_first_not_of(' '), line.size()));
    std::string digits(line.substr(0, line.find("  ")));
    std::erase(digits, ' ');
    for (std::size_t i = 0; i + 1 < digits.size(); i += 2) {
      bytes.push_back(static_cast<std::byte>(std::stoi(digits.substr(i, 2), nullptr, 16)));
    }
  }
  return bytes;
}

InterfaceState good_state() {
  return {.name = "can0",
          .kind = "can",
          .is_can = true,
          .is_up = true,
          .send_queue = 1000,
          .mtu = 16,
          .controller = ControllerState{.bit_rate = 1'000'000,
                                        .sample_point = 0.875,
                                        .error_state = ErrorState::kActive,
                                        .restart_time = milliseconds(100)}};
}

TEST(InterfaceStateParser, ReadsWhatTheKernelTellsOfAController) {
  const auto state = parse_interface_state(bytes_of(kController));
  ASSERT_TRUE(state.has_value());
  EXPECT_EQ(state->name, "can0");
  EXPECT_EQ(state->kind, "can");
  EXPECT_TRUE(state->is_can);
  EXPECT_TRUE(state->is_up);
  EXPECT_EQ(state->send_queue, 10U);
  EXPECT_EQ(state->mtu, 16U);
  ASSERT_TRUE(state->controller.has_value());
  EXPECT_EQ(state->controller->bit_rate, 500'000U);
  EXPECT_DOUBLE_EQ(state->controller->sample_point, 0.875);
  EXPECT_EQ(state->controller->error_state, ErrorState::kBusOff);
  EXPECT_EQ(state->controller->restart_time, milliseconds(0));
  EXPECT_TRUE(state->controller->fd);
  EXPECT_FALSE(state->controller->listen_only);
  EXPECT_FALSE(state->controller->loopback);
  EXPECT_EQ(state->controller->send_errors, 128U);
  EXPECT_EQ(state->controller->receive_errors, 7U);
  EXPECT_EQ(state->controller->bus_offs, 4U);
  EXPECT_EQ(state->controller->restarts, 2U);
}

TEST(InterfaceStateParser, FindsNoControllerInAVirtualInterface) {
  const auto state = parse_interface_state(bytes_of(kVirtual));
  ASSERT_TRUE(state.has_value());
  EXPECT_EQ(state->name, "vcan0");
  EXPECT_EQ(state->kind, "vcan");
  EXPECT_TRUE(state->is_can);
  EXPECT_TRUE(state->is_up);
  EXPECT_EQ(state->mtu, 72U);
  EXPECT_FALSE(state->controller.has_value());
}

TEST(InterfaceStateParser, SurvivesEveryDamagedMessage) {
  const auto whole = bytes_of(kController);
  for (std::size_t size = 0; size < whole.size(); ++size) {
    EXPECT_FALSE(parse_interface_state(std::span(whole).first(size)).has_value()) << size;
  }
  for (std::size_t i = 0; i < whole.size(); ++i) {
    for (unsigned bit = 0; bit < 8; ++bit) {
      auto damaged = whole;
      damaged[i] ^= static_cast<std::byte>(1U << bit);
      static_cast<void>(parse_interface_state(damaged));
    }
  }
}

TEST(InterfaceState, IsReadOfThisMachine) {
  const auto state = read_interface_state("lo");
  ASSERT_TRUE(state.has_value());
  EXPECT_EQ(state->name, "lo");
  EXPECT_FALSE(state->is_can);
}

TEST(InterfaceState, CanBeReadOfEveryInterfaceThatIsListed) {
  const std::vector<std::string> names = interface_names();
  EXPECT_THAT(names, Contains("lo"));
  for (const std::string& name : names) {
    const auto state = read_interface_state(name);
    if (!state) continue;  // it may have been removed meanwhile
    EXPECT_EQ(state->name, name);
  }
}

TEST(InterfaceState, IsEmptyWithoutAnInterface) {
  EXPECT_FALSE(read_interface_state("no-can-here").has_value());
  EXPECT_FALSE(read_interface_state("").has_value());
  EXPECT_FALSE(read_interface_state("a-name-longer-than-any-interface").has_value());
}

TEST(InterfaceProblems, AreNoneOfAGoodInterface) {
  EXPECT_TRUE(problems(good_state()).empty());
  EXPECT_TRUE(problems({.name = "vcan0", .kind = "vcan", .is_can = true, .is_up = true}).empty());
}

TEST(InterfaceProblems, OfANewInterfaceAreSolvedByTheirCommandsInOrder) {
  InterfaceState state = good_state();
  state.is_up = false;
  state.send_queue = 10;
  state.controller = ControllerState{};
  const auto found = problems(state);
  ASSERT_EQ(found.size(), 3U);
  EXPECT_EQ(found[0].sentence, "can0: it has no bit rate, it never restarts after bus-off");
  EXPECT_EQ(found[0].command,
            "ip link set can0 type can bitrate 1000000 sample-point 0.867 restart-ms 100");
  EXPECT_EQ(found[1].sentence, "can0 queues only 10 frames instead of 1000");
  EXPECT_EQ(found[1].command, "ip link set can0 txqueuelen 1000");
  EXPECT_EQ(found[2].sentence, "can0 is down");
  EXPECT_EQ(found[2].command, "ip link set can0 up");
}

TEST(InterfaceProblems, ThatNeedTheInterfaceDownTakeItDownAndUp) {
  InterfaceState state = good_state();
  state.controller->sample_point = 0.75;
  state.controller->fd = true;
  const auto found = problems(state);
  ASSERT_EQ(found.size(), 1U);
  EXPECT_EQ(found[0].sentence,
            "can0: its sample point is 0.75 instead of 0.867, it is in CAN FD mode");
  EXPECT_EQ(found[0].command,
            "ip link set can0 down && ip link set can0 type can bitrate 1000000 sample-point 0.867 "
            "restart-ms 100 fd off && ip link set can0 up");
}

TEST(InterfaceProblems, NameBusOffAndItsCauses) {
  InterfaceState state = good_state();
  state.controller->error_state = ErrorState::kBusOff;
  auto found = problems(state);
  ASSERT_EQ(found.size(), 1U);
  EXPECT_THAT(found[0].sentence, HasSubstr("check cable, termination"));
  EXPECT_EQ(found[0].command, "ip link set can0 type can restart");
  state.controller->error_state = ErrorState::kPassive;
  found = problems(state);
  ASSERT_EQ(found.size(), 1U);
  EXPECT_EQ(found[0].command, "");
}

TEST(InterfaceProblems, OfAnotherKindOfInterfaceHaveNoCommand) {
  const auto found = problems({.name = "eth0", .is_up = true});
  ASSERT_EQ(found.size(), 1U);
  EXPECT_EQ(found[0].sentence, "eth0 is not a CAN interface");
  EXPECT_TRUE(found[0].command.empty());
}

}  // namespace
}  // namespace trifinger::can::test
