#pragma once

#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "clients/cam/rapid/tokens.h"

/// What a RAPID module says, as far as targets need it. The whole language is not read: a statement that is not
/// understood is passed over.
namespace trammel::cam::rapid {

/// An expression, with its bytes. Names are in lower case: RAPID does not tell cases apart.
struct Expression {
  enum class Kind { kNumber, kText, kTruth, kName, kAggregate, kCall, kField, kElement, kUnary, kBinary, kUnknown };
  Kind kind = Kind::kUnknown;
  std::size_t begin = 0, end = 0;
  int line = 0;
  std::string name;   ///< of a name, a call, a field; the word of a truth value
  double value = 0;   ///< of a number
  char sign = 0;      ///< of a unary or binary operation
  std::string label;  ///< of an argument `\Rx:=...`: `rx`
  std::vector<Expression> parts;  ///< elements, arguments, operands; of a field or element: what it is of, first
};

enum class Storage { kConst, kPers, kVar, kParameter, kLoop };

struct Declaration {
  std::string name, type;
  Storage storage = Storage::kVar;
  bool local = false;    ///< to its module
  int routine = -1;      ///< of the module; -1: of the module itself
  bool is_array = false;
  bool may_be_changed = false;  ///< of a parameter: INOUT, VAR, PERS
  std::size_t begin = 0, end = 0;  ///< of the statement
  int line = 0;
  std::optional<Expression> value;
};

struct Assignment {
  Expression target, value;
  int routine = -1;
  int line = 0;
};

/// `MoveL p10,v100,fine,tool1\WObj:=wobj1;`, or a call of a procedure.
struct Instruction {
  std::string name;        ///< in lower case
  std::string spelled;     ///< as it stands there
  std::vector<Expression> arguments;
  std::size_t begin = 0, end = 0;
  int routine = -1;
  int line = 0;
};

struct Routine {
  std::string name;
  bool local = false;
  std::vector<std::string> parameters;  ///< in order, those with `\` left out
};

struct Record {
  std::string name;
  std::vector<std::string> fields, types;
};

struct Module {
  std::string name;
  std::size_t head_end = 0;  ///< behind `MODULE name(...)`; 0: there is none
  std::vector<Declaration> declarations;
  std::vector<Assignment> assignments;
  std::vector<Instruction> instructions;
  std::vector<Routine> routines;
  std::vector<Record> records;
};

/// Never fails: what is not understood is not there.
[[nodiscard]] Module parse(std::string_view text);

}  // namespace trammel::cam::rapid
