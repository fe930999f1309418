// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

namespace trifinger::can {

/// The states of a CAN controller, in the kernel's numbers.
enum class ErrorState : std::uint32_t {
  kActive = 0,
  kWarning = 1,
  kPassive = 2,
  kBusOff = 3,
  kStopped = 4,
  kSleeping = 5,
};

/// What the kernel knows of a CAN controller.
struct ControllerState {
  std::uint32_t bit_rate{0};  ///< [bit/s]; 0: not set.
  double sample_point{0.0};   ///< 0 to 1
  ErrorState error_state{ErrorState::kStopped};
  std::chrono::milliseconds restart_time{0};  ///< From bus-off to the restart; 0: never.
  bool fd{false};                             ///< CAN FD mode
  bool listen_only{false};
  bool loopback{false};
  std::uint16_t send_errors{0};     ///< Error counter of the controller.
  std::uint16_t receive_errors{0};  ///< Error counter of the controller.
  std::uint32_t bus_offs{0};        ///< Since the interface exists.
  std::uint32_t restarts{0};        ///< Since the interface exists.
};

/// What the kernel knows of a network interface.
struct InterfaceState {
  std::string name{};
  std::string kind{};  ///< "can", "vcan"; empty for most others.
  bool is_can{false};
  bool is_up{false};
  std::uint32_t send_queue{0};                  ///< [frames], "txqueuelen"
  std::uint32_t mtu{0};                         ///< [bytes]: 16 for classic CAN, 72 for CAN FD.
  std::optional<ControllerState> controller{};  ///< Virtual interfaces have none.
};

/// Reads an RTM_NEWLINK message of rtnetlink(7). Empty if it is another message, or cut off.
[[nodiscard]] std::optional<InterfaceState> parse_interface_state(
    std::span<const std::byte> message);

/// The names of all network interfaces of this machine, of any kind.
[[nodiscard]] std::vector<std::string> interface_names();

/// Asks the kernel. Empty if there is no interface of this name. Needs no permission.
/// @throws SystemError
[[nodiscard]] std::optional<InterfaceState> read_interface_state(const std::string& name);

/// What motor boards need. These are their defaults.
struct InterfaceNeeds {
  std::uint32_t bit_rate{1'000'000};            ///< [bit/s]
  double sample_point{0.867};                   ///< 0 to 1
  double sample_point_tolerance{0.02};          ///< Controllers round.
  std::chrono::milliseconds restart_time{100};  ///< From bus-off to the restart.
  std::uint32_t send_queue{1000};               ///< [frames], at least.
};

struct Problem {
  std::string sentence;
  std::string command;  ///< Sets it right, run by the administrator. Empty if no command can.
};

/// Judges an interface. Empty if it is fit for use; the order is that in which to solve them.
[[nodiscard]] std::vector<Problem> problems(const InterfaceState& state,
                                            const InterfaceNeeds& needs = {});

}  // namespace trifinger::can
