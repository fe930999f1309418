// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <atomic>
#include <cerrno>
#include <condition_variable>
#include <cstring>
#include <filesystem>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "log/message_layout.hpp"
#include "log/recorder.hpp"
#include "trifinger/base/error.hpp"
#include "trifinger/core/backend.hpp"
#include "trifinger/mcap/reader.hpp"

namespace trifinger::test {

/// A recorder that runs in its own thread, and its events.
class RecorderUnderTest {
 public:
  RecorderUnderTest(const std::vector<std::string>& robots, log::RecorderOptions options)
      : recorder_(robots, with_listener(std::move(options))), thread_([this] {
          try {
            recorder_.run();
          } catch (...) {
            failure_ = std::current_exception();
          }
          // release: the failure was stored before.
          has_returned_.store(true, std::memory_order_release);
        }) {}
  RecorderUnderTest(const RecorderUnderTest&) = delete;
  RecorderUnderTest& operator=(const RecorderUnderTest&) = delete;
  ~RecorderUnderTest() {
    if (!thread_.joinable()) return;
    recorder_.request_stop();
    thread_.join();
  }

  /// Stops it and waits. Throws what `run` has thrown.
  void stop() {
    recorder_.request_stop();
    join();
  }
  /// Waits until it ends by itself.
  void join() {
    thread_.join();
    if (failure_ != nullptr) std::rethrow_exception(failure_);
  }

  [[nodiscard]] log::Recorder& operator*() noexcept { return recorder_; }
  [[nodiscard]] log::Recorder* operator->() noexcept { return &recorder_; }

  /// Waits until the state fulfils the condition. The suite's watchdog limits the wait.
  template <class Condition>
  void wait_until(const Condition& is_wanted) {
    while (!is_wanted(recorder_.state())) {
      // acquire: so that the failure is visible.
      if (has_returned_.load(std::memory_order_acquire)) {
        throw Error("the recorder has returned before what was waited for");
      }
      std::this_thread::yield();
    }
  }
  /// Waits until the recorder has read everything before `step` of the robot's newest session.
  void wait_for_step(TimeIndex step, std::size_t robot = 0) {
    wait_until(
        [=](const log::RecorderState& state) { return state.robots[robot].next_step >= step; });
  }
  /// Waits until there is an event with this text.
  void wait_for_event(const std::string& text) {
    wait_until([&](const log::RecorderState&) { return count_events(text) > 0; });
  }

  [[nodiscard]] std::size_t count_events(const std::string& text) const {
    const std::lock_guard lock(mutex_);
    return static_cast<std::size_t>(std::ranges::count_if(events_, [&](const auto& event) {
      return (event.source + ": " + event.text).find(text) != std::string::npos;
    }));
  }
  [[nodiscard]] std::string all_events() const {
    const std::lock_guard lock(mutex_);
    std::string text;
    for (const auto& event : events_) text += event.source + ": " + event.text + "\n";
    return text;
  }

 private:
  log::RecorderOptions with_listener(log::RecorderOptions options) {
    options.on_event = [this](const log::Event& event) {
      const std::lock_guard lock(mutex_);
      events_.push_back(event);
    };
    return options;
  }

  mutable std::mutex mutex_;
  std::vector<log::Event> events_;
  log::Recorder recorder_;
  std::exception_ptr failure_;
  std::atomic<bool> has_returned_{false};
  std::thread thread_;
};

/// The content of the files of a folder, message by message. It is read without the log reader, so
/// that each checks the other.
class Recorded {
 public:
  struct Session {
    std::string name;
    std::vector<TimeIndex> steps;  // in the order of the files
    std::map<std::string, std::vector<TimeIndex>> companions;
    std::vector<std::pair<TimeIndex, TimeIndex>> gaps;
    std::map<std::string, std::map<std::string, std::string>> ends;  // metadata, by name
    std::size_t end_messages{0};
    std::size_t headers{0};

