// SPDX-License-Identifier: BSD-3-Clause
#include <fmt/format.h>
#include <libdeflate.h>
#include <zstd.h>

#include <array>
#include <chrono>
#include <cstdint>
#include <cstring>
#include <filesystem>
#include <memory>
#include <random>
#include <span>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "harness.hpp"
#include "log/log_writer.hpp"
#include "log/recorder.hpp"
#include "support/folder.hpp"
#include "trifinger/base/error.hpp"
#include "trifinger/log/log.hpp"
#include "trifinger/mcap/reader.hpp"
#include "trifinger/mcap/sink.hpp"
#include "trifinger/sim/simulation.hpp"

namespace trifinger::benchmarks {
namespace {

constexpr TimeIndex kLogSteps = 60'000;   // a minute at 1 kHz
constexpr TimeIndex kStepsPerChunk = 80;  // number of steps that the recorder writes at once

// The series of a session in memory.
struct Run {
  explicit Run(std::size_t steps)
      : desired(steps), applied(steps), observations(steps), statuses(steps) {}

  std::vector<TriFinger::Action> desired;
  std::vector<TriFinger::AppliedAction> applied;
  std::vector<TriFinger::Observation> observations;
  std::vector<Status> statuses;
};

// Simulates a robot that roughly keeps its pose. In every step each joint gets a new random torque.
Run run_with_random_torques() {
  Run run(kLogSteps);
  std::mt19937_64 random(1);  // NOLINT(cert-msc51-cpp): the same run every time
  std::uniform_real_distribution<double> torque(-0.2, 0.2);
  const Simulation simulation({}, {.history = static_cast<std::size_t>(2 * kLogSteps)});
  auto robot = simulation.connect();
  auto action = hold_position(robot.latest_observation());
  for (TimeIndex t = 0; t <= kLogSteps; ++t) {
    for (double& value : action.torque) value = torque(random);
    robot.wait_until_time_index(robot.append_desired_action(action));
  }
  robot.get_desired_actions(0, run.desired);
  robot.get_applied_actions(0, run.applied);
  robot.get_observations(0, run.observations);
  robot.get_statuses(0, run.statuses);
  return run;
}

log::SessionHeader make_header() {
  log::SessionHeader header;
  header.name = "sim";
  header.session_id = 1;
  header.period = std::chrono::milliseconds(1);
  header.types = describe_robot<TriFinger>();
  // The messages for viewers are made from these documents.
  for (Document& document : model_documents({})) {
    if (document.name != "model.xml") header.documents.push_back(std::move(document));
  }
  return header;
}

// Making it takes longer than writing a chunk, so it is made once.
const log::SessionHeader& header() {
  static const log::SessionHeader the_header = make_header();
  return the_header;
}

// Writes `run` like the recorder, but without waiting for the disk.
void write(const Run& run, const std::filesystem::path& path, log::Precision precision) {
  std::filesystem::remove(path);
  mcap::FileSink sink = mcap::FileSink::create(path);
  log::LogOptions options;
  options.precision = precision;
  log::LogWriter writer(sink, options);
  const std::size_t session = writer.begin_session(header());
  for (TimeIndex t = 0; t < kLogSteps; t += kStepsPerChunk) {
    const auto i = static_cast<std::size_t>(t);
    writer.write_steps(session, {.first = t,
                                 .count = static_cast<std::size_t>(kStepsPerChunk),
                                 .desired_actions = &run.desired[i],
                                 .applied_actions = &run.applied[i],
                                 .observations = &run.observations[i],
                                 .statuses = &run.statuses[i]});
    writer.flush();
  }
  writer.finish();
}

using Bytes = std::vector<std::byte>;

// Returns the uncompressed bytes of each chunk in the file at `path`.
std::vector<Bytes> raw_chunks(const std::filesystem::path& path) {
  mcap::Reader reader(path);
  std::vector<Bytes> chunks;
  constexpr std::size_t kMessageHeader = 31;
  for (std::size_t i = 0; i < reader.contents().chunks.size(); ++i) {
    const auto messages = reader.read_chunk(i);
    if (!messages) throw Error("the log that was just written is damaged");
    Bytes& bytes = chunks.emplace_back();
    for (const mcap::Message& message : *messages) {
      const std::size_t begin = bytes.size();
      bytes.resize(begin + kMessageHeader + message.data.size());
      std::memcpy(&bytes[begin], &message.log_time, sizeof message.log_time);
      std::memcpy(&bytes[begin + kMessageHeader], message.data.data(), message.data.size());
    }
  }
  return chunks;
}

std::size_t total_size(const std::vector<Bytes>& pieces) {
  std::size_t size = 0;
  for (const Bytes& piece : pieces) size += piece.size();
  return size;
}

std::vector<Bytes> compress(const std::vector<Bytes>& chunks) {
  const std::unique_ptr<ZSTD_CCtx, decltype(&ZSTD_freeCCtx)> context(ZSTD_createCCtx(),
                                                                     &ZSTD_freeCCtx);
  std::vector<Bytes> frames;
  frames.reserve(chunks.size());
  for (const Bytes& chunk : chunks) {
    Bytes& frame = frames.emplace_back(ZSTD_compressBound(chunk.size()));
    frame.resize(ZSTD_compressCCtx(context.get(), frame.data(), frame.size(), chunk.data(),
                                   chunk.size(), 1));
  }
  return frames;
}

// Decompresses `frames` into new memory of `size` bytes, with a check. Returns a sum, so that the
// compiler cannot remove the work.
std::uint32_t decompress(const std::vector<Bytes>& frames, std::size_t size) {
  const std::unique_ptr<ZSTD_DCtx, decltype(&ZSTD_freeDCtx)> context(ZSTD_createDCtx(),
                                                                     &ZSTD_freeDCtx);
  const auto memory = std::make_unique_for_overwrite<std::byte[]>(size);
  std::span<std::byte> rest(memory.get(), size);
  std::uint32_t sum = 0;
  for (const Bytes& frame : frames) {
    const std::size_t part =
        ZSTD_decompressDCtx(context.get(), rest.data(), rest.size(), frame.data(), frame.size());
    sum += libdeflate_crc32(0, rest.data(), part);
    rest = rest.subspan(part);
  }
  return sum;
}

Row size_row(std::string measure, const Run& run, const std::filesystem::path& file,
             log::Precision precision, double reach) {
  write(run, file, precision);
  Row row;
  row.measure = std::move(measure);
  // Documents are stored once in a file, however long it is.
  double documents = 0;
  for (const Document& document : header().documents) {
    documents += static_cast<double>(document.text.size());
  }
  row.value = (static_cast<double>(std::filesystem::file_size(file)) - documents) / kLogSteps;
  row.low = row.high = row.value;
  row.unit = "bytes";
  row.reach = fmt::format("<= {:.0f} bytes", reach);
  row.holds = row.value <= reach;
  return row;
}

Row write_row(const Effort& effort, const Run& run, const std::filesystem::path& file,
              const std::vector<Bytes>& chunks) {
  const double megabytes = 1e-6 * static_cast<double>(total_size(chunks));
  const auto ours = [&] {
    const auto begin = Clock::now();
    write(run, file, log::Precision::kDouble);
    return megabytes / seconds_since(begin);
  };
  const std::unique_ptr<ZSTD_CCtx, decltype(&ZSTD_freeCCtx)> context(ZSTD_createCCtx(),
                                                                     &ZSTD_freeCCtx);
  Bytes frame(ZSTD_compressBound(2 * chunks.front().size()));
  const auto bare = [&] {
    const auto begin = Clock::now();
    for (const Bytes& chunk : chunks) {
      ZSTD_compressCCtx(context.get(), frame.data(), frame.size(), chunk.data(), chunk.size(), 1);
    }
    return megabytes / seconds_since(begin);
  };
  const Paired paired = alternate(effort.rounds, ours, bare);
  return make_row("log: writing, memory to file", "MB/s", paired, "zstd level 1 of the same bytes",
                  ">= 0.7x", paired.ratio.median() >= 0.7);
}

Row read_row(const Effort& effort, const std::filesystem::path& file,
             const std::vector<Bytes>& chunks) {
  std::vector<log::Column> series(4);
  series[0].series = Series::kDesiredAction;
  series[1].series = Series::kAppliedAction;
  series[2].series = Series::kObservation;
  series[3].series = Series::kStatus;
  const auto ours = [&] {
    const auto begin = Clock::now();
    log::SeriesReader reader = log::Log(file).session().read(series);
    std::array<std::unique_ptr<std::byte[]>, 4> arrays;
    std::array<void*, 4> columns{};
    for (std::size_t i = 0; i < arrays.size(); ++i) {
      arrays[i] = std::make_unique_for_overwrite<std::byte[]>(kLogSteps * reader.element(i).size());
      columns[i] = arrays[i].get();
    }
    if (reader.read(kLogSteps, {.columns = columns}) != kLogSteps) throw Error("steps are missing");
    return seconds_since(begin);
  };
  const std::vector<Bytes> frames = compress(chunks);
  const std::size_t size = total_size(chunks);
  std::uint32_t sum = 0;
  const auto bare = [&] {
    const auto begin = Clock::now();
    sum += decompress(frames, size);
    return seconds_since(begin);
  };
  const Paired paired = alternate(effort.rounds, ours, bare);
  Row row = make_row("log: 60 s at 1 kHz into arrays, C++", "s", paired,
                     "decompressing and checking the same bytes", "<= 1.5x",
                     paired.ratio.median() <= 1.5);
  row.remark = fmt::format("both into new memory; sum of the checksums {:08x}", sum);
  return row;
}

}  // namespace

std::vector<Row> log_files(const Effort& effort) {
  const Run run = run_with_random_torques();
  const test::Folder folder;
  const std::filesystem::path file = folder.path() / "log.mcap";
  std::vector<Row> rows;
  rows.push_back(
      size_row("log: bytes per step, single precision", run, file, log::Precision::kSingle, 180.0));
  rows.push_back(size_row("log: bytes per step", run, file, log::Precision::kDouble, 320.0));
  const std::vector<Bytes> chunks = raw_chunks(file);
  rows.push_back(write_row(effort, run, file, chunks));
  rows.push_back(read_row(effort, file, chunks));
  return rows;
}

// A simulated robot with its cube moves as fast as it can, with and without a recorder.
std::vector<Row> recorded_simulation(const Effort& effort) {
  const Simulation bare;
  const Simulation recorded;
  const test::Folder folder;
  log::RecorderOptions options;
  options.folder = folder.path();
  options.is_follower = true;
  const auto recorder =
      std::make_shared<log::Recorder>(std::vector<std::string>{"sim"}, std::move(options));
  recorded.follow(recorder);
  std::thread thread([&recorder] { recorder->run(); });

  constexpr TimeIndex kRun = 30'000;  // more than the history
  TimeIndex steps = 0;
  const auto measure = [&](const Simulation& simulation) {
    auto robot = simulation.connect();
    const auto action = hold_position(robot.latest_observation());
    const auto begin = Clock::now();
    for (TimeIndex t = 0; t < kRun; ++t) {
      robot.wait_until_time_index(robot.append_desired_action(action));
    }
    const double time = seconds_since(begin);
    robot.finish();
    return static_cast<double>(kRun) / time;
  };
  const Paired paired = alternate(
      effort.rounds,
      [&] {
        steps += kRun;
        return measure(recorded);
      },
      [&] { return measure(bare); });
  recorder->request_stop();
  thread.join();

  TimeIndex found = 0;
  std::size_t gaps = 0;
  for (const log::LoggedSession& session : log::Log(folder.path()).sessions()) {
    found += session.steps().value_or(0);
    gaps += session.gaps().size();
  }
  Row row = make_row("log: simulation recorded without loss", "steps/s", paired,
                     "the same without recording", ">= 0.5x, nothing missing",
                     paired.ratio.median() >= 0.5 && found == steps && gaps == 0);
  row.remark = fmt::format("{} of {} steps in the log, {} gaps", found, steps, gaps);
  return {row};
}

}  // namespace trifinger::benchmarks
