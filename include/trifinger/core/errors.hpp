// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>

#include "trifinger/base/error.hpp"
#include "trifinger/base/time.hpp"
#include "trifinger/core/fault.hpp"

namespace trifinger {

/// The session has ended: it takes no further action, and no further element will come. Elements
/// that are still in the history can still be read.
class RobotStopped : public Error {
 public:
  RobotStopped(const Fault& fault, const std::string& text) : Error(text), fault_(fault) {}

  [[nodiscard]] const Fault& fault() const noexcept { return fault_; }

 private:
  Fault fault_;
};

/// The element was overwritten by newer ones.
class HistoryLost : public Error {
 public:
  HistoryLost(TimeIndex time_index, TimeIndex oldest);
  /// For payloads, which have a count of their own.
  HistoryLost(TimeIndex oldest, const std::string& text) : Error(text), oldest_(oldest) {}

  /// The oldest step, or the oldest payload, that can still be read; -1 if there is none.
  [[nodiscard]] TimeIndex oldest() const noexcept { return oldest_; }

 private:
  TimeIndex oldest_;
};

/// An action was appended for a step whose observation had already been read. On a real robot it
/// would have come too late.
class AcausalAction : public Error {
 public:
  explicit AcausalAction(TimeIndex time_index);
};

/// A wait can end only with a further action, and in this program nobody else can append it.
class ActionMissing : public Error {
 public:
  using Error::Error;
};

/// Nobody offers a session of this name.
class SessionNotFound : public Error {
 public:
  using Error::Error;
};

/// Another process or handle controls the robot.
class ControlHeld : public Error {
 public:
  using Error::Error;
};

/// Another back-end owns the robot of this name.
class RobotOwned : public Error {
 public:
  using Error::Error;
};

/// The session belongs to another robot, has other fields, or comes from another version.
class IncompatibleSession : public Error {
 public:
  using Error::Error;
};

/// A driver of two functions or a safety check throws this when its user interrupts, for example by
/// Ctrl-C. The session ends without a fault, as if the controller had let go (`kDetached`).
class Interrupted : public Error {
 public:
  using Error::Error;
};

/// The handle was made before fork(); the child process must connect again.
class InheritedHandle : public Error {
 public:
  using Error::Error;
};

}  // namespace trifinger