    /// Returns the missing steps before the last one, as ranges that include both ends.
    [[nodiscard]] std::vector<std::pair<TimeIndex, TimeIndex>> holes() const {
      std::vector<std::pair<TimeIndex, TimeIndex>> found;
      for (std::size_t i = 1; i < steps.size(); ++i) {
        if (steps[i] > steps[i - 1] + 1) found.emplace_back(steps[i - 1] + 1, steps[i] - 1);
      }
      return found;
    }
    /// Returns the missing steps behind the first one that the log reports. A recorder that is too
    /// late twice, on a busy machine, reports two gaps that touch: one hole. If it comes late to
    /// begin with, it reports steps before all that it writes.
    [[nodiscard]] std::vector<std::pair<TimeIndex, TimeIndex>> reported_holes() const {
      std::vector<std::pair<TimeIndex, TimeIndex>> told;
      for (const auto& [first, last] : gaps) {
        if (steps.empty() || last < steps.front()) continue;
        if (!told.empty() && told.back().second + 1 == first) {
          told.back().second = last;
        } else {
          told.emplace_back(first, last);
        }
      }
      return told;
    }
    /// True if every index is greater than the one before: no index twice, all in order.
    [[nodiscard]] bool is_ordered() const {
      return std::ranges::adjacent_find(steps, std::greater_equal<>()) == steps.end();
    }
  };

  explicit Recorded(const std::filesystem::path& folder) {
    for (const auto& entry : std::filesystem::directory_iterator(folder)) {
      if (entry.path().extension() == ".mcap") files.push_back(entry.path());
    }
    std::ranges::sort(files);
    for (const auto& file : files) {
      if (std::filesystem::file_size(file) > 0) read(file);
    }
  }

  /// Returns the session that was recorded last. Without a name: of the only robot.
  [[nodiscard]] const Session& newest(const std::string& name = {}) const {
    const Session* newest = nullptr;
    for (const auto& id : order) {
      const Session& session = sessions.at(id);
      if (name.empty() || session.name == name) newest = &session;
    }
    if (newest == nullptr) throw Error("no session was recorded");
    return *newest;
  }
  /// Returns the session that was recorded first.
  [[nodiscard]] const Session& first() const { return sessions.at(order.at(0)); }
  [[nodiscard]] std::size_t count_events(const std::string& text) const {
    return static_cast<std::size_t>(std::ranges::count_if(
        events, [&](const std::string& event) { return event.find(text) != std::string::npos; }));
  }
  /// Returns the number of events about lost steps of a robot, or about lost elements of a
  /// companion.
  [[nodiscard]] std::size_t count_losses_of(const std::string& name) const {
    return count_events(" of " + name + " is not in the log: overwritten") +
           count_events(" of " + name + " are not in the log: overwritten");
  }

  std::vector<std::filesystem::path> files;
  std::vector<bool> is_finished;        // for each file
  std::vector<std::string> recordings;  // the id of each file
  std::map<std::uint64_t, Session> sessions;
  std::vector<std::uint64_t> order;  // in the order of their appearance
  std::vector<std::string> events;
  std::size_t damages{0};

 private:
  static std::string entry(const std::map<std::string, std::string>& entries,
                           const std::string& key) {
    const auto found = entries.find(key);
    return found == entries.end() ? "" : found->second;
  }

  void read(const std::filesystem::path& file) {
    mcap::Reader reader(file);
    const auto& metadata = reader.contents().metadata;
    recordings.emplace_back();
    for (const mcap::Metadata& record : metadata) {
      if (record.name == "trifinger.log") {
        recordings.back() = entry(record.entries, "recording");
        continue;
      }
      const std::uint64_t id = std::stoull(entry(record.entries, "session_id"));
      const std::string name = entry(record.entries, "name");
      if (record.name == "trifinger.session") {
        if (!sessions.contains(id)) order.push_back(id);
        sessions[id].name = name;
        ++sessions[id].headers;
      } else if (record.name == "trifinger.end") {
        sessions[id].ends[name] = record.entries;
      } else if (record.name == "trifinger.gap" && name == sessions[id].name) {
        sessions[id].gaps.emplace_back(std::stoll(entry(record.entries, "first")),
                                       std::stoll(entry(record.entries, "last")));
      }
    }
    for (std::size_t i = 0; i < reader.contents().chunks.size(); ++i) {
      const auto messages = reader.read_chunk(i);
      if (!messages) continue;
      for (const mcap::Message& message : *messages) read(reader.contents(), message);
    }
    is_finished.push_back(reader.contents().is_finished);
    damages += reader.contents().damage.size();
  }

