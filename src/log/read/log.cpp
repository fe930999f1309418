// SPDX-License-Identifier: BSD-3-Clause
#include "trifinger/log/log.hpp"

#include <algorithm>
#include <cstdint>
#include <map>
#include <mutex>
#include <set>
#include <string_view>
#include <system_error>

#include "base/moved.hpp"
#include "log/format/format.hpp"
#include "log/read/log_data.hpp"
#include "log/read/series_reader.hpp"
#include "log/read/session_table.hpp"
#include "trifinger/base/error.hpp"

namespace trifinger::log {

using namespace detail;

namespace {

// Returns the robot's part of a name: "sim" for both "sim.object" and "sim".
std::string_view robot_of(std::string_view name) { return name.substr(0, name.find('.')); }

}  // namespace

std::vector<std::filesystem::path> files_of(const std::filesystem::path& path) {
  std::error_code error;
  if (!std::filesystem::is_directory(path, error)) return {path};
  std::vector<std::filesystem::path> files;
  for (const auto& entry : std::filesystem::directory_iterator(path, error)) {
    std::error_code ignored;
    if (entry.path().extension() == kLogSuffix && entry.is_regular_file(ignored)) {
      files.push_back(entry.path());
    }
  }
  if (error) throw SystemError("look into " + path.string(), error.value());
  if (files.empty()) throw InvalidArgument("the folder " + path.string() + " has no .mcap files");
  std::ranges::sort(files);
  return files;
}

Log::Log(const std::filesystem::path& path)
    : data_(std::make_shared<LogData>(files_of(path), Several::kTakeNewest)) {}

Log::Log(const std::vector<std::filesystem::path>& parts) {
  if (parts.empty()) throw InvalidArgument("a log has at least one file");
  data_ = std::make_shared<LogData>(parts, Several::kRefuse);
}

const std::vector<std::filesystem::path>& Log::files() const noexcept {
  return checked(data_)->paths();
}
std::uint64_t Log::size() const noexcept { return checked(data_)->size(); }
bool Log::is_finished() const noexcept { return checked(data_)->is_finished(); }
const std::map<std::string, std::string>& Log::origin() const noexcept {
  return checked(data_)->origin();
}

std::vector<LoggedSession> Log::sessions() const {
  const std::scoped_lock lock(checked(data_)->mutex);
  std::vector<LoggedSession> sessions;
  for (const SessionRecord& session : data_->sessions()) {
    sessions.emplace_back(data_, session.robot);
  }
  // A robot's sessions follow each other in the log. Where the clock was set back between two, the
  // later one counts as made when the earlier one was.
  std::map<std::string_view, std::int64_t> latest;
  std::map<std::uint64_t, std::int64_t> began;
  for (const LoggedSession& session : sessions) {
    const SessionHeader& header = session.header();
    if (header.created == 0) continue;  // Its record is lost.
    std::int64_t& time = latest.try_emplace(header.name, header.created).first->second;
    time = std::max(time, header.created);
    began[header.session_id] = time;
  }
  std::ranges::stable_sort(sessions, {}, [&](const LoggedSession& session) {
    return began[session.header().session_id];
  });
  return sessions;
}

LoggedSession Log::session(const std::string& name) const {
  const std::vector<LoggedSession> all = sessions();
  std::set<std::string_view> names;
  for (const LoggedSession& session : all) names.insert(session.name());
  const std::string_view robot =
      name.empty() && names.size() == 1 ? *names.begin() : robot_of(name);
  if (!names.contains(robot)) {
    const std::string known = list_of({names.begin(), names.end()});
    throw InvalidArgument(name.empty() ? "this log has the robots " + known + "; name one of them"
                                       : "this log has no robot or companion '" + name +
                                             "'; it has " + known);
  }
  const LoggedSession* found = nullptr;
  for (const LoggedSession& session : all) {
    if (session.name() != robot) continue;
    // A robot that waits for its next session has a session without steps, which is skipped.
    const auto [first, end] = session.range(Series::kAppliedAction);
    if (found == nullptr || first < end) found = &session;
  }
  return name.empty() || name == robot ? *found : found->companion(name);
}

std::vector<Event> Log::events() const {
  const std::scoped_lock lock(checked(data_)->mutex);
  return data_->events();
}
std::vector<Damage> Log::damage() const {
  const std::scoped_lock lock(checked(data_)->mutex);
  return data_->damage();
}
std::uint64_t Log::lost_bytes() const {
  const std::scoped_lock lock(checked(data_)->mutex);
  return data_->lost_bytes();
}

}  // namespace trifinger::log
