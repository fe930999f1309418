// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <stdlib.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <random>
#include <span>
#include <string>
#include <vector>

#include "core/odd_robot.hpp"
#include "log/log_writer.hpp"
#include "support/folder.hpp"
#include "trifinger/base/error.hpp"
#include "trifinger/core/robot.hpp"
#include "trifinger/core/status.hpp"
#include "trifinger/log/log.hpp"
#include "trifinger/mcap/sink.hpp"

namespace trifinger::test {

using Bytes = std::vector<char>;

inline Bytes read_file(const std::filesystem::path& path) {
  std::ifstream file(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>()};
}

inline void write_file(const std::filesystem::path& path, std::span<const char> bytes) {
  std::ofstream(path, std::ios::binary)
      .write(bytes.data(), static_cast<std::streamsize>(bytes.size()));
}

inline char flipped(char byte, unsigned bit) {
  return static_cast<char>(static_cast<unsigned char>(byte) ^ (1U << bit));
}

/// Flips a bit after the first bytes, which say that it is an MCAP file. Returns its position.
template <class Random>
std::size_t flip(Bytes& bytes, Random& random) {
  constexpr std::size_t kHead = 64;
  const std::size_t place = kHead + random() % (bytes.size() - kHead);
  bytes[place] = flipped(bytes[place], random() % 8);
  return place;
}

/// A session of the odd robot with its lamp. All numbers are random, and what is read must be equal
/// bit by bit.
struct OddSession {
  log::SessionHeader header;
  std::vector<OddAction> desired_actions;
  std::vector<OddAppliedAction> applied_actions;
  std::vector<OddObservation> observations;  // one more than actions
  std::vector<Status> statuses;              // one more than actions
  std::vector<OddLampReading> lamp;

