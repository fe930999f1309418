// SPDX-License-Identifier: BSD-3-Clause
#include "log/write/recording_lock.hpp"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include "base/regular_file.hpp"
#include "ipc/file_lock.hpp"
#include "log/recorder.hpp"

namespace trifinger::log::detail {
namespace {

// Says who holds a lock, as stored in the lock's file. Messages and waiting processes use it;
// everything else works without it.
struct LockOwner {
  ipc::ProcessIdentity recorder;
  ipc::ProcessIdentity robot;  // the recorder ends with this process, if there is one

  static LockOwner read(const ipc::FileDescriptor& file) noexcept {
    LockOwner owner;
    if (::pread(file.get(), &owner, sizeof(owner), 0) != sizeof(owner)) return {};
    return owner;
  }
  void write(const ipc::FileDescriptor& file) const noexcept {
    static_cast<void>(::pwrite(file.get(), this, sizeof(*this), 0));
  }
  [[nodiscard]] bool is_known() const noexcept { return recorder.pid != 0; }
  [[nodiscard]] bool is_finishing() const noexcept {
    return (robot.pid != 0 && robot.is_ending()) || (is_known() && recorder.is_ending());
  }
};

[[noreturn]] void throw_recorded(const std::filesystem::path& folder, const std::string& robot,
                                 const LockOwner& owner) {
  throw AlreadyRecorded("robot '" + robot + "' is recorded into " + folder.string() + " by " +
                        (owner.is_known() ? ipc::describe(owner.recorder) : "another process") +
                        "; choose another folder, or stop that one");
}

[[noreturn]] void throw_unfinished(const std::filesystem::path& folder, const std::string& robot,
                                   const LockOwner& owner) {
  throw AlreadyRecorded(
      "robot '" + robot + "' is recorded into " + folder.string() + " by " +
      ipc::describe(owner.recorder) +
      ", whose back-end is gone and which does not finish; choose another folder, or end it with "
      "'kill -9 " +
      std::to_string(owner.recorder.pid) + "'");
}

}  // namespace

RecordingLock::RecordingLock(const std::filesystem::path& folder, const std::string& robot,
                             const std::optional<ipc::ProcessIdentity>& robot_process)
    : path_(folder / ("." + robot + ".recorder")) {
  constexpr mode_t kMode = S_IRUSR | S_IWUSR | S_IRGRP | S_IROTH;
  const ipc::LockTimeout timeout;
  while (true) {
    file_ = ipc::FileDescriptor(
        [this] { return open_regular_file(path_, O_RDWR | O_CREAT, NamedBy::kProgram, kMode); });
    if (!ipc::try_lock(file_)) {
      const LockOwner owner = LockOwner::read(file_);
      if (timeout.wait(owner.is_finishing())) continue;
      if (owner.is_finishing()) throw_unfinished(folder, robot, owner);
      throw_recorded(folder, robot, owner);
    }
    // The previous owner may have removed the file between our two calls.
    if (ipc::is_named(file_, path_)) break;
  }
  LockOwner{ipc::ProcessIdentity::of_this_process(), robot_process.value_or(ipc::ProcessIdentity{})}
      .write(file_);
}

RecordingLock::~RecordingLock() {
  // The lock is still held here, so the file that is removed is ours.
  if (file_) ::unlink(path_.c_str());
}

}  // namespace trifinger::log::detail
