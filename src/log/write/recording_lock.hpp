// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <filesystem>
#include <optional>
#include <string>

#include "trifinger/ipc/file_descriptor.hpp"
#include "trifinger/ipc/process.hpp"

namespace trifinger::log::detail {

// The right to record one robot into one folder. It lasts as long as the object.
class RecordingLock {
 public:
  // `robot_process`: the process with which the recorder ends, if there is one. If the present
  // owner's own such process is gone, that owner is about to finish, and the constructor waits for
  // it. Throws AlreadyRecorded, SystemError.
  RecordingLock(const std::filesystem::path& folder, const std::string& robot,
                const std::optional<ipc::ProcessIdentity>& robot_process);
  RecordingLock(RecordingLock&&) noexcept = default;
  RecordingLock& operator=(RecordingLock&&) = delete;
  RecordingLock(const RecordingLock&) = delete;
  RecordingLock& operator=(const RecordingLock&) = delete;
  ~RecordingLock();

 private:
  std::filesystem::path path_;
  ipc::FileDescriptor file_;
};

}  // namespace trifinger::log::detail
