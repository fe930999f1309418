// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <limits>
#include <optional>
#include <string>
#include <utility>

#include "log/image_storage.hpp"
#include "log/message_layout.hpp"
#include "shared/options.hpp"
#include "trifinger/base/time.hpp"

// Options that several commands for logs have.
namespace trifinger::apps {

// LOG
inline void add_log_file(CLI::App& command, std::string& log) {
  command.add_option("LOG", log, "A file, or a folder: the newest recording in it")->required();
}

// --first and --last: the steps [first, last).
inline std::pair<CLI::Option*, CLI::Option*> add_steps(CLI::App& command,
                                                       std::optional<TimeIndex>& first,
                                                       std::optional<TimeIndex>& last) {
  const CLI::Range steps(TimeIndex{0}, std::numeric_limits<TimeIndex>::max());
  return {command.add_option("--first", first, "First step of the part")
              ->check(steps)
              ->option_text("T"),
          command.add_option("--last", last, "First step after the part")
              ->check(steps)
              ->option_text("T")};
}

// --precision
inline void add_precision(CLI::App& command, log::Precision& precision) {
  add_choice(
      command, "--precision", precision,
      {{"double", log::Precision::kDouble}, {"single", log::Precision::kSingle}},
      "single takes half the space, but its log cannot be replayed exactly; default: double");
}

// --images
inline void add_images(CLI::App& command, log::ImageStorage& images) {
  add_choice(
      command, "--images", images,
      {{"jpeg", log::ImageStorage::kJpeg},
       {"raw", log::ImageStorage::kRaw},
       {"none", log::ImageStorage::kNone}},
      "What is kept of images, if the robot has cameras; raw keeps every bit and takes some 20 "
      "times the space; default: jpeg");
}

}  // namespace trifinger::apps
