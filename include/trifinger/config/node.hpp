// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <concepts>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "trifinger/base/error.hpp"

namespace trifinger::config {

namespace detail {
struct Element;
}

/// The place where a value was written.
struct Location {
  std::string source;  ///< The file, or "--set fingers.height" for an override.
  int line{0};         ///< Line, counted from 1; 0 for an override.
  int column{0};       ///< Column, counted from 1; 0 for an override.

  /// "robot.yml:12:3", or the source alone for an override.
  [[nodiscard]] std::string text() const;

  friend bool operator==(const Location&, const Location&) = default;
};

/// A configuration contains something that makes no sense. The text names the place, the thing, the
/// value found and the value allowed, for example "robot.yml:2:11: fingers.height is 3 m, must be
/// 0.2 to 0.5 m".
class ConfigError : public Error {
 public:
  ConfigError(Location location, const std::string& problem);

  [[nodiscard]] const Location& location() const noexcept { return location_; }

 private:
  Location location_;
};

/// The unit and the allowed range of a number. A file may write the unit after the number: "0.3 m".
/// Any other unit is an error.
struct Range {
  std::string_view unit{};  ///< SI unit; empty for a number without dimension.
  double min{-std::numeric_limits<double>::infinity()};
  double max{std::numeric_limits<double>::infinity()};
  bool above_min{false};       ///< `min` itself is out of range.
  bool allow_infinite{false};  ///< .inf and -.inf are allowed within `min` and `max`; NaN never is.
};

namespace detail {

template <class T>
struct ListTraits {
  static constexpr bool kIsList = false;
};
template <class T, std::size_t N>
struct ListTraits<std::array<T, N>> {
  static constexpr bool kIsList = true;
  static constexpr std::size_t kSize = N;
};
template <class T>
struct ListTraits<std::vector<T>> {
  static constexpr bool kIsList = true;
  static constexpr std::size_t kSize = 0;
};

}  // namespace detail

/// One value of a configuration: a scalar, a list or a section (a map).
///
/// Reading defines the schema: a section remembers the keys that were asked for, and
/// `File::reject_unknown_keys` reports the others. A node is a cheap handle that keeps the
/// configuration alive.
class Node {
 public:
  Node(std::shared_ptr<const detail::Element> element, std::string path);

  /// The place where the value was written.
  [[nodiscard]] const Location& location() const noexcept;
  /// The path of the value, "fingers.height" or "objects.0.mass"; empty for the whole
  /// configuration.
  [[nodiscard]] const std::string& path() const noexcept { return path_; }

  [[nodiscard]] bool is_list() const noexcept;
  [[nodiscard]] bool is_section() const noexcept;

  /// The value under `key`, if it exists. @throws ConfigError if this is not a section.
  [[nodiscard]] std::optional<Node> find(std::string_view key) const;
  /// The value under `key`. @throws ConfigError if it is missing; the text names the `unit`.
  [[nodiscard]] Node at(std::string_view key, std::string_view unit = "") const;
  /// The section under `key`. @throws ConfigError if it is missing or not a section.
  [[nodiscard]] Node section(std::string_view key) const;
  /// The section under `key`, if it exists. @throws ConfigError if it is not a section.
  [[nodiscard]] std::optional<Node> optional_section(std::string_view key) const;
  /// Says that the value under `key`, whatever it is, does not count here.
  void leave_out(std::string_view key) const;
  /// The entries of this list. @throws ConfigError if this is not a list.
  [[nodiscard]] std::vector<Node> items() const;

  /// The value under `key` as a T: bool, an integer, double, std::string, or a std::array or
  /// std::vector of these. `range` applies to every number in it.
  /// @throws ConfigError if it is missing, has another type or is out of range.
  template <class T>
  [[nodiscard]] T required(std::string_view key, const Range& range = {}) const {
    return at(key, range.unit).as<T>(range);
  }

  /// The value under `key` as a T, or `fallback` if the key is missing. Throws like `required`.
  template <class T>
  [[nodiscard]] T optional(std::string_view key, T fallback, const Range& range = {}) const {
    const std::optional<Node> value = find(key);
    return value ? value->as<T>(range) : std::move(fallback);
  }

  /// The value of the choice whose name is written under `key`.
  template <class Choice>
  [[nodiscard]] Choice required_choice(
      std::string_view key, const std::vector<std::pair<std::string_view, Choice>>& choices) const {
    return at(key).as_choice(choices);
  }
  template <class Choice>
  [[nodiscard]] Choice optional_choice(
      std::string_view key, Choice fallback,
      const std::vector<std::pair<std::string_view, Choice>>& choices) const {
    const std::optional<Node> value = find(key);
    return value ? value->as_choice(choices) : fallback;
  }

  /// This value as a T, with the same types and errors as `required`.
  template <class T>
  [[nodiscard]] T as(const Range& range = {}) const {
    if constexpr (detail::ListTraits<T>::kIsList) {
      const std::vector<Node> entries = items();
      T list{};
      if constexpr (detail::ListTraits<T>::kSize == 0) {
        list.resize(entries.size());
      } else {
        require_size(list.size());
      }
      for (std::size_t i = 0; i < entries.size(); ++i) {
        list[i] = entries[i].as<typename T::value_type>(range);
      }
      return list;
    } else if constexpr (std::same_as<T, bool>) {
      return as_bool();
    } else if constexpr (std::same_as<T, std::string>) {
      return as_string();
    } else if constexpr (std::integral<T>) {
      constexpr auto kLargest =
          static_cast<std::uint64_t>(std::numeric_limits<std::int64_t>::max());
      constexpr bool kFits = static_cast<std::uint64_t>(std::numeric_limits<T>::max()) <= kLargest;
      return static_cast<T>(
          as_integer(std::numeric_limits<T>::min(),
                     kFits ? static_cast<std::int64_t>(std::numeric_limits<T>::max())
                           : std::numeric_limits<std::int64_t>::max(),
                     range));
    } else {
      static_assert(std::same_as<T, double>, "no reader for this type");
      return as_number(range);
    }
  }

  template <class Choice>
  [[nodiscard]] Choice as_choice(
      const std::vector<std::pair<std::string_view, Choice>>& choices) const {
    std::vector<std::string_view> names;
    names.reserve(choices.size());
    for (const auto& choice : choices) names.push_back(choice.first);
    return choices[index_of_choice(names)].second;
  }

  /// Throws a ConfigError at this place, for checks that involve several values. `problem` follows
  /// the name of the value: "is 0.3, must be less than ...".
  [[noreturn]] void fail(const std::string& problem) const;

 private:
  [[nodiscard]] Node child(const detail::Element& element, std::string_view key) const;
  void require_section() const;
  void require_size(std::size_t size) const;
  void require_unit(std::string_view unit, std::string_view allowed) const;
  [[nodiscard]] bool as_bool() const;
  [[nodiscard]] double as_number(const Range& range) const;
  [[nodiscard]] std::int64_t as_integer(std::int64_t min, std::int64_t max,
                                        const Range& range) const;
  [[nodiscard]] std::string as_string() const;
  [[nodiscard]] std::size_t index_of_choice(const std::vector<std::string_view>& names) const;

  std::shared_ptr<const detail::Element> element_;
  std::string path_;
};

}  // namespace trifinger::config
