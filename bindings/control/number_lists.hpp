// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <nanobind/nanobind.h>
#include <nanobind/stl/pair.h>

#include <algorithm>
#include <cstddef>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "conversion/array.hpp"
#include "conversion/numbers.hpp"

namespace trifinger::bindings {

inline std::span<const double> span_of(const Numbers& numbers) {
  return {numbers.value.data(), static_cast<std::size_t>(numbers.value.size())};
}
inline std::span<double> span_of(Numbers& numbers) {
  return {numbers.value.data(), static_cast<std::size_t>(numbers.value.size())};
}

/// Copies numbers in place, so that arrays that show them stay valid.
inline void assign(const char* what, std::span<const double> numbers, std::span<double> target) {
  require_length(what, numbers.size(), target.size());
  std::ranges::copy(numbers, target.begin());
}

/// Binds a list of numbers as an array that shows it in place.
template <class T>
void bind_list(nanobind::class_<T>& type, const char* name, std::vector<double> T::* member,
               const char* doc) {
  const std::string signature =
      std::string("def ") + name + "(self) -> numpy.typing.NDArray[numpy.float64]";
  type.def_prop_rw(
      name,
      [member](nanobind::handle_t<T> self) {
        std::vector<double>& numbers = nanobind::inst_ptr<T>(self)->*member;
        return view_of(numbers, {static_cast<npy_intp>(numbers.size())}, self);
      },
      [member, name](T& self, const Numbers& numbers) {
        assign(name, span_of(numbers), self.*member);
      },
      nanobind::for_getter(nanobind::sig(signature.c_str())), doc);
}

/// Values and rates at one time.
using ValueAndRate = std::pair<Numbers, Numbers>;

inline ValueAndRate value_and_rate(int width) {
  return {{Eigen::VectorXd(width)}, {Eigen::VectorXd(width)}};
}

}  // namespace trifinger::bindings