  void read(const mcap::Contents& contents, const mcap::Message& message) {
    const mcap::Channel& channel = contents.channels.at(message.channel_id);
    if (channel.topic == "/events") {
      const auto* begin = reinterpret_cast<const char*>(message.data.data());
      events.emplace_back(begin, message.data.size());
      return;
    }
    log::MessageHead head;
    std::memcpy(&head, message.data.data() + 4, sizeof(head));
    Session& session = sessions[head.session_id];
    const std::string role = entry(channel.metadata, "role");
    if (role == "step") session.steps.push_back(head.index);
    if (role == "end") ++session.end_messages;
    if (role == "companion") {
      session.companions[entry(channel.metadata, "session")].push_back(head.index);
    }
  }
};

/// Controls the files of a recorder in tests: appends can fail or wait.
class Disk {
 public:
  /// From now on every append and every new file fails with this error; 0 ends that.
  void set_error(int error_number) { error_.store(error_number, std::memory_order_release); }
  /// From now on every append waits.
  void hold() {
    const std::lock_guard lock(mutex_);
    is_held_ = true;
  }
  void let_go() {
    {
      const std::lock_guard lock(mutex_);
      is_held_ = false;
    }
    changed_.notify_all();
  }
  /// Waits until an append hangs.
  void wait_for_append() {
    std::unique_lock lock(mutex_);
    changed_.wait(lock, [this] { return is_waiting_; });
  }
  [[nodiscard]] int syncs() const { return syncs_.load(std::memory_order_acquire); }

  [[nodiscard]] log::RecorderOptions::OpenFile opener() {
    return [this](const std::filesystem::path& path, std::optional<std::uint64_t> size) {
      fail_if_wanted();
      return std::make_unique<Sink>(
          *this, size ? mcap::FileSink::resume(path, *size) : mcap::FileSink::create(path));
    };
  }

 private:
  class Sink final : public mcap::Sink {
   public:
    Sink(Disk& disk, mcap::FileSink file) : disk_(disk), file_(std::move(file)) {}

    void append(std::span<const std::byte> bytes) override {
      disk_.wait_if_wanted();
      disk_.fail_if_wanted();
      file_.append(bytes);
    }
    void sync() override {
      disk_.fail_if_wanted();
      disk_.syncs_.fetch_add(1, std::memory_order_release);
      file_.sync();
    }
    [[nodiscard]] std::uint64_t size() const noexcept override { return file_.size(); }

   private:
    Disk& disk_;
    mcap::FileSink file_;
  };

  void fail_if_wanted() const {
    const int error = error_.load(std::memory_order_acquire);
    if (error != 0) throw SystemError("write to a disk of the tests", error);
  }
  void wait_if_wanted() {
    std::unique_lock lock(mutex_);
    if (!is_held_) return;
    is_waiting_ = true;
    changed_.notify_all();
    changed_.wait(lock, [this] { return !is_held_; });
    is_waiting_ = false;
  }

  std::atomic<int> error_{0};
  std::atomic<int> syncs_{0};
  std::mutex mutex_;
  std::condition_variable changed_;
  bool is_held_{false};
  bool is_waiting_{false};
};

/// One step per period, whatever the user does: time passes by itself.
inline constexpr BackendOptions kRealTime{.mode = BackendOptions::Mode::kRealTime,
                                          .period = std::chrono::microseconds(200),
                                          .max_action_repeats = 1'000'000'000,
                                          .max_skipped_ticks = 1'000'000'000};

/// Waits for followers however long the disk or a busy machine takes.
inline constexpr BackendOptions kPatient{.max_follower_wait = kForever};

}  // namespace trifinger::test
