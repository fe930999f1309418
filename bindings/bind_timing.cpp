// SPDX-License-Identifier: BSD-3-Clause
#include <nanobind/nanobind.h>
#include <nanobind/stl/optional.h>
#include <nanobind/stl/vector.h>

#include <cstring>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "array.hpp"
#include "bindings.hpp"
#include "element_type.hpp"
#include "text.hpp"
#include "timeout.hpp"
#include "trifinger/base/error.hpp"
#include "trifinger/base/time.hpp"
#include "trifinger/core/timing.hpp"

namespace nb = nanobind;
using namespace nanobind::literals;

namespace trifinger::python {
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
      R"(Counts times in bins that widen with the time: eight for each power of two, so a quantile is
known to an eighth of itself however many times there are.)")
      .def("count", &LatenessHistogram::count, "How many times there are.")
      .def(
          "quantile",
          [](const LatenessHistogram& histogram, double fraction) {
            return to_seconds(histogram.quantile(fraction));
          },
          "fraction"_a,
          "The time [s] below which the share `fraction` of all times lies; 0 if there are none.")
      .def(
          "counts",
          [](const LatenessHistogram& histogram) {
            std::vector<std::uint64_t> counts(LatenessHistogram::kNumBins);
            for (std::size_t bin = 0; bin < counts.size(); ++bin) {
              counts[bin] = histogram.count_in(bin);
            }
            return counts;
          },
          "How many times are in each bin.")
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
          "The shortest time of each bin [s]; that of the last one and all that are longer.")
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
          R"(How late the tick began [s]; if the user was to blame, for how long there has been no new
action.)")
      .def_prop_ro(
          "cause", [](const LateStep& step) { return std::string(name_of(step.cause)); },
          R"(Who was to blame: "user", "scheduler" or "driver".)")
      .def("__repr__", [](const LateStep& step) {
        return "<LateStep " + std::to_string(step.time_index) + " by " +
               duration_text(step.lateness) + ", " + std::string(name_of(step.cause)) + ">";
      });

  nb::class_<TimingRecord>(
      m, "TimingRecord",
      R"(How a session in real time keeps its time; str() tells it in a sentence.

A step is late because its action was missing ("user"), because the back-end was woken late or
did not get the processor ("scheduler"), or because calls of the driver took up the tick before
("driver").)")
      .def("lateness", &TimingRecord::lateness, nb::rv_policy::reference_internal,
           "`lateness_of` all steps.")
      .def("steps", &TimingRecord::steps, "Steps so far, the one that ended the session included.")
      .def(
          "late_steps",
          // Of a std::string g++ 12 says that it is used before it is set.
          [](const TimingRecord& timing, const std::optional<nb::str>& cause) {
            return cause ? timing.late_steps(cause_of(text_of(*cause))) : timing.late_steps();
          },
          "cause"_a = nb::none(), "How many steps were late, all of them or because of `cause`.")
      .def("success_rate", &TimingRecord::success_rate,
           "The share of the newest 1000 steps that were in time: 1 if all of them were.")
      .def(
          "worst",
          [](const TimingRecord& timing) {
            const auto worst = timing.worst();
            return std::vector<LateStep>(worst.begin(), worst.end());
          },
          R"(The worst late steps, the worst first. Of steps that are later and later in a row there is
only the last one.)")
      .def("__str__", [](const TimingRecord& timing) { return describe(timing); })
      .def("__repr__",
           [](const TimingRecord& timing) { return "<TimingRecord: " + describe(timing) + ">"; });

  m.def(
      "duration_text", [](double seconds) { return duration_text(to_time(seconds)); }, "seconds"_a,
      "A time for people, as in \"12 µs\" and \"1.2 ms\".");
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
      R"(How late each step was [s]: how long after its deadline the tick began, or after the deadline of
the first tick that was left out before it; zero without deadlines. `period` is the session's.)");
}

}  // namespace trifinger::python
