// SPDX-License-Identifier: BSD-3-Clause
#include "can/socket_can.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <linux/can.h>
#include <linux/can/error.h>
#include <sys/socket.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <deque>
#include <string>

#include "can/error_frame.hpp"
#include "can/raw_socket.hpp"
#include "can/socket_can_checks.hpp"
#include "support/message_of.hpp"

namespace trifinger::can::test {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using Reason = BusUnavailable::Reason;
using std::chrono::seconds;

// A kernel that first answers with these errors.
class FailingCalls final : public SocketCalls {
 public:
  int receive(int socket, std::span<mmsghdr> messages) noexcept override {
    return next(receive_errors, [&] { return SocketCalls::receive(socket, messages); });
  }
  int send(int socket, std::span<mmsghdr> messages) noexcept override {
    return next(send_errors, [&] { return SocketCalls::send(socket, messages); });
  }

  [[nodiscard]] bool is_running(int /*socket*/, const std::string& interface) noexcept override {
    return interface == "can0" && runs;
  }

  bool runs{true};
  std::deque<int> receive_errors;
  std::deque<int> send_errors;

 private:
  template <class Call>
  static int next(std::deque<int>& errors, const Call& call) {
    if (errors.empty()) return call();
    const int error = errors.front();
    errors.pop_front();
    return -error;
  }
};

class RawSocketTest : public ::testing::Test {
 protected:
  RawSocketTest() {
    std::array<int, 2> ends{};
    ipc::FileDescriptor socket([&ends] {
      constexpr int kType = SOCK_SEQPACKET | SOCK_NONBLOCK | SOCK_CLOEXEC;
      return ::socketpair(AF_UNIX, kType, 0, ends.data()) == 0 ? ends[0] : -1;
    });
    kernel_ = ends[1];
    EXPECT_TRUE(enable_stamps(socket.get()));
    bus_ = std::make_unique<RawSocket>(std::move(socket), "can0", calls_);
  }
  ~RawSocketTest() override { ::close(kernel_); }

  // Lets the kernel deliver this frame.
  void deliver(canid_t id, std::array<std::uint8_t, 8> data = {}, std::uint8_t size = 8) const {
    can_frame frame{};
    frame.can_id = id;
    frame.len = size;
    std::ranges::copy(data, std::begin(frame.data));
    ASSERT_EQ(::send(kernel_, &frame, sizeof(frame), 0), ssize_t{sizeof(frame)});
  }
  std::size_t receive() { return bus_->receive(budget_).size(); }
  SendResult send() {
    const Frame frame{.id = 5, .dlc = 8};
    return bus_->send({&frame, 1});
  }

