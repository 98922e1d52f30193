#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "clients/cam/flow.h"

/// The content of a RAPID module, as far as targets need it. The parser does not know the whole
/// language: it skips statements that it does not understand.
namespace trammel::cam::rapid {

/// A text that costs one pointer when it is empty: most parts of a long program are numbers.
class Name {
 public:
  Name() = default;
  Name(std::string text)  // NOLINT(google-explicit-constructor): it is one
      : text_(text.empty() ? nullptr : std::make_unique<std::string>(std::move(text))) {}
  Name(const Name& other) : Name(other.text()) {}
  Name(Name&&) noexcept = default;
  Name& operator=(Name other) noexcept {
    text_ = std::move(other.text_);
    return *this;
  }
  ~Name() = default;

  [[nodiscard]] const std::string& text() const {
    static const std::string kEmpty;
    return text_ ? *text_ : kEmpty;
  }
  operator const std::string&() const { return text(); }  // NOLINT(google-explicit-constructor)
  [[nodiscard]] bool empty() const { return !text_; }
  [[nodiscard]] bool operator==(std::string_view other) const { return text() == other; }

 private:
  std::unique_ptr<std::string> text_;
};

/// An expression, with its bytes. Names are in lower case: RAPID does not tell cases apart.
struct Expression {
  enum class Kind : unsigned char {
    kNumber,
    kText,
    kTruth,
    kName,
    kAggregate,
    kCall,
    kField,
    kElement,
    kUnary,
    kBinary,
    kUnknown
  };
  Kind kind = Kind::kUnknown;
  char sign = 0;  ///< of a unary or binary operation
  int line = 0;
  std::uint32_t begin = 0, end = 0;
  double value = 0;  ///< of a number
  Name name;         ///< of a name, a call, a field; the word of a truth value
  Name label;        ///< of an argument `\Rx:=...`: `rx`
  std::vector<Expression>
      parts;  ///< elements, arguments, operands; for a field or element, its container comes first
};

enum class Storage { kConst, kPers, kVar, kParameter, kLoop };

struct Declaration {
  std::string name, type;
  std::string spelled = {};  ///< the name as it stands there
  Storage storage = Storage::kVar;
  bool local = false;    ///< to its module
  bool of_task = false;  ///< `TASK PERS`: each task has its own
  int routine = -1;      ///< of the module; -1: of the module itself
  bool is_array = false;
  bool may_be_changed = false;     ///< of a parameter: INOUT, VAR, PERS
  std::size_t begin = 0, end = 0;  ///< of the statement
  int line = 0;
  std::optional<Expression> value;
};

struct Assignment {
  Expression target, value;
  int routine = -1;
  int line = 0;
  std::size_t begin = 0, end = 0;  ///< of the value
  std::size_t before = 0;          ///< which instruction of the module
  std::size_t turns = 0;           ///< of the module's statements above it
};

/// The condition of an IF, WHILE, TEST or FOR.
struct Condition {
  std::size_t begin = 0, end = 0;
  int routine = -1;
  int line = 0;
};

/// A word that decides the order of instructions.
struct Turn {
  Step step;
  std::size_t before = 0;  ///< which instruction of the module
};

/// The name of an instruction whose routine is named at run time, by its first argument: `%"load"%
/// p10;`.
constexpr const char* kLateCall = "%";

/// `MoveL p10,v100,fine,tool1\WObj:=wobj1;`, or a call of a procedure.
struct Instruction {
  std::string name;     ///< in lower case
  std::string spelled;  ///< the text in the file
  std::vector<Expression> arguments;
  std::size_t begin = 0, end = 0;
  int routine = -1;
  int line = 0;
};

struct Routine {
  std::string name;
  bool local = false;
  bool is_function = false;
  std::vector<std::string> parameters;  ///< in order, without those marked `\`
};

struct Record {
  std::string name;
  std::vector<std::string> fields, types;
};

/// A PROC without its ENDPROC, or an ENDIF without its IF: the module is incomplete.
struct Unbalanced {
  std::string what;  ///< a clause
  int line = 0;
};

struct Module {
  std::string name;
  std::size_t head_end = 0;  ///< behind `MODULE name(...)`; 0: there is none
  std::vector<Declaration> declarations;
  std::vector<Assignment> assignments;
  std::vector<Instruction> instructions;
  std::vector<Routine> routines;
  std::vector<Record> records;
  std::vector<Condition> conditions;
  std::vector<Turn> turns;  ///< routines are named by their number
  std::vector<Unbalanced> unbalanced;
};

}  // namespace trammel::cam::rapid
