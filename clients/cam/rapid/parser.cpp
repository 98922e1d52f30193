#include "clients/cam/rapid/parser.h"

#include <fmt/format.h>

#include <array>
#include <set>

#include "clients/cam/rapid/expressions.h"
#include "server/base/letters.h"
#include "server/base/plain_text.h"

namespace trammel::cam::rapid {

namespace {

using Kind = Expression::Kind;

class Parser : private Expressions {
 public:
  explicit Parser(std::string_view text) : Expressions(text) {}

  Module parse() {
    while (!at_end()) {
      const std::size_t before = at_;
      statement();
      if (at_ == before) ++at_;
    }
    drop_blocks_down_to(0);
    return std::move(module_);
  }

 private:
  /// It needs an END...
  struct Block {
    std::string word;  ///< in lower case
    std::string called;
    int line = 0;
  };
  void open_block(const std::string& word, const std::string& name = {}) {
    blocks_.push_back({word, name.empty() ? upper(word) : upper(word) + " " + name, token().line});
  }
  /// The block that the word at hand ends.
  void close_block(const std::string& word) {
    std::size_t open = blocks_.size();
    while (open > 0 && "end" + blocks_[open - 1].word != word) --open;
    if (open == 0) {
      const std::string due = upper(word.substr(std::string_view("end").size()));
      module_.unbalanced.push_back({fmt::format("{} has no {}", upper(word), due), token().line});
      return;
    }
    drop_blocks_down_to(open);
    blocks_.pop_back();
  }
  /// Blocks from number `keep` on have no end.
  void drop_blocks_down_to(std::size_t keep) {
    for (; blocks_.size() > keep; blocks_.pop_back()) {
      const Block& block = blocks_.back();
      module_.unbalanced.push_back(
          {fmt::format("{} has no END{}", shown(block.called), upper(block.word)), block.line});
    }
  }

  /// Behind the next `;`.
  void skip_statement() {
    while (!at_statement_end()) ++at_;
    take(";");
  }

  void statement() {
    static const std::set<std::string> kSingle = {"else",      "endif",   "endfor", "endwhile",
                                                  "endtest",   "error",   "undo",   "default",
                                                  "endmodule", "backward"};
    const std::string first = word();
    if (first.empty()) return skip_odd_statement();
    if (first == "module") return module_head();
    if (first == "record") return record();
    if (first == "proc" || first == "func" || first == "trap" || first == "local" ||
        first == "task" || first == "const" || first == "pers" || first == "var") {
      return declaration();
    }
    if (first == "endproc" || first == "endfunc" || first == "endtrap") {
      close_block(first);
      turn(Step::Kind::kEnd);
      routine_ = -1;
      ++at_;
    } else if (first == "if" || first == "elseif") {
      condition();
    } else if (first == "for") {
      loop();
    } else if (first == "while") {
      open_block(first);
      turn(Step::Kind::kWhile);
      const std::size_t begin = at_;
      while (!at_end() && word() != "do" && !is_sign(";")) ++at_;
      note_condition(begin);
      ++at_;
    } else if (first == "test") {
      open_block(first);
      turn(Step::Kind::kSwitch);
      const std::size_t begin = at_;
      while (!at_end() && word() != "case" && word() != "default" && word() != "endtest" &&
             !is_sign(";"))
        ++at_;
      note_condition(begin);
    } else if (first == "case") {
      turn(Step::Kind::kCase);
      const std::size_t begin = at_;
      while (!at_end() && !is_sign(":") && !is_sign(";")) ++at_;
      note_condition(begin);
      ++at_;
    } else if (kSingle.contains(first) || is_sign(":", 1)) {
      note_single(first);
      at_ += is_sign(":", 1) ? 2 : 1;
      if (first == "error" && is_sign("(")) skip_numbers_of_errors();
    } else if (first == "alias") {
      skip_statement();
    } else {
      simple_statement();
    }
  }

  void turn(Step::Kind kind, std::string label = {}) {
    module_.turns.push_back({{kind, std::move(label)}, module_.instructions.size()});
  }
  void note_single(const std::string& first) {
    if (first.starts_with("end") && !is_sign(":", 1)) {
      close_block(first);
      turn(Step::Kind::kEnd);
    } else if (first == "else" || first == "default") {
      turn(Step::Kind::kElse);
    } else if (first == "error" || first == "undo" || first == "backward") {
      turn(Step::Kind::kHandler, fmt::format("the handler '{}' of its routine", shown(first)));
    } else {
      turn(Step::Kind::kLabel, first);
    }
  }
  /// `ERROR (ERR_1, ERR_2)`
  void skip_numbers_of_errors() {
    while (!at_statement_end() && !is_sign(")")) ++at_;
    take(")");
  }
  /// Records the condition from the token `begin` to the present token.
  void note_condition(std::size_t begin) {
    module_.conditions.push_back(
        {tokens_[begin].begin, token().begin, routine_, tokens_[begin].line});
  }

