// SPDX-License-Identifier: BSD-3-Clause
#include "controller/episode_marks.hpp"

#include <fmt/core.h>

#include <nlohmann/json.hpp>
#include <string_view>
#include <utility>

#include "trifinger/base/error.hpp"

namespace trifinger::apps {
namespace {

constexpr std::string_view kEnding = ".episodes.jsonl";
constexpr int kVersion = 1;

}  // namespace

EpisodeMarks::EpisodeMarks(std::filesystem::path path) : path_(std::move(path)) {
  if (!std::string_view(path_.native()).ends_with(kEnding)) {
    throw InvalidArgument(
        fmt::format("{} must end in {}, so that exports find it", path_.native(), kEnding));
  }
  if (path_.has_parent_path()) {
    std::error_code error;
    std::filesystem::create_directories(path_.parent_path(), error);
    if (error) {
      throw Error(fmt::format("cannot make the folder {}: {}", path_.parent_path().native(),
                              error.message()));
    }
  }
  file_.open(path_, std::ios::app);
  check();
}

void EpisodeMarks::write(const EpisodeMark& mark) {
  const nlohmann::ordered_json json{{"version", kVersion},    {"session_id", mark.session_id},
                                    {"first", mark.first},    {"end", mark.end},
                                    {"task", mark.task},      {"terminated", mark.terminated},
                                    {"success", mark.success}};
  // A sentence from a terminal may be no UTF-8.
  file_ << json.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace) << '\n';
  file_.flush();
  check();
}

void EpisodeMarks::check() const {
  if (!file_) throw Error("cannot write the marks of episodes to " + path_.native());
}

}  // namespace trifinger::apps
