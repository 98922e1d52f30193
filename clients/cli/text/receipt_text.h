#pragma once

#include <optional>
#include <string>
#include <vector>

#include "clients/cam/correct_program.h"
#include "clients/cli/text/receipt_page.h"
#include "server/base/note.h"

/// The receipt of a corrected program, for people and programs.
namespace trammel::cli {

/// One row per target: `file,line,name,motion,used_at,tool,frame,status`, the numbers before and
/// after in the units of the file, `x_mm` ... of the position in the robot's base, expected errors,
/// `rounding_mm`, `message`, `suggestion`.
[[nodiscard]] std::string receipt_csv(const cam::CorrectedProgram& program);
[[nodiscard]] std::string receipt_json(const cam::CorrectedProgram& program,
                                       const std::optional<ToleranceVerdict>& verdict,
                                       const std::vector<Note>& of_model = {});
/// `148 motions, 141 corrected; 60 targets: 55 ok, 5 refused`, and the items left alone with their
/// reasons.
[[nodiscard]] std::string receipt_summary(const cam::CorrectedProgram& program);
/// A line per target; beyond ten, a line per reason, the one with the most motions first.
[[nodiscard]] std::string left_alone_text(const cam::CorrectedProgram& program);

}  // namespace trammel::cli