  /// `%"name"% p10;`. Heads of module files, `%%%`, and rubbish mean nothing.
  void skip_odd_statement() {
    const bool of_head = is_sign("%", 1) || tokens_[at_ - 1].is_sign("%");
    if (!is_sign(kLateCall) || of_head || routine_ < 0) {
      ++at_;
      return;
    }
    Instruction made = instruction_here();
    made.name = kLateCall;
    ++at_;
    made.arguments.push_back(expression());
    while (!at_statement_end() && !is_sign("%")) ++at_;
    take("%");
    arguments(std::move(made));
  }

  void module_head() {
    drop_blocks_down_to(0);
    ++at_;
    const std::string spelled(bytes());
    module_.name = take_word();
    open_block("module", spelled);
    if (take("(")) {
      while (!at_end() && !is_sign(")") && !is_sign(";")) ++at_;
      take(")");
    }
    module_.head_end = last_end();
  }

  void record() {
    open_block("record");
    ++at_;
    Record record;
    record.name = take_word();
    while (!at_end() && word() != "endrecord") {
      const std::string type = take_word();
      const std::string name = take_word();
      if (type.empty() || name.empty()) {
        ++at_;
        continue;
      }
      record.types.push_back(type);
      record.fields.push_back(name);
      take(";");
    }
    if (!at_end()) close_block("endrecord");
    ++at_;
    module_.records.push_back(std::move(record));
  }

  void declaration() {
    Declaration declared;
    declared.begin = token().begin;
    declared.line = token().line;
    declared.routine = routine_;
    if (word() == "local" || word() == "task") {
      declared.local = word() == "local";
      declared.of_task = take_word() == "task";
    }
    const std::string kind = take_word();
    if (kind == "proc" || kind == "func" || kind == "trap")
      return routine_head(kind, declared.local);
    if (kind != "const" && kind != "pers" && kind != "var") return skip_statement();
    declared.storage = kind == "const"  ? Storage::kConst
                       : kind == "pers" ? Storage::kPers
                                        : Storage::kVar;
    declared.type = take_word();
    declared.spelled = std::string(bytes());
    declared.name = take_word();
    if (is_sign("{")) {
      declared.is_array = true;
      while (!at_end() && !is_sign("}") && !is_sign(";")) ++at_;
      take("}");
    }
    if (take(":=")) declared.value = expression();
    const bool ends = is_sign(";");
    declared.end = token().end;
    if (!ends) declared.value.reset();
    skip_statement();
    if (!declared.name.empty()) module_.declarations.push_back(std::move(declared));
  }

  void routine_head(const std::string& kind, bool local) {
    Routine routine;
    if (kind == "func") take_word();
    const std::string spelled(bytes());
    if (routine_ >= 0) drop_blocks_down_to(first_block_of_routine());
    open_block(kind, spelled);
    routine.name = take_word();
    routine.local = local;
    routine.is_function = kind == "func";
    routine_ = static_cast<int>(module_.routines.size());
    if (kind == "trap")
      turn(Step::Kind::kInterrupt, fmt::format("the TRAP {}", shown(spelled)));
    else
      turn(Step::Kind::kRoutine, std::to_string(routine_));
    if (take("(")) parameters(routine);
    module_.routines.push_back(std::move(routine));
  }

  /// Routines stand in a module, or in no block.
  [[nodiscard]] std::size_t first_block_of_routine() const {
    return !blocks_.empty() && blocks_.front().word == "module" ? 1 : 0;
  }

  void parameters(Routine& routine) {
    while (!at_end() && !is_sign(")") && !is_sign(";")) {
      Declaration declared;
      declared.storage = Storage::kParameter;
      declared.routine = routine_;
      declared.line = token().line;
      declared.begin = token().begin;
      const bool optional = take("\\");
      for (std::string mode = word();
           mode == "inout" || mode == "var" || mode == "pers" || mode == "switch"; mode = word()) {
        if (mode == "switch") break;
        declared.may_be_changed = true;
        ++at_;
      }
      declared.type = take_word();
      declared.name = take_word();
      if (is_sign("{")) {
        declared.is_array = true;
        while (!at_end() && !is_sign("}") && !is_sign(")")) ++at_;
        take("}");
      }
      declared.end = last_end();
      if (!optional) routine.parameters.push_back(declared.name);
      if (!declared.name.empty()) module_.declarations.push_back(std::move(declared));
      while (!at_end() && !is_sign(",") && !is_sign(")") && !is_sign("\\") && !is_sign("|")) ++at_;
      if (is_sign(",") || is_sign("|")) ++at_;
    }
    take(")");
  }

