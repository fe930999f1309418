// SPDX-License-Identifier: BSD-3-Clause
// What SocketCAN does when its interface changes. Each test makes a virtual interface, which needs
// an administrator and a kernel with vcan: ./run check has both in a virtual machine.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <linux/can.h>
#include <linux/can/error.h>
#include <linux/can/raw.h>
#include <net/if.h>
#include <sys/socket.h>
#include <unistd.h>

#include <array>
#include <memory>
#include <string>

#include "can/interface_state.hpp"
#include "can/socket_can.hpp"
#include "support/message_of.hpp"
#include "support/program.hpp"
#include "trifinger/ipc/file_descriptor.hpp"

namespace trifinger::can::test {
namespace {

using ::testing::HasSubstr;
using trifinger::test::run;

class VirtualInterface : public ::testing::Test {
 protected:
  void SetUp() override {
    is_there_ = run({"ip", "link", "add", "dev", name_, "type", "vcan"}) == 0;
    if (!is_there_) GTEST_SKIP() << "this user cannot make virtual CAN interfaces here";
    set("up");
  }
  void TearDown() override {
    if (is_there_) remove();
  }

  void set(const std::string& state) const {
    ASSERT_EQ(run({"ip", "link", "set", name_, state}), 0);
  }
  void remove() {
    ASSERT_EQ(run({"ip", "link", "del", name_}), 0);
    is_there_ = false;
  }

  [[nodiscard]] std::unique_ptr<Bus> connect() const { return open_socket_can(name_); }
  [[nodiscard]] InterfaceState state() const { return read_interface_state(name_).value(); }

  static SendResult send(Bus& bus) {
    const Frame frame{.id = 5, .dlc = 8};
    return bus.send({&frame, 1});
  }
  std::size_t receive(Bus& bus) { return bus.receive(budget_).size(); }

  // Lets the kernel deliver an error frame, as the driver of a controller does.
  void deliver_error(canid_t error) const {
    const ipc::FileDescriptor socket([] { return ::socket(PF_CAN, SOCK_RAW, CAN_RAW); });
    sockaddr_can address{};
    address.can_family = AF_CAN;
    address.can_ifindex = static_cast<int>(::if_nametoindex(name_.c_str()));
    ASSERT_EQ(::bind(socket.get(), reinterpret_cast<sockaddr*>(&address), sizeof(address)), 0);
    can_frame frame{};
    frame.can_id = CAN_ERR_FLAG | error;
    frame.len = CAN_ERR_DLC;
    ASSERT_EQ(::write(socket.get(), &frame, sizeof(frame)), ssize_t{sizeof(frame)});
  }

  const std::string name_ = "vcan-t" + std::to_string(::getpid());  // at most 15 characters
  bool is_there_{false};
  std::array<Frame, 16> budget_{};
};

TEST_F(VirtualInterface, IsJudgedGoodWhileItIsUp) {
  EXPECT_EQ(state().kind, "vcan");
  EXPECT_TRUE(state().is_can);
  EXPECT_TRUE(state().is_up);
  EXPECT_TRUE(problems(state()).empty());
}

TEST_F(VirtualInterface, fault_40_IsSetRightByTheCommandThatIsNamed) {
  set("down");
  const auto found = problems(state());
  ASSERT_EQ(found.size(), 1U);
  EXPECT_EQ(found[0].sentence, name_ + " is down");
  EXPECT_THAT(trifinger::test::message_of<BusUnavailable>([this] { return connect(); }),
              HasSubstr("is down; set it right as administrator: " + found[0].command));
  ASSERT_EQ(run({"sh", "-c", found[0].command}), 0);
  EXPECT_TRUE(problems(state()).empty());
  EXPECT_EQ(send(*connect()).sent, 1U);
}

TEST_F(VirtualInterface, fault_40_GoesDownAndUpBeneathItsNodes) {
  const auto speaker = connect();
  const auto listener = connect();
  set("down");
  EXPECT_EQ(receive(*listener), 0U);
  EXPECT_EQ(listener->state().link, Link::kDown);
  EXPECT_EQ(send(*speaker).refusal, Refusal::kDown);
  EXPECT_EQ(speaker->state().link, Link::kDown);

  set("up");
  EXPECT_EQ(send(*speaker).sent, 1U);
  EXPECT_EQ(speaker->state().link, Link::kUp);
  EXPECT_EQ(receive(*listener), 1U);
  EXPECT_EQ(listener->state().link, Link::kUp);
}

TEST_F(VirtualInterface, fault_40_IsGoneForEverOnceItIsRemoved) {
  const auto silent = connect();
  const auto speaker = connect();
  remove();
  EXPECT_EQ(receive(*silent), 0U);
  EXPECT_EQ(silent->state().link, Link::kGone);
  EXPECT_EQ(send(*speaker).refusal, Refusal::kGone);
  EXPECT_EQ(speaker->state().link, Link::kGone);
  EXPECT_THAT(trifinger::test::message_of<BusUnavailable>([this] { return connect(); }),
              HasSubstr("there is no network interface '" + name_ + "'"));

  SetUp();  // another interface with this name
  EXPECT_EQ(receive(*silent), 0U);
  EXPECT_EQ(send(*silent).refusal, Refusal::kGone);
  EXPECT_EQ(send(*connect()).sent, 1U);
}

TEST_F(VirtualInterface, fault_40_BringsTheErrorFramesOfItsController) {
  const auto node = connect();
  deliver_error(CAN_ERR_BUSOFF);
  EXPECT_EQ(receive(*node), 0U);
  EXPECT_EQ(node->state().link, Link::kBusOff);
  EXPECT_EQ(send(*node).refusal, Refusal::kBusOff);

  deliver_error(CAN_ERR_RESTARTED);
  EXPECT_EQ(receive(*node), 0U);
  EXPECT_EQ(node->state().link, Link::kUp);
  EXPECT_EQ(node->state().error_frames, 2U);
  EXPECT_EQ(send(*node).sent, 1U);
}

TEST_F(VirtualInterface, HandsOnOnlyTheIdsThatANodeAsksFor) {
  const auto speaker = connect();
  const auto listener = open_socket_can(name_, {.ids = {7}});
  EXPECT_EQ(send(*speaker).sent, 1U);
  const Frame wanted{.id = 7};
  EXPECT_EQ(speaker->send({&wanted, 1}).sent, 1U);
  ASSERT_EQ(receive(*listener), 1U);
  EXPECT_EQ(budget_[0].id, 7U);
}

}  // namespace
}  // namespace trifinger::can::test
