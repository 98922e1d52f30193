#include "server/base/yaml_file.h"

#include <gtest/gtest.h>

namespace trammel {
namespace {

std::string repeated(const std::string& part, int times) {
  std::string text;
  for (int i = 0; i < times; ++i) text += part;
  return text;
}

/// What reading all keys of the text ends with.
Result<std::size_t> keys_of(const std::string& text) {
  return read_yaml(text, "x.yaml", [](const YamlMap& map) { return map.keys().size(); });
}

TEST(YamlFile, WhatPeopleWritePasses) {
  EXPECT_EQ(keys_of("a: 1\nb: {c: [1, 2, {d: e}]}\n").value(), 2u);
  EXPECT_EQ(keys_of("a: &here {x: 1}\nb: *here\n").value(), 2u);
}

TEST(YamlFile, WhatNobodyWritesIsRefusedBeforeItIsBuilt) {
  const std::vector<std::pair<std::string, std::string>> wrong = {
      {"a: " + std::string(1 << 20, 'x'), "bytes, limit 1048576"},
      {repeated("[", 1'000'000), "inside one another"},
      {"a: " + repeated("[", 21) + repeated("]", 21), "inside one another, limit 20"},
      {repeated("{a: ", 200'000), "inside one another"},
      {repeated("- ", 500'000), "inside one another"},
      {repeated("? ", 500'000), "inside one another"},
      {"a: [" + repeated("1,", 30'000) + "1]", "20001 entries, limit 20000"},
      {"a: &a 1\nb: [" + repeated("*a, ", 101) + "]", "101 aliases, limit 100"}};
  for (const auto& [text, part] : wrong) {
    const Result<std::size_t> keys = keys_of(text);
    ASSERT_FALSE(keys) << part;
    EXPECT_NE(keys.error().message.find(part), std::string::npos) << keys.error().message;
    EXPECT_EQ(keys.error().message.rfind("x.yaml", 0), 0u) << keys.error().message;
  }
}

TEST(YamlFile, AliasesThatUnfoldToBillionsAreHarmless) {
  std::string text = "a0: &a0 [x, x]\n";
  for (int i = 1; i <= 30; ++i) text += fmt::format("a{0}: &a{0} [*a{1}, *a{1}]\n", i, i - 1);
  EXPECT_EQ(keys_of(text).value(), 31u);
  EXPECT_FALSE(keys_of("&self [*self]"));
}

TEST(YamlFile, AnyBytesEndInAnAnswer) {
  const std::string good = "version: 1\ncell: a\nlist: [1, {b: \"c\"}, 'd']\nmap:\n  - x\n  - &y {z: 1}\n  - *y\n";
  for (std::size_t i = 0; i < good.size(); ++i) {
    static_cast<void>(keys_of(good.substr(0, i)));
    for (const char c : {'\0', '\n', '[', '{', '&', '*', '!', '%', '\xff', '"', '?', ':', '-', '|'}) {
      std::string text = good;
      text[i] = c;
      static_cast<void>(keys_of(text));
    }
  }
}

}  // namespace
}  // namespace trammel
