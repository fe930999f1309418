// SPDX-License-Identifier: BSD-3-Clause
#include "session_place.hpp"

#include <sys/stat.h>

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <cstddef>
#include <thread>
#include <utility>

#include "ipc/file_lock.hpp"
#include "session_layout.hpp"
#include "session_mapping.hpp"
#include "trifinger/base/error.hpp"
#include "trifinger/core/errors.hpp"
#include "trifinger/core/payload.hpp"
#include "trifinger/core/status.hpp"
#include "trifinger/ipc/process.hpp"

namespace trifinger::detail {

SessionPlace::SessionPlace(std::shared_ptr<Directory> directory, std::string name,
                           SessionOptions options)
    : directory_(std::move(directory)),
      name_((require_valid_name(name), std::move(name))),
      options_(std::move(options)) {
  if (options_.history == 0 || options_.queue == 0) {
    throw InvalidArgument("history and queue need room for at least one element each");
  }
  take_name(false);
}

void SessionPlace::take_name(bool is_ours) {
  // One process at a time may do this, so that nobody looks at files that are about to be removed.
  std::optional<ipc::SharedMemory> lock;
  try {
    lock = claim([&] { return directory_->open_or_create(lock_file(name_), options_.mode); });
  } catch (const SystemError& error) {
    const bool is_refused = error.error_number() == EACCES || error.error_number() == EPERM;
    if (!is_refused || !directory_->is_owned(lock_file(name_))) throw;
    throw RobotOwned("robot '" + name_ + "' is run by another user: " + error.what());
  }
  if (!lock) throw_owned("another process that is just starting");
  try {
    own(*lock, is_ours);
  } catch (...) {
    leave(*lock);
    throw;
  }
  const std::lock_guard guard(mutex_);
  // Our old lock, if any, is released last: it shows others at any time that we live.
  lock_ = std::move(lock);
  ipc::unlock(lock_->file(), ipc::Lock::kClaim);
}

void SessionPlace::own(ipc::SharedMemory& lock, bool is_ours) {
  // A back-end that was just killed releases its locks a little later.
  const ipc::LockTimeout timeout;
  bool is_taken = ipc::try_lock(lock.file());
  while (!is_taken && !is_left_by_the_dead() && timeout.wait(is_left_by_the_dying())) {
    is_taken = ipc::try_lock(lock.file());
  }
  if (!is_taken) {
    if (!is_left_by_the_dead()) throw_owned(find_owner().value_or("another process"));
    // That lock cannot be taken, so a new file replaces it. Others who arrive wait for our claim.
    ipc::SharedMemory fresh = directory_->create(lock_file(name_), 1, options_.mode);
    if (!ipc::try_lock(fresh.file(), ipc::Lock::kClaim) || !ipc::try_lock(fresh.file())) {
      throw_owned("another process");
    }
    lock = directory_->publish(lock_file(name_), std::move(fresh));
  }
  // The lock file may be new because somebody has removed the file of a living back-end.
  if (!is_ours) {
    std::optional<std::string> owner = find_owner();
    while (owner && timeout.wait(is_left_by_the_dying())) owner = find_owner();
    if (owner) throw_owned(*owner);
  }
  // The existing file may be older than the permission for the group.
  if (!lock.path().empty()) ::fchmod(lock.file().get(), options_.mode);
  if (is_ours) return;
  directory_->remove_all(name_);
  directory_->require_removed(name_);
}

std::optional<std::string> SessionPlace::find_owner() const {
  std::optional<std::string> owner;
  try {
    const ipc::SharedMemory state = directory_->open(state_file(name_), ipc::Access::kReadOnly);
    if (ipc::is_locked_by_other(state.file())) owner = "another process";
    const SessionMapping session(directory_, name_);
    const ipc::ProcessIdentity backend = session.header().backend();
    if (owner && backend.is_known_dead()) owner.reset();
    if (owner) owner = ipc::describe(backend) + " on " + session.host();
  } catch (const Error&) {
    // The session has just begun, or its file is gone, damaged or another user's. Only its lock
    // counts, if there is one.
    if (!owner && directory_->is_owned(state_file(name_))) owner = "another process";
  }
  if (const auto owners = directory_->other_owners(lock_file(name_)); !owners.empty()) {
    // A child that a bare fork(2) made keeps what its dead parent owned.
    if (owner || !is_left_by_the_dead()) owner = ipc::describe(owners.front());
  }
  return owner;
}

std::optional<ipc::ProcessIdentity> SessionPlace::last_backend() const {
  try {
    return SessionMapping(directory_, name_).header().backend();
  } catch (const Error&) {
    return std::nullopt;
  }
}

bool SessionPlace::is_left_by_the_dead() const {
  const auto backend = last_backend();
  return backend && backend->is_known_dead();
}

bool SessionPlace::is_left_by_the_dying() const {
  const auto backend = last_backend();
  return backend && backend->is_ending();
}

void SessionPlace::throw_owned(const std::string& owner) const {
  throw RobotOwned("robot '" + name_ + "' is run by " + owner + "; stop it with 'trifinger stop " +
                   name_ + "', or choose another name");
}

SessionPlace::~SessionPlace() {
  if (fork_.is_inherited()) return;
  directory_->remove_all(name_);
  leave(*lock_);
}

void SessionPlace::withdraw() noexcept {
  directory_->remove_all(name_);
  const std::lock_guard guard(mutex_);
  // The robot may still move. Other processes that look for its owner find this one until it ends.
  if (lock_->path().empty()) return;
  // Who has the claim just now asks who owns the name, and does not get it.
  constexpr int kLooks = 500;
  for (int look = 0; look < kLooks && !ipc::remove_lock_file(lock_->file(), lock_->path());
       ++look) {
    std::this_thread::sleep_for(std::chrono::milliseconds(1));
  }
}

SessionPlace::Writers SessionPlace::begin(const UntypedDriver& driver, bool is_real_time,
                                          Nanoseconds period,
                                          const std::vector<std::string>& realtime_warnings) {
  if (fork_.is_inherited()) {
    throw InheritedHandle("the host of '" + name_ +
                          "' was made before fork(), and the name belongs to the parent process");
  }
  // Somebody has removed the lock file: processes that arrive from now on look at another file.
  if (!lock_->has_name()) take_name(true);
  const RobotTypes& robot = driver.description();
  SessionPlan plan{
      .name = name_,
      .type = robot.type,
      .session_id = random_id(),
      .is_real_time = is_real_time,
      .period = period,
      .first_index = first_index_,
      .elements = {&robot.action, &robot.applied_action, &robot.observation, &describe<Status>(),
                   &robot.observation, &robot.observation},
      .default_action = robot.default_action,
      .documents = options_.documents,
      .queue = options_.queue,
      .mode = options_.mode,
  };
  plan.robot_session_id = plan.session_id;
  plan.capacities.fill(options_.history);
  if (is_real_time) {
    for (const std::string& sentence : realtime_warnings) plan.realtime_warnings += sentence + "\n";
  }
  constexpr std::size_t kHoldingHistory = 16;
  plan.capacities[index_of(Series::kHolding)] = kHoldingHistory;
  // One second at 1 kHz, which is longer than a damped stop takes.
  constexpr std::size_t kStoppingHistory = 1024;
  plan.capacities[index_of(Series::kStopping)] = std::min(options_.history, kStoppingHistory);

  Writers writers;
  // Companions come first: whoever finds the robot's session also finds its companions.
  for (const CompanionDescription& companion : driver.companions()) {
    SessionPlan companion_plan{
        .name = name_ + "." + companion.name,
        .type = companion.type,
        .session_id = random_id(),
        .robot_session_id = plan.session_id,
        .is_real_time = is_real_time,
        .period = period,
        .payload = companion.payload.text(),
        .mode = options_.mode,
    };
    if (companion.payload.size() > 0) require_payload_reference(companion.element);
    companion_plan.elements[index_of(Series::kObservation)] = &companion.element;
    companion_plan.capacities[index_of(Series::kObservation)] = companion.history;
    plan.companions += companion.name + "\n";
    writers.companions.push_back(std::make_unique<SessionWriter>(directory_, companion_plan));
  }
  writers.robot = std::make_unique<SessionWriter>(directory_, plan);
  if (!has_reserve_) {
    writers.robot->reserve_another();
    for (const auto& companion : writers.companions) companion->reserve_another();
    has_reserve_ = true;
  }
  return writers;
}

}  // namespace trifinger::detail
