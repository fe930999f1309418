// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <string>
#include <string_view>
#include <vector>

#include "log/read/log_data.hpp"
#include "trifinger/core/description.hpp"
#include "trifinger/core/session.hpp"
#include "trifinger/log/log.hpp"

namespace trifinger::log::detail {

// Returns the layout of the elements of `series`. Throws InvalidArgument if `stream` has none.
[[nodiscard]] const ElementDescription& element_of(const Stream& stream, Series series);

// Reads the elements of one column from messages.
class ColumnReader {
 public:
  // Throws InvalidArgument if the stream does not have the column.
  ColumnReader(const Stream& stream, const Column& column);

  [[nodiscard]] const ElementDescription& element() const noexcept { return element_; }
  void read(const StreamMessage& found, std::byte* element);

 private:
  struct Copy {
    std::size_t from;
    std::size_t to;
    std::size_t size;
  };

  Series series_;
  ElementDescription element_;
  std::vector<std::byte> scratch_;  // a whole element, where only some fields are wanted
  std::vector<Copy> copies_;
};

// Joins names, as in "'a' and 'b'". Returns "none" if there are none.
[[nodiscard]] std::string list_of(const std::vector<std::string_view>& names);

}  // namespace trifinger::log::detail
