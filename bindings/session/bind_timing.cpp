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
#include "docstrings.hpp"
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
      also(docs::LatenessHistogram::LatenessHistogram, R"(Times are in seconds.)"))
      .def("count", &LatenessHistogram::count, docs::LatenessHistogram::count)
      .def(
          "quantile",
          [](const LatenessHistogram& histogram, double fraction) {
            return to_seconds(histogram.quantile(fraction));
          },
          "fraction"_a, docs::LatenessHistogram::quantile)
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
          docs::LatenessHistogram::max)
      .def("__str__", [](const LatenessHistogram& histogram) { return describe(histogram); })
      .def("__repr__", [](const LatenessHistogram& histogram) {
        return "<LatenessHistogram: " + describe(histogram) + ">";
      });

  nb::class_<LateStep>(m, "LateStep", also(docs::LateStep::LateStep, R"(Times are in seconds.)"))
      .def_ro("time_index", &LateStep::time_index)
      .def_prop_ro(
          "lateness", [](const LateStep& step) { return to_seconds(step.lateness); },
          docs::LateStep::lateness)
      .def_prop_ro(
          "cause", [](const LateStep& step) { return std::string(name_of(step.cause)); },
          also(docs::LateStep::cause, R"(One of "user", "scheduler" and "driver".)"))
      .def("__repr__", [](const LateStep& step) {
        return "<LateStep " + std::to_string(step.time_index) + " by " +
               duration_text(step.lateness) + ", " + std::string(name_of(step.cause)) + ">";
      });

  nb::class_<TimingRecord>(
      m, "TimingRecord",
      also(
          docs::TimingRecord::TimingRecord,
          R"(str() tells it in a sentence. A step is late because its action was missing ("user"), because the
back-end was woken late or did not get the processor ("scheduler"), or because calls of the driver
used up the tick before ("driver").)"))
      .def("lateness", &TimingRecord::lateness, nb::rv_policy::reference_internal,
           docs::TimingRecord::lateness)
      .def("steps", &TimingRecord::steps, docs::TimingRecord::steps)
      .def(
          "late_steps",
          // No std::string: g++ 12 warns that it is used before it is set.
          [](const TimingRecord& timing, const std::optional<nb::str>& cause) {
            return cause ? timing.late_steps(cause_of(text_of(*cause))) : timing.late_steps();
          },
          "cause"_a = nb::none(), docs::TimingRecord::late_steps)
      .def("success_rate", &TimingRecord::success_rate, docs::TimingRecord::success_rate)
      .def(
          "worst",
          [](const TimingRecord& timing) {
            const auto worst = timing.worst();
            return std::vector<LateStep>(worst.begin(), worst.end());
          },
          docs::TimingRecord::worst)
      .def("__str__", [](const TimingRecord& timing) { return describe(timing); })
      .def("__repr__",
           [](const TimingRecord& timing) { return "<TimingRecord: " + describe(timing) + ">"; });

  m.def(
      "duration_text", [](double seconds) { return duration_text(to_time(seconds)); }, "seconds"_a,
      also(docs::duration_text, R"(`seconds` is the duration [s].)"));
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
      also(docs::lateness_of,
           R"(Returns one number [s] for each of `statuses`. `period` is the session's [s].)"));
}

}  // namespace trifinger::bindings
