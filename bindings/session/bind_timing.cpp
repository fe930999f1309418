// SPDX-License-Identifier: BSD-3-Clause
#include <nanobind/nanobind.h>
#include <nanobind/stl/optional.h>
#include <nanobind/stl/vector.h>

#include <cstring>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "bindings.hpp"
#include "conversion/array.hpp"
#include "conversion/element_type.hpp"
#include "conversion/text.hpp"
#include "conversion/timeout.hpp"
#include "trifinger/base/error.hpp"
#include "trifinger/base/time.hpp"
#include "trifinger/core/timing.hpp"

namespace nb = nanobind;
using namespace nanobind::literals;

namespace trifinger::bindings {
namespace {

LateCause cause_of(std::string_view name) {
  for (const LateCause cause : {LateCause::kUser, LateCause::kScheduler, LateCause::kDriver}) {
    if (name == name_of(cause)) return cause;
  }
  throw InvalidArgument("'" + std::string(name) +
                        "' is no cause; there are 'user', 'scheduler' and 'driver'");
}

}  // namespace

void bind_timing(nb::module_& m) {
  nb::class_<LatenessHistogram>(
      m, "LatenessHistogram",
      R"(Counts times in bins whose width grows with the time: eight bins for each power of two. A
quantile is therefore known to an eighth of its value, however many times were counted.)")
      .def("count", &LatenessHistogram::count, "Number of counted times.")
      .def(
          "quantile",
          [](const LatenessHistogram& histogram, double fraction) {
            return to_seconds(histogram.quantile(fraction));
          },
          "fraction"_a,
          "The time below which the share `fraction` of all times lies [s]; 0 if no time was "
          "counted.")
      .def(
          "counts",
          [](const LatenessHistogram& histogram) {
            std::vector<std::uint64_t> counts(LatenessHistogram::kNumBins);
            for (std::size_t bin = 0; bin < counts.size(); ++bin) {
              counts[bin] = histogram.count_in(bin);
            }
            return counts;
          },
          "Number of times in each bin.")
      .def_static(
          "edges",
          [] {
            std::vector<double> edges;
            edges.reserve(LatenessHistogram::kNumBins);
            for (std::size_t bin = 0; bin < LatenessHistogram::kNumBins; ++bin) {
              edges.push_back(to_seconds(LatenessHistogram::begin_of(bin)));
            }
            return edges;
          },
          "The shortest time of each bin [s]. The last bin has no upper end.")
      .def(
          "max", [](const LatenessHistogram& histogram) { return to_seconds(histogram.max()); },
          "The longest time [s].")
      .def("__str__", [](const LatenessHistogram& histogram) { return describe(histogram); })
      .def("__repr__", [](const LatenessHistogram& histogram) {
        return "<LatenessHistogram: " + describe(histogram) + ">";
      });

  nb::class_<LateStep>(m, "LateStep", "A step that was late.")
      .def_ro("time_index", &LateStep::time_index)
      .def_prop_ro(
          "lateness", [](const LateStep& step) { return to_seconds(step.lateness); },
          R"(How late the tick began [s]. If the user caused it, the time without a new action.)")
      .def_prop_ro(
          "cause", [](const LateStep& step) { return std::string(name_of(step.cause)); },
          R"(Who caused the late step: "user", "scheduler" or "driver".)")
      .def("__repr__", [](const LateStep& step) {
        return "<LateStep " + std::to_string(step.time_index) + " by " +
               duration_text(step.lateness) + ", " + std::string(name_of(step.cause)) + ">";
      });

  nb::class_<TimingRecord>(
      m, "TimingRecord",
      R"(How well a session in real time keeps its time; str() tells it in a sentence.

A step is late because its action was missing ("user"), because the back-end was woken late or did
not get the processor ("scheduler"), or because calls of the driver used up the tick before
("driver").)")
      .def("lateness", &TimingRecord::lateness, nb::rv_policy::reference_internal,
           "The `lateness_of` all steps.")
      .def("steps", &TimingRecord::steps,
           "Number of steps so far, including the one that ended the session.")
      .def(
          "late_steps",
          // No std::string: g++ 12 warns that it is used before it is set.
          [](const TimingRecord& timing, const std::optional<nb::str>& cause) {
            return cause ? timing.late_steps(cause_of(text_of(*cause))) : timing.late_steps();
          },
          "cause"_a = nb::none(),
          "Number of late steps: all of them, or those late because of `cause`.")
      .def("success_rate", &TimingRecord::success_rate,
           "The share of the newest 1000 steps that were in time: 1 if all of them were.")
      .def(
          "worst",
          [](const TimingRecord& timing) {
            const auto worst = timing.worst();
            return std::vector<LateStep>(worst.begin(), worst.end());
          },
          R"(The worst late steps, the worst one first. In a row of steps with growing lateness only
the last one is listed.)")
      .def("__str__", [](const TimingRecord& timing) { return describe(timing); })
      .def("__repr__",
           [](const TimingRecord& timing) { return "<TimingRecord: " + describe(timing) + ">"; });

  m.def(
      "duration_text", [](double seconds) { return duration_text(to_time(seconds)); }, "seconds"_a,
      "Formats a time for people, for example \"12 µs\" and \"1.2 ms\".");
  m.def(
      "lateness_of",
      [](nb::handle statuses, double period) {
        const ElementType type(describe<Status>());
        const ElementType::Elements elements = type.contiguous(statuses);
        const Nanoseconds length = to_time(period);
        Eigen::VectorXd lateness(static_cast<Eigen::Index>(elements.count));
        for (std::size_t i = 0; i < elements.count; ++i) {
          Status status;
          std::memcpy(&status, elements.bytes + i * sizeof(status), sizeof(status));
          lateness[static_cast<Eigen::Index>(i)] = to_seconds(lateness_of(status, length));
        }
        return Array{std::move(lateness)};
      },
      "statuses"_a, "period"_a,
      nb::sig("def lateness_of(statuses: numpy.typing.NDArray[StatusElement], period: float) -> "
              "numpy.typing.NDArray[numpy.float64]"),
      R"(How late each step was [s]: the time from the deadline to the beginning of the tick. If
ticks were left out before it, the time counts from the deadline of the first of them. Zero without
deadlines. `period` is the session's [s].)");
}

}  // namespace trifinger::bindings
