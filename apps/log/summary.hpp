// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "shared/step_counts.hpp"
#include "trifinger/base/time.hpp"
#include "trifinger/core/timing.hpp"
#include "trifinger/log/log.hpp"

// What `trifinger log info` says about a log, or about another MCAP file.
namespace trifinger::apps {

// What the statuses of a session say.
struct LoopSummary {
  TimingRecord timing;
  StepCounts counts;
};

// Summary of a robot's steps or of a companion's elements.
struct StreamSummary {
  std::string name;
  std::string type;
  std::int64_t count{0};
  TimeIndex first{0};
  TimeIndex last{0};
  std::int64_t begin{0};  // times of the first and the last one, since 1970 [ns]
  std::int64_t end{0};
  std::vector<log::Gap> gaps;

  [[nodiscard]] double duration() const noexcept { return static_cast<double>(end - begin) / 1e9; }
  [[nodiscard]] double rate() const noexcept {
    return end > begin ? static_cast<double>(last - first) / duration() : 0.0;
  }
};

// Images of a camera.
struct ImageSummary {
  std::string camera;
  std::int64_t count{0};     // in the log
  std::int64_t left_out{0};  // good, but not in the log
  std::uint64_t bytes{0};
  std::string encoding;  // of the first one: "jpeg", "bayer_rggb8"
};

struct SessionSummary {
  log::LoggedSession session;
  StreamSummary steps;
  std::optional<LoopSummary> loop;  // only if this version knows the statuses
  std::vector<StreamSummary> companions;
  std::vector<ImageSummary> images;  // none if no image was recorded
};

struct LogSummary {
  log::Log log;
  std::vector<SessionSummary> sessions;
};

// A file that is no log.
struct McapSummary {
  struct Topic {
    std::string name;
    std::string type;
    std::uint64_t messages{0};
  };
  std::string file;
  std::uint64_t size{0};  // [bytes]
  bool is_finished{false};
  std::string profile;
  std::string library;
  std::uint64_t messages{0};
  double duration{0.0};       // [s]
  std::vector<Topic> topics;  // sorted by name
  std::string reason;         // why it is no log
};

// Reads the whole log.
[[nodiscard]] LogSummary summary_of(log::Log log);
[[nodiscard]] McapSummary summary_of(const std::string& file, const std::string& reason);

// Formats a damage: "bytes 4711 to 4999: The checksum of a chunk is wrong".
[[nodiscard]] std::string text_of(const log::Damage& damage);

// For people. `all_events`: also those that are no warnings and no errors.
void print(const LogSummary& summary, bool all_events);
void print(const McapSummary& summary);

// For programs.
void print_json(const LogSummary& summary);
void print_json(const McapSummary& summary);

}  // namespace trifinger::apps
