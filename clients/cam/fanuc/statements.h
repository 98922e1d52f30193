#pragma once

#include <cstddef>
#include <optional>
#include <string>
#include <vector>

#include "clients/cam/flow.h"
#include "clients/cam/program.h"
#include "clients/cam/scan.h"

/// The parts and statements of an LS file.
namespace trammel::cam::fanuc {

using Pieces = std::vector<Piece>;

struct Part {
  std::size_t begin = 0, end = 0;
  int line = 1;
};

/// What stands between a line that is `head` and the next that begins with `/`.
[[nodiscard]] Part part_of(const std::string& text, const std::string& head);
/// `/PROG  WELD1`, in capitals; of a file without it its own name.
[[nodiscard]] std::string name_of_program(const SourceFile& source);
/// The statements of /MN: `12:L P[1] 100mm/sec FINE ;`, without their numbers. A quote in one of
/// them, or in a remark, is no matter of the next.
[[nodiscard]] std::vector<Pieces> statements_of(const std::string& text, const Part& part);

[[nodiscard]] bool is_number(const std::string& text);
[[nodiscard]] double number(const Piece& piece);
/// `GP1`
[[nodiscard]] bool is_group(const Piece& piece);
/// `-12.5`, `(-12.5)`, up to the end of a statement.
[[nodiscard]] std::optional<double> constant_at(const Pieces& statement, std::size_t at);
/// `IF (R[1]=1),PR[5,1]=(200)`: where what it may do begins; 0: the statement is no such one.
[[nodiscard]] std::size_t done_perhaps(const Pieces& statement);
/// `PR[5]`, also of `PR[GP1:5]`; `PR[*]` where an index chooses it.
[[nodiscard]] std::string indexed(const Pieces& pieces, std::size_t at);
/// What a statement does to the order. Calls are not in it.
[[nodiscard]] Step step_of(const Pieces& statement);
/// `CALL SUB(1)`, `IF R[1]=1,CALL SUB`; empty: it calls nothing.
[[nodiscard]] std::string called_by(const Pieces& statement);
/// `GRIPPER OPEN`: a macro is called by its name, of any words. Empty: it is an instruction that is
/// known.
[[nodiscard]] std::string macro_in(const Pieces& statement);

}  // namespace trammel::cam::fanuc
