// SPDX-License-Identifier: BSD-3-Clause
#include "robot/wear_table.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <string_view>

#include "shared/text.hpp"
#include "trifinger/core/description.hpp"
#include "trifinger/core/frontend.hpp"

namespace trifinger::apps {
namespace {

constexpr const char* kCompanion = "wear";

// The newest element of a companion; its fields are read by name.
class NewestElement {
 public:
  explicit NewestElement(const Session& companion)
      : description_(companion.element(Series::kObservation)), bytes_(description_.size()) {
    const UntypedFrontend session(companion);
    const TimeIndex end = session.range(Series::kObservation).second;
    is_there_ = end > 0 && session.try_get(Series::kObservation, end - 1, bytes_.data());
  }

  [[nodiscard]] bool is_there() const noexcept { return is_there_; }

  // Returns the numbers of a field; empty if there is no such field.
  template <class T>
  [[nodiscard]] std::vector<T> numbers(std::string_view name) const {
    const FieldDescription* const field = description_.find(name);
    if (field == nullptr || field->type != detail::scalar_type_of<T>()) return {};
    std::vector<T> numbers(field->count());
    std::memcpy(numbers.data(), bytes_.data() + field->offset, numbers.size() * sizeof(T));
    return numbers;
  }
  [[nodiscard]] std::int64_t count(std::string_view name) const {
    const auto found = numbers<std::uint64_t>(name);
    return found.empty() ? 0 : static_cast<std::int64_t>(found[0]);
  }

 private:
  ElementDescription description_;
  std::vector<std::byte> bytes_;
  bool is_there_{false};
};

std::vector<std::string> table_of(const NewestElement& wear) {
  const auto times = wear.numbers<double>("powered_time");
  const auto revolutions = wear.numbers<double>("revolutions");
  const auto work = wear.numbers<double>("work");
  const auto current = wear.numbers<double>("squared_current");
  const auto slips = wear.numbers<std::uint64_t>("index_slips");
  const std::size_t joints =
      std::min({times.size(), revolutions.size(), work.size(), current.size(), slips.size()});
  if (joints == 0) return {};
  const std::int64_t starts = wear.count("starts");
  std::vector<std::string> lines{fmt::format(
      "{}, {}, {}", starts == 0 ? "since this start only" : counted(starts, "start"),
      counted(wear.count("homings"), "homing"), counted(wear.count("faults"), "fault"))};
  constexpr const char* kRow = "{:>5}  {:>8}  {:>11}  {:>8}  {:>13}  {:>5}";
  lines.push_back(fmt::format(kRow, "joint", "power", "revolutions", "work", "current^2", "slips"));
  constexpr double kHour = 3600.0;  // [s]
  for (std::size_t i = 0; i < joints; ++i) {
    lines.push_back(fmt::format(
        kRow, i, fmt::format("{:.2f} h", times[i] / kHour), fmt::format("{:.1f}", revolutions[i]),
        fmt::format("{:.1f} J", work[i]), fmt::format("{:.1f} A^2s", current[i]), slips[i]));
  }
  return lines;
}

}  // namespace

std::vector<std::string> wear_table(const Session& robot) {
  const std::vector<std::string>& names = robot.companion_names();
  if (std::ranges::find(names, kCompanion) == names.end()) return {};
  try {
    const NewestElement wear(robot.companion(kCompanion));
    return wear.is_there() ? table_of(wear) : std::vector<std::string>{};
  } catch (const Error&) {
    return {};  // The next session has begun, or the element is being overwritten.
  }
}

}  // namespace trifinger::apps
