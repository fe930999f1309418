// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <sys/stat.h>
#include <sys/types.h>

#include <cstdint>
#include <filesystem>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "shared_robot/process_tree.hpp"
#include "trifinger/ipc/file_descriptor.hpp"

namespace trifinger::apps {

// A file, whatever its name is now: device and inode.
using FileIdentity = std::pair<std::uint64_t, std::uint64_t>;

struct FilesUsage {
  std::uint64_t bytes{0};  // on the disk, or in memory
  std::uint64_t count{0};
  // Some of them cannot be counted: they lie in a folder of the job that may not be read, or too
  // deep.
  bool is_hidden{false};
};

// The files of a job: those in its folder, and those that it leaves in shared memory.
class JobFiles {
 public:
  // The job of `user` begins now: what lies in the folders `shared` already is not its own.
  JobFiles(std::filesystem::path folder, std::vector<std::filesystem::path> shared, uid_t user);

  // Notes which files the processes of the job have open.
  void look_at(const std::vector<ProcessEntry>& processes);
  // Returns what is in the folder, what the user has made in shared memory, and what processes of
  // the job have removed but still have open. Sessions that processes outside of the job use do not
  // count. Stops counting above `most`.
  [[nodiscard]] FilesUsage usage(FilesUsage most) const;

  // Call it when all processes of the job have ended. Removes what they left in shared memory:
  // files of their user, made since the beginning, that nobody has open, and folders that are then
  // empty. If the job had the user of this program, only files that the job was seen to have open,
  // and their folders, because others may be ours. Returns the paths of what was removed.
  [[nodiscard]] std::vector<std::string> remove_leftovers() const;

 private:
  // Whether the user has made this since the beginning.
  [[nodiscard]] bool is_new(const struct stat& status) const;
  // Finds sessions that processes outside of the job use.
  void find_sessions_of_others(const std::vector<ProcessEntry>& job);

  std::filesystem::path path_;
  ipc::FileDescriptor folder_;
  std::vector<std::filesystem::path> shared_;
  std::vector<std::filesystem::path> roots_;  // of these, those that lie in no other
  uid_t user_;
  std::set<FileIdentity> before_;
  std::set<FileIdentity> seen_;                // in shared memory, open in a process of the job
  std::set<FileIdentity> sessions_of_others_;  // in shared memory
  std::set<FileIdentity> removed_;             // at the last look, without a name
  std::uint64_t removed_bytes_{0};
};

}  // namespace trifinger::apps
