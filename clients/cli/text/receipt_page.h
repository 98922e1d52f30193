#pragma once

#include <string>

#include "clients/cam/correct_program.h"
#include "server/robot/cell_papers.h"

namespace trammel::cli {

/// How many targets are inside a tolerance about their wanted positions.
struct ToleranceVerdict {
  double tolerance_mm = 0;
  std::size_t targets = 0;                         ///< whose error is known
  std::size_t before = 0;                          ///< of them inside with 95 % or more, not corrected
  std::size_t after = 0;                           ///< likewise as the program is now
  double expected_before = 0, expected_after = 0;  ///< mean number inside
};
[[nodiscard]] ToleranceVerdict tolerance_verdict(const cam::CorrectedProgram& program, double tolerance_mm);
/// `tolerance 0.2 mm: 33 of 35 targets inside with 95 % (before 0)`
[[nodiscard]] std::string verdict_text(const ToleranceVerdict& verdict);

/// The receipt as one self-contained page: verdict, figures, path in 3D, targets. `tolerance_mm` 0: nothing is held
/// against one. `papers`: of the model's cell.
[[nodiscard]] std::string receipt_page(const cam::CorrectedProgram& program, double tolerance_mm,
                                       const CellPapers& papers = {});

}  // namespace trammel::cli
