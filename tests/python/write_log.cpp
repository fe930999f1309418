// SPDX-License-Identifier: BSD-3-Clause
// Writes a log of random numbers, and beside it the original bytes of each series:
//
//     write_log FOLDER trifinger|odd STEPS [GAP_FIRST GAP_LAST]
#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <limits>
#include <random>
#include <string>
#include <vector>

#include "core/odd_robot.hpp"
#include "log/log_writer.hpp"
#include "trifinger/joint/types.hpp"
#include "trifinger/log/log.hpp"
#include "trifinger/mcap/sink.hpp"
#include "trifinger/sim/object_observation.hpp"

namespace trifinger {
namespace {

using Bytes = std::vector<std::byte>;

// Appends one element with numbers of all sizes, some of them NaN.
void append_element(Bytes& bytes, const ElementDescription& element, std::mt19937& random) {
  const auto append = [&bytes](const auto& number) {
    const auto* begin = reinterpret_cast<const std::byte*>(&number);
    bytes.insert(bytes.end(), begin, begin + sizeof(number));
  };
  std::normal_distribution<double> normal;
  for (const FieldDescription& field : element.fields()) {
    for (std::size_t i = 0; i < field.count(); ++i) {
      const bool is_nan = random() % 50 == 0;
      if (field.type == ScalarType::kFloat64) {
        append(is_nan ? std::numeric_limits<double>::quiet_NaN() : normal(random));
      } else if (field.type == ScalarType::kFloat32) {
        append(static_cast<float>(normal(random)));
      } else {
        for (std::size_t k = 0; k < size_of(field.type); ++k) {
          append(static_cast<std::uint8_t>(random()));
        }
      }
    }
  }
}

Bytes random_elements(const ElementDescription& element, TimeIndex count, std::mt19937& random) {
  Bytes bytes;
  for (TimeIndex i = 0; i < count; ++i) append_element(bytes, element, random);
  return bytes;
}

void save(const std::filesystem::path& path, const Bytes& bytes) {
  std::ofstream(path, std::ios::binary)
      .write(reinterpret_cast<const char*>(bytes.data()),
             static_cast<std::streamsize>(bytes.size()));
}

void write(const std::filesystem::path& folder, const RobotTypes& types,
           const log::SessionHeader::Companion& companion, TimeIndex steps, const log::Gap& gap) {
  constexpr std::int64_t kMillisecond = 1'000'000;
  constexpr TimeIndex kBlock = 50;
  constexpr TimeIndex kCompanionPeriod = 10;  // [steps]
  std::mt19937 random(1);
  const Bytes desired = random_elements(types.action, steps, random);
  const Bytes applied = random_elements(types.applied_action, steps, random);
  const Bytes observations = random_elements(types.observation, steps + 1, random);
  Bytes readings = random_elements(companion.element, steps / kCompanionPeriod, random);
  std::vector<Status> statuses(static_cast<std::size_t>(steps + 1));
  for (TimeIndex t = 0; t <= steps; ++t) {
    Status& status = statuses[static_cast<std::size_t>(t)];
    status.time = t * kMillisecond;
    status.tick = t;
    status.lateness = static_cast<std::int64_t>(5'000 + random() % 20'000);
    if (random() % 100 == 0) status.flags = Status::kActionRepeated;
  }
  statuses.back().flags = Status::kEnd;

  mcap::FileSink sink = mcap::FileSink::create(folder / "log.mcap");
  log::LogWriter writer(sink, {});
  const std::size_t session = writer.begin_session(
      {.name = "robot",
       .session_id = 4711,
       .is_real_time = true,
       .period = Nanoseconds(kMillisecond),
       .created = 1'700'000'000'000'000'000,
       .time_offset = 1'700'000'000'000'000'000,
       .host = "host",
       .backend_pid = 1,
       .types = types,
       .companions = {companion},
       .documents = {{"configuration.yml", "application/yaml", "period: 0.001 s\n"}},
       .first_index = 0});
  const auto at = [](const Bytes& bytes, const ElementDescription& element, TimeIndex t) {
    return bytes.data() + static_cast<std::size_t>(t) * element.size();
  };
  for (TimeIndex t = 0; t < steps;) {
    if (t == gap.first) {
      writer.write_gap(session, gap.first, gap.last, "the disk was full");
      t = gap.last + 1;
      continue;
    }
    const TimeIndex end = std::min({t + kBlock, steps, gap.first > t ? gap.first : steps});
    writer.write_steps(session, {.first = t,
                                 .count = static_cast<std::size_t>(end - t),
                                 .desired_actions = at(desired, types.action, t),
                                 .applied_actions = at(applied, types.applied_action, t),
                                 .observations = at(observations, types.observation, t),
                                 .statuses = &statuses[static_cast<std::size_t>(t)]});
    t = end;
    writer.flush();
  }
  for (TimeIndex i = 0; i < steps / kCompanionPeriod; ++i) {
    std::byte* const reading =
        readings.data() + static_cast<std::size_t>(i) * companion.element.size();
    const TimeIndex t = i * kCompanionPeriod;
    const Stamp stamp{t, t, t * kMillisecond, t * kMillisecond};
    std::memcpy(reading, &stamp, sizeof(stamp));
    writer.write_companion(session, 0, i, 1, reading);
  }
  writer.write_event(log::Level::kWarning, "recorder", "the disk is nearly full",
                     1'700'000'000'100'000'000);
  writer.write_end(session, steps, at(observations, types.observation, steps), statuses.back());
  writer.end_session(session, steps, {.code = Fault::Code::kActionLate, .time_index = steps},
                     "the action for the last step came too late");
  writer.finish();

  save(folder / "desired_action.bin", desired);
  save(folder / "applied_action.bin", applied);
  save(folder / "observation.bin", observations);
  save(folder / "companion.bin", readings);
  const auto* bytes = reinterpret_cast<const std::byte*>(statuses.data());
  save(folder / "status.bin", {bytes, bytes + statuses.size() * sizeof(Status)});
}

}  // namespace
}  // namespace trifinger

int main(int argument_count, char** arguments) {
  using namespace trifinger;
  if (argument_count < 4) return 2;
  const std::string robot = arguments[2];
  log::Gap gap{-1, -1, {}};
  if (argument_count == 6) gap = {std::stoll(arguments[4]), std::stoll(arguments[5]), {}};
  if (robot == "odd") {
    write(arguments[1], describe_robot<test::OddRobot>(),
          {"robot.lamp", "odd_lamp", describe<test::OddLampReading>()}, std::stoll(arguments[3]),
          gap);
  } else {
    write(arguments[1], describe_robot<TriFinger>(),
          {"robot.object", "object_observation", describe<CubeObservation>()},
          std::stoll(arguments[3]), gap);
  }
  return 0;
}
