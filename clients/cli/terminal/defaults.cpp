#include "clients/cli/terminal/defaults.h"

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <sstream>
#include <string_view>

#include "clients/cli/terminal/names.h"
#include "server/base/letters.h"
#include "server/base/near_miss.h"
#include "server/base/plain_text.h"
#include "server/base/text_file.h"

namespace trammel::cli {

namespace {

const std::vector<std::string> kNames = {
    "host", "discovery-server", "port", "security", "domain", "timeout", "cell",
    "tool", "payload",          "seed"};

struct Default {
  std::string name, value;
};

constexpr std::string_view kByteOrderMark = "\xef\xbb\xbf";

Result<std::vector<Default>> read_defaults(const std::string& path) {
  const Result<std::string> text = read_text_file(path, 100'000);
  if (!text)
    return Failure(text.error()).as(ErrorCode::kUsage).next("TRAMMEL_DEFAULTS= takes no defaults");
  std::vector<Default> found;
  std::istringstream lines(text->starts_with(kByteOrderMark) ? text->substr(kByteOrderMark.size())
                                                             : *text);
  long row = 0;
  for (std::string line; std::getline(lines, line);) {
    ++row;
    line = std::string(trimmed(std::string_view(line).substr(0, line.find('#'))));
    if (line.empty()) continue;
    const auto equals = line.find('=');
    const std::string name(trimmed(std::string_view(line).substr(0, equals)));
    const std::string value(
        equals == std::string::npos ? "" : trimmed(std::string_view(line).substr(equals + 1)));
    if (value.empty())
      return failure(ErrorCode::kUsage, "'{}' is no name = value", shown_short(line))
          .in(path)
          .at_row(row)
          .next("write for example port = 17501");
    if (std::find(kNames.begin(), kNames.end(), name) == kNames.end())
      return failure(ErrorCode::kUsage, "unknown default '{}'{}", shown_short(name),
                     did_you_mean(name, kNames))
          .in(path)
          .at_row(row)
          .of(shown_short(name))
          .next(fmt::format("known: {}", fmt::join(kNames, " ")));
    found.push_back({name, value});
  }
  return found;
}

bool says(const std::vector<std::string>& words, const std::string& option) {
  return std::any_of(words.begin(), words.end(), [&](const std::string& word) {
    return word == option || word.starts_with(option + "=");
  });
}

}  // namespace

std::string defaults_path() {
  if (const char* said = std::getenv("TRAMMEL_DEFAULTS")) return said;
  const char* config = std::getenv("XDG_CONFIG_HOME");
  const char* home = std::getenv("HOME");
  if (config == nullptr && home == nullptr) return "";
  const std::filesystem::path folder =
      config != nullptr ? std::filesystem::path(config) : std::filesystem::path(home) / ".config";
  std::error_code error;
  const std::filesystem::path path = folder / "trammel" / "defaults";
  return std::filesystem::exists(path, error) ? path.string() : "";
}

Result<std::vector<std::string>> with_defaults(const CLI::App& app, std::vector<std::string> words,
                                               const std::string& path) {
  if (words.empty()) return words;
  const std::vector<Default> defaults =
      TRY(path.empty() ? Result<std::vector<Default>>() : read_defaults(path));
  const auto is_command = [&](const CLI::App* one) {
    return one->get_name() == words[0] && !words[0].empty();
  };
  const auto commands = app.get_subcommands(is_command);
  const bool asks_help = says(words, "--help") || says(words, "-h");
  if (commands.empty() || asks_help) return words;
  const bool cell_is_known = std::any_of(defaults.begin(), defaults.end(),
                                         [](const Default& one) { return one.name == "cell"; });
  words = words_by_option(app, words, cell_is_known);
  std::vector<std::string> added;
  for (const Default& one : defaults) {
    const std::string option = "--" + one.name;
    const CLI::Option* known = commands.front()->get_option_no_throw(option);
    if (known == nullptr || says(words, option) || (one.name == "cell" && !known->get_required()))
      continue;
    added.push_back(option);
    added.push_back(one.value);
  }
  const auto end = std::find(words.begin(), words.end(), "--");
  words.insert(end, added.begin(), added.end());
  return words;
}

}  // namespace trammel::cli
