// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <filesystem>
#include <fstream>
#include <string>

#include "trifinger/base/time.hpp"

namespace trifinger::apps {

// An episode of a session, for `trifinger export`: docs/data_sets.md.
struct EpisodeMark {
  std::uint64_t session_id{0};
  TimeIndex first{0};
  TimeIndex end{0};  // The first step after the episode.
  std::string task;  // A sentence; empty: the export says it.
  bool terminated{false};
  bool success{false};
};

// A file of marks, which Python calls trifinger_data_sets.marks.EpisodeMarks.
class EpisodeMarks {
 public:
  // Begins the file, or goes on at its end. Throws InvalidArgument if exports would not find it by
  // its name, Error if it cannot be written.
  explicit EpisodeMarks(std::filesystem::path path);

  // The mark is with the kernel when this returns. Throws Error.
  void write(const EpisodeMark& mark);

 private:
  void check() const;

  std::filesystem::path path_;
  std::ofstream file_;
};

}  // namespace trifinger::apps
