// SPDX-License-Identifier: BSD-3-Clause
#include "boards/emulated_fault.hpp"

#include <algorithm>
#include <array>
#include <charconv>
#include <chrono>
#include <cmath>
#include <sstream>
#include <vector>

#include "base/suggestion.hpp"
#include "trifinger/base/error.hpp"

namespace trifinger::boards {
namespace {

using Kind = EmulatedFault::Kind;
using Words = std::vector<std::string_view>;

// A text that is understood. Words in capitals stand for: N, M a number; P a share in percent; R a
// rate; A an angle; F a factor; T a time; ERROR the name of an error.
struct Pattern {
  Kind kind;
  std::string_view text;
  bool may_last{true};  // "for T s" may follow
};

constexpr std::array kPatterns{
    Pattern{Kind::kPowerOff, "power off"},
    Pattern{Kind::kPowerOff, "emergency stop"},
    Pattern{Kind::kPowerOn, "power on", false},
    Pattern{Kind::kBoardOff, "board N off"},
    Pattern{Kind::kBoardRestart, "board N restarts", false},
    Pattern{Kind::kBoardRollover, "board N near rollover", false},
    Pattern{Kind::kBoardSilent, "board N silent"},
    Pattern{Kind::kBoardError, "board N error ERROR", false},
    Pattern{Kind::kBusLoses, "bus N loses P %"},
    Pattern{Kind::kBusDuplicates, "bus N duplicates P %"},
    Pattern{Kind::kBusDelays, "bus N delays P % by T s"},
    Pattern{Kind::kBusCorrupts, "bus N corrupts P %"},
    Pattern{Kind::kBusFlooded, "bus N flooded with R frames/s"},
    Pattern{Kind::kBusFull, "bus N full"},
    Pattern{Kind::kBusOff, "bus N off"},
    Pattern{Kind::kBusDown, "bus N down"},
    Pattern{Kind::kBusGone, "bus N gone", false},
    Pattern{Kind::kJointJumps, "joint N jumps by A rad"},
    Pattern{Kind::kJointStuck, "joint N stuck"},
    Pattern{Kind::kJointNoisy, "joint N noisy by A rad"},
    Pattern{Kind::kJointHot, "joint N draws F times the current"},
    Pattern{Kind::kJointLoose, "joint N loose"},
    Pattern{Kind::kJointReversed, "joint N reversed"},
    Pattern{Kind::kJointsSwapped, "joints N and M swapped"},
};

bool is_slot(std::string_view word) { return word.front() >= 'A' && word.front() <= 'Z'; }

Words split(std::string_view text) {
  Words words;
  std::size_t begin = 0;
  while ((begin = text.find_first_not_of(" \t", begin)) != std::string_view::npos) {
    std::size_t end = std::min(text.find_first_of(" \t", begin), text.size());
    // A unit may follow its number at once: "5s", "1%".
    const std::string_view word = text.substr(begin, end - begin);
    const std::size_t number = word.find_first_not_of("0123456789.+-");
    if (number != std::string_view::npos && number > 0) end = begin + number;
    words.push_back(text.substr(begin, end - begin));
    begin = end;
  }
  return words;
}

std::optional<double> number_of(std::string_view word) {
  double value = 0.0;
  const auto [end, error] = std::from_chars(word.data(), word.data() + word.size(), value);
  if (error != std::errc{} || end != word.data() + word.size() || !std::isfinite(value)) return {};
  return value;
}

std::optional<can::BoardError> error_of(std::string_view word) {
  for (int code = 1; code < 8; ++code) {
    const auto error = static_cast<can::BoardError>(code);
    if (can::text_of(error).name == word) return error;
  }
  return {};
}

// Takes the value of a slot. False if the word is none, or not within the bounds.
bool take(std::string_view slot, std::string_view word, EmulatedFault& fault) {
  constexpr double kLongest = 1e6;  // [s]
  if (slot == "ERROR") {
    const auto error = error_of(word);
    fault.error = error.value_or(can::BoardError::kNone);
    return error.has_value();
  }
  const std::optional<double> value = number_of(word);
  if (!value) return false;
  const auto is_within = [&](double least, double most) {
    return *value >= least && *value <= most;
  };
  switch (slot.front()) {
    case 'N':
    case 'M':
      if (!is_within(0, 99) || *value != std::floor(*value)) return false;
      (slot == "N" ? fault.number : fault.other) = static_cast<std::size_t>(*value);
      return true;
    case 'P':
      fault.amount = *value / 100.0;
      return is_within(0, 100);
    case 'T':
      fault.time = std::chrono::round<Nanoseconds>(
          std::chrono::duration<double>(std::clamp(*value, 0.0, kLongest)));
      return is_within(0, kLongest);
    case 'R':
      fault.amount = *value;
      return is_within(1, 1e6);
    default:  // A, F
      fault.amount = *value;
      return is_within(-100, 100);
  }
}

std::string_view name_of_slot(std::string_view slot) {
  if (slot == "P") return "a share from 0 to 100";
  if (slot == "T") return "a time in seconds, 0 to 1000000";
  if (slot == "R") return "a rate from 1 to 1000000";
  if (slot == "A") return "an angle in rad, -100 to 100";
  if (slot == "F") return "a factor, -100 to 100";
  return "a whole number from 0 to 99";
}

// Compares words with patterns and remembers how far the best got.
class Matcher {
 public:
  explicit Matcher(std::string_view text) : text_(text), words_(split(text)) {}

