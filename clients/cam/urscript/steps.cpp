#include "clients/cam/urscript/steps.h"

#include <fmt/format.h>

#include <map>
#include <set>

#include "server/base/plain_text.h"

namespace trammel::cam::urscript {

bool is_of_axes(const Token& word) { return word.is("movej") || word.is("optimovej"); }

bool is_motion(const Token& word) {
  return is_of_axes(word) || word.is("movel") || word.is("movep") || word.is("movec") ||
         word.is("optimovel");
}

bool is_followed(const Token& word) {
  static const std::set<std::string_view> kFollows = {"servoj", "servoc",         "speedl",
                                                      "speedj", "freedrive_mode", "teach_mode"};
  return kFollows.contains(word.text);
}

std::vector<Statement> statements_of(const Tokens& tokens, const Values& values) {
  using Kind = Step::Kind;
  static const std::map<std::string_view, Kind> kWords = {{"if", Kind::kIf},
                                                          {"elif", Kind::kCase},
                                                          {"else", Kind::kElse},
                                                          {"while", Kind::kWhile},
                                                          {"end", Kind::kEnd},
                                                          {"break", Kind::kExit},
                                                          {"continue", Kind::kContinue},
                                                          {"return", Kind::kReturn},
                                                          {"halt", Kind::kReturn}};
  std::set<std::string, std::less<>> functions;
  for (std::size_t at = 0; at + 1 < tokens.size(); ++at) {
    if (tokens[at].is("def")) functions.emplace(tokens[at + 1].text);
  }
  std::vector<Statement> statements;
  auto next = values.assignments().begin();
  for (std::size_t at = 0; at < tokens.size(); ++at) {
    for (; next != values.assignments().end() && next->first <= at; ++next) {
      if (values.is_set_in_order(next->second.name)) statements.push_back({{}, at, &next->second});
    }
    if (!tokens[at].is_word()) continue;
    const std::string name(tokens[at + 1].text);
    if (defines(tokens[at]) && at + 1 < tokens.size()) {
      // A thread runs beside all others.
      const bool is_function = tokens[at].is("def");
      statements.push_back({is_function
                                ? Step{Kind::kRoutine, name}
                                : Step{Kind::kInterrupt, fmt::format("the thread {}", shown(name))},
                            at});
      ++at;  // skips a name without a call
    } else if (const auto word = kWords.find(tokens[at].text); word != kWords.end()) {
      statements.push_back({{word->second}, at});
    } else if (tokens[at + 1].is("(")) {
      const bool known = functions.contains(tokens[at].text);
      statements.push_back({known ? Step{Kind::kCall, std::string(tokens[at].text)} : Step{}, at});
    }
  }
  return statements;
}

std::optional<Cut> cut_in(const Tokens& tokens, std::size_t file) {
  std::vector<Token> open;
  for (const Token token : tokens) {
    if (!token.is_word()) continue;
    if (opens(token)) open.push_back(token);
    if (!token.is("end")) continue;
    if (open.empty()) return Cut{file, token.line, "an end without its beginning"};
    open.pop_back();
  }
  if (open.empty()) return std::nullopt;
  return Cut{file, open.back().line, fmt::format("{} has no end", open.back().text)};
}

}  // namespace trammel::cam::urscript
