#pragma once

#include <string>
#include <vector>

#include "clients/cam/correct_program.h"
#include "clients/cli/text/tolerance.h"
#include "server/robot/cell_papers.h"

namespace trammel::cli {

/// The expected error of every target of the program.
[[nodiscard]] std::vector<ExpectedError> expected_errors(const cam::CorrectedProgram& program);

/// The receipt as one self-contained page: verdict, figures, path in 3D, targets. `tolerance_mm` 0:
/// nothing is held against one. `papers`: of the model's cell.
[[nodiscard]] std::string receipt_page(const cam::CorrectedProgram& program, double tolerance_mm,
                                       const CellPapers& papers = {});

}  // namespace trammel::cli
