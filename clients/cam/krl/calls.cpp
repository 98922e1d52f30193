#include "clients/cam/krl/calls.h"

#include "clients/cam/krl/statements.h"

namespace trammel::cam::krl {

namespace {

class HandedOver {
 public:
  HandedOver(const std::vector<std::vector<Line>>& lines, const Routines& routines,
             Variables& names)
      : lines_(lines), routines_(routines), names_(names) {}

  void note() {
    for (std::size_t f = 0; f < lines_.size(); ++f) {
      for (std::size_t k = 0; k < lines_[f].size(); ++k) {
        const Tokens& tokens = lines_[f][k].tokens;
        for (std::size_t at = 0; at + 1 < tokens.size(); ++at) {
          const bool calls = tokens[at].is_word() && tokens[at + 1].is("(");
          if (calls && !declares(tokens)) note(f, k, at);
        }
      }
    }
  }
  std::set<std::string> elsewhere() && { return std::move(elsewhere_); }

 private:
  void note(std::size_t f, std::size_t k, std::size_t at) {
    const Tokens& tokens = lines_[f][k].tokens;
    const std::string name(tokens[at].text);
    const Routine* routine = routines_.find(name);
    // Functions of the controller in expressions take values; so do BAS( ) and `IF (`.
    const bool is_statement =
        at == 0 && name != "BAS" && step_of(tokens).kind == Step::Kind::kPlain;
    if (routine == nullptr && !is_statement) return;
    if (routine == nullptr) elsewhere_.insert(name);
    std::size_t argument = 0;
    int depth = 0;
    for (std::size_t t = at + 1; t + 1 < tokens.size(); ++t) {
      const Token token = tokens[t];
      if (token.is("(") || token.is("[") || token.is("{")) ++depth;
      if (token.is(")") || token.is("]") || token.is("}")) --depth;
      if (depth == 0) return;
      if (depth != 1) continue;
      if (token.is(",")) ++argument;
      if (!token.is("(") && !token.is(",")) continue;
      const bool by_value = routine != nullptr && takes_value(*routine, argument);
      if (!by_value && tokens[t + 1].is_word()) names_.note_handed_over(f, k, t + 1, name);
    }
  }
  /// True if the parameter with that number is `:IN`.
  [[nodiscard]] bool takes_value(const Routine& routine, std::size_t number) const {
    if (routine.first == 0) return true;
    const Tokens& tokens = lines_[routine.file][routine.first - 1].tokens;
    std::size_t parameter = 0;
    for (std::size_t t = 0; t + 1 < tokens.size(); ++t) {
      if (tokens[t].is(",")) ++parameter;
      if (tokens[t].is(":") && parameter == number) return tokens[t + 1].is("IN");
    }
    return false;
  }

  const std::vector<std::vector<Line>>& lines_;
  const Routines& routines_;
  Variables& names_;
  std::set<std::string> elsewhere_;
};

}  // namespace

void Routines::add(Routine routine) {
  by_name_.emplace(routine.name, all_.size());
  all_.push_back(std::move(routine));
}

const Routine* Routines::find(const std::string& name) const {
  const auto known = by_name_.find(name);
  return known == by_name_.end() ? nullptr : &all_[known->second];
}

std::vector<std::size_t> Routines::called_by(const Tokens& tokens) const {
  std::vector<std::size_t> called;
  if (done_later(tokens) > 0) return called;
  for (const std::string_view name : called_in(tokens)) {
    if (const auto known = by_name_.find(name); known != by_name_.end())
      called.push_back(known->second);
  }
  return called;
}

std::set<std::string> note_handed_over(const std::vector<std::vector<Line>>& lines,
                                       const Routines& routines, Variables& names) {
  HandedOver handed(lines, routines, names);
  handed.note();
  return std::move(handed).elsewhere();
}

}  // namespace trammel::cam::krl
