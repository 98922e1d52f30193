#pragma once

#include <cstddef>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "clients/cam/flow.h"
#include "clients/cam/program.h"
#include "clients/cam/scan.h"

/// The parts of a JBI file: the head of a job with its positions, and its statements.
namespace trammel::cam::inform {

struct Position {
  std::size_t begin = 0;
  int line = 1;
  std::string kind, tool, user;  ///< the values of POSTYPE, TOOL, USER above it
  std::vector<int> conf;         ///< RCONF
  int again_at = 0;              ///< the line of another one with that name; 0: none
  std::vector<Token> numbers;
};
/// `1,0,0,0,0,0`: wrist not flipped, upper arm, front; R, T, S below 180 deg.
[[nodiscard]] Configuration configuration_of(const std::vector<int>& conf);

/// A line behind //INST.
struct Statement {
  int line = 1;
  Tokens tokens;
  std::string_view whole_word;  ///< its first, up to the next blank: `SMOVL`, `*AGAIN`
  std::string_view jumps_to;    ///< a label, `*AGAIN`; empty: it jumps to none
  std::string_view job;         ///< the job that it calls or jumps to; empty: none
  bool maybe = false;           ///< `IF` stands behind it

  [[nodiscard]] std::string_view word() const { return tokens[0].text; }
  [[nodiscard]] bool begins(std::string_view with) const { return tokens[0].is(with); }
  /// The variable that `MFRAME UF#(1) ...`, `SETTOOL TL#(1) ...` set: `USER[1]`, `TOOL[*]`; empty:
  /// none.
  [[nodiscard]] std::string sets() const;
  /// `CALL JOB:DRILL UF#(2)`
  [[nodiscard]] bool gives_frame() const { return !job.empty() && tokens.has("UF"); }
  /// The effect of the statement on the order. A call with a condition becomes a block.
  [[nodiscard]] std::vector<Step> steps() const;
};

/// `MOVL C00000 BC00000 V=138.0 UNTIL IN#(1)=ON`
struct Motion {
  std::string_view word;
  std::string position;
  std::vector<std::string> external;  ///< positions of axes that carry the robot or the part
  std::optional<double> speed_mm_s;   ///< `VJ=50.00` is a share of the axes' speed instead
  std::string_view ended_by;          ///< `UNTIL`; empty: only its end
};
/// Empty if the statement is none of these.
[[nodiscard]] std::optional<Motion> motion_of(const Statement& statement);

/// A job as its file has it.
struct JobText {
  std::string name, group;
  std::map<std::string, Position> positions;
  std::vector<Statement> statements;
  std::size_t mark_at = 0;  ///< behind NOP
  int open_at = 0;          ///< the line of a head that has no END; 0: none
};
/// The text outlives it.
[[nodiscard]] JobText job_of(std::string_view text);

}  // namespace trammel::cam::inform
