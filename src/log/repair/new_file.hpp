// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <filesystem>
#include <system_error>
#include <utility>

#include "trifinger/mcap/sink.hpp"

namespace trifinger::log::detail {

// A new file. The destructor removes it unless `finish` was called.
class NewFile {
 public:
  explicit NewFile(std::filesystem::path path)
      : path_(std::move(path)), sink_(mcap::FileSink::create(path_)) {}
  NewFile(const NewFile&) = delete;
  NewFile& operator=(const NewFile&) = delete;
  ~NewFile() {
    std::error_code ignored;
    if (!is_finished_) std::filesystem::remove(path_, ignored);
  }

  [[nodiscard]] mcap::Sink& sink() noexcept { return sink_; }
  void finish() {
    sink_.sync();
    is_finished_ = true;
  }

 private:
  std::filesystem::path path_;
  mcap::FileSink sink_;
  bool is_finished_{false};
};

}  // namespace trifinger::log::detail
