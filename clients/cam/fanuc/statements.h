#pragma once

#include <cstddef>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "clients/cam/flow.h"
#include "clients/cam/program.h"
#include "clients/cam/scan.h"

/// The parts and statements of an LS file.
namespace trammel::cam::fanuc {

constexpr Lexis kLexis = {"", "'\""};

struct Part {
  std::size_t begin = 0, end = 0;
  int line = 1;
};

/// The part from the line `head` to the next line that begins with `/`.
[[nodiscard]] Part part_of(const std::string& text, std::string_view head);
/// `/PROG  WELD1`, in capitals; for a file without it the file's name.
[[nodiscard]] std::string name_of_program(const SourceFile& source);

/// `UTOOL[2]=PR[5]`, `PR[5,1]=(100)`, `IF (DI[1]),UFRAME_NUM=2`
struct Assignment {
  std::string name;      ///< `PR[5]`; empty: without an index
  Tokens target, value;  ///< before and behind the `=`
  bool perhaps = false;  ///< a condition stands before it
  std::optional<double> constant;

  [[nodiscard]] std::string_view word() const { return target[0].text; }
};

/// `RUN SUB`, `CALL SUB(1)`
struct Start {
  std::string_view by, program;
};

/// A statement of /MN, `12:L P[1] 100mm/sec FINE ;`, without its number.
struct Statement {
  int line = 1;
  Tokens tokens;
  std::optional<Assignment> assignment = {};
  std::vector<Start> starts = {};
  std::string called = {};  ///< the program that it calls, in capitals; empty: none
  std::string macro = {};   ///< called by its name, of any words: `GRIPPER OPEN`; empty: none

  [[nodiscard]] std::string_view word() const { return tokens[0].text; }
  [[nodiscard]] bool begins(std::string_view with) const { return tokens[0].is(with); }
};
/// The statements of a program. A quote in one statement, or in a remark, does not affect the next.
[[nodiscard]] std::vector<Statement> statements_of(const std::string& text, const Part& part);

/// `J P[1] 100% FINE`, `L PR[3] ... Offset,PR[1]`, `C P[4] P[5] ...`, `A P[6] ...`
struct Motion {
  std::string_view kind;       ///< `J`
  std::string_view elsewhere;  ///< it goes to no point: `PAL_1`; empty: it goes to a point
  std::vector<std::string> points;
  std::optional<double> speed_mm_s;
  std::string moved = {};  ///< why it goes elsewhere at run time; empty: it does not

  [[nodiscard]] bool is_arc() const { return kind == "C" || kind == "A"; }
};
/// Empty if the statement is none of these.
[[nodiscard]] std::optional<Motion> motion_of(const Statement& statement);

/// The instruction that moves the targets behind a statement: `Track TAST[1] (line 4)`; empty where
/// it ends. No value: the statement does neither.
[[nodiscard]] std::optional<std::string> follows_behind(const Statement& statement);
/// `MONITOR SAFE`, `ERROR_PROG=SAFE`. Empty if the statement starts nothing beside the program.
[[nodiscard]] std::string started_beside(const Statement& statement);
/// `PAYLOAD[3]`, by its place among the tokens.
[[nodiscard]] std::vector<std::string> loads_in(const Statement& statement);

[[nodiscard]] bool is_number(const std::string& text);
/// `GP1`
[[nodiscard]] bool is_group(const Token& token);
/// `PR[5]`, also of `PR[GP1:5]`; `PR[*]` where an index chooses it.
[[nodiscard]] std::string indexed(const Tokens& tokens, std::size_t at);
/// The effect of a statement on the order, without its calls.
[[nodiscard]] Step step_of(const Statement& statement);

}  // namespace trammel::cam::fanuc
