// SPDX-License-Identifier: BSD-3-Clause
#include "trifinger/base/text.hpp"

#include <gtest/gtest.h>

#include <exception>
#include <limits>
#include <stdexcept>
#include <string>

namespace trifinger {
namespace {

TEST(Utf8, TellsCharactersFromOtherBytes) {
  EXPECT_EQ(utf8_length("a"), 1U);
  EXPECT_EQ(utf8_length("\u00e4b"), 2U);
  EXPECT_EQ(utf8_length("\u20ac"), 3U);
  EXPECT_EQ(utf8_length("\U0001f916"), 4U);
  for (const char* const none :
       {"", "\x80", "\xc3", "\xc0\xaf", "\xed\xa0\x80", "\xf5\x80\x80\x80"}) {
    EXPECT_EQ(utf8_length(none), 0U);
  }
  EXPECT_TRUE(is_utf8("joint \u2116 3"));
  EXPECT_FALSE(is_utf8("joint \xe2\x84"));
}

TEST(FixedText, IsMadeOfTextsAndNumbers) {
  FixedText text("joint ");
  text.append(std::size_t{3})
      .append(" is ")
      .append(0.1)
      .append(" rad, or ")
      .append(std::numeric_limits<double>::quiet_NaN());
  EXPECT_EQ(text.view(), "joint 3 is 0.1 rad, or nan");
  EXPECT_EQ(FixedText().view(), "");
}

TEST(FixedText, IsOneLineOfUtf8WhateverIsAppended) {
  EXPECT_EQ(FixedText("a\nb\tc\x7f\u009bd").view(), "a b c  d");
  EXPECT_EQ(FixedText("\xff\u00e4\xc3").view(), "?\u00e4?");
}

TEST(FixedText, MarksWhatItCutsOff) {
  const std::string fits(FixedText::kCapacity, 'x');
  EXPECT_EQ(FixedText(fits).view(), fits);
  FixedText cut(fits + "y");
  EXPECT_EQ(cut.view(), fits.substr(3) + "...");
  // Text that is appended after the cut must not look as if it belonged there.
  EXPECT_EQ(cut.append("z").view(), fits.substr(3) + "...");
}

TEST(FixedText, CutsOffNoHalfCharacter) {
  for (std::size_t before = 0; before < 8; ++before) {
    std::string text(before, 'x');
    while (text.size() <= FixedText::kCapacity) text += "\U0001f916";
    const FixedText cut(text);
    EXPECT_TRUE(is_utf8(cut.view())) << before;
    EXPECT_TRUE(cut.view().ends_with("\U0001f916...")) << before;
    EXPECT_LE(cut.view().size(), FixedText::kCapacity);
    EXPECT_GT(cut.view().size(), FixedText::kCapacity - 4);
  }
}

TEST(FixedText, SaysWhatWasThrown) {
  const auto text_of = [](const auto& thrown) {
    try {
      std::rethrow_exception(std::make_exception_ptr(thrown));
    } catch (...) {
      return std::string(FixedText("hold ").append_exception().view());
    }
  };
  EXPECT_EQ(text_of(std::runtime_error("out of order")), "hold threw an exception: out of order");
  EXPECT_EQ(text_of(std::runtime_error("")), "hold threw an exception without a text");
  EXPECT_EQ(text_of(3), "hold threw an object that is no std::exception, so there is no text");
}

}  // namespace
}  // namespace trifinger
