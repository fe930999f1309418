// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <nanobind/nanobind.h>

#include <array>
#include <string>
#include <string_view>

#include "trifinger/core/session.hpp"

namespace trifinger::bindings {

/// The series that Python knows.
inline constexpr std::array kSeries{Series::kDesiredAction, Series::kAppliedAction,
                                    Series::kObservation, Series::kStatus};

/// The series called `name`. @throws InvalidArgument with the existing names
[[nodiscard]] Series series_of(std::string_view name);

/// What Python calls the elements of a series.
struct SeriesNames {
  Series series;
  std::string one;
  std::string many;
  std::string type;
};

inline const std::array<SeriesNames, 4> kSeriesNames{{
    {Series::kObservation, "observation", "observations", "Observation"},
    {Series::kDesiredAction, "desired_action", "desired_actions", "Action"},
    {Series::kAppliedAction, "applied_action", "applied_actions", "AppliedAction"},
    {Series::kStatus, "status", "statuses", "StatusElement"},
}};

/// Binds the layouts of the four series of `T`, which `dtype` gives.
template <class T>
void bind_dtypes(nanobind::class_<T>& type) {
  const auto dtype = [](Series series) {
    return [series](const T& object) { return object.dtype(series); };
  };
  using nanobind::sig;
  type.def_prop_ro("action_dtype", dtype(Series::kDesiredAction),
                   sig("def action_dtype(self) -> numpy.dtype[Action]"), "The layout of an action.")
      .def_prop_ro("applied_action_dtype", dtype(Series::kAppliedAction),
                   sig("def applied_action_dtype(self) -> numpy.dtype[AppliedAction]"),
                   "The layout of an applied action.")
      .def_prop_ro("observation_dtype", dtype(Series::kObservation),
                   sig("def observation_dtype(self) -> numpy.dtype[Observation]"),
                   "The layout of an observation.")
      .def_prop_ro("status_dtype", dtype(Series::kStatus),
                   sig("def status_dtype(self) -> numpy.dtype[StatusElement]"),
                   "The layout of a status, the same for every robot.");
}

}  // namespace trifinger::bindings
