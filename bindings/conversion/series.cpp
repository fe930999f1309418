// SPDX-License-Identifier: BSD-3-Clause
#include "series.hpp"

#include <string>

#include "trifinger/base/error.hpp"

namespace trifinger::bindings {

Series series_of(std::string_view name) {
  std::string names;
  for (const Series series : kSeries) {
    if (name_of(series) == name) return series;
    names += (names.empty() ? "" : ", ") + std::string(name_of(series));
  }
  throw InvalidArgument("there is no series '" + std::string(name) + "'; there are " + names);
}

}  // namespace trifinger::bindings
