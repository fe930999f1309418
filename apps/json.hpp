// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <type_traits>
#include <utility>
#include <vector>

namespace trifinger::apps {

// A value of JSON, made in the order in which it is to be printed.
class Json {
 public:
  Json(std::nullptr_t) : text_("null") {}
  Json(bool value) : text_(value ? "true" : "false") {}
  Json(double value);
  Json(std::string_view value);
  Json(const std::string& value) : Json(std::string_view(value)) {}
  Json(const char* value) : Json(std::string_view(value)) {}
  template <class Integer>
    requires std::is_integral_v<Integer>
  Json(Integer value) : text_(std::to_string(value)) {}

  [[nodiscard]] static Json array(const std::vector<Json>& values);
  [[nodiscard]] static Json object(const std::vector<std::pair<std::string, Json>>& entries);

  [[nodiscard]] const std::string& text() const noexcept { return text_; }

 private:
  Json() = default;

  std::string text_;
};

}  // namespace trifinger::apps
