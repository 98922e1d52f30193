#include "server/base/plain_text.h"

#include <gtest/gtest.h>

#include "server/base/name_check.h"
#include "tests/support/refusal.h"

namespace trammel {
namespace {

using test::Refusal;
using test::refusal_of;

Refusal refusal_of_part(const std::string& name) {
  const Status fine = check_name(name, "pose_id");
  return refusal_of(fine);
}

TEST(PlainText, NamesOfAnyLanguagePass) {
  for (const char* name :
       {"", "p1", "lt-07 (2)", "Fräser", "工具", "Ω", "🤖", "a\\b'\"`", "\xc2\xa0x"}) {
    EXPECT_TRUE(is_plain(name)) << name;
    EXPECT_EQ(refusal_of_part(name), Refusal::none()) << name;
    EXPECT_EQ(shown(name), name);
  }
}

TEST(PlainText, ANameThatControlsATerminalOrIsNoTextIsRefusedAndShownHarmless) {
  const std::vector<std::pair<std::string, std::string>> wrong = {
      {"\x1b[2J", "\\u001b[2J"},
      {"a\nb", "a\\u000ab"},
      {"a\tb", "a\\u0009b"},
      {std::string("a\0b", 3), "a\\u0000b"},
      {"\x7f", "\\u007f"},
      {"\xc2\x9b"
       "31m",
       "\\u009b31m"},                      // the one-character form of ESC [
      {"\xe2\x80\xae", "\\u202e"},         // what follows is written from right to left
      {"\xe2\x80\xa8", "\\u2028"},         // a line separator
      {"\xef\xbb\xbf", "\\ufeff"},         // a mark that nobody sees
      {"a\xe2\x80\x8b", "a\\u200b"},       // a space without width
      {"\xe2\x81\xa0", "\\u2060"},         // a joiner that nobody sees
      {"\xc2\xad", "\\u00ad"},             // a hyphen that nobody sees
      {"\xef\xb8\x8f", "\\ufe0f"},         // a selector of variants
      {"\xf3\xa0\x81\x81", "\\ue0041"},    // a tag
      {"\xef\xb7\x90", "\\ufdd0"},         // no character
      {"\xef\xbf\xbf", "\\uffff"},         // no character
      {"\xf0\x9f\xbf\xbe", "\\u1fffe"},    // no character
      {"\xff", "\\xff"},                   // no UTF-8 at all
      {"\xc3", "\\xc3"},                   // cut
      {"\xc0\xaf", "\\xc0\\xaf"},          // overlong
      {"\xed\xa0\x80", "\\xed\\xa0\\x80"}  // half a surrogate pair
  };
  for (const auto& [name, harmless] : wrong) {
    EXPECT_FALSE(is_plain(name)) << harmless;
    EXPECT_EQ(refusal_of_part(name), Refusal("", {}, "pose_id").text(harmless));
    EXPECT_EQ(shown(name), harmless);
    EXPECT_EQ(shown(shown(name)), harmless);
  }
}

TEST(PlainText, ANameHasALimit) {
  EXPECT_EQ(refusal_of_part(std::string(256, 'x')), Refusal::none());
  EXPECT_EQ(refusal_of_part(std::string(257, 'x')),
            Refusal("", {}, "pose_id").of(ErrorCode::kTooLarge).beyond(257, 256));
}

TEST(PlainText, LinesStayLinesAndNothingElse) {
  EXPECT_TRUE(is_plain_lines("a\tb\r\nc"));
  EXPECT_FALSE(is_plain_lines("a\x1b"));
  EXPECT_EQ(shown_lines("a\tb\r\nc"), "a\tb\\u000d\nc");
}

TEST(PlainText, AShortFormCutsBetweenCharacters) {
  EXPECT_EQ(shown_short("abcdef", 6), "abcdef");
  EXPECT_EQ(shown_short("abcdefg", 6), "abcdef...");
  EXPECT_EQ(shown_short("aaµµµ", 3), "aa...");
}

TEST(PlainText, TheSentenceOfARefusalControlsNoTerminalWhateverItQuotes) {
  const Error error =
      refused("unknown tool '{}'", "\x1b]0;owned\a").in("lt\x1b[31m.csv").next("\xff").value();
  EXPECT_EQ(sentence(error), "lt\\u001b[31m.csv: unknown tool '\\u001b]0;owned\\u0007'; \\xff");
}

}  // namespace
}  // namespace trammel
