// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <filesystem>
#include <memory>

#include "can/bus.hpp"

namespace trifinger::can {

/// The number of nodes that a bus between processes can have.
inline constexpr std::size_t kMaxUnixNodes = 64;

/// A node on a bus between processes.
class UnixBus : public Bus {
 public:
  /// Tells the other nodes what has become of their link, as an emulator of the bus does: for them
  /// it is the worst that any node tells. Call it in every tick, because others may join.
  virtual void set_link(Link link) noexcept TRIFINGER_REALTIME = 0;
};

/// Joins the bus between processes whose folder is `folder`, and makes the folder if there is none.
///
/// Whoever joins the same folder is on the same bus: any process of this user on this machine.
/// There is no process in between. Each node has a bounded queue for each other node, so a node
/// that is stopped or dies costs nobody more than its own frames. `send` never refuses for its
/// sake: the receiver counts what it has lost.
///
/// The last node that leaves removes the folder if it was made by a node, and only then.
///
/// Joining waits until other nodes have joined, at most 10 s.
/// @throws SystemError if the folder belongs to or may be written by somebody else, TimedOut,
/// InvalidArgument if there are already kMaxUnixNodes nodes
[[nodiscard]] std::unique_ptr<UnixBus> join_unix_bus(const std::filesystem::path& folder);

}  // namespace trifinger::can
