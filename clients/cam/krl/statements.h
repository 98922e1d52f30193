#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "clients/cam/flow.h"
#include "clients/cam/krl/lines.h"

/// The statements of KRL, by the names of their parts.
namespace trammel::cam::krl {

[[nodiscard]] bool is_motion(std::string_view word);
/// `LIN_REL`
[[nodiscard]] bool is_relative(std::string_view word);
/// `PTP`, `SPTP`, `PTP_REL`
[[nodiscard]] bool is_by_axes(std::string_view word);
/// `DEF shift(p:IN)`, `EXT shift(E6POS:IN)`
[[nodiscard]] bool declares(const Tokens& tokens);

/// `GLOBAL DEFFCT E6POS shifted(p:IN)`, `DEFDAT drill PUBLIC`
struct Head {
  std::string_view name;
  bool is_list = false;        ///< of data
  std::size_t parameters = 0;  ///< the token behind the name
};
[[nodiscard]] std::optional<Head> head_of(const Tokens& tokens);

/// `PTP XP1`, `CIRC XP1,XP2,CA 360`, `LIN_REL {X 10}`
struct Motion {
  std::string_view word;
  std::vector<std::vector<Value>> targets;  ///< operands of each; one that is empty is not there
  bool is_arc = false;
  bool ends_by_angle = false;
};
/// Empty: the line is not a motion, or it is `PTP $AXIS_ACT`, which goes to the present place.
[[nodiscard]] std::optional<Motion> motion_of(const Tokens& tokens);

/// `BAS(#TOOL,1)`
struct Bas {
  std::string_view sets;  ///< `TOOL`
  Token to;
  std::optional<double> speed_mm_s;  ///< if `to` is a speed in m/s
};
[[nodiscard]] std::optional<Bas> bas_of(const Tokens& tokens);

/// `$TOOL=TOOL_DATA[1]`, `$BASE = SBASE(FP1.BASE_NO)`, `$VEL.CP=0.2`: of a line, or behind `WITH`.
struct Setting {
  std::string_view name;             ///< `$TOOL`
  bool whole = false;                ///< the whole variable, not only a part
  std::string_view function;         ///< `SBASE`; empty: none
  Token argument;                    ///< its first
  std::vector<Value> operands;       ///< the value assigned
  std::string_view constant;         ///< `#TCP` -> `TCP`, also as an argument; empty: none
  std::optional<double> speed_mm_s;  ///< of `$VEL`
};
/// Empty: the line begins with none of them.
[[nodiscard]] std::optional<Setting> setting_of(const Tokens& tokens);
[[nodiscard]] std::vector<Setting> settings_with(const Tokens& tokens);

/// The start of the delayed action in `INTERRUPT DECL 3 WHEN $IN[1] DO stopped( )` or `TRIGGER WHEN
/// DISTANCE=0 DELAY=0 DO $OUT[1]=TRUE`; 0: the line is neither.
[[nodiscard]] std::size_t done_later(const Tokens& tokens);
/// Words that stand before `(`, in their order.
[[nodiscard]] std::vector<std::string_view> called_in(const Tokens& tokens);
/// The effect of a line on the order, without its calls.
[[nodiscard]] Step step_of(const Tokens& tokens);

}  // namespace trammel::cam::krl
