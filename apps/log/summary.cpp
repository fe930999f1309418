// SPDX-License-Identifier: BSD-3-Clause
#include "log/summary.hpp"

#include <algorithm>
#include <cstddef>
#include <cstring>
#include <filesystem>
#include <utility>

#include "log/logged_images.hpp"
#include "trifinger/camera/images.hpp"
#include "trifinger/core/description.hpp"
#include "trifinger/core/status.hpp"
#include "trifinger/mcap/reader.hpp"

namespace trifinger::apps {
namespace {

constexpr std::size_t kBlock = 4096;

// Reads all elements once. `use(indices, pointers, rows)` gets the elements of the columns.
template <class Use>
StreamSummary summary_of(const log::LoggedSession& session, const std::vector<log::Column>& columns,
                         const Use& use) {
  StreamSummary summary{.name = session.name(), .type = session.type(), .gaps = session.gaps()};
  log::SeriesReader reader = session.read(columns);
  std::vector<TimeIndex> indices(kBlock);
  std::vector<std::int64_t> times(kBlock);
  std::vector<std::vector<std::byte>> memory;
  std::vector<void*> addresses;
  for (std::size_t i = 0; i < columns.size(); ++i) {
    memory.emplace_back(kBlock * reader.element(i).size());
    addresses.push_back(memory.back().data());
  }
  while (const std::size_t rows = reader.read(kBlock, {indices.data(), times.data(), addresses})) {
    if (summary.count == 0) {
      summary.first = indices.front();
      summary.begin = times.front();
    }
    summary.last = indices[rows - 1];
    summary.end = times[rows - 1];
    summary.count += static_cast<std::int64_t>(rows);
    use(indices, addresses, rows);
  }
  return summary;
}

bool has_images(const log::LoggedSession& session) {
  const auto is_calibration = [](const Document& document) {
    return document.name == camera::kDocument;
  };
  const std::string name = session.name() + "." + camera::kCompanion;
  return std::ranges::any_of(session.header().documents, is_calibration) &&
         std::ranges::any_of(session.companions(), [&](const log::LoggedSession& companion) {
           return companion.name() == name && companion.has_elements();
         });
}

std::vector<ImageSummary> images_of(const log::LoggedSession& session) {
  if (!has_images(session)) return {};
  const log::LoggedCameras cameras(session);
  std::vector<ImageSummary> images;
  for (const camera::Camera& camera : cameras.calibration().cameras) {
    images.push_back({.camera = camera.name, .encoding = {}});
  }
  const auto [first, end] = cameras.range();
  bool is_any = false;
  for (TimeIndex i = first; i < end; ++i) {
    try {
      const log::LoggedImages found = cameras.at(i);
      for (std::size_t k = 0; k < images.size(); ++k) {
        if (found.infos()[k].frame().state != camera::Frame::State::kGood) continue;
        const std::size_t size = found.size(k);
        ++(size > 0 ? images[k].count : images[k].left_out);
        images[k].bytes += size;
        if (size > 0 && images[k].encoding.empty()) images[k].encoding = found.recorded(k).encoding;
        is_any = is_any || size > 0;
      }
    } catch (const log::NotInLog&) {  // NOLINT(bugprone-empty-catch): the gaps say it
    }
  }
  return is_any ? images : std::vector<ImageSummary>();
}

SessionSummary summary_of(const log::LoggedSession& session) {
  SessionSummary summary{
      .session = session, .steps = {}, .loop = {}, .companions = {}, .images = {}};
  std::vector<log::Column> columns;
  if (session.has_elements() && session.element(Series::kStatus) == describe<Status>()) {
    columns.push_back({Series::kStatus, {}});
    summary.loop.emplace();
  }
  summary.steps = summary_of(
      session, columns, [&](const auto& indices, const auto& addresses, std::size_t rows) {
        for (std::size_t i = 0; summary.loop && i < rows; ++i) {
          Status status;
          std::memcpy(&status, static_cast<const std::byte*>(addresses[0]) + i * sizeof(status),
                      sizeof(status));
          summary.loop->timing.add(indices[i], status, session.header().period);
          summary.loop->counts.add(status.flags, status.skipped_ticks);
        }
      });
  if (const auto end = session.end_status(); end && summary.loop) {
    summary.loop->timing.add(end->first, end->second, session.header().period);
  }
  for (const log::LoggedSession& companion : session.companions()) {
    summary.companions.push_back(
        summary_of(companion, {}, [](const auto&, const auto&, std::size_t) {}));
  }
  summary.images = images_of(session);
  return summary;
}

}  // namespace

LogSummary summary_of(log::Log log) {
  LogSummary summary{.log = std::move(log), .sessions = {}};
  for (const log::LoggedSession& session : summary.log.sessions()) {
    summary.sessions.push_back(summary_of(session));
  }
  return summary;
}

McapSummary summary_of(const std::string& file, const std::string& reason) {
  const mcap::Reader reader{std::filesystem::path(file)};
  const mcap::Contents& contents = reader.contents();
  McapSummary summary{.file = file,
                      .size = std::filesystem::file_size(file),
                      .is_finished = contents.is_finished,
                      .profile = contents.profile,
                      .library = contents.library,
                      .messages = contents.message_count,
                      .topics = {},
                      .reason = reason};
  for (const auto& [id, channel] : contents.channels) {
    const auto schema = contents.schemas.find(channel.schema_id);
    const auto count = contents.channel_message_counts.find(id);
    summary.topics.push_back(
        {.name = channel.topic,
         .type = schema == contents.schemas.end() ? std::string() : schema->second.name,
         .messages = count == contents.channel_message_counts.end() ? 0 : count->second});
  }
  std::ranges::sort(summary.topics, {}, &McapSummary::Topic::name);
  std::uint64_t begin = contents.chunks.empty() ? 0 : contents.chunks.front().first_time;
  std::uint64_t end = begin;
  for (const mcap::ChunkPlace& chunk : contents.chunks) {
    begin = std::min(begin, chunk.first_time);
    end = std::max(end, chunk.last_time);
  }
  summary.duration = static_cast<double>(end - begin) / 1e9;
  return summary;
}

}  // namespace trifinger::apps
