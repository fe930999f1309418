// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <charconv>
#include <cstddef>
#include <cstdint>
#include <map>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <system_error>
#include <vector>

#include "trifinger/base/time.hpp"
#include "trifinger/core/fault.hpp"
#include "trifinger/log/session_header.hpp"
#include "trifinger/mcap/records.hpp"

// The records of a log, which are metadata of its MCAP file; docs/log_format.md lists them.
namespace trifinger::log::detail {

inline constexpr const char* kLogRecord = "trifinger.log";
inline constexpr const char* kSessionRecord = "trifinger.session";
inline constexpr const char* kEndRecord = "trifinger.end";
inline constexpr const char* kGapRecord = "trifinger.gap";

using Entries = std::map<std::string, std::string>;

// ---- writing ----

[[nodiscard]] mcap::Metadata session_record(const SessionHeader& header);
[[nodiscard]] mcap::Metadata end_record(const SessionHeader& header, TimeIndex steps,
                                        TimeIndex observations, const Fault& fault,
                                        std::string_view fault_text);
// Says that the steps or elements `first` to `last` of the session or companion `name` are missing.
[[nodiscard]] mcap::Metadata gap_record(const std::string& name, std::uint64_t session_id,
                                        TimeIndex first, TimeIndex last, std::string_view reason);
[[nodiscard]] std::string hexadecimal(std::span<const std::byte> bytes);

// ---- reading ----

// Returns the text of an entry; an empty one if it is missing.
[[nodiscard]] std::string entry_of(const Entries& entries, const std::string& key);
// Inverse of `hexadecimal`. Other characters read as 0.
[[nodiscard]] std::vector<std::byte> bytes_of(std::string_view digits);
// Splits a text at its spaces.
[[nodiscard]] std::vector<std::string> words_of(const std::string& text);
// Returns nothing if the text is not a number.
template <class Number>
[[nodiscard]] std::optional<Number> number_of(std::string_view text) {
  Number number = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), number);
  if (error != std::errc{} || end != text.data() + text.size()) return std::nullopt;
  return number;
}

// The entries of a record, converted to their types. Functions throw InvalidArgument if an entry
// cannot be converted.
class RecordEntries {
 public:
  explicit RecordEntries(const mcap::Metadata& record) : record_(record) {}

  [[nodiscard]] std::string text(const std::string& key) const {
    return entry_of(record_.entries, key);
  }
  [[nodiscard]] std::int64_t integer(const std::string& key) const;
  [[nodiscard]] std::uint64_t session_id() const;
  [[nodiscard]] std::string name() const;
  // Converts a session's record. The result lacks companions, documents and all types but the name.
  [[nodiscard]] SessionHeader session_header() const;

 private:
  [[noreturn]] void throw_wrong(const std::string& key) const;

  const mcap::Metadata& record_;
};

}  // namespace trifinger::log::detail
