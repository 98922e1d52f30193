#include "server/base/yaml_file.h"

#include <gtest/gtest.h>

#include "tests/support/refusal.h"

namespace trammel {
namespace {

using test::Refusal;
using test::refusal_of;

std::string repeated(const std::string& part, int times) {
  std::string text;
  for (int i = 0; i < times; ++i) text += part;
  return text;
}

/// The result of reading all keys of the text.
Result<std::size_t> keys_of(const std::string& text) {
  return read_yaml(text, "x.yaml", [](const YamlMap& map) { return map.keys().size(); });
}

TEST(YamlFile, WhatPeopleWritePasses) {
  EXPECT_EQ(keys_of("a: 1\nb: {c: [1, 2, {d: e}]}\n").value(), 2u);
  EXPECT_EQ(keys_of("a: &here {x: 1}\nb: *here\n").value(), 2u);
}

TEST(YamlFile, WhatNobodyWritesIsRefusedBeforeItIsBuilt) {
  const auto too_large = [](double count, double limit) {
    return Refusal("x.yaml").of(ErrorCode::kTooLarge).beyond(count, limit);
  };
  const std::vector<std::pair<std::string, Refusal>> wrong = {
      {"a: " + std::string(1 << 20, 'x'), too_large(1048579, 1048576)},
      {repeated("[", 1'000'000), too_large(21, 20)},
      {"a: " + repeated("[", 21) + repeated("]", 21), too_large(21, 20)},
      {repeated("{a: ", 200'000), too_large(21, 20)},
      {repeated("- ", 500'000), too_large(21, 20)},
      {repeated("? ", 500'000), too_large(21, 20)},
      {"a: [" + repeated("1,", 30'000) + "1]", too_large(20001, 20000)},
      {"a: &a 1\nb: [" + repeated("*a, ", 101) + "]", too_large(101, 100)}};
  for (const auto& [text, expected] : wrong)
    EXPECT_EQ(refusal_of(keys_of(text)), expected) << text.substr(0, 20);
}

TEST(YamlFile, ARefusalHasTheLineAndTheWayToItsKey) {
  const auto weight = [](const YamlMap& map) {
    return map.map("tools").maps("list").at(1).number("mass_kg");
  };
  const auto refused = [&](const std::string& text) {
    return refusal_of(read_yaml(text, "x.yaml", weight));
  };
  EXPECT_EQ(
      refused("a: 1\ntools:\n  list:\n    - {mass_kg: 1}\n    - b: 2\n      mass_kg: heavy\n"),
      Refusal("x.yaml", 6, "tools: list 2: mass_kg").text("heavy"));
  EXPECT_EQ(refused("tools: {list: [{}, {b: 2}]}\n"),
            Refusal("x.yaml", 1, "tools: list 2: mass_kg"));
  EXPECT_EQ(refused("a: 1\ntools: [1\n"), Refusal("x.yaml", 3));
}

TEST(YamlFile, AllThatIsWrongIsToldAtOnce) {
  const auto read = read_yaml("a: 1\nbb: x\ncc: y\n", "x.yaml", [](const YamlMap& map) {
    map.only({"a", "bb", "cc2"});
    map.attempt([&] { static_cast<void>(map.number("bb")); });
    return map.number("a");
  });
  ASSERT_FALSE(read);
  const std::vector<Error> each = apart(read.error());
  ASSERT_EQ(each.size(), 2u);
  EXPECT_EQ(Refusal(each[0]), Refusal("x.yaml", 3, "cc"));
  EXPECT_EQ(Refusal(each[1]), Refusal("x.yaml", 2, "bb").text("x"));
}

TEST(YamlFile, AliasesThatUnfoldToBillionsAreHarmless) {
  std::string text = "a0: &a0 [x, x]\n";
  for (int i = 1; i <= 30; ++i) text += fmt::format("a{0}: &a{0} [*a{1}, *a{1}]\n", i, i - 1);
  EXPECT_EQ(keys_of(text).value(), 31u);
  EXPECT_FALSE(keys_of("&self [*self]"));
}

TEST(YamlFile, ASyntaxErrorHasItsColumn) {
  const auto read = keys_of("a: 1\nb: [1, 2}\n");
  ASSERT_FALSE(read);
  EXPECT_EQ(sentence(read.error()).substr(0, 23), "x.yaml row 2: column 9:");
}

TEST(YamlFile, TextThatIsNoneAndNumbersBeyondReasonAreRefused) {
  const auto text = [](const YamlMap& map) { return map.text("a"); };
  const auto number = [](const YamlMap& map) { return map.number("a"); };
  const auto refused_text = [&](const std::string& yaml) {
    return refusal_of(read_yaml(yaml, "x.yaml", text));
  };
  EXPECT_EQ(refused_text("a: \xff\n"), Refusal("x.yaml"));
  EXPECT_EQ(refused_text("a: \"\\e[2J\"\n"), Refusal("x.yaml", 1, "a").text("\\u001b[2J"));
  EXPECT_EQ(refused_text("a: \"b\\nc\"\n"), Refusal("x.yaml", 1, "a").text("b\\u000ac"));
  EXPECT_EQ(refused_text("a: Fräser\n"), Refusal::none());
  EXPECT_FALSE(keys_of("\"a\\eb\": 1\n"));
  EXPECT_EQ(refusal_of(read_yaml("a: 1e300\n", "x.yaml", number)),
            Refusal("x.yaml", 1, "a").beyond(1e300, 1e12));
  EXPECT_EQ(refusal_of(read_yaml("a: .inf\n", "x.yaml", number)),
            Refusal("x.yaml", 1, "a").text(".inf"));
}

TEST(YamlFile, AnyBytesEndInAnAnswer) {
  const std::string good =
      "version: 1\ncell: a\nlist: [1, {b: \"c\"}, 'd']\nmap:\n  - x\n  - &y {z: 1}\n  - *y\n";
  for (std::size_t i = 0; i < good.size(); ++i) {
    static_cast<void>(keys_of(good.substr(0, i)));
    for (const char c :
         {'\0', '\n', '[', '{', '&', '*', '!', '%', '\xff', '"', '?', ':', '-', '|'}) {
      std::string text = good;
      text[i] = c;
      static_cast<void>(keys_of(text));
    }
  }
}

}  // namespace
}  // namespace trammel
