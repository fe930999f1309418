// SPDX-License-Identifier: BSD-3-Clause
#include "session_directory.hpp"

#include <grp.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <chrono>
#include <cstdio>
#include <map>
#include <mutex>
#include <random>
#include <string_view>
#include <system_error>
#include <thread>
#include <utility>

#include "base/regular_file.hpp"
#include "ipc/file_lock.hpp"
#include "trifinger/base/error.hpp"
#include "trifinger/base/time.hpp"

namespace trifinger::detail {
namespace {

constexpr std::string_view kPrefix = "trifinger.";
constexpr std::string_view kStateSuffix = ".state";

// How the names of all files of the robot or companion `name` begin.
std::string prefix_of(const std::string& name) { return std::string(kPrefix) + name + "."; }

std::string group_name(gid_t group) {
  struct group entry{};
  struct group* found = nullptr;
  std::array<char, 4096> text{};
  ::getgrgid_r(group, &entry, text.data(), text.size(), &found);
  return found != nullptr ? found->gr_name : std::to_string(group);
}

// The files that lie in `folder` under the names of one owner's life: those of a robot, or those of
// a sensor or its payloads. They begin with this.
std::string common_beginning(const std::string& file) {
  if (file.starts_with(kPrefix)) return prefix_of(robot_of(file.substr(kPrefix.size())));
  constexpr std::string_view kLockSuffix = ".lock";
  return file.ends_with(kLockSuffix) ? file.substr(0, file.size() - kLockSuffix.size()) : file;
}

// Why `doing` something with a file of another user failed: whose it is, whether its process lives,
// and the remedy. Only `doing` if the file cannot be examined.
std::string refusal_text(const std::string& doing, const std::filesystem::path& path) {
  struct stat status{};
  if (::stat(path.c_str(), &status) != 0) return doing + " " + path.string();
  std::array<char, 8> mode{};
  std::snprintf(mode.data(), mode.size(), "%04o", status.st_mode & 07777U);
  const std::string owner = user_name(status.st_uid);
  const std::string text = doing + " " + path.string() + ", which belongs to user " + owner +
                           " and group " + group_name(status.st_gid) + " with mode " + mode.data();
  const std::string beginning = common_beginning(path.filename().string());
  const bool is_robot = beginning.starts_with(kPrefix);
  const std::string lock =
      (path.parent_path() / beginning).string() + (is_robot ? "lock" : ".lock");
  // A lock that this user has just taken says nothing about the other one.
  const auto is_owned = [&status](const std::filesystem::path& file) {
    struct stat found{};
    return ::stat(file.c_str(), &found) == 0 && found.st_uid == status.st_uid &&
           ipc::is_owned(file);
  };
  const bool is_alive = is_owned(path) || is_owned(lock) ||
                        (is_robot && is_owned(path.parent_path() / (beginning + "state")));
  if (is_robot && is_alive) {
    return text +
           "; its back-end runs: it shares its sessions with its group if its configuration "
           "says 'backend.access: group', and " +
           owner + " can stop it";
  }
  if (is_alive) return text + "; its process runs, and " + owner + " can end it";
  const std::string all = (path.parent_path() / beginning).string();
  return text + "; its process was killed: " + owner +
         " or the administrator must remove what it left with 'rm " +
         (is_robot ? all + "*" : all + " " + lock) + "', or choose another name";
}

// The group that shares the files of this user: "trifinger" if the user is one of its members.
// Otherwise files keep the group of the process.
std::optional<gid_t> shared_group() {
  struct group entry{};
  struct group* found = nullptr;
  std::vector<char> text(65536);  // the names of all its members
  ::getgrnam_r("trifinger", &entry, text.data(), text.size(), &found);
  if (found == nullptr) return std::nullopt;
  std::vector<gid_t> groups(static_cast<std::size_t>(std::max(0, ::getgroups(0, nullptr))));
  static_cast<void>(::getgroups(static_cast<int>(groups.size()), groups.data()));
  if (std::ranges::find(groups, found->gr_gid) == groups.end()) return std::nullopt;
  return found->gr_gid;
}

// Gives a file that its group may use to the group that the users of robots have in common.
void share(const ipc::SharedMemory& memory, unsigned mode) {
  constexpr unsigned kGroup = 0070;
  if ((mode & kGroup) == 0) return;
  if (const auto group = shared_group()) {
    constexpr auto kSameUser = static_cast<uid_t>(-1);
    if (::fchown(memory.file().get(), kSameUser, *group) != 0) {
      throw SystemError("give " + memory.path().string() + " to the group trifinger", errno);
    }
  }
}

class FolderDirectory final : public Directory {
 public:
  explicit FolderDirectory(std::filesystem::path folder) : folder_(std::move(folder)) {}

