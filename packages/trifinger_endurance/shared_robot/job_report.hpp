// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <chrono>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "shared_robot/confined_program.hpp"
#include "shared_robot/job_limits.hpp"
#include "shared_robot/robot_preparation.hpp"
#include "trifinger/base/time.hpp"
#include "trifinger/core/timing.hpp"

namespace trifinger::apps {

// Exit codes of `trifinger job`, besides those of all programs.
inline constexpr int kProgramFailed = 10;  // The program ended with another code than 0.
inline constexpr int kLimitReached = 11;   // A limit ended the program.
inline constexpr int kNotFit = 12;         // The robot was not fit: the program was not started.
inline constexpr int kNeedsOperator = 13;  // The robot is not fit afterwards: somebody must look.

// How a job has ended.
struct JobEnd {
  enum class Kind : unsigned char {
    kNotStarted,  // `text` says why
    kExited,      // with `exit_code`
    kSignal,      // by `signal`
    kLimit,       // was ended at `limit`
    kCancelled,   // by the `signal` that this program got
  };
  Kind kind{Kind::kNotStarted};
  int exit_code{0};
  int signal{0};
  Limit limit{Limit::kNone};
  bool was_killed{false};  // It did not end when it was asked to.
  std::string text;        // a sentence
};
[[nodiscard]] std::string_view name_of(JobEnd::Kind kind) noexcept;

// What the program did with the robot, by the log.
struct Driving {
  int sessions{0};  // that had at least one step
  TimeIndex steps{0};
  std::vector<std::string> faults;
  std::int64_t repeats{0};
  std::int64_t rejected{0};
  std::uint64_t late_steps{0};
  std::uint64_t late_by_user{0};
  Nanoseconds lateness_max{0};
  std::string error;  // Why the log cannot be read or is not complete.
};

// Reads the log in `folder`.
[[nodiscard]] Driving driving_in(const std::filesystem::path& folder);

// Everything that is said about a job.
struct JobReport {
  std::string robot;
  std::vector<std::string> words;
  std::optional<std::string> user;
  std::chrono::system_clock::time_point begin;
  std::chrono::system_clock::time_point end_time;
  std::filesystem::path folder;
  JobEnd end;
  JobLimits limits;
  JobUsage most;
  std::optional<ConfinedBy> confined_by;
  PreparationReport before;
  std::optional<PreparationReport> after;
  Driving driving;
  std::uint64_t output_bytes{0};
  std::uint64_t output_left_out{0};
  std::vector<std::string> leftovers;  // that were removed from shared memory
  std::vector<std::string> errors;     // of this program itself, such as a full disk
};

[[nodiscard]] int exit_code_of(const JobReport& report) noexcept;

// Writes `job.json` into `folder`, in one step. Makes the folder anew if it is gone. Throws
// SystemError.
void write_json(const JobReport& report, const std::filesystem::path& folder);
// The report for people, one line each.
[[nodiscard]] std::vector<std::string> lines_of(const JobReport& report);

}  // namespace trifinger::apps
