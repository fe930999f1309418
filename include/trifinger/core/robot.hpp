// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "trifinger/core/description.hpp"

namespace trifinger {

// A robot is a struct that names its types:
//
//     struct Wheel {
//       static constexpr std::string_view kType = "wheel";
//       using Action = WheelAction;
//       using Observation = WheelObservation;
//       using AppliedAction = WheelAppliedAction;  // optional; default: Action
//     };

namespace detail {

template <class R>
struct AppliedActionTraits {
  using Type = typename R::Action;
};
template <class R>
  requires requires { typename R::AppliedAction; }
struct AppliedActionTraits<R> {
  using Type = typename R::AppliedAction;
};

}  // namespace detail

/// The type of the action that robot R applies: its AppliedAction, or its Action if it has no
/// AppliedAction.
template <class R>
using AppliedActionOf = typename detail::AppliedActionTraits<R>::Type;

template <class R>
concept Robot =
    Described<typename R::Action> && Described<typename R::Observation> &&
    Described<AppliedActionOf<R>> && std::convertible_to<decltype(R::kType), std::string_view>;

/// The types of a robot, known at run time.
struct RobotTypes {
  std::string type;
  ElementDescription action;
  ElementDescription applied_action;
  ElementDescription observation;
  /// The bytes of `Action{}`: what a new action holds before the user fills it in.
  std::vector<std::byte> default_action;
};

namespace detail {

template <Described T>
std::vector<std::byte> bytes_of(const T& value) {
  const auto* begin = reinterpret_cast<const std::byte*>(&value);
  return {begin, begin + sizeof(T)};
}

}  // namespace detail

template <Robot R>
[[nodiscard]] const RobotTypes& describe_robot() {
  static const RobotTypes description{
      .type = std::string(R::kType),
      .action = describe<typename R::Action>(),
      .applied_action = describe<AppliedActionOf<R>>(),
      .observation = describe<typename R::Observation>(),
      .default_action = detail::bytes_of(typename R::Action{}),
  };
  return description;
}

}  // namespace trifinger
