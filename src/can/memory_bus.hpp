// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>

#include "can/bus.hpp"
#include "trifinger/base/time.hpp"
#include "trifinger/realtime/clock.hpp"

namespace trifinger::can {

/// Something that goes wrong on a bus in memory for a while.
struct BusFault {
  enum class Kind : std::uint8_t {
    kLose,       ///< Frames reach nobody. With `node` and no `probability`, that node is silent.
    kDuplicate,  ///< Frames arrive twice.
    kDelay,      ///< Frames arrive late by up to `delay`, also after later ones.
    kCorrupt,    ///< Frames arrive with another id, length or data.
    kFlood,      ///< A foreign node sends `rate` frames per second.
    kQueueFull,  ///< Nothing can be sent.
    kBusOff,     ///< Nodes are off the bus. They restart at the end.
    kDown,       ///< The nodes' interface is down.
    kGone,       ///< The nodes' interface was removed: for ever.
  };

  Kind kind{Kind::kLose};
  Instant begin{Instant::min()};
  Instant end{Instant::max()};
  double probability{1.0};            ///< Probability for each frame.
  std::optional<std::size_t> node{};  ///< This node, or frames sent by it; default: all.
  std::optional<std::uint32_t> id{};  ///< Only frames with this id; of a flood: its id.
  Nanoseconds delay{};                ///< The longest delay of kDelay.
  double rate{0.0};                   ///< Frames of kFlood [1/s], from a finite `begin` on.
};

struct MemoryBusOptions {
  std::size_t queue{1024};  ///< Frames that can wait for each node.
  std::uint64_t seed{0};    ///< Decides about everything random.
};

/// A bus in the memory of one thread, with any number of nodes and with faults as a script.
///
/// Equal calls at equal times give equal frames, bit for bit.
class MemoryBus {
 public:
  /// `clock` must live as long as the bus. It tells when frames are sent and faults begin.
  explicit MemoryBus(const Clock& clock, const MemoryBusOptions& options = {});
  ~MemoryBus();

  /// A further node. The first one has number 0. A node must not outlive its bus.
  [[nodiscard]] std::unique_ptr<Bus> connect();

  /// Adds a fault to the script. @throws InvalidArgument for a fault that makes no sense
  void add(const BusFault& fault);

 private:
  class Node;
  class Wire;
  std::unique_ptr<Wire> wire_;
};

}  // namespace trifinger::can