  [[nodiscard]] ipc::SharedMemory create(const std::string& file, std::size_t size,
                                         unsigned mode) override {
    for (ipc::SharedMemory& spare : spares_) {
      if (spare.size() != size || !spare.make_anew(file, mode)) continue;
      ipc::SharedMemory memory = std::move(spare);
      share(memory, mode);
      std::erase_if(spares_, [](const ipc::SharedMemory& one) { return !one.file(); });
      return memory;
    }
    ipc::SharedMemory memory = ipc::SharedMemory::create_file(folder_, file, size, mode);
    share(memory, mode);
    // The other spare files of this size are still in use elsewhere. Their last user releases them.
    std::erase_if(spares_, [size](const ipc::SharedMemory& one) { return one.size() == size; });
    return memory;
  }

  void give_back(ipc::SharedMemory memory) noexcept override {
    memory.retire();
    spares_.push_back(std::move(memory));
  }

  void reserve(const std::string& file, std::size_t size) override {
    constexpr unsigned kOwnerAlone = 0600;
    give_back(ipc::SharedMemory::create_file(folder_, file, size, kOwnerAlone));
  }

  [[nodiscard]] std::vector<ipc::ProcessIdentity> other_owners(
      const std::string& file) const override {
    std::vector<ipc::ProcessIdentity> owners = ipc::owners_of(folder_ / file);
    std::erase(owners, ipc::ProcessIdentity::of_this_process());
    return owners;
  }

  [[nodiscard]] ipc::SharedMemory publish(const std::string&, ipc::SharedMemory memory) override {
    memory.publish();
    return memory;
  }

  [[nodiscard]] ipc::SharedMemory open_or_create(const std::string& file, unsigned mode) override {
    while (true) {
      try {
        return open(file, ipc::Access::kReadWrite);
      } catch (const SystemError& error) {
        if (error.error_number() != ENOENT) throw;
      }
      ipc::SharedMemory memory = create(file, 1, mode);
      if (memory.publish_if_absent()) return memory;
    }
  }

  [[nodiscard]] ipc::SharedMemory open(const std::string& file, ipc::Access access) override {
    const std::filesystem::path path = folder_ / file;
    try {
      return ipc::SharedMemory::open(path, access);
    } catch (const SystemError& error) {
      if (error.error_number() != EACCES) throw;
      throw SystemError(refusal_text("open", path), EACCES);
    }
  }

  void remove(const std::string& file) noexcept override { ::unlink((folder_ / file).c_str()); }

  void remove_all(const std::string& name) noexcept override {
    const std::string prefix = prefix_of(name);
    std::error_code ignored;
    for (const auto& entry : std::filesystem::directory_iterator(folder_, ignored)) {
      const std::string file = entry.path().filename().string();
      // Unpublished files of killed processes begin with a dot.
      const bool is_ours = file.starts_with(prefix) || file.starts_with("." + prefix);
      if (is_ours && file != lock_file(name)) remove(file);
    }
  }

  void require_removed(const std::string& name) const override {
    for (const auto& session : session_names(folder_)) {
      if (robot_of(session) != name) continue;
      const std::filesystem::path path = folder_ / state_file(session);
      struct stat status{};
      if (::lstat(path.c_str(), &status) != 0 || !S_ISREG(status.st_mode)) continue;
      if (status.st_uid != ::geteuid()) throw SystemError(refusal_text("remove", path), EPERM);
    }
  }

  [[nodiscard]] bool is_owned(const std::string& file) const override {
    return ipc::is_owned(folder_ / file);
  }

