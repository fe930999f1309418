// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <nanobind/nanobind.h>

#include <cstddef>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "trifinger/core/description.hpp"

namespace trifinger::bindings {

/// Elements of one kind in NumPy: a structured dtype, single elements as records, many elements as
/// an array. Nested fields ("stamp.capture_time") are nested dtypes, so they read the same
/// in both languages.
class ElementType {
 public:
  ElementType() = default;
  /// `kind` is the class of single elements: Element, or the class of a series.
  explicit ElementType(const ElementDescription& description, const char* kind = "Element");

  [[nodiscard]] const nanobind::object& dtype() const noexcept { return dtype_; }
  /// Size of one element [bytes].
  [[nodiscard]] std::size_t size() const noexcept { return size_; }

  /// A new object and its memory, not yet filled in.
  using New = std::pair<nanobind::object, std::byte*>;
  /// One element: a record on an array of its own, so that what is written into its fields stays.
  [[nodiscard]] New new_element() const;
  [[nodiscard]] New new_array(std::size_t count) const;
  /// One element as an array without dimensions.
  [[nodiscard]] New new_scalar_array() const;
  /// The element at `memory` as an array without dimensions that cannot be written. It keeps
  /// `owner`, whose memory this is.
  [[nodiscard]] nanobind::object view(const std::byte* memory, const nanobind::object& owner) const;

  /// The memory of `element`. @throws InvalidArgument unless it is one element of exactly this type
  [[nodiscard]] const std::byte* bytes_of(nanobind::handle element) const;
  struct Elements {
    nanobind::object owner;
    const std::byte* bytes;
    std::size_t count;
  };
  /// The memory of many elements, one after the other.
  /// @throws InvalidArgument unless `elements` is a one-dimensional array of exactly this type
  [[nodiscard]] Elements contiguous(nanobind::handle elements) const;

 private:
  [[nodiscard]] bool is_same(const void* descr) const;
  [[nodiscard]] std::string expected() const;

  nanobind::object dtype_;
  std::size_t size_{0};
};

/// Finds numbers that an action must not hold: a NaN where the default action has a number. A NaN
/// says "not given", which has a meaning only where it is the default.
class NanCheck {
 public:
  NanCheck() = default;
  NanCheck(const ElementDescription& description, std::span<const std::byte> default_action);

  /// @throws InvalidArgument naming the field
  void require_numbers(const std::byte* action) const {
    for (const Run& run : runs_) {
      if (run.has_nan(action)) throw_nan(run, action);
    }
  }

 private:
  // Numbers of one field, one after the other.
  struct Run {
    std::string field;
    std::size_t first{0};  // index in the field
    std::size_t offset{0};
    std::size_t count{0};
    bool is_double{true};

    [[nodiscard]] bool has_nan(const std::byte* action) const;
    [[nodiscard]] bool is_nan(const std::byte* action, std::size_t i) const;
  };
  [[noreturn]] static void throw_nan(const Run& run, const std::byte* action);

  std::vector<Run> runs_;
};

}  // namespace trifinger::bindings