  [[nodiscard]] TimeIndex steps() const { return static_cast<TimeIndex>(desired_actions.size()); }
};

template <class T, class Random>
T random_element(Random& random) {
  std::array<std::byte, sizeof(T)> bytes;
  for (std::byte& byte : bytes) byte = static_cast<std::byte>(random());
  T element;
  std::memcpy(&element, bytes.data(), sizeof(T));
  return element;
}

/// Returns a session with one millisecond per step; in real-time mode with some lateness. The lamp
/// is read every third step.
inline OddSession random_session(unsigned seed, TimeIndex steps, bool is_real_time = true,
                                 const std::string& name = "odd") {
  constexpr std::int64_t kMillisecond = 1'000'000;
  std::mt19937 random(seed);
  OddSession session;
  session.header = {.name = name,
                    .session_id = random(),
                    .is_real_time = is_real_time,
                    .period = Nanoseconds(kMillisecond),
                    .created = 1'700'000'000'000'000'000 + std::int64_t{seed} * 3'600'000'000'000,
                    .time_offset = 0,
                    .host = "host",
                    .backend_pid = 4711,
                    .types = describe_robot<OddRobot>(),
                    .companions = {{name + ".lamp", "odd_lamp", describe<OddLampReading>()}},
                    .documents = {{"configuration.yml", "application/yaml",
                                   "seed: " + std::to_string(seed) + "\n"},
                                  {"model.xml", "application/xml", "<mujoco/>\n"}},
                    .first_index = 0};
  if (is_real_time) {
    session.header.realtime_warnings.emplace();
    for (unsigned i = 0; i < seed % 3; ++i) {
      session.header.realtime_warnings->push_back("lacks " + std::to_string(i) + "; and a remedy");
    }
  }
  session.header.time_offset = session.header.created - (is_real_time ? 5 * kMillisecond : 0);
  for (TimeIndex t = 0; t <= steps; ++t) {
    auto status = random_element<Status>(random);
    status.time = (5 + t) * kMillisecond + static_cast<std::int64_t>(random() % 1000);
    if (t == steps) status.flags = Status::kEnd;
    session.statuses.push_back(status);
    session.observations.push_back(random_element<OddObservation>(random));
    if (t == steps) break;
    session.desired_actions.push_back(random_element<OddAction>(random));
    session.applied_actions.push_back(random_element<OddAppliedAction>(random));
    if (t % 3 != 2) continue;
    auto reading = random_element<OddLampReading>(random);
    reading.stamp = {.arrival_index = t,
                     .capture_index = t - 2,
                     .arrival_time = status.time,
                     .capture_time = status.time - 2 * kMillisecond};
    session.lamp.push_back(reading);
  }
  return session;
}

/// Writes the steps [first, last) and the readings that arrived in them, `block` steps per chunk.
inline void write_steps(log::LogWriter& writer, std::size_t number, const OddSession& session,
                        TimeIndex first, TimeIndex last, TimeIndex block = 20) {
  while (first < last) {
    const TimeIndex end = std::min(first + block, last);
    const auto t = static_cast<std::size_t>(first);
    writer.write_steps(number, {.first = first,
                                .count = static_cast<std::size_t>(end - first),
                                .desired_actions = &session.desired_actions[t],
                                .applied_actions = &session.applied_actions[t],
                                .observations = &session.observations[t],
                                .statuses = &session.statuses[t]});
    for (std::size_t i = 0; i < session.lamp.size(); ++i) {
      const TimeIndex arrival = session.lamp[i].stamp.arrival_index;
      if (arrival < first || arrival >= end) continue;
      writer.write_companion(number, 0, static_cast<TimeIndex>(i), 1, &session.lamp[i]);
    }
    writer.flush();
    first = end;
  }
}

inline constexpr Fault kFinished{.code = Fault::Code::kFinished};

/// Writes y_N and the reason of the end.
inline void write_end(log::LogWriter& writer, std::size_t number, const OddSession& session) {
  writer.write_end(number, session.steps(), &session.observations.back(), session.statuses.back());
  Fault fault = kFinished;
  fault.time_index = session.steps();
  writer.end_session(number, session.steps(), fault, "the controller has finished");
}

/// Writes a log with these sessions, one after the other.
inline void write_log(const std::filesystem::path& path, const std::vector<OddSession>& sessions,
                      const log::LogOptions& options = {}, TimeIndex block = 20) {
  mcap::FileSink sink = mcap::FileSink::create(path);
  log::LogWriter writer(sink, options);
  for (const OddSession& session : sessions) {
    const std::size_t number = writer.begin_session(session.header);
    writer.write_event(log::Level::kInfo, session.header.name, "begins", session.header.created);
    write_steps(writer, number, session, 0, session.steps(), block);
    write_end(writer, number, session);
  }
  writer.finish();
}

/// Writes a log of one session without the steps `first` to `last`.
inline void write_log_with_gap(const std::filesystem::path& path, const OddSession& session,
                               TimeIndex first, TimeIndex last) {
  mcap::FileSink sink = mcap::FileSink::create(path);
  log::LogWriter writer(sink, {});
  const std::size_t number = writer.begin_session(session.header);
  write_steps(writer, number, session, 0, first);
  writer.write_gap(number, first, last, "the disk was full");
  write_steps(writer, number, session, last + 1, session.steps());
  write_end(writer, number, session);
  writer.finish();
}

template <class T>
bool same_bytes(const T& one, const T& other) {
  return std::memcmp(&one, &other, sizeof(T)) == 0;
}

/// What one pass through a session finds.
struct FoundSteps {
  std::vector<TimeIndex> indices;
  std::vector<std::int64_t> times;
  std::vector<OddAction> desired_actions;
  std::vector<OddAppliedAction> applied_actions;
  std::vector<OddObservation> observations;
  std::vector<Status> statuses;
};

/// Reads the steps [first, last), `block` steps at a time.
inline FoundSteps read_steps(const log::LoggedSession& session, TimeIndex first = 0,
                             TimeIndex last = std::numeric_limits<TimeIndex>::max(),
                             std::size_t block = 1000) {
  log::SeriesReader reader = session.read({{Series::kDesiredAction, {}},
                                           {Series::kAppliedAction, {}},
                                           {Series::kObservation, {}},
                                           {Series::kStatus, {}}},
                                          first, last);
  FoundSteps found;
  std::size_t size = 0;
  std::size_t count = 0;
  do {
    found.indices.resize(size + block);
    found.times.resize(size + block);
    found.desired_actions.resize(size + block);
    found.applied_actions.resize(size + block);
    found.observations.resize(size + block);
    found.statuses.resize(size + block);
    const std::array<void*, 4> columns{&found.desired_actions[size], &found.applied_actions[size],
                                       &found.observations[size], &found.statuses[size]};
    count = reader.read(block, {&found.indices[size], &found.times[size], columns});
    size += count;
  } while (count == block);
  found.indices.resize(size);
  found.times.resize(size);
  found.desired_actions.resize(size);
  found.applied_actions.resize(size);
  found.observations.resize(size);
  found.statuses.resize(size);
  return found;
}

/// True if every element that was found equals the one that was written.
inline bool is_true(const FoundSteps& found, const OddSession& written) {
  TimeIndex before = -1;
  for (std::size_t i = 0; i < found.indices.size(); ++i) {
    const TimeIndex index = found.indices[i];
    if (index <= before || index >= written.steps()) return false;
    before = index;
    const auto t = static_cast<std::size_t>(index);
    if (!same_bytes(found.desired_actions[i], written.desired_actions[t]) ||
        !same_bytes(found.applied_actions[i], written.applied_actions[t]) ||
        !same_bytes(found.observations[i], written.observations[t]) ||
        !same_bytes(found.statuses[i], written.statuses[t])) {
      return false;
    }
  }
  return true;
}

}  // namespace trifinger::test