  /// `IF c THEN`, or `IF c instruction;`: then the instruction is found by its name behind the
  /// condition.
  void condition() {
    ++at_;
    const std::size_t begin = at_;
    const bool another = at_ > 1 && word_at(at_ - 1) == "elseif";
    while (!at_end() && !is_sign(";") && word() != "then") ++at_;
    note_condition(begin);
    turn(another ? Step::Kind::kCase : Step::Kind::kIf);
    if (word() == "then") {
      if (!another) open_block("if");
      ++at_;
      return;
    }
    const std::size_t end = at_;
    for (at_ = begin; at_ < end; ++at_) {
      const bool two_words = token().is_word() && at_ > begin &&
                             (tokens_[at_ - 1].kind != TokenKind::kSign || is_closing(at_ - 1));
      if (two_words && !is_operator(word()) && !is_operator(word_at(at_ - 1))) {
        module_.conditions.back().end = token().begin;
        simple_statement();
        return turn(Step::Kind::kEnd);
      }
    }
    turn(Step::Kind::kEnd);
    at_ = end;
    take(";");
  }
  [[nodiscard]] bool is_closing(std::size_t index) const {
    const Token sign = tokens_[index];
    return sign.is(")") || sign.is("]") || sign.is("}");
  }
  [[nodiscard]] std::string word_at(std::size_t index) const {
    return tokens_[index].is_word() ? lower(tokens_[index].text) : std::string();
  }

  /// `FOR i FROM a TO b DO`: i is a number that the loop decides.
  void loop() {
    Declaration counter;
    counter.begin = token().begin;
    counter.line = token().line;
    ++at_;
    counter.storage = Storage::kLoop;
    counter.routine = routine_;
    counter.type = "num";
    counter.name = take_word();
    counter.end = last_end();
    if (!counter.name.empty()) module_.declarations.push_back(std::move(counter));
    open_block("for");
    turn(Step::Kind::kWhile);
    const std::size_t begin = at_;
    while (!at_end() && word() != "do" && !is_sign(";")) ++at_;
    note_condition(begin);
    ++at_;
  }

  /// An assignment or an instruction.
  void simple_statement() {
    const std::size_t begin = at_;
    const int line = token().line;
    Expression target = primary(0);
    if (take(":=")) {
      const std::size_t value_begin = token().begin;
      Expression value = expression();
      // A value that is not understood still changes its target.
      if (!is_sign(";")) value = {};
      module_.assignments.push_back({std::move(target), std::move(value), routine_, line,
                                     value_begin, 0, module_.instructions.size(),
                                     module_.turns.size()});
      skip_statement();
      module_.assignments.back().end = last_end();
      return;
    }
    at_ = begin;
    instruction();
  }

  [[nodiscard]] Instruction instruction_here() const {
    Instruction made;
    made.begin = token().begin;
    made.line = token().line;
    made.routine = routine_;
    made.spelled = std::string(bytes());
    return made;
  }

  void instruction() {
    Instruction made = instruction_here();
    made.name = take_word();
    arguments(std::move(made));
  }

  /// Up to the end of the instruction.
  void arguments(Instruction made) {
    while (!at_statement_end()) {
      if (take(",")) continue;
      Expression argument;
      if (take("\\")) {
        const std::string label = take_word();
        // `\WObj?w` passes on the caller's argument.
        if (take(":=") || take("?")) argument = expression();
        argument.label = label.empty() ? "?" : label;
      } else {
        argument = expression();
      }
      if (argument.kind == Kind::kUnknown && argument.label.empty()) {
        // Not understood: to the next argument.
        int depth = 0;
        for (; !at_statement_end(); ++at_) {
          if (is_sign("(") || is_sign("[") || is_sign("{")) ++depth;
          if (is_sign(")") || is_sign("]") || is_sign("}")) --depth;
          if (depth <= 0 && (is_sign(",") || is_sign("\\"))) break;
        }
      }
      made.arguments.push_back(std::move(argument));
    }
    made.arguments.shrink_to_fit();
    made.end = is_sign(";") ? token().end : token().begin;
    const bool ends = take(";");
    if (ends) module_.instructions.push_back(std::move(made));
  }

  int routine_ = -1;
  std::vector<Block> blocks_;
  Module module_;
};

}  // namespace

Module parse(std::string_view text) { return Parser(text).parse(); }

}  // namespace trammel::cam::rapid
