// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "can/bus.hpp"
#include "trifinger/base/error.hpp"

namespace trifinger::can {

/// A network interface cannot be used as a CAN bus.
class BusUnavailable : public Error {
 public:
  enum class Reason : std::uint8_t {
    kNoCanInKernel,  ///< The kernel has no CAN sockets for this process.
    kNoPermission,
    kNoInterface,    ///< There is no interface of this name.
    kNotClassicCan,  ///< It is no CAN interface, or it is in CAN FD mode.
    kDown,
  };

  BusUnavailable(Reason reason, const std::string& text) : Error(text), reason_(reason) {}

  [[nodiscard]] Reason reason() const noexcept { return reason_; }

 private:
  Reason reason_;
};

struct SocketCanOptions {
  /// Only frames with these identifiers are received; empty: all. The kernel filters them.
  std::vector<std::uint32_t> ids{};
};

/// Opens the CAN interface `interface`, such as "can0", as a node of its bus.
///
/// The time of a received frame is the kernel's, on the monotonic clock: the time that the frame
/// has waited in the socket does not count.
/// @throws BusUnavailable, SystemError
[[nodiscard]] std::unique_ptr<Bus> open_socket_can(const std::string& interface,
                                                   const SocketCanOptions& options = {});

}  // namespace trifinger::can
