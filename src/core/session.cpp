// SPDX-License-Identifier: BSD-3-Clause
#include "trifinger/core/session.hpp"

#include <array>
#include <cerrno>
#include <cstdlib>
#include <utility>

#include "base/moved.hpp"
#include "base/suggestion.hpp"
#include "base/text_of.hpp"
#include "core/refused_sessions.hpp"
#include "frontend_state.hpp"
#include "ipc/file_lock.hpp"
#include "ipc/ring.hpp"
#include "session_directory.hpp"
#include "session_layout.hpp"
#include "session_mapping.hpp"
#include "session_place.hpp"
#include "trifinger/base/text.hpp"
#include "trifinger/core/errors.hpp"

namespace trifinger {
namespace {

std::shared_ptr<detail::Directory> session_directory() {
  return detail::directory_in(session_folder());
}

// How to end the back-end of a robot whose session cannot be opened. Empty if it has no back-end.
// Looking at all processes is slow, so it happens only if the robot has no lock file.
std::string remedy_for(const std::string& robot) {
  const auto directory = session_directory();
  const auto is_locked = [&](const std::string& file) {
    try {
      return ipc::is_locked_by_other(directory->open(file, ipc::Access::kReadOnly).file());
    } catch (const Error&) {
      return false;
    }
  };
  const std::filesystem::path lock = session_folder() / detail::lock_file(robot);
  if (!is_locked(detail::lock_file(robot)) && !is_locked(detail::state_file(robot)) &&
      (std::filesystem::exists(lock) || !find_backend(robot))) {
    return "";
  }
  return "its back-end still runs, 'trifinger stop " + robot +
         "' brings the robot to rest and ends it";
}

std::vector<std::string> names_of_running(bool with_companions) {
  std::vector<std::string> names;
  for (const SessionInfo& info : list_sessions()) {
    if (info.backend_is_alive && (with_companions || !info.is_companion)) {
      names.push_back(info.name);
    }
  }
  return names;
}

std::string not_found_text(const std::string& name) {
  if (name.find('.') == std::string::npos) {
    if (const std::string remedy = remedy_for(name); !remedy.empty()) {
      return "robot '" + name + "' is just beginning its session, or somebody has removed " +
             (session_folder() / detail::state_file(name)).string() + "; " + remedy;
    }
  }
  std::string text = "there is no robot '" + name + "' on this machine";
  try {
    static_cast<void>(session_directory()->open(detail::lock_file(name), ipc::Access::kReadOnly));
  } catch (const SystemError& error) {
    if (error.error_number() != ENOENT) return text + " for this user: " + error.what();
  }
  const std::vector<std::string> others = names_of_running(/*with_companions=*/true);
  const std::string_view similar = closest(name, {others.begin(), others.end()});
  if (!others.empty()) text += "; running: " + detail::joined(others);
  if (!similar.empty()) text += "; perhaps '" + std::string(similar) + "' is meant";
  return text + "; 'trifinger run sim --name " + name + "' starts a simulated one";
}

}  // namespace

std::string_view name_of(Series series) noexcept {
  static constexpr std::array<std::string_view, detail::kNumSeries> kNames{
      "desired_action", "applied_action", "observation", "status", "holding", "stopping"};
  return name_in(kNames, series);
}

std::string_view name_of(SessionInfo::Phase phase) noexcept {
  static constexpr std::array<std::string_view, 4> kNames{"preparing", "holding", "running",
                                                          "ended"};
  return name_in(kNames, phase);
}

std::filesystem::path session_folder() {
  const char* const folder = std::getenv("TRIFINGER_SESSION_DIR");
  return folder != nullptr && *folder != '\0' ? folder : "/dev/shm";
}

Session::Session(std::shared_ptr<const detail::SessionMapping> mapping)
    : mapping_(std::move(mapping)) {}

Session Session::open(const std::string& name) {
  const std::size_t dot = name.find('.');
  detail::require_valid_name(name.substr(0, dot));
  if (dot != std::string::npos) detail::require_valid_name(name.substr(dot + 1));
  try {
    return Session(std::make_shared<detail::SessionMapping>(session_directory(), name));
  } catch (const SystemError& error) {
    if (error.error_number() == ENOENT) throw SessionNotFound(not_found_text(name));
    throw;
  } catch (const IncompatibleSession& error) {
    const std::string remedy = remedy_for(detail::robot_of(name));
    if (remedy.empty()) throw;
    throw IncompatibleSession(std::string(error.what()) + "; " + remedy);
  }
}

std::optional<ipc::ProcessIdentity> find_backend(const std::string& name) {
  detail::require_valid_name(name);
  const auto owners = ipc::owners_of(session_folder() / detail::lock_file(name));
  // The oldest owner is the back-end. Children that a bare fork(2) made own the same locks.
  if (owners.empty()) return std::nullopt;
  return owners.front();
}

namespace {

// Actions follow each other in the queue, so the first one that is missing is searched by halves.
TimeIndex waiting_actions(const detail::StateHeader& header, const ipc::SharedMemory& action) {
  const auto& [offset, shape] = header.queue;
  if (action.size() < offset || action.size() - offset < shape.size()) return 0;
  const ipc::Ring queue(action.data() + offset, shape);
  const TimeIndex next = header.next_action.load(std::memory_order_acquire);
  TimeIndex there = 0;
  for (auto end = static_cast<TimeIndex>(shape.capacity); there < end;) {
    const TimeIndex middle = there + (end - there) / 2;
    const bool is_there =
        queue.sequence_in_slot(next + middle) >= ipc::Ring::sequence_of(next + middle);
    (is_there ? there : end) = is_there ? middle + 1 : middle;
  }
  return there;
}

}  // namespace

SessionInfo Session::info() const {
  const detail::SessionMapping& mapping = *checked(mapping_);
  mapping.require_own();
  const detail::StateHeader& header = mapping.header();
  SessionInfo info;
  info.name = mapping.name();
  info.type = mapping.description().type;
  info.is_companion = mapping.is_companion();
  info.session_id = header.session_id;
  info.robot_session_id = header.robot_session_id;
  info.is_real_time = header.is_real_time != 0;
  info.realtime_warnings = mapping.realtime_warnings();
  info.period = Nanoseconds(header.period);
  info.created = std::chrono::system_clock::time_point(
      std::chrono::duration_cast<std::chrono::system_clock::duration>(
          Nanoseconds(header.created_time)));
  info.host = mapping.host();
  info.backend = header.backend();
  info.backend_is_alive = mapping.backend_is_alive();
  info.phase = static_cast<SessionInfo::Phase>(header.phase.load(std::memory_order_acquire));
  const Series counted = info.is_companion ? Series::kObservation : Series::kAppliedAction;
  info.steps = mapping.end_of(counted) - mapping.begin_of(counted);
  const std::int64_t heartbeat = header.heartbeat.load(std::memory_order_relaxed);
  if (heartbeat != 0) {
    info.since_heartbeat =
        std::chrono::steady_clock::now().time_since_epoch() - Nanoseconds(heartbeat);
  }
  // acquire: everything measured until then can be read.
  info.is_at_rest = header.is_at_rest.load(std::memory_order_acquire) != 0;
  if (mapping.has_ended() || !info.backend_is_alive) {
    info.fault = mapping.fault();
    info.fault_text = mapping.fault_text();
  }
  if (!mapping.is_companion()) {
    try {
      const ipc::SharedMemory action = mapping.directory()->open(
          detail::action_file(mapping.name(), header.session_id), ipc::Access::kReadOnly);
      if (action.size() >= sizeof(detail::ActionHeader) && ipc::is_locked_by_other(action.file())) {
        const ipc::ProcessIdentity controller =
            reinterpret_cast<const detail::ActionHeader*>(action.data())->controller();
        // A child that a bare fork(2) made keeps the lock of its dead parent.
        if (!controller.is_known_dead()) info.controller = controller;
      }
      info.waiting_actions = waiting_actions(header, action);
    } catch (const Error&) {
      // The session has ended, or this user may not look at the file: no controller is named.
    }
  }
  return info;
}

std::optional<TimingRecord> Session::timing() const {
  const detail::SessionMapping& mapping = *checked(mapping_);
  mapping.require_own();
  return mapping.timing();
}

const RobotTypes& Session::description() const noexcept { return checked(mapping_)->description(); }

const ElementDescription& Session::element(Series series) const {
  return checked(mapping_)->element(series);
}

const ElementDescription& Session::payload() const noexcept { return checked(mapping_)->payload(); }

std::vector<Document> Session::documents() const { return checked(mapping_)->documents(); }

const std::vector<std::string>& Session::companion_names() const noexcept {
  return checked(mapping_)->companion_names();
}

Session Session::companion(const std::string& name) const {
  return Session(checked(mapping_)->companion(name));
}

std::vector<SessionInfo> list_sessions() {
  std::vector<SessionInfo> sessions;
  for (const std::string& name : detail::session_names(session_folder())) {
    try {
      sessions.push_back(Session::open(name).info());
    } catch (const Error&) {
      // The session is gone since we looked, or belongs to another version or user: it is not
      // listed. `refused_sessions` says why.
    }
  }
  return sessions;
}

std::string running_robot(const std::string& name) {
  if (!name.empty()) {
    static_cast<void>(Session::open(name));
    return name;
  }
  const std::vector<std::string> names = names_of_running(/*with_companions=*/false);
  if (names.size() == 1) return names.front();
  if (names.empty()) {
    throw SessionNotFound(
        "no robot runs on this machine; 'trifinger run sim' starts a simulated one");
  }
  throw InvalidArgument("several robots run on this machine, name one of them: " +
                        detail::joined(names));
}

std::vector<std::string> refused_sessions() {
  std::vector<std::string> reasons;
  for (const std::string& name : detail::session_names(session_folder())) {
    if (name.find('.') != std::string::npos) continue;
    try {
      static_cast<void>(Session::open(name));
    } catch (const InvalidArgument&) {
      // Other programs may use any bytes in the name of a file. It is no robot's.
    } catch (const SessionNotFound&) {
      // It is gone since we looked.
    } catch (const Error& error) {
      reasons.push_back(name + ": " + error.what());
    }
  }
  return reasons;
}

void recover(const std::string& name, Timeout timeout) {
  const Session stopped = Session::open(name);
  const detail::SessionMapping& mapping = *stopped.mapping();
  if (!mapping.backend_is_alive()) mapping.throw_stopped();
  if (!mapping.has_ended()) return;
  try {
    const ipc::SharedMemory action = mapping.directory()->open(
        detail::action_file(name, mapping.header().session_id), ipc::Access::kReadWrite);
    if (action.size() < sizeof(detail::ActionHeader)) {
      throw Error("the queue of robot '" + name +
                  "' was cut off; stop its back-end and start it again");
    }
    detail::send_request(*reinterpret_cast<detail::ActionHeader*>(action.data()), detail::kRecover);
  } catch (const SystemError& error) {
    // The queue is gone: the next session is about to begin.
    if (error.error_number() != ENOENT) throw;
  }
  detail::wait_for_next_session(mapping, timeout);
}

SessionHost::SessionHost(std::unique_ptr<detail::SessionPlace> place) : place_(std::move(place)) {}
SessionHost::SessionHost(SessionHost&&) noexcept = default;
SessionHost& SessionHost::operator=(SessionHost&&) noexcept = default;
SessionHost::~SessionHost() = default;

void SessionHost::withdraw() noexcept { checked(place_)->withdraw(); }

detail::SessionPlace& SessionHost::place() const { return *checked(place_); }

SessionHost SessionHost::anonymous(SessionOptions options, const std::string& name) {
  return SessionHost(std::make_unique<detail::SessionPlace>(detail::directory_of_process(), name,
                                                            std::move(options)));
}

SessionHost SessionHost::named(const std::string& name, SessionOptions options) {
  return SessionHost(
      std::make_unique<detail::SessionPlace>(session_directory(), name, std::move(options)));
}

Session SessionHost::open(const std::string& companion) const {
  const detail::SessionPlace& place = *checked(place_);
  const std::string name = place.name() + (companion.empty() ? "" : "." + companion);
  try {
    return Session(std::make_shared<detail::SessionMapping>(place.directory(), name));
  } catch (const SystemError& error) {
    if (error.error_number() != ENOENT) throw;
    throw SessionNotFound("robot '" + place.name() + "' has no session" +
                          (companion.empty() ? " yet" : " '" + companion + "'"));
  }
}

}  // namespace trifinger
