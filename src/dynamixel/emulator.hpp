// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "dynamixel/emulated_bus.hpp"

namespace trifinger::dynamixel {

/// Emulated motors at a pseudo-terminal: any program opens it like the serial device of an adapter.
/// A thread moves the motors in real time and hands over each packet when its last byte would have
/// arrived, never earlier.
///
/// Motors hear only a host that has set their baud rate at the terminal, as in reality.
class Emulator {
 public:
  /// Makes the terminal and starts the thread. `plant` must outlive the emulator; its functions run
  /// in the thread. If `link` is not empty, a symbolic link of this name leads to the terminal. It
  /// replaces a link that was there, unless that belongs to an emulator that lives.
  /// @throws InvalidArgument, SystemError
  Emulator(const std::vector<EmulatedMotorOptions>& motors, Plant& plant,
           const EmulatedBusOptions& options = {}, const std::string& link = {});
  /// Ends the thread and closes the terminal: its users see that the line has gone.
  ~Emulator();

  /// True if an emulator that lives has made this link. The link of one that was killed remains,
  /// and may lead to somebody's terminal.
  /// @throws SystemError
  [[nodiscard]] static bool is_at(const std::string& link);

  /// The terminal's name, such as "/dev/pts/7".
  [[nodiscard]] const std::string& path() const noexcept;

  /// Runs `change` in the thread, between two steps, and waits for its end: to switch a motor off,
  /// let it fail, read its registers, or change the faults of the line. Any thread may call this.
  void change(const std::function<void(EmulatedBus&)>& change);

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace trifinger::dynamixel
