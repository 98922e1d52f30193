#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "clients/cam/rapid/interpreter.h"
#include "clients/cam/rapid/syntax.h"

/// The instructions of RAPID that move the tool, and their arguments.
namespace trammel::cam::rapid {

/// True for instructions of the controller that move the tool to their targets. A similar name,
/// `MoveLOffset`, is a user's procedure.
[[nodiscard]] bool is_motion(const std::string& name);
[[nodiscard]] bool is_search(const std::string& name);
/// True if the tool goes to the target on a line or an arc.
[[nodiscard]] bool is_linear(const std::string& name);
/// `MoveC`, `TriggC`, `ArcC1Start`: the letter behind the kind of motion.
[[nodiscard]] bool is_arc(const std::string& name);
[[nodiscard]] bool has_label(const Instruction& instruction, std::string_view label);
/// The tool argument: one that is declared as a tool, or the last.
[[nodiscard]] const Expression* tool_argument(const Interpreter& meaning, const Instruction& motion,
                                              const std::vector<const Expression*>& positional,
                                              const Scope& scope);
/// mm/s, of the tool: the fastest that the callers of a motion hand over; `\V:=60` decides it.
[[nodiscard]] std::optional<double> speed_of(Interpreter& meaning, std::size_t module,
                                             const Instruction& motion);

}  // namespace trammel::cam::rapid