  FailingCalls calls_;
  int kernel_{-1};
  std::unique_ptr<Bus> bus_;
  std::array<Frame, 16> budget_;
};

TEST_F(RawSocketTest, fault_40_BusOffStopsSendingUntilTheRestart) {
  deliver(CAN_ERR_FLAG | CAN_ERR_BUSOFF);
  EXPECT_EQ(receive(), 0U);
  EXPECT_EQ(bus_->state().link, Link::kBusOff);
  EXPECT_EQ(bus_->state().bus_offs, 1U);
  EXPECT_EQ(send().refusal, Refusal::kBusOff);

  deliver(CAN_ERR_FLAG | CAN_ERR_RESTARTED);
  EXPECT_EQ(receive(), 0U);
  EXPECT_EQ(bus_->state().link, Link::kUp);
  EXPECT_EQ(bus_->state().restarts, 1U);
  EXPECT_EQ(send().refusal, Refusal::kNone);
  EXPECT_EQ(bus_->state().error_frames, 2U);
}

TEST_F(RawSocketTest, fault_40_AFrameShowsThatTheBusIsOnAgain) {
  deliver(CAN_ERR_FLAG | CAN_ERR_BUSOFF);
  deliver(0x20);
  EXPECT_EQ(receive(), 1U);
  EXPECT_EQ(bus_->state().link, Link::kUp);
}

TEST_F(RawSocketTest, fault_40_CountsWhatTheControllerReports) {
  deliver(CAN_ERR_FLAG | CAN_ERR_ACK | CAN_ERR_BUSERROR);
  deliver(CAN_ERR_FLAG | CAN_ERR_CRTL, {0, CAN_ERR_CRTL_RX_OVERFLOW});
  deliver(CAN_ERR_FLAG | CAN_ERR_CRTL, {0, CAN_ERR_CRTL_TX_PASSIVE});
  deliver(CAN_ERR_FLAG | CAN_ERR_CRTL, {0, CAN_ERR_CRTL_TX_PASSIVE | CAN_ERR_CRTL_RX_PASSIVE});
  EXPECT_EQ(receive(), 0U);
  EXPECT_EQ(bus_->state().no_acknowledgements, 1U);
  EXPECT_EQ(bus_->state().controller_overflows, 1U);
  EXPECT_EQ(bus_->state().error_passives, 1U);
  EXPECT_EQ(bus_->state().link, Link::kPassive);
  EXPECT_EQ(send().refusal, Refusal::kNone);
  deliver(CAN_ERR_FLAG | CAN_ERR_CRTL, {0, CAN_ERR_CRTL_ACTIVE});
  EXPECT_EQ(receive(), 0U);
  EXPECT_EQ(bus_->state().link, Link::kUp);
}

TEST_F(RawSocketTest, fault_40_ErrorFramesUseTheBudget) {
  for (int i = 0; i < 20; ++i) deliver(CAN_ERR_FLAG | CAN_ERR_BUSERROR);
  EXPECT_EQ(receive(), 0U);
  EXPECT_EQ(bus_->state().error_frames, budget_.size());
  EXPECT_EQ(bus_->state().overloads, 1U);
}

TEST_F(RawSocketTest, fault_40_AnInterfaceGoesDownAndUp) {
  deliver(0x20);  // waits while the interface goes down
  calls_.receive_errors = {ENETDOWN};
  EXPECT_EQ(receive(), 1U);
  EXPECT_EQ(bus_->state().link, Link::kDown);
  calls_.send_errors = {ENETDOWN};
  EXPECT_EQ(send().refusal, Refusal::kDown);
  EXPECT_EQ(send().refusal, Refusal::kNone);
  EXPECT_EQ(bus_->state().link, Link::kUp);

  calls_.receive_errors = {ENETDOWN};
  EXPECT_EQ(receive(), 0U);
  EXPECT_EQ(bus_->state().link, Link::kDown);
  deliver(0x20);
  EXPECT_EQ(receive(), 1U);
  EXPECT_EQ(bus_->state().link, Link::kUp);
}

// The kernel drops frames before it tells its sockets why.
TEST_F(RawSocketTest, fault_40_AnInterfaceThatGoesDownIsFoundBeforeTheKernelTellsIt) {
  calls_.runs = false;
  deliver(0x20);
  EXPECT_EQ(receive(), 1U);
  EXPECT_EQ(bus_->state().link, Link::kUp);
  EXPECT_EQ(receive(), 0U);
  EXPECT_EQ(bus_->state().link, Link::kDown);
  EXPECT_EQ(send().refusal, Refusal::kNone);
  EXPECT_EQ(bus_->state().link, Link::kDown);

  calls_.runs = true;
  EXPECT_EQ(receive(), 0U);
  EXPECT_EQ(bus_->state().link, Link::kDown);
  EXPECT_EQ(send().refusal, Refusal::kNone);
  EXPECT_EQ(bus_->state().link, Link::kUp);
}

TEST_F(RawSocketTest, fault_40_BusOffIsNotMistakenForAnInterfaceThatIsDown) {
  calls_.runs = false;  // a controller that is off has no carrier
  deliver(CAN_ERR_FLAG | CAN_ERR_BUSOFF);
  EXPECT_EQ(receive(), 0U);
  EXPECT_EQ(receive(), 0U);
  EXPECT_EQ(bus_->state().link, Link::kBusOff);
}

TEST_F(RawSocketTest, fault_40_AnInterfaceThatWasRemovedIsGoneForEver) {
  calls_.receive_errors = {ENODEV};
  EXPECT_EQ(receive(), 0U);
  EXPECT_EQ(bus_->state().link, Link::kGone);
  deliver(0x20);
  EXPECT_EQ(receive(), 1U);
  EXPECT_EQ(send().refusal, Refusal::kGone);
}

TEST_F(RawSocketTest, fault_40_AFullQueueIsNoError) {
  for (const int error : {ENOBUFS, EAGAIN}) {
    calls_.send_errors = {error};
    const SendResult result = send();
    EXPECT_EQ(result.sent, 0U);
    EXPECT_EQ(result.refusal, Refusal::kQueueFull);
  }
  EXPECT_EQ(bus_->state().link, Link::kUp);
  EXPECT_EQ(send().sent, 1U);
}

TEST_F(RawSocketTest, fault_40_SaysHowManyFramesWentIntoAQueueThatIsFull) {
  std::array<Frame, 100> frames;
  frames.fill({.id = 5});
  SendResult result;
  std::size_t sent = 0;
  do {
    result = bus_->send(frames);
    sent += result.sent;
  } while (result.refusal == Refusal::kNone);
  EXPECT_EQ(result.refusal, Refusal::kQueueFull);
  EXPECT_LT(result.sent, frames.size());
  std::size_t arrived = 0;
  can_frame frame{};
  while (::recv(kernel_, &frame, sizeof(frame), MSG_DONTWAIT) > 0) ++arrived;
  EXPECT_EQ(sent, arrived);
  EXPECT_EQ(bus_->state().sent, arrived);
}

TEST_F(RawSocketTest, UnknownErrorsAreHandedOn) {
  calls_.send_errors = {EPERM};
  const SendResult result = send();
  EXPECT_EQ(result.refusal, Refusal::kFailed);
  EXPECT_EQ(result.error_number, EPERM);
}

TEST_F(RawSocketTest, fault_39_DropsAndCountsWhatIsNoStandardDataFrame) {
  deliver(0x20 | CAN_EFF_FLAG);
  deliver(0x20 | CAN_RTR_FLAG);
  deliver(0x800);
  deliver(0x20, {}, 9);
  ASSERT_EQ(::send(kernel_, "short", 5, 0), 5);
  const canfd_frame long_frame{};
  ASSERT_EQ(::send(kernel_, &long_frame, sizeof(long_frame), 0), ssize_t{sizeof(long_frame)});
  deliver(0x20);
  EXPECT_EQ(receive(), 1U);
  EXPECT_EQ(bus_->state().invalid, 6U);
}

TEST_F(RawSocketTest, fault_39_BytesAfterTheLastAreZero) {
  deliver(0x20, {1, 2, 3, 4, 5, 6, 7, 8}, 3);
  EXPECT_EQ(receive(), 1U);
  EXPECT_EQ(budget_[0].data, (std::array<std::uint8_t, 8>{1, 2, 3}));
}

TEST(ArrivalTime, SubtractsTheAgeOnTheWallClock) {
  const ClockPair now{.monotonic = Instant(seconds(100)), .wall = seconds(5000)};
  EXPECT_EQ(arrival_time(seconds(4998), now, Instant(seconds(90))), Instant(seconds(98)));
}

TEST(ArrivalTime, fault_55_IsBoundedIfSomebodySetsTheWallClock) {
  const ClockPair now{.monotonic = Instant(seconds(100)), .wall = seconds(5000)};
  const Instant empty(seconds(99));
  // The wall clock was set forward or back after the frame arrived.
  EXPECT_EQ(arrival_time(seconds(1000), now, empty), empty);
  EXPECT_EQ(arrival_time(seconds(9000), now, empty), now.monotonic);
}

TEST(SocketCan, SaysWhyAKernelGivesNoSocket) {
  const auto reason_of = [](int error) {
    try {
      throw_socket_error(error);
    } catch (const BusUnavailable& unavailable) {
      return unavailable.reason();
    }
  };
  EXPECT_EQ(reason_of(EAFNOSUPPORT), Reason::kNoCanInKernel);
  EXPECT_EQ(reason_of(EPROTONOSUPPORT), Reason::kNoCanInKernel);
  EXPECT_EQ(reason_of(EPERM), Reason::kNoPermission);
  EXPECT_EQ(reason_of(EACCES), Reason::kNoPermission);
  EXPECT_THROW(throw_socket_error(EMFILE), SystemError);
}

std::string refusal_of(const std::string& name, const std::optional<InterfaceState>& state) {
  return trifinger::test::message_of<BusUnavailable>([&] {
    require_usable(name, state);
    return 0;
  });
}

TEST(SocketCan, SaysWhatIsWrongWithAnInterface) {
  InterfaceState state{
      .name = "can0",
      .kind = "can",
      .is_can = true,
      .is_up = true,
      .send_queue = 1000,
      .mtu = 16,
      .controller = ControllerState{.bit_rate = 1'000'000,
                                    .sample_point = 0.867,
                                    .restart_time = std::chrono::milliseconds(100)}};
  EXPECT_EQ(refusal_of("can0", state), "nothing");
  state.is_up = false;
  EXPECT_EQ(refusal_of("can0", state),
            "the CAN interface 'can0' is down; set it right as administrator: ip link set can0 up");
  state.controller->fd = true;
  EXPECT_THAT(refusal_of("can0", state),
              AllOf(HasSubstr("in CAN FD mode, but motor boards speak classic CAN"),
                    HasSubstr("restart-ms 100 fd off && ip link set can0 up")));
  state.is_can = false;
  EXPECT_THAT(refusal_of("can0", state), HasSubstr("'can0' is not a CAN interface"));
  EXPECT_EQ(refusal_of("loo", std::nullopt),
            "there is no network interface 'loo'; did you mean 'lo'?");
}

TEST(SocketCan, RefusesAnInterfaceThatDoesNotExist) {
  try {
    static_cast<void>(open_socket_can("no-can-here"));
    FAIL() << "opened";
  } catch (const BusUnavailable& error) {
    // A kernel without CAN cannot have the interface either.
    EXPECT_THAT(error.reason(), ::testing::AnyOf(Reason::kNoInterface, Reason::kNoCanInKernel))
        << error.what();
  }
}

}  // namespace
}  // namespace trifinger::can::test
