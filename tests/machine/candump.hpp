// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <fstream>
#include <map>
#include <stdexcept>
#include <string>
#include <vector>

#include "support/folder.hpp"
#include "support/program.hpp"

namespace trifinger::test {

/// candump, which writes down frames on all buses. It shares no code with this project.
class Candump {
 public:
  /// Writes down the frames that pass `filter`, which is candump's: "any" or "any,0:7F8". It has
  /// begun when the constructor returns.
  explicit Candump(const std::string& filter)
      : candump_({"candump", "-d", "-r", "100000000", "-L", filter}, folder_ / "frames") {
    // It says nothing when it begins to listen, but it hears this on another bus.
    show("007#");
  }
  Candump(const Candump&) = delete;
  Candump& operator=(const Candump&) = delete;
  ~Candump() = default;

  /// Waits until it has written all frames that were sent before, and ends it.
  /// @throws std::runtime_error if it has missed frames
  void dismiss() {
    // It has one queue for all buses, and its signal to end would lose what is still in there.
    show("007#0E");
    candump_.end();
    std::ifstream lines(folder_ / "frames");
    // "(1795384655.961230)  vcan3 005#0066F2AE00000000"
    for (std::string line; std::getline(lines, line);) {
      const std::size_t frame = line.rfind(' ') + 1;
      const std::size_t bus = line.rfind(' ', frame - 2) + 1;
      if (line.starts_with("DROPCOUNT")) {
        throw std::runtime_error("candump has missed frames: " + line);
      }
      frames_[line.substr(bus, frame - bus - 1)].push_back(line.substr(frame));
    }
  }

  /// The frames on one bus, once it is dismissed, as candump writes them: "005#0000000000000000".
  [[nodiscard]] const std::vector<std::string>& frames(const std::string& bus) const {
    return frames_.at(bus);
  }

 private:
  // Sends a frame that is on no other bus, until it is written.
  void show(const std::string& frame) const {
    if (run({"ip", "link", "add", "dev", kOwnBus, "type", "vcan"}) != 0 ||
        run({"ip", "link", "set", kOwnBus, "up"}) != 0) {
      throw std::runtime_error("there is no bus for candump");
    }
    while (candump_.text().find(frame + '\n') == std::string::npos) {
      if (run({"cansend", kOwnBus, frame}) != 0) throw std::runtime_error("cansend failed");
    }
    run({"ip", "link", "del", kOwnBus});
  }

  static constexpr const char* kOwnBus = "vcan-w";

  Folder folder_;
  Program candump_;
  std::map<std::string, std::vector<std::string>> frames_;  // of each bus
};

}  // namespace trifinger::test
