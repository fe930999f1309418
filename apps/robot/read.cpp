// SPDX-License-Identifier: BSD-3-Clause
#include <fmt/core.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cstring>
#include <limits>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "commands.hpp"
#include "shared/options.hpp"
#include "shared/output.hpp"
#include "shared/terminal.hpp"
#include "trifinger/core/frontend.hpp"

namespace trifinger::apps {
namespace {

struct ReadOptions {
  std::string name;
  std::optional<TimeIndex> time_index;
  Series series{Series::kObservation};
  TimeIndex last{1};
  bool csv{false};
  bool fields{false};
};

template <class T>
std::string number_at(const std::byte* place, bool exact) {
  T number;
  std::memcpy(&number, place, sizeof(number));
  if constexpr (std::is_floating_point_v<T>) {
    return exact ? fmt::format("{}", number) : fmt::format("{:.6g}", number);
  } else {
    return fmt::format("{}", number);
  }
}

// Formats the number of this type at `place`. If `exact`, the text is the shortest that reads back
// to equal bits; otherwise it is rounded for people.
std::string number_text(ScalarType type, const std::byte* place, bool exact) {
  switch (type) {
    case ScalarType::kInt8:
      return number_at<std::int8_t>(place, exact);
    case ScalarType::kUint8:
      return number_at<std::uint8_t>(place, exact);
    case ScalarType::kInt16:
      return number_at<std::int16_t>(place, exact);
    case ScalarType::kUint16:
      return number_at<std::uint16_t>(place, exact);
    case ScalarType::kInt32:
      return number_at<std::int32_t>(place, exact);
    case ScalarType::kUint32:
      return number_at<std::uint32_t>(place, exact);
    case ScalarType::kInt64:
      return number_at<std::int64_t>(place, exact);
    case ScalarType::kUint64:
      return number_at<std::uint64_t>(place, exact);
    case ScalarType::kFloat32:
      return number_at<float>(place, exact);
    case ScalarType::kFloat64:
      return number_at<double>(place, exact);
  }
  return "?";
}

// Returns the name of one number of a field: "position[0][2]".
std::string number_name(const FieldDescription& field, std::size_t index) {
  std::string name = field.name;
  std::size_t stride = field.count();
  for (const std::size_t extent : field.shape) {
    stride /= extent;
    name += fmt::format("[{}]", index / stride % extent);
  }
  return name;
}

// Returns the element's numbers in the order of its fields.
std::vector<std::string> numbers_of(const FieldDescription& field, const std::byte* element,
                                    bool exact) {
  std::vector<std::string> numbers;
  numbers.reserve(field.count());
  for (std::size_t i = 0; i < field.count(); ++i) {
    numbers.push_back(
        number_text(field.type, element + field.offset + i * size_of(field.type), exact));
  }
  return numbers;
}

void print_csv_header(const ElementDescription& description) {
  print_safely("time_index");
  for (const FieldDescription& field : description.fields()) {
    for (std::size_t i = 0; i < field.count(); ++i) print_safely(",{}", number_name(field, i));
  }
  print_safely("\n");
}

void print_csv(TimeIndex t, const ElementDescription& description, const std::byte* element) {
  print_safely("{}", t);
  for (const FieldDescription& field : description.fields()) {
    fmt::print(",{}", fmt::join(numbers_of(field, element, true), ","));
  }
  print_safely("\n");
}

void print_for_people(const std::string& title, const ElementDescription& description,
                      const std::byte* element, const Terminal& terminal) {
  std::size_t width = 0;
  for (const FieldDescription& field : description.fields()) {
    width = std::max(width, columns_of(field.name));
  }
  fmt::print("{}\n", terminal.paint(title, Style::kBold));
  for (const FieldDescription& field : description.fields()) {
    const std::string unit = field.unit.empty() ? "" : " " + field.unit;
    fmt::print("  {}  {}{}\n", terminal.paint(pad(field.name, width), Style::kPlain),
               fmt::join(numbers_of(field, element, false), " "),
               terminal.paint(unit, Style::kDim));
  }
}

// Returns the steps [first, second) that the options ask for.
std::pair<TimeIndex, TimeIndex> wanted_range(const ReadOptions& options,
                                             const UntypedFrontend& session) {
  const auto [oldest, end] = session.range(options.series);
  if (!options.time_index) return {std::max(oldest, end - options.last), end};

  const TimeIndex t = *options.time_index;
  if (t < oldest) throw HistoryLost(t, oldest);
  if (t >= end) {
    throw Error(fmt::format("step {} has not come yet: the newest {} of '{}' is {}", t,
                            name_of(options.series), options.name, end - 1));
  }
  return {t, t + 1};
}

int read(const ReadOptions& options) {
  const UntypedFrontend session(options.name, {.control = false});
  const ElementDescription& description = session.session().element(options.series);
  if (options.fields) {
    fmt::print("{}", printable_lines(description.text(), std::string::npos));
    return kDone;
  }
  const auto [first, end] = wanted_range(options, session);
  if (first == end) {
    throw Error(fmt::format("'{}' has no {} yet, it is {}", options.name, name_of(options.series),
                            name_of(session.session().info().phase)));
  }

  const Terminal terminal;
  std::vector<std::byte> element(description.size());
  if (options.csv) print_csv_header(description);
  for (TimeIndex t = first; t < end; ++t) {
    try {
      if (!session.try_get(options.series, t, element.data())) break;
    } catch (const HistoryLost& lost) {
      // The step was overwritten while earlier ones were printed. For a single step, that is the
      // answer.
      if (options.time_index) throw;
      t = std::min(end, lost.oldest()) - 1;
      continue;
    }
    if (options.csv) {
      print_csv(t, description, element.data());
    } else {
      const std::string title = fmt::format("{} {} {}", options.name, name_of(options.series), t);
      print_for_people(title, description, element.data(), terminal);
    }
  }
  return kDone;
}

}  // namespace

void add_read(CLI::App& program, Action& action) {
  const auto& [command, options] =
      add_command(program, action, "read", "Print elements of a session, of any robot", read);
  add_robot(command, options.name, "Name of the session, as in sim or sim.object");
  CLI::Option* const step =
      command.add_option("STEP", options.time_index, "The step to print; default: the newest")
          ->check(CLI::Range(TimeIndex{0}, std::numeric_limits<TimeIndex>::max()));
  Choices<Series> choices;
  for (const Series series : {Series::kDesiredAction, Series::kAppliedAction, Series::kObservation,
                              Series::kStatus, Series::kHolding, Series::kStopping}) {
    choices.emplace_back(name_of(series), series);
  }
  add_choice(command, "--series", options.series, choices,
             "The series to print; default: observation");
  command.add_option("--last", options.last, "How many steps to print, up to the newest")
      ->check(CLI::Range(TimeIndex{1}, std::numeric_limits<TimeIndex>::max()))
      ->option_text("N")
      ->excludes(step);
  command.add_flag("--csv", options.csv, "Print a table, numbers in full, for other programs");
  command.add_flag("--fields", options.fields, "Print only which fields the elements have");
  command.footer(
      "A companion counts its own elements. Their field stamp.arrival_index is the robot's step.\n"
      "Example:\n"
      "  trifinger read sim 1000 --series applied_action\n"
      "  trifinger read sim --last 5000 --csv > observations.csv");
}

}  // namespace trifinger::apps
