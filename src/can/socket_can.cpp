// SPDX-License-Identifier: BSD-3-Clause
#include "can/socket_can.hpp"

#include <linux/can/raw.h>
#include <net/if.h>
#include <sys/socket.h>

#include <cerrno>
#include <memory>
#include <utility>

#include "base/suggestion.hpp"
#include "raw_socket.hpp"
#include "socket_can_checks.hpp"

namespace trifinger::can {
namespace {

using Reason = BusUnavailable::Reason;

// Returns ", did you mean ...?" if an interface has a similar name.
std::string suggestion_for(const std::string& interface) {
  const std::vector<std::string> names = interface_names();
  const std::vector<std::string_view> known(names.begin(), names.end());
  const std::string_view similar = closest(interface, known);
  if (similar.empty()) return "; 'ip link' lists those that there are";
  return "; did you mean '" + std::string(similar) + "'?";
}

template <class T>
void set_option(int socket, int level, int option, const T& value, const char* doing) {
  if (::setsockopt(socket, level, option, &value, sizeof(value)) != 0) {
    throw SystemError(doing, errno);
  }
}

void set_filter(int socket, const std::vector<std::uint32_t>& ids) {
  // Without a filter for ids only the flags are compared: standard data frames pass.
  constexpr canid_t kFlags = CAN_EFF_FLAG | CAN_RTR_FLAG;
  std::vector<can_filter> filters;
  for (const std::uint32_t id : ids) {
    detail::require(id <= Frame::kMaxId, "a standard identifier has 11 bits, but " +
                                             std::to_string(id) + " is above 2047");
    filters.push_back({.can_id = id, .can_mask = kFlags | CAN_SFF_MASK});
  }
  if (filters.empty()) filters.push_back({.can_id = 0, .can_mask = kFlags});
  const auto size = static_cast<socklen_t>(filters.size() * sizeof(can_filter));
  if (::setsockopt(socket, SOL_CAN_RAW, CAN_RAW_FILTER, filters.data(), size) != 0) {
    throw SystemError("filter the frames of a CAN bus", errno);
  }
}

}  // namespace

void throw_socket_error(int error) {
  switch (error) {
    case EAFNOSUPPORT:
    case EPROTONOSUPPORT:
      throw BusUnavailable(Reason::kNoCanInKernel,
                           "this process gets no CAN sockets; load the kernel's modules with "
                           "'modprobe can_raw', use a kernel that has them (containers have that "
                           "of their host), or let the service have AF_CAN in its "
                           "RestrictAddressFamilies");
    case EPERM:
    case EACCES:
      throw BusUnavailable(Reason::kNoPermission,
                           "this user may not open CAN sockets; a security module or a filter of "
                           "system calls forbids it");
    default:
      throw SystemError("open a CAN socket", error);
  }
}

void require_usable(const std::string& interface, const std::optional<InterfaceState>& state) {
  if (!state) {
    throw BusUnavailable(Reason::kNoInterface, "there is no network interface '" + interface + "'" +
                                                   suggestion_for(interface));
  }
  if (!state->is_can) {
    throw BusUnavailable(Reason::kNotClassicCan,
                         "the network interface '" + interface + "' is not a CAN interface");
  }
  const bool is_fd = state->controller && state->controller->fd;
  if (!is_fd && state->is_up) return;
  std::string commands;
  for (const Problem& problem : problems(*state)) {
    if (problem.command.empty()) continue;
    commands += (commands.empty() ? "" : " && ") + problem.command;
  }
  throw BusUnavailable(is_fd ? Reason::kNotClassicCan : Reason::kDown,
                       "the CAN interface '" + interface + "' is " +
                           (is_fd ? "in CAN FD mode, but motor boards speak classic CAN" : "down") +
                           "; set it right as administrator: " + commands);
}

std::unique_ptr<Bus> open_socket_can(const std::string& interface,
                                     const SocketCanOptions& options) {
  ipc::FileDescriptor socket(
      [] { return ::socket(PF_CAN, SOCK_RAW | SOCK_NONBLOCK | SOCK_CLOEXEC, CAN_RAW); });
  if (!socket) throw_socket_error(errno);
  require_usable(interface, read_interface_state(interface));

  const int fd = socket.get();
  set_filter(fd, options.ids);
  set_option(fd, SOL_CAN_RAW, CAN_RAW_ERR_FILTER, can_err_mask_t{CAN_ERR_MASK},
             "receive the error frames of a CAN bus");
  set_option(fd, SOL_SOCKET, SO_RXQ_OVFL, 1, "count the frames that a CAN socket loses");
  if (!enable_stamps(fd)) throw SystemError("receive the times of CAN frames", errno);

  sockaddr_can address{};
  address.can_family = AF_CAN;
  address.can_ifindex = static_cast<int>(::if_nametoindex(interface.c_str()));
  // Index 0 would mean all interfaces.
  if (address.can_ifindex == 0) require_usable(interface, std::nullopt);
  if (::bind(fd, reinterpret_cast<const sockaddr*>(&address), sizeof(address)) != 0) {
    if (errno == ENODEV) require_usable(interface, std::nullopt);
    throw SystemError("use the CAN interface '" + interface + "'", errno);
  }
  return std::make_unique<RawSocket>(std::move(socket), interface);
}

}  // namespace trifinger::can