  // True if the words from `place` on begin with the pattern; then `place` is after it.
  bool match(std::string_view pattern, std::size_t& place, EmulatedFault& fault) {
    std::size_t at = place;
    for (const std::string_view wanted : split(pattern)) {
      const bool is_there = at < words_.size();
      const bool fits =
          is_there && (is_slot(wanted) ? take(wanted, words_[at], fault) : words_[at] == wanted);
      if (!fits) {
        expect(at, wanted);
        return false;
      }
      ++at;
    }
    place = at;
    return true;
  }
  [[nodiscard]] bool is_end(std::size_t place) {
    if (place == words_.size()) return true;
    expect(place, {});
    return false;
  }

  [[noreturn]] void fail() const {
    std::string text = "fault '" + std::string(text_) + "': ";
    const bool is_missing = furthest_ >= words_.size();
    text += is_missing ? "something is missing at its end"
                       : "'" + std::string(words_[furthest_]) + "' is not understood";
    if (furthest_ > 0 && !is_missing) {
      text += " after '" + std::string(words_[furthest_ - 1]) + "'";
    }
    if (!is_missing) {
      if (const auto similar = closest(words_[furthest_], expected_); !similar.empty()) {
        text += "; did you mean '" + std::string(similar) + "'";
      }
    }
    std::string allowed = slots_;
    if (!expected_.empty()) {
      allowed += (allowed.empty() ? "" : ", or ") + quoted_list(expected_, "or");
    }
    throw InvalidArgument(text +
                          (allowed.empty() ? "; nothing may follow" : "; expected is " + allowed));
  }

 private:
  void expect(std::size_t place, std::string_view wanted) {
    if (place < furthest_) return;
    if (place > furthest_) {
      expected_.clear();
      slots_.clear();
    }
    furthest_ = place;
    if (wanted.empty()) return;
    if (wanted == "ERROR") {
      for (int code = 1; code < 8; ++code) {
        expected_.push_back(can::text_of(static_cast<can::BoardError>(code)).name);
      }
    } else if (is_slot(wanted)) {
      slots_ = name_of_slot(wanted);
    } else if (std::ranges::find(expected_, wanted) == expected_.end()) {
      expected_.push_back(wanted);
    }
  }

  std::string_view text_;
  Words words_;
  std::size_t furthest_{0};
  Words expected_;
  std::string slots_;
};

}  // namespace

EmulatedFault parse_fault(std::string_view text) {
  Matcher matcher(text);
  for (const Pattern& pattern : kPatterns) {
    EmulatedFault fault{.kind = pattern.kind};
    std::size_t place = 0;
    if (!matcher.match(pattern.text, place, fault)) continue;
    EmulatedFault begin;
    if (matcher.match("at T s", place, begin)) fault.at = begin.time;
    EmulatedFault end;
    if (pattern.may_last && matcher.match("for T s", place, end)) fault.duration = end.time;
    if (matcher.is_end(place)) return fault;
  }
  matcher.fail();
}

std::string fault_texts() {
  std::ostringstream lines;
  for (const Pattern& pattern : kPatterns) {
    lines << pattern.text << " [at T s]" << (pattern.may_last ? " [for T s]" : "") << "\n";
  }
  return lines.str();
}

}  // namespace trifinger::boards
