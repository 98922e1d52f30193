#include "tests/fuzz/mutate.h"

#include <algorithm>
#include <array>
#include <cstring>
#include <nlohmann/json.hpp>
#include <string_view>
#include <vector>

#include "server/base/hash.h"

namespace trammel::fuzz {
namespace {

using Json = nlohmann::json;

std::size_t below(std::size_t limit, Random& random) {
  return limit == 0 ? 0 : std::uniform_int_distribution<std::size_t>(0, limit - 1)(random);
}

template <typename List>
const auto& one_of(const List& list, Random& random) {
  return list[below(std::size(list), random)];
}

constexpr std::array<const char*, 34> kWords = {"nan",
                                                "inf",
                                                "-inf",
                                                "1e999",
                                                "-1e999",
                                                "1e-999",
                                                "0",
                                                "-0",
                                                "1",
                                                "-1",
                                                "2147483648",
                                                "-2147483649",
                                                "18446744073709551616",
                                                "1e12",
                                                "1e308",
                                                "0x10",
                                                "1,5",
                                                "1.5.5",
                                                "\"",
                                                "\\",
                                                "\x1b[2J",
                                                "\xff",
                                                "\xc2\x9b",
                                                "\xe2\x80\xae",
                                                "#",
                                                "\t",
                                                "\r\n",
                                                "\n",
                                                ",",
                                                ";",
                                                "null",
                                                "~",
                                                "",
                                                "//"};

std::string replaced(const std::string& input, std::size_t at, std::size_t length,
                     std::string_view by) {
  return input.substr(0, at) + std::string(by) + input.substr(std::min(input.size(), at + length));
}

/// The word around `at`: what stands between separators.
std::pair<std::size_t, std::size_t> word_at(const std::string& input, std::size_t at) {
  static constexpr std::string_view kEnds = " \t\r\n,;:[]{}\"()";
  const std::size_t before = at == 0 ? std::string::npos : input.find_last_of(kEnds, at - 1);
  const std::size_t begin = before == std::string::npos ? 0 : before + 1;
  return {begin, std::min(input.find_first_of(kEnds, at), input.size()) - begin};
}

std::pair<std::size_t, std::size_t> line_at(const std::string& input, std::size_t at) {
  const std::size_t before = at == 0 ? std::string::npos : input.rfind('\n', at - 1);
  const std::size_t begin = before == std::string::npos ? 0 : before + 1;
  const std::size_t end = input.find('\n', at);
  return {begin, (end == std::string::npos ? input.size() : end + 1) - begin};
}

std::string cut(std::string text, std::size_t longest) {
  if (text.size() > longest) text.resize(longest);
  return text;
}

std::string change_one_byte(std::string text, Random& random) {
  if (text.empty()) return std::string(1, static_cast<char>(below(256, random)));
  const std::size_t at = below(text.size(), random);
  text[at] = below(2, random) == 0 ? static_cast<char>(text[at] ^ (1 << below(8, random)))
                                   : static_cast<char>(below(256, random));
  return text;
}

std::string change_a_part(const std::string& text, Random& random) {
  const std::size_t at = below(text.size() + 1, random);
  const std::size_t length = std::min(text.size() - at, std::size_t{1} << below(8, random));
  switch (below(4, random)) {
    case 0:
      return replaced(text, at, length, "");
    case 1:
      return replaced(text, at, 0, text.substr(at, length));
    case 2:
      return replaced(text, below(text.size() + 1, random), length, text.substr(at, length));
    default: {
      std::string many;
      for (std::size_t i = below(300, random) + 1; i > 0; --i)
        many += text.substr(at, std::min<std::size_t>(length, 16));
      return replaced(text, at, 0, many);
    }
  }
}

std::string change_a_word(const std::string& text, Random& random) {
  const auto [at, length] = word_at(text, below(text.size() + 1, random));
  const auto [other, other_length] = word_at(text, below(text.size() + 1, random));
  return replaced(
      text, at, length,
      below(2, random) == 0 ? one_of(kWords, random) : text.substr(other, other_length));
}

std::string change_a_line(const std::string& text, Random& random) {
  const auto [at, length] = line_at(text, below(text.size() + 1, random));
  const auto [other, other_length] = line_at(text, below(text.size() + 1, random));
  switch (below(3, random)) {
    case 0:
      return replaced(text, at, length, "");
    case 1:
      return replaced(text, at, 0, text.substr(other, other_length));
    default:
      return replaced(text, at, length, text.substr(other, other_length));
  }
}

/// Every column once more or left out, so that rows stay equally long.
std::string change_a_column(const std::string& text, Random& random) {
  const std::size_t column = below(12, random);
  const bool repeat = below(2, random) == 0;
  std::string changed;
  for (std::size_t begin = 0; begin < text.size();) {
    const std::size_t end = std::min(text.find('\n', begin), text.size());
    std::size_t field = 0;
    for (std::size_t at = begin; at <= end;) {
      const std::size_t stop = std::min(text.find(',', at), end);
      const std::string value = text.substr(at, stop - at);
      if (field != column || repeat) changed += (at == begin ? "" : ",") + value;
      if (field == column && repeat) changed += "," + value + (begin == 0 ? "x" : "");
      ++field;
      at = stop + 1;
    }
    changed += '\n';
    begin = end + 1;
  }
  return changed;
}

}  // namespace

std::string mutate_bytes(const std::string& input, Random& random, std::size_t longest) {
  return cut(below(2, random) == 0 ? change_one_byte(input, random) : change_a_part(input, random),
             longest);
}

std::string mutate_text(const std::string& input, Random& random, std::size_t longest) {
  return below(2, random) == 0 ? mutate_bytes(input, random, longest)
                               : cut(change_a_word(input, random), longest);
}

std::string mutate_table(const std::string& input, Random& random, std::size_t longest) {
  switch (below(4, random)) {
    case 0:
      return cut(change_a_line(input, random), longest);
    case 1:
      return cut(change_a_column(input, random), longest);
    default:
      return mutate_text(input, random, longest);
  }
}

std::string mutate_yaml(const std::string& input, Random& random, std::size_t longest) {
  static constexpr std::array<const char*, 20> kYaml = {
      "&a ",   "*a",          "[",   "]",   "{",           "}",           "- ",
      "? ",    ": ",          "|\n", ">\n", "!!",          "<<",          "---\n",
      "...\n", "%YAML 1.1\n", "  ",  "'",   "\"\\u001b\"", "{a: &a [*a]}"};
  switch (below(4, random)) {
    case 0:
      return cut(change_a_line(input, random), longest);
    case 1:
      return cut(
          replaced(input, below(input.size() + 1, random), below(3, random), one_of(kYaml, random)),
          longest);
    default:
      return mutate_text(input, random, longest);
  }
}

namespace {

Json any_value(Random& random) {
  switch (below(12, random)) {
    case 0:
      return nullptr;
    case 1:
      return true;
    case 2:
      return std::string(one_of(kWords, random));
    case 3:
      return -1;
    case 4:
      return 1e300;
    case 5:
      return std::numeric_limits<std::uint64_t>::max();
    case 6:
      return Json::array();
    case 7:
      return Json::object();
    case 8:
      return Json::array({Json::array({Json::array()})});
    case 9:
      return std::ldexp(static_cast<double>(below(2000, random)) - 1000,
                        static_cast<int>(below(80, random)) - 60);
    case 10:
      return below(100, random);
    default:
      return std::vector<double>(below(50, random), 0.5);
  }
}

/// A random part of the tree, with a preference for what lies deep.
Json* part_of(Json& tree, Random& random) {
  Json* at = &tree;
  while (at->is_structured() && !at->empty() && below(12, random) != 0) {
    auto step = at->begin();
    std::advance(step, static_cast<std::ptrdiff_t>(below(at->size(), random)));
    at = &*step;
  }
  return at;
}

void change_tree(Json& tree, Random& random) {
  Json* at = part_of(tree, random);
  switch (below(5, random)) {
    case 0:
      *at = any_value(random);
      break;
    case 1: {
      const Json other = *part_of(tree, random);
      *part_of(tree, random) = other;
      break;
    }
    case 2:
      if (at->is_number())
        *at = at->get<double>() * (1 + 1e-6 * static_cast<double>(below(100, random)));
      break;
    case 3:
      if (at->is_structured() && !at->empty())
        at->erase(std::next(at->begin(), static_cast<std::ptrdiff_t>(below(at->size(), random))));
      break;
    default:
      if (at->is_string()) *at = mutate_yaml(at->get<std::string>(), random, std::size_t{1} << 14);
      if (at->is_array() && !at->empty()) at->push_back(at->back());
      break;
  }
}

std::string dumped(const Json& tree) {
  return tree.dump(-1, ' ', false, Json::error_handler_t::replace);
}

/// As the hashes of a file are made: of the bytes that dump() writes.
void make_hashes_fit(Json& file) {
  if (!file.is_object()) return;
  for (const auto& [part, hash] : {std::pair("content", "hash"), std::pair("stamp", "stamp_hash"),
                                   std::pair("self_test", "self_test_hash")}) {
    if (file.contains(part) && file.contains(hash)) file[hash] = sha256_hex(dumped(file[part]));
  }
}

}  // namespace

std::string mutate_json(const std::string& input, Random& random, std::size_t longest) {
  Json tree = below(8, random) == 0 ? Json() : Json::parse(input, nullptr, false);
  if (tree.is_null() || tree.is_discarded()) return mutate_text(input, random, longest);
  change_tree(tree, random);
  return cut(dumped(tree), longest);
}

std::string mutate_model(const std::string& input, Random& random, std::size_t longest) {
  if (below(16, random) == 0) return mutate_text(input, random, longest);
  Json file = Json::parse(input, nullptr, false);
  if (file.is_discarded() || !file.is_object()) return mutate_text(input, random, longest);
  change_tree(below(8, random) == 0 || !file.contains("content") ? file : file["content"], random);
  if (!file.is_object()) return dumped(file);
  // Without stated predictions a model that predicts otherwise is read to its end.
  if (below(2, random) == 0) file["self_test"] = Json::array();
  if (below(32, random) != 0) make_hashes_fit(file);
  return cut(dumped(file), longest);
}

std::string with_fitting_hashes(const std::string& model) {
  Json file = Json::parse(model, nullptr, false);
  if (file.is_discarded()) return model;
  make_hashes_fit(file);
  return dumped(file);
}

std::string mutate_cdr(const std::string& input, Random& random, std::size_t longest) {
  if (input.size() < 8 || below(3, random) == 0) return mutate_bytes(input, random, longest);
  static constexpr std::array<std::uint32_t, 14> kLengths = {
      0, 1, 2, 3, 4, 16, 64, 65, 1024, 10000, 0x7fffffff, 0x80000000, 0xfffffffe, 0xffffffff};
  std::string changed = input;
  // Numbers are aligned to four bytes behind the encapsulation.
  const std::size_t at = 4 + 4 * below((input.size() - 4) / 4, random);
  std::uint32_t number =
      below(2, random) == 0 ? one_of(kLengths, random) : static_cast<std::uint32_t>(random());
  if (at + 4 <= changed.size()) std::memcpy(changed.data() + at, &number, 4);
  return below(4, random) == 0 ? mutate_bytes(changed, random, longest)
                               : cut(std::move(changed), longest);
}

}  // namespace trammel::fuzz
