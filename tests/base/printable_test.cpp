// SPDX-License-Identifier: BSD-3-Clause
#include "base/printable.hpp"

#include <gtest/gtest.h>

#include <random>
#include <string>

#include "trifinger/base/text.hpp"

namespace trifinger {
namespace {

TEST(Printable, LeavesOrdinaryTextsAsTheyAre) {
  for (const std::string text : {"", "joint \u2116 3", "\\x1b is no escape", "\U0001f916 §"}) {
    EXPECT_EQ(printable(text), text);
    EXPECT_EQ(printable_lines(text), text);
  }
}

TEST(Printable, fault_78_ShowsWhatATerminalWouldObey) {
  EXPECT_EQ(printable("\x1b]0;title\x07"), "\\x1b]0;title\\x07");
  EXPECT_EQ(printable("a\u009bb\x7f"), "a\\x9bb\\x7f");
  // A literal with these would turn this line around in editors.
  const std::string right_to_left{'\xe2', '\x80', '\xae'};
  const std::string isolate{'\xe2', '\x81', '\xa6'};
  EXPECT_EQ(printable("good " + right_to_left + "evil" + isolate), "good \\u202eevil\\u2066");
  EXPECT_EQ(printable("a\xff\xc3"), "a\\xff\\xc3");
  EXPECT_EQ(printable(std::string_view("a\0b", 3)), "a\\x00b");
}

TEST(Printable, fault_78_IsOneLineUnlessLinesAreWanted) {
  EXPECT_EQ(printable("a\nb\tc\rd"), "a\\nb\\tc\\rd");
  EXPECT_EQ(printable_lines("a\nb\tc\rd"), "a\nb\tc\\rd");
}

TEST(Printable, fault_78_ShortensATextInItsMiddle) {
  const std::string text = "begin" + std::string(3 << 20, 'x') + "end";
  const std::string shown = printable(text, 12);
  EXPECT_EQ(shown, "beginxxxx… (3,145,736 characters) …end");
  EXPECT_EQ(printable(shown), shown);
  EXPECT_EQ(printable("0123456789ab", 12), "0123456789ab");
  EXPECT_LT(printable(text).size(), kMaxPrinted + 100);
  EXPECT_LT(printable_lines(text).size(), 4 * kMaxPrinted + 100);
}

TEST(Printable, fault_78_IsHarmlessUtf8WhateverTheBytesAre) {
  std::mt19937 random(1);
  for (int i = 0; i < 2000; ++i) {
    std::string bytes(random() % 40, ' ');
    for (char& byte : bytes) byte = static_cast<char>(random());
    const std::string shown = printable(bytes);
    EXPECT_TRUE(is_utf8(shown));
    for (const char byte : shown) {
      EXPECT_TRUE(static_cast<unsigned char>(byte) >= 0x20U && byte != 0x7f) << shown;
    }
    EXPECT_EQ(printable(shown), shown);
  }
}

}  // namespace
}  // namespace trifinger
