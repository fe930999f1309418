// SPDX-License-Identifier: BSD-3-Clause
#include "robot/doctor_can.hpp"

#include <fmt/core.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <filesystem>
#include <iterator>
#include <memory>
#include <thread>
#include <utility>
#include <variant>

#include "boards/read_options.hpp"
#include "can/bus.hpp"
#include "can/interface_state.hpp"
#include "can/motor_board.hpp"
#include "can/socket_can.hpp"
#include "can/unix_bus.hpp"
#include "sim/boards_config.hpp"
#include "trifinger/base/error.hpp"
#include "trifinger/base/time.hpp"

namespace trifinger::apps {
namespace {

constexpr const char* kInterface = "CAN interface";

// Describes an interface without problems: "can0: up, 1000000 bit/s, sample point 0.867".
std::string description_of(const can::InterfaceState& state) {
  if (!state.controller) return state.name + ": up, virtual";
  return fmt::format("{}: up, {} bit/s, sample point {:.3f}, restarts {} ms after bus-off",
                     state.name, state.controller->bit_rate, state.controller->sample_point,
                     state.controller->restart_time.count());
}

// One finding for each problem, or one that nothing is wrong.
std::vector<Finding> judge(const can::InterfaceState& state, Verdict verdict) {
  std::vector<Finding> findings;
  for (const can::Problem& problem : can::problems(state)) {
    findings.push_back({kInterface, verdict, problem.sentence, problem.command});
  }
  if (findings.empty()) findings.push_back({kInterface, Verdict::kGood, description_of(state), ""});
  return findings;
}

// Errors say what is wrong, then after a semicolon what to do.
Finding finding_of(const Error& error) {
  const std::string text = error.what();
  const std::size_t end = text.find("; ");
  if (end == std::string::npos) return {kInterface, Verdict::kFails, text, ""};
  return {kInterface, Verdict::kFails, text.substr(0, end), text.substr(end + 2)};
}

// What a board is connected to, and whether it answers.
struct BoardBus {
  std::string name;
  bool is_virtual;
  std::unique_ptr<can::Bus> bus;  // Empty if there is none to listen to.
  bool answers{false};
};

// Returns an emulated bus, or nothing if nobody has ever joined it: joining would make it.
std::unique_ptr<can::Bus> join_if_it_exists(const std::string& robot, const std::string& name) {
  std::error_code ignored;
  const std::filesystem::path folder = boards::emulated_bus_folder(robot, name);
  return std::filesystem::exists(folder, ignored) ? can::join_unix_bus(folder) : nullptr;
}

// A board that is on sends its status once a second, whether or not anybody uses it.
void listen(std::vector<BoardBus>& boards) {
  const Deadline deadline(std::chrono::seconds(5));
  std::array<can::Frame, 64> frames{};
  const auto is_silent = [](const BoardBus& board) { return board.bus && !board.answers; };
  while (std::ranges::any_of(boards, is_silent) && !deadline.passed()) {
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
    for (BoardBus& board : boards) {
      if (!board.bus) continue;
      for (const can::Frame& frame : board.bus->receive(frames)) {
        board.answers |= !std::holds_alternative<can::Rejection>(can::decode_from_board(frame));
      }
    }
  }
}

Finding judge_answers(const std::vector<BoardBus>& boards, const std::string& configuration) {
  std::vector<std::string> silent;
  bool are_virtual = true;
  for (const BoardBus& board : boards) {
    if (board.answers) continue;
    silent.push_back(board.name);
    are_virtual = are_virtual && board.is_virtual;
  }
  constexpr const char* kWhat = "motor boards";
  if (silent.empty()) {
    return {kWhat, Verdict::kGood, fmt::format("{} answer", boards.size()), ""};
  }
  return {kWhat, Verdict::kFails, fmt::format("none answers on {}", fmt::join(silent, ", ")),
          are_virtual ? fmt::format("start them: trifinger emulate {}", configuration)
                      : "check their supply, their cables and the emergency stop"};
}

}  // namespace

std::vector<Finding> examine_can_interfaces() {
  std::vector<Finding> findings;
  for (const std::string& name : can::interface_names()) {
    // An interface may be removed meanwhile.
    const auto state = can::read_interface_state(name);
    if (!state || !state->is_can) continue;
    for (Finding& finding : judge(*state, Verdict::kNote)) findings.push_back(std::move(finding));
  }
  return findings;
}

std::vector<Finding> examine_boards(const BoardsConfig& config, const std::string& configuration,
                                    const std::string& robot) {
  std::vector<Finding> findings;
  std::vector<BoardBus> boards;
  for (const std::string& bus : config.options.interfaces) {
    try {
      if (config.bus == boards::BusKind::kEmulated) {
        boards.push_back({.name = bus, .is_virtual = true, .bus = join_if_it_exists(robot, bus)});
        continue;
      }
      const auto state = can::read_interface_state(bus);
      if (state) std::ranges::move(judge(*state, Verdict::kFails), std::back_inserter(findings));
      // Without problems, or without an interface, opening it says the rest.
      if (state && findings.back().verdict != Verdict::kGood) continue;
      boards.push_back({.name = bus,
                        .is_virtual = state && state->kind == "vcan",
                        .bus = can::open_socket_can(bus)});
    } catch (const can::BusUnavailable& error) {
      // Without CAN in the kernel, nothing can be said of any interface.
      if (error.reason() == can::BusUnavailable::Reason::kNoCanInKernel) return {finding_of(error)};
      findings.push_back(finding_of(error));
    } catch (const Error& error) {
      findings.push_back(finding_of(error));
    }
  }
  listen(boards);
  if (!boards.empty()) findings.push_back(judge_answers(boards, configuration));
  return findings;
}

}  // namespace trifinger::apps
