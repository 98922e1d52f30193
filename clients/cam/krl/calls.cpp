#include "clients/cam/krl/calls.h"

#include <algorithm>
#include <map>

namespace trammel::cam::krl {

Step step_of(const std::vector<Token>& tokens) {
  using Kind = Step::Kind;
  static const std::map<std::string, Kind> kWords = {
      {"IF", Kind::kIf},         {"ELSE", Kind::kElse},     {"ENDIF", Kind::kEnd},
      {"SWITCH", Kind::kSwitch}, {"CASE", Kind::kCase},     {"DEFAULT", Kind::kElse},
      {"ENDSWITCH", Kind::kEnd}, {"LOOP", Kind::kRepeat},   {"ENDLOOP", Kind::kEnd},
      {"WHILE", Kind::kWhile},   {"ENDWHILE", Kind::kEnd},  {"FOR", Kind::kWhile},
      {"ENDFOR", Kind::kEnd},    {"REPEAT", Kind::kRepeat}, {"UNTIL", Kind::kEnd},
      {"EXIT", Kind::kExit},     {"RETURN", Kind::kReturn}, {"RESUME", Kind::kReturn}};
  if (tokens.empty()) return {};
  if (tokens.size() == 2 && tokens[1].text == ":") return {Kind::kLabel, tokens[0].text};
  if (tokens.size() > 1 && tokens[0].text == "GOTO") return {Kind::kJump, tokens[1].text};
  if (tokens.size() > 1 &&
      (tokens[1].text == "=" || tokens[1].text == "[" || tokens[1].text == "."))
    return {};
  const auto word = kWords.find(tokens[0].text);
  return word == kWords.end() ? Step{} : Step{word->second};
}

namespace {

class HandedOver {
 public:
  HandedOver(const std::vector<std::vector<Line>>& lines, const std::vector<Routine>& routines,
             Variables& names)
      : lines_(lines), routines_(routines), names_(names) {}

  void note() {
    for (std::size_t f = 0; f < lines_.size(); ++f) {
      for (std::size_t k = 0; k < lines_[f].size(); ++k) {
        const std::vector<Token>& tokens = lines_[f][k].tokens;
        for (std::size_t at = 0; at + 1 < tokens.size(); ++at) {
          const bool calls = tokens[at].kind == TokenKind::kWord && tokens[at + 1].text == "(";
          if (calls && !declares(tokens)) note(f, k, at);
        }
      }
    }
  }
  std::set<std::string> elsewhere() && { return std::move(elsewhere_); }

 private:
  void note(std::size_t f, std::size_t k, std::size_t at) {
    const std::vector<Token>& tokens = lines_[f][k].tokens;
    const std::string& name = tokens[at].text;
    const auto routine = std::find_if(routines_.begin(), routines_.end(),
                                      [&](const Routine& one) { return one.name == name; });
    // Functions of the controller in expressions take values; so do BAS( ) and `IF (`.
    const bool is_statement =
        at == 0 && name != "BAS" && step_of(tokens).kind == Step::Kind::kPlain;
    if (routine == routines_.end() && !is_statement) return;
    if (routine == routines_.end()) elsewhere_.insert(name);
    std::size_t argument = 0;
    int depth = 0;
    for (std::size_t t = at + 1; t + 1 < tokens.size(); ++t) {
      if (tokens[t].text == "(" || tokens[t].text == "[" || tokens[t].text == "{") ++depth;
      if (tokens[t].text == ")" || tokens[t].text == "]" || tokens[t].text == "}") --depth;
      if (depth == 0) return;
      if (depth != 1) continue;
      if (tokens[t].text == ",") ++argument;
      if (tokens[t].text != "(" && tokens[t].text != ",") continue;
      const bool by_value = routine != routines_.end() && takes_value(*routine, argument);
      if (!by_value && tokens[t + 1].kind == TokenKind::kWord)
        names_.note_handed_over(f, k, t + 1, tokens[at].text);
    }
  }
  /// Whether the parameter of that number is `:IN`.
  [[nodiscard]] bool takes_value(const Routine& routine, std::size_t number) const {
    if (routine.first == 0) return true;
    const std::vector<Token>& tokens = lines_[routine.file][routine.first - 1].tokens;
    std::size_t parameter = 0;
    for (std::size_t t = 0; t + 1 < tokens.size(); ++t) {
      if (tokens[t].text == ",") ++parameter;
      if (tokens[t].text == ":" && parameter == number) return tokens[t + 1].text == "IN";
    }
    return false;
  }

  const std::vector<std::vector<Line>>& lines_;
  const std::vector<Routine>& routines_;
  Variables& names_;
  std::set<std::string> elsewhere_;
};

}  // namespace

std::set<std::string> note_handed_over(const std::vector<std::vector<Line>>& lines,
                                       const std::vector<Routine>& routines, Variables& names) {
  HandedOver handed(lines, routines, names);
  handed.note();
  return std::move(handed).elsewhere();
}

}  // namespace trammel::cam::krl
