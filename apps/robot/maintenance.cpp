// SPDX-License-Identifier: BSD-3-Clause
#include "robot/maintenance.hpp"

#include <poll.h>
#include <termios.h>
#include <unistd.h>

#include <csignal>
#include <string_view>

#include "shared/options.hpp"
#include "trifinger/base/error.hpp"
#include "trifinger/core/backend.hpp"

namespace trifinger::apps {
namespace {

RunnableRobot on_boards(RunnableRobot robot) {
  if (robot.boards == nullptr) {
    throw InvalidArgument("'" + robot.name + "' is not on motor boards");
  }
  return robot;
}

// Describes a phase of the preparation; empty if it needs no words.
std::string_view phase_text(const boards::BoardRobot& boards) {
  using Phase = boards::BoardRobot::Phase;
  switch (boards.phase()) {
    case Phase::kStarting:
      return "starts its boards; the motors align themselves";
    case Phase::kTesting:
      return "tests its wiring: each joint moves by about 2 degrees";
    case Phase::kHoming:
      return "homes its joints";
    case Phase::kMoving:
      return "moves to its initial position";
    case Phase::kSweeping:
      if (!boards.options().names[0].empty()) {
        return "measures: one joint after the other moves by 2 degrees and back, in the order of "
               "robot.joints";
      }
      return "measures: one joint after the other moves by 2 degrees and back, finger 0 first, "
             "from the base to the tip";
    case Phase::kReference:
    case Phase::kReady:
      break;
  }
  return "";
}

}  // namespace

void add_maintenance(CLI::App& command, MaintenanceOptions& options) {
  add_configured_robot(command, options,
                       "A configuration of a robot on motor boards, by name or file",
                       "boards.max_current=0.5")
      ->required();
  add_scheduling(command, options.realtime.demand,
                 "Whether real-time priority and locked memory are required; default: try");
}

ServicedRobot::ServicedRobot(const MaintenanceOptions& options, bool is_calibrated)
    : realtime_(options.realtime),
      robot_(on_boards(make_robot({.robot = options.robot,
                                   .name = options.name,
                                   .overrides = options.overrides,
                                   .is_calibrated = is_calibrated}))),
      host_(SessionHost::named(robot_.name, robot_.session)),
      wear_(robot_.name, *robot_.boards, host_) {
  for (const int signal : {SIGTSTP, SIGTTIN, SIGTTOU, SIGPIPE}) std::signal(signal, SIG_IGN);
}

void ServicedRobot::prepare(const std::function<void()>& while_ready) {
  Backend backend(*robot_.driver, host_, robot_.backend);
  backend.set_after_session([this](const Fault&) { wear_.take(); });
  BackendThread loop(backend, realtime_, Signals::notify);
  for (const std::string& sentence : loop.refused()) print(sentence, Style::kWarning);
  std::string said;
  bool is_stopping = false;
  while (!loop.wait_for_end(Timeout::zero())) {
    const std::string_view doing = phase_text(boards());
    if (!doing.empty() && doing != said) print(said = doing);
    print_warning(wear_.look());
    if (!is_stopping) ask_for_reference();
    if (const std::optional<int> signal = signals_.wait(kRefresh)) {
      if (is_stopping) Signals::die_of(*signal);
      is_stopping = true;
      backend.request_stop();
      print("comes to rest; a second Ctrl-C kills");
    }
    if (!is_stopping && is_ready()) {
      while_ready();
      break;
    }
  }
  loop.stop();
  print_warning(wear_.finish());
  if (is_stopping) throw Error(robot_.name + ": interrupted");
}

bool ServicedRobot::is_ready() const {
  SessionInfo info;
  try {
    info = host_.open().info();
  } catch (const SessionNotFound&) {
    return false;  // it begins soon
  }
  if (info.phase == SessionInfo::Phase::kEnded && info.is_at_rest) {
    throw Error(robot_.name + ": " + info.fault_text);
  }
  return info.phase == SessionInfo::Phase::kHolding;
}

void ServicedRobot::ask_for_reference() {
  if (boards().phase() != boards::BoardRobot::Phase::kReference) {
    question_ = Question::kNone;
  } else if (question_ == Question::kNone) {
    question_ = Question::kIsAtReference;
    ::tcflush(STDIN_FILENO, TCIFLUSH);  // An Enter from before is no answer.
    print("put all joints at the reference, hold them there, and press Enter", Style::kBold);
  } else if (was_enter_pressed()) {
    if (question_ == Question::kIsAtReference) {
      question_ = Question::kIsFree;
      boards().take_reference();
      print("take your hands away, then press Enter: the robot homes itself", Style::kBold);
    } else {
      boards().leave_reference();
    }
  }
}

bool ServicedRobot::was_enter_pressed() {
  pollfd input{.fd = STDIN_FILENO, .events = POLLIN, .revents = 0};
  while (::poll(&input, 1, 0) > 0) {
    char typed = 0;
    const ssize_t size = ::read(STDIN_FILENO, &typed, 1);
    if (size == 0) throw Error("standard input has ended, so nobody can press Enter");
    if (size > 0 && typed == '\n') return true;
    if (size < 0) return false;
  }
  return false;
}

}  // namespace trifinger::apps
