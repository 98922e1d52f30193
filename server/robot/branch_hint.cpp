#include "server/robot/branch_hint.h"

#include <fmt/format.h>

#include <charconv>

namespace trammel {

namespace {

constexpr std::string_view kJoins = "; ", kConf = "conf ", kComma = ", ", kOr = " or ",
                           kEnd = " would reach it";

/// Takes `word` from the front of `text` if it stands there.
bool take(std::string_view& text, std::string_view word) {
  if (!text.starts_with(word)) return false;
  text.remove_prefix(word.size());
  return true;
}

/// Takes the list from the front of `text`; empty where none stands there.
std::vector<int> take_branches(std::string_view& text) {
  std::vector<int> branches;
  if (!take(text, kConf)) return {};
  do {
    int branch = 0;
    const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), branch);
    if (error != std::errc()) return {};
    text.remove_prefix(static_cast<std::size_t>(end - text.data()));
    branches.push_back(branch);
  } while (take(text, kComma) || take(text, kOr));
  return branches;
}

}  // namespace

std::string branch_list(const std::vector<int>& branches) {
  std::string list = fmt::format("{}{}", kConf, branches.front());
  for (std::size_t i = 1; i < branches.size(); ++i)
    list += fmt::format("{}{}", i + 1 == branches.size() ? kOr : kComma, branches[i]);
  return list;
}

std::string with_branch_hint(const std::string& before, const std::vector<int>& branches) {
  return branches.empty() ? before
                          : fmt::format("{}{}{}{}", before, kJoins, branch_list(branches), kEnd);
}

BranchHint branch_hint_in(std::string_view message) {
  const std::size_t joint = message.rfind(kJoins);
  if (joint != std::string_view::npos) {
    std::string_view rest = message.substr(joint + kJoins.size());
    std::vector<int> branches = take_branches(rest);
    if (!branches.empty() && rest == kEnd)
      return {std::string(message.substr(0, joint)), std::move(branches)};
  }
  return {std::string(message), {}};
}

}  // namespace trammel
