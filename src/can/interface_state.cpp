// SPDX-License-Identifier: BSD-3-Clause
#include "can/interface_state.hpp"

#include <linux/can/netlink.h>
#include <linux/rtnetlink.h>
#include <net/if.h>
#include <net/if_arp.h>
#include <sys/socket.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cmath>
#include <cstring>
#include <memory>

#include "base/text_of.hpp"
#include "trifinger/base/error.hpp"
#include "trifinger/ipc/file_descriptor.hpp"

namespace trifinger::can {
namespace {

using Bytes = std::span<const std::byte>;

// Reads a T at the beginning of `bytes`. Kernels append fields to their structs, so there may be
// more bytes.
template <class T>
std::optional<T> read(Bytes bytes) {
  if (bytes.size() < sizeof(T)) return std::nullopt;
  T value{};
  std::memcpy(&value, bytes.data(), sizeof(T));
  return value;
}

template <class T>
void read_into(T& target, Bytes bytes) {
  if (const auto value = read<T>(bytes)) target = *value;
}

std::string text_of(Bytes bytes) {
  const auto end = std::ranges::find(bytes, std::byte{0});
  std::string text(static_cast<std::size_t>(end - bytes.begin()), '\0');
  std::memcpy(text.data(), bytes.data(), text.size());
  return text;
}

// Calls `visit(type, payload)` for each attribute. False if one is cut off.
template <class Visit>
bool for_each_attribute(Bytes bytes, const Visit& visit) {
  while (bytes.size() >= sizeof(rtattr)) {
    const auto attribute = read<rtattr>(bytes).value();
    const std::size_t size = attribute.rta_len;
    if (size < sizeof(rtattr) || size > bytes.size()) return false;
    // The two highest bits are flags.
    visit(attribute.rta_type & NLA_TYPE_MASK, bytes.first(size).subspan(RTA_LENGTH(0)));
    bytes = bytes.subspan(std::min<std::size_t>(RTA_ALIGN(size), bytes.size()));
  }
  return true;
}

bool read_controller(Bytes bytes, ControllerState& controller) {
  return for_each_attribute(bytes, [&](int type, Bytes payload) {
    switch (type) {
      case IFLA_CAN_BITTIMING:
        if (const auto timing = read<can_bittiming>(payload)) {
          controller.bit_rate = timing->bitrate;
          controller.sample_point = 1e-3 * timing->sample_point;
        }
        break;
      case IFLA_CAN_STATE:
        read_into(controller.error_state, payload);
        break;
      case IFLA_CAN_CTRLMODE:
        if (const auto mode = read<can_ctrlmode>(payload)) {
          controller.fd = (mode->flags & CAN_CTRLMODE_FD) != 0;
          controller.listen_only = (mode->flags & CAN_CTRLMODE_LISTENONLY) != 0;
          controller.loopback = (mode->flags & CAN_CTRLMODE_LOOPBACK) != 0;
        }
        break;
      case IFLA_CAN_RESTART_MS:
        controller.restart_time =
            std::chrono::milliseconds(read<std::uint32_t>(payload).value_or(0));
        break;
      case IFLA_CAN_BERR_COUNTER:
        if (const auto counter = read<can_berr_counter>(payload)) {
          controller.send_errors = counter->txerr;
          controller.receive_errors = counter->rxerr;
        }
        break;
      default:
        break;
    }
  });
}

bool read_link_info(Bytes bytes, InterfaceState& state) {
  Bytes data;
  Bytes statistics;
  const bool is_whole = for_each_attribute(bytes, [&](int type, Bytes payload) {
    if (type == IFLA_INFO_KIND) state.kind = text_of(payload);
    if (type == IFLA_INFO_DATA) data = payload;
    if (type == IFLA_INFO_XSTATS) statistics = payload;
  });
  // Other kinds have other data under the same numbers.
  if (!is_whole || state.kind != "can") return is_whole;
  state.controller.emplace();
  if (const auto count = read<can_device_stats>(statistics)) {
    state.controller->bus_offs = count->bus_off;
    state.controller->restarts = count->restarts;
  }
  return read_controller(data, *state.controller);
}

struct Request {
  nlmsghdr header{};
  ifinfomsg link{};
  rtattr name_header{};
  std::array<char, IFNAMSIZ> name{};
};

// A number without superfluous zeros: "0.867", "1000000".
std::string number_text(double number) {
  std::string text = std::to_string(std::round(number * 1e3) / 1e3);
  text.erase(text.find_last_not_of('0') + 1);
  if (text.back() == '.') text.pop_back();
  return text;
}

// What of the controller's settings is wrong, in words.
std::vector<std::string> wrong_settings(const ControllerState& controller,
                                        const InterfaceNeeds& needs) {
  std::vector<std::string> wrong;
  if (controller.bit_rate != needs.bit_rate) {
    wrong.push_back(controller.bit_rate == 0
                        ? "it has no bit rate"
                        : "its bit rate is " + std::to_string(controller.bit_rate) +
                              " instead of " + std::to_string(needs.bit_rate) + " bit/s");
  } else if (std::abs(controller.sample_point - needs.sample_point) >
             needs.sample_point_tolerance) {
    wrong.push_back("its sample point is " + number_text(controller.sample_point) + " instead of " +
                    number_text(needs.sample_point));
  }
  if (controller.restart_time.count() == 0) {
    wrong.emplace_back("it never restarts after bus-off");
  } else if (controller.restart_time > needs.restart_time) {
    wrong.push_back("it restarts only " + std::to_string(controller.restart_time.count()) +
                    " ms after bus-off");
  }
  if (controller.fd) wrong.emplace_back("it is in CAN FD mode");
  if (controller.listen_only) wrong.emplace_back("it only listens");
  if (controller.loopback) wrong.emplace_back("it only talks to itself (loopback)");
  return wrong;
}

std::string set_command(const InterfaceState& state, const InterfaceNeeds& needs) {
  const std::string link = "ip link set " + state.name;
  std::string command = link + " type can bitrate " + std::to_string(needs.bit_rate) +
                        " sample-point " + number_text(needs.sample_point) + " restart-ms " +
                        std::to_string(needs.restart_time.count());
  if (state.controller->fd) command += " fd off";
  if (state.controller->listen_only) command += " listen-only off";
  if (state.controller->loopback) command += " loopback off";
  // The kernel changes these settings only while the interface is down.
  if (state.is_up) command = link + " down && " + command + " && " + link + " up";
  return command;
}

}  // namespace

std::optional<InterfaceState> parse_interface_state(Bytes message) {
  const auto header = read<nlmsghdr>(message);
  if (!header || header->nlmsg_type != RTM_NEWLINK || header->nlmsg_len > message.size() ||
      header->nlmsg_len < NLMSG_LENGTH(sizeof(ifinfomsg))) {
    return std::nullopt;
  }
  const Bytes body = message.first(header->nlmsg_len).subspan(NLMSG_HDRLEN);
  const auto link = read<ifinfomsg>(body).value();
  InterfaceState state;
  state.is_can = link.ifi_type == ARPHRD_CAN;
  state.is_up = (link.ifi_flags & IFF_UP) != 0;
  bool is_whole = true;
  is_whole &=
      for_each_attribute(body.subspan(NLMSG_ALIGN(sizeof(link))), [&](int type, Bytes payload) {
        if (type == IFLA_IFNAME) state.name = text_of(payload);
        if (type == IFLA_TXQLEN) read_into(state.send_queue, payload);
        if (type == IFLA_MTU) read_into(state.mtu, payload);
        if (type == IFLA_LINKINFO) is_whole &= read_link_info(payload, state);
      });
  return is_whole ? std::optional(state) : std::nullopt;
}

std::vector<std::string> interface_names() {
  struct Release {
    void operator()(struct if_nameindex* list) const noexcept { ::if_freenameindex(list); }
  };
  const std::unique_ptr<struct if_nameindex, Release> list(::if_nameindex());
  std::vector<std::string> names;
  for (const auto* entry = list.get(); entry != nullptr && entry->if_name != nullptr; ++entry) {
    names.emplace_back(entry->if_name);
  }
  return names;
}

std::optional<InterfaceState> read_interface_state(const std::string& name) {
  // The kernel truncates longer names instead of refusing them.
  if (name.empty() || name.size() >= IFNAMSIZ) return std::nullopt;
  const std::string doing = "ask the kernel about the network interface '" + name + "'";
  const ipc::FileDescriptor socket(
      [] { return ::socket(AF_NETLINK, SOCK_RAW | SOCK_CLOEXEC, NETLINK_ROUTE); });
  if (!socket) throw SystemError(doing, errno);

  Request request;
  request.header.nlmsg_len = sizeof(request);
  request.header.nlmsg_type = RTM_GETLINK;
  request.header.nlmsg_flags = NLM_F_REQUEST;
  request.name_header = {.rta_len = RTA_LENGTH(IFNAMSIZ), .rta_type = IFLA_IFNAME};
  std::ranges::copy(name, request.name.begin());
  if (::send(socket.get(), &request, sizeof(request), 0) < 0) throw SystemError(doing, errno);

  std::vector<std::byte> reply(std::size_t{1} << 16U);
  ssize_t size = 0;
  do {
    size = ::recv(socket.get(), reply.data(), reply.size(), 0);
  } while (size < 0 && errno == EINTR);
  if (size < 0) throw SystemError(doing, errno);
  const Bytes message = Bytes(reply).first(static_cast<std::size_t>(size));
  const auto header = read<nlmsghdr>(message);
  if (header && header->nlmsg_type == NLMSG_ERROR && message.size() >= NLMSG_LENGTH(sizeof(int))) {
    const int error = -read<int>(message.subspan(NLMSG_HDRLEN)).value();
    if (error == ENODEV) return std::nullopt;
    throw SystemError(doing, error);
  }
  auto state = parse_interface_state(message);
  if (!state) throw SystemError(doing, EBADMSG);
  return state;
}

std::vector<Problem> problems(const InterfaceState& state, const InterfaceNeeds& needs) {
  if (!state.is_can) return {{.sentence = state.name + " is not a CAN interface", .command = {}}};
  std::vector<Problem> found;
  const std::string link = "ip link set " + state.name;
  if (state.controller) {
    const auto wrong = wrong_settings(*state.controller, needs);
    if (!wrong.empty()) {
      found.push_back({.sentence = state.name + ": " + trifinger::detail::joined(wrong),
                       .command = set_command(state, needs)});
    }
    // A virtual interface has no queue.
    if (state.send_queue < needs.send_queue) {
      found.push_back({.sentence = state.name + " queues only " + std::to_string(state.send_queue) +
                                   " frames instead of " + std::to_string(needs.send_queue),
                       .command = link + " txqueuelen " + std::to_string(needs.send_queue)});
    }
  }
  if (!state.is_up) {
    found.push_back({.sentence = state.name + " is down", .command = link + " up"});
  } else if (state.controller && state.controller->error_state == ErrorState::kBusOff) {
    found.push_back({.sentence = state.name +
                                 " is bus-off after too many errors: check cable, termination at "
                                 "both ends, bit rate and power of the board",
                     .command = link + " type can restart"});
  } else if (state.controller && state.controller->error_state == ErrorState::kPassive) {
    found.push_back({.sentence = state.name +
                                 " counts many errors (error passive): check cable, termination at "
                                 "both ends and power of the board",
                     .command = {}});
  }
  return found;
}

}  // namespace trifinger::can
