// SPDX-License-Identifier: BSD-3-Clause
#include "json.hpp"

#include <fmt/core.h>

#include <cmath>

namespace trifinger::apps {
namespace {

// `text` moved to the right by two spaces behind its first line.
std::string indented(const std::string& text) {
  std::string result;
  for (const char c : text) {
    result += c;
    if (c == '\n') result += "  ";
  }
  return result;
}

std::string joined(char open, const std::vector<std::string>& parts, char close) {
  std::string text(1, open);
  for (const std::string& part : parts) {
    text += (text.size() == 1 ? "\n  " : ",\n  ") + indented(part);
  }
  if (!parts.empty()) text += '\n';
  return text + close;
}

}  // namespace

Json::Json(double value) : text_(std::isfinite(value) ? fmt::format("{}", value) : "null") {}

Json::Json(std::string_view value) {
  text_ = "\"";
  for (const char c : value) {
    if (c == '"' || c == '\\') {
      text_ += '\\';
      text_ += c;
    } else if (static_cast<unsigned char>(c) < 0x20U) {
      text_ += fmt::format("\\u{:04x}", static_cast<unsigned>(c));
    } else {
      text_ += c;
    }
  }
  text_ += '"';
}

Json Json::array(const std::vector<Json>& values) {
  std::vector<std::string> parts;
  parts.reserve(values.size());
  for (const Json& value : values) parts.push_back(value.text());
  Json json;
  json.text_ = joined('[', parts, ']');
  return json;
}

Json Json::object(const std::vector<std::pair<std::string, Json>>& entries) {
  std::vector<std::string> parts;
  parts.reserve(entries.size());
  for (const auto& [key, value] : entries) parts.push_back(Json(key).text() + ": " + value.text());
  Json json;
  json.text_ = joined('{', parts, '}');
  return json;
}

}  // namespace trifinger::apps