 private:
  std::filesystem::path folder_;
  std::vector<ipc::SharedMemory> spares_;  // used only by the back-end's thread
};

class ProcessDirectory final : public Directory {
 public:
  [[nodiscard]] ipc::SharedMemory create(const std::string&, std::size_t size, unsigned) override {
    return ipc::SharedMemory::create_anonymous(size);
  }

  [[nodiscard]] ipc::SharedMemory publish(const std::string& file,
                                          ipc::SharedMemory memory) override {
    const std::lock_guard lock(mutex_);
    files_.insert_or_assign(file, memory.reopen(ipc::Access::kReadOnly));
    return memory;
  }

  [[nodiscard]] ipc::SharedMemory open_or_create(const std::string& file, unsigned mode) override {
    return publish(file, create(file, 1, mode));
  }

  [[nodiscard]] ipc::SharedMemory open(const std::string& file, ipc::Access access) override {
    const std::lock_guard lock(mutex_);
    const auto found = files_.find(file);
    if (found == files_.end()) throw SystemError("open " + file + " of this process", ENOENT);
    return found->second.reopen(access);
  }

  void remove(const std::string& file) noexcept override {
    const std::lock_guard lock(mutex_);
    files_.erase(file);
  }

  void remove_all(const std::string& name) noexcept override {
    const std::lock_guard lock(mutex_);
    std::erase_if(files_, [&](const auto& entry) {
      return entry.first.starts_with(prefix_of(name)) && entry.first != lock_file(name);
    });
  }

 private:
  std::mutex mutex_;
  std::map<std::string, ipc::SharedMemory> files_;
};

}  // namespace

std::shared_ptr<Directory> directory_in(const std::filesystem::path& folder) {
  return std::make_shared<FolderDirectory>(folder);
}

std::shared_ptr<Directory> directory_of_process() { return std::make_shared<ProcessDirectory>(); }

std::optional<ipc::SharedMemory> claim(const std::function<ipc::SharedMemory()>& open) {
  const Deadline deadline(std::chrono::seconds(2));
  while (true) {
    ipc::SharedMemory lock = open();
    if (ipc::try_lock(lock.file(), ipc::Lock::kClaim) && lock.has_name()) return lock;
    if (deadline.passed()) return std::nullopt;
    std::this_thread::sleep_for(std::chrono::milliseconds(1));
  }
}

void leave(const ipc::SharedMemory& lock) noexcept {
  if (!lock.path().empty()) ipc::leave_lock_file(lock.file(), lock.path());
}

std::string state_file(const std::string& name) {
  return std::string(kPrefix) + name + std::string(kStateSuffix);
}

std::string action_file(const std::string& name, std::uint64_t session_id) {
  return prefix_of(name) + std::to_string(session_id) + ".action";
}

std::string lock_file(const std::string& name) { return prefix_of(robot_of(name)) + "lock"; }

std::string robot_of(const std::string& name) { return name.substr(0, name.find('.')); }

std::vector<std::string> session_names(const std::filesystem::path& folder) {
  std::vector<std::string> names;
  std::error_code ignored;
  for (const auto& entry : std::filesystem::directory_iterator(folder, ignored)) {
    const std::string file = entry.path().filename().string();
    if (!file.starts_with(kPrefix) || !file.ends_with(kStateSuffix)) continue;
    if (file.size() <= kPrefix.size() + kStateSuffix.size()) continue;
    names.push_back(
        file.substr(kPrefix.size(), file.size() - kPrefix.size() - kStateSuffix.size()));
  }
  std::ranges::sort(names);
  return names;
}

std::uint64_t random_id() {
  std::random_device device;
  const std::uint64_t id = (std::uint64_t{device()} << 32U) | device();
  return id == 0 ? 1 : id;
}

void require_valid_name(const std::string& name) {
  const auto is_allowed = [](char c) {
    return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '_' ||
           c == '-';
  };
  // A name that begins with '-' would be an option to every command.
  require(!name.empty() && name.size() <= 64 && name.front() != '-' &&
              std::ranges::all_of(name, is_allowed),
          "'" + name +
              "' cannot name a robot: use 1 to 64 letters, digits, '_' and '-', and begin with one "
              "of the first three");
}

}  // namespace trifinger::detail
