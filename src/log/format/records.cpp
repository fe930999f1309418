// SPDX-License-Identifier: BSD-3-Clause
#include "log/format/records.hpp"

#include <sstream>

#include "trifinger/base/error.hpp"

namespace trifinger::log::detail {

mcap::Metadata session_record(const SessionHeader& header) {
  std::string companions;
  std::string first_indices;
  for (const SessionHeader::Companion& companion : header.companions) {
    const std::string separator = companions.empty() ? "" : " ";
    companions += separator + companion.name;
    first_indices += separator + std::to_string(companion.first_index);
  }
  mcap::Metadata record{kSessionRecord,
                        {{"name", header.name},
                         {"type", header.types.type},
                         {"session_id", std::to_string(header.session_id)},
                         {"is_real_time", header.is_real_time ? "1" : "0"},
                         {"period", std::to_string(header.period.count())},
                         {"created", std::to_string(header.created)},
                         {"host", header.host},
                         {"backend_pid", std::to_string(header.backend_pid)},
                         {"time_offset", std::to_string(header.time_offset)},
                         {"companions", companions},
                         {"companion_first_indices", first_indices},
                         {"first_index", std::to_string(header.first_index)}}};
  if (header.realtime_warnings) {
    std::string& warnings = record.entries["realtime_lacks"];
    for (const std::string& sentence : *header.realtime_warnings) warnings += sentence + "\n";
  }
  return record;
}

mcap::Metadata end_record(const SessionHeader& header, TimeIndex steps, TimeIndex observations,
                          const Fault& fault, std::string_view fault_text) {
  return {kEndRecord,
          {{"name", header.name},
           {"session_id", std::to_string(header.session_id)},
           {"steps", std::to_string(steps)},
           {"observations", std::to_string(observations)},
           {"fault_code", std::to_string(static_cast<int>(fault.code))},
           {"fault", std::string(name_of(fault.code))},
           {"fault_detail", std::to_string(fault.detail)},
           {"fault_time_index", std::to_string(fault.time_index)},
           {"fault_text", std::string(fault_text)}}};
}

mcap::Metadata gap_record(const std::string& name, std::uint64_t session_id, TimeIndex first,
                          TimeIndex last, std::string_view reason) {
  return {kGapRecord,
          {{"name", name},
           {"session_id", std::to_string(session_id)},
           {"first", std::to_string(first)},
           {"last", std::to_string(last)},
           {"reason", std::string(reason)}}};
}

std::string hexadecimal(std::span<const std::byte> bytes) {
  constexpr std::string_view kDigits = "0123456789abcdef";
  std::string text;
  for (const std::byte byte : bytes) {
    const auto value = std::to_integer<unsigned>(byte);
    text += kDigits[value / 16];
    text += kDigits[value % 16];
  }
  return text;
}

std::string entry_of(const Entries& entries, const std::string& key) {
  const auto entry = entries.find(key);
  return entry == entries.end() ? std::string() : entry->second;
}

std::vector<std::byte> bytes_of(std::string_view digits) {
  std::vector<std::byte> bytes(digits.size() / 2);
  for (std::size_t i = 0; i < bytes.size(); ++i) {
    unsigned value = 0;
    std::from_chars(digits.data() + 2 * i, digits.data() + 2 * i + 2, value, 16);
    bytes[i] = static_cast<std::byte>(value);
  }
  return bytes;
}

std::vector<std::string> words_of(const std::string& text) {
  std::istringstream stream(text);
  std::vector<std::string> words;
  for (std::string word; stream >> word;) words.push_back(word);
  return words;
}

std::int64_t RecordEntries::integer(const std::string& key) const {
  const auto number = number_of<std::int64_t>(text(key));
  if (!number) throw_wrong(key);
  return *number;
}

std::uint64_t RecordEntries::session_id() const {
  const auto number = number_of<std::uint64_t>(text("session_id"));
  if (!number) throw_wrong("session_id");
  return *number;
}

std::string RecordEntries::name() const {
  std::string name = text("name");
  if (name.empty()) throw_wrong("name");
  return name;
}

SessionHeader RecordEntries::session_header() const {
  SessionHeader header;
  header.name = name();
  header.session_id = session_id();
  header.is_real_time = integer("is_real_time") != 0;
  if (record_.entries.contains("realtime_lacks")) {
    std::istringstream warnings(text("realtime_lacks"));
    header.realtime_warnings.emplace();
    for (std::string sentence; std::getline(warnings, sentence);) {
      header.realtime_warnings->push_back(sentence);
    }
  }
  header.period = Nanoseconds(integer("period"));
  header.created = integer("created");
  header.time_offset = integer("time_offset");
  header.host = text("host");
  header.backend_pid = integer("backend_pid");
  header.first_index = integer("first_index");
  header.types.type = text("type");
  return header;
}

void RecordEntries::throw_wrong(const std::string& key) const {
  throw InvalidArgument("The record '" + record_.name + "' says '" + text(key) + "' for '" + key +
                        "'");
}

}  // namespace trifinger::log::detail
