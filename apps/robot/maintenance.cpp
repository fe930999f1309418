// SPDX-License-Identifier: BSD-3-Clause
#include "robot/maintenance.hpp"

#include <poll.h>
#include <unistd.h>

#include <array>
#include <chrono>
#include <csignal>
#include <utility>

#include "shared/options.hpp"
#include "trifinger/base/error.hpp"
#include "trifinger/core/backend.hpp"

namespace trifinger::apps {
namespace {

RunnableRobot on_boards(RunnableRobot robot) {
  if (std::holds_alternative<std::monostate>(robot.boards)) {
    throw InvalidArgument("'" + robot.name + "' is not on motor boards");
  }
  return robot;
}

// Describes a phase of the preparation; empty if it needs no words.
template <class Phase>
std::string phase_text(Phase phase) {
  switch (phase) {
    case Phase::kStarting:
      return "starts its boards; the motors align themselves";
    case Phase::kTesting:
      return "tests its wiring: each joint moves by about 2 degrees";
    case Phase::kHoming:
      return "homes its joints";
    case Phase::kMoving:
      return "moves to its initial position";
    case Phase::kSweeping:
      return "measures: one joint after the other moves by 2 degrees and back, finger 0 first, "
             "from "
             "the base to the tip";
    case Phase::kReference:
    case Phase::kReady:
      break;
  }
  return "";
}

}  // namespace

void add_maintenance(CLI::App& command, MaintenanceOptions& options) {
  command
      .add_option("ROBOT", options.robot,
                  "A configuration of a robot on motor boards, by name or file")
      ->required();
  command.add_option("--name", options.name, "Name of the robot; default: the configuration's")
      ->option_text("NAME");
  command
      .add_option("--set", options.overrides,
                  "Change a value of the configuration, as in boards.max_current=0.5")
      ->allow_extra_args(false)
      ->option_text("KEY=VALUE ...");
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
      wear_(robot_.name, *robot_.wear, host_) {
  for (const int signal : {SIGTSTP, SIGTTOU, SIGPIPE}) std::signal(signal, SIG_IGN);
}

void ServicedRobot::prepare(const std::function<void()>& while_ready, const std::string& request) {
  Backend backend(*robot_.driver, host_, robot_.backend);
  backend.set_after_session([this](const Fault&) { wear_.take(); });
  BackendThread loop(backend, realtime_, Signals::notify);
  for (const std::string& sentence : loop.refused()) print(sentence, Style::kWarning);
  std::string said;
  bool has_requested = false;
  while (!loop.wait_for_end(Timeout::zero())) {
    const std::string doing = visit([](const auto& boards) { return phase_text(boards.phase()); });
    if (!doing.empty() && doing != said) print(said = doing);
    print_news(wear_.look());
    visit([&](auto& boards) {
      using Phase = typename std::remove_reference_t<decltype(boards)>::Phase;
      if (boards.phase() != Phase::kReference) return;
      if (!std::exchange(has_requested, true)) print(request, Style::kBold);
      if (was_enter_pressed()) boards.take_reference();
    });
    if (const std::optional<int> signal = signals_.wait(kRefresh)) {
      print("comes to rest");
      loop.stop();
      print_news(wear_.finish());
      Signals::die_of(*signal);
    }
    try {
      const SessionInfo info = host_.open().info();
      if (info.phase == SessionInfo::Phase::kHolding) {
        while_ready();
        break;
      }
      if (info.phase == SessionInfo::Phase::kEnded && info.is_at_rest) {
        throw Error(robot_.name + ": " + info.fault_text);
      }
    } catch (const SessionNotFound&) {
      continue;  // it begins soon
    }
  }
  loop.stop();
  print_news(wear_.finish());
}

bool ServicedRobot::was_enter_pressed() const {
  pollfd input{.fd = STDIN_FILENO, .events = POLLIN, .revents = 0};
  if (::poll(&input, 1, 0) <= 0) return false;
  std::array<char, 256> line{};
  const ssize_t size = ::read(STDIN_FILENO, line.data(), line.size());
  if (size == 0) throw Error("standard input has ended, so nobody can press Enter");
  return size > 0;
}

}  // namespace trifinger::apps
