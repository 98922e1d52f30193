#pragma once

#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "clients/cam/correct_program.h"
#include "server/base/note.h"

/// The receipt of a corrected program, for people and programs.
namespace trammel::cam {

/// One row per target: `file,line,name,motion,used_at,tool,frame,status`, the numbers before and
/// after in the units of the file, `x_mm` ... of the position in the robot's base, expected errors,
/// `rounding_mm`, `message`, `suggestion`.
[[nodiscard]] std::string receipt_csv(const CorrectedProgram& program);
/// `tolerance`: what the targets were held against; null: nothing.
[[nodiscard]] std::string receipt_json(const CorrectedProgram& program,
                                       const nlohmann::ordered_json& tolerance = nullptr,
                                       const std::vector<Note>& of_model = {});
/// What the files contradict, then `148 motions, 141 corrected; 60 targets: 55 ok, 5 refused`, and
/// the items left alone with their reasons.
[[nodiscard]] std::string receipt_summary(const CorrectedProgram& program);
/// A line per target; beyond ten, a line per reason, the one with the most motions first.
[[nodiscard]] std::string left_alone_text(const CorrectedProgram& program);

}  // namespace trammel::cam
