#pragma once

#include <optional>
#include <string>
#include <vector>

#include "clients/cam/cell_tools.h"
#include "clients/cam/lead_ins.h"
#include "clients/cam/mark.h"
#include "clients/cam/program.h"
#include "clients/cam/receipt.h"
#include "server/exchange/answer.h"
#include "server/robot/cell.h"

/// A program in, a corrected program and its receipt out. The same for every dialect, and for a
/// model in a file or behind a service.
namespace trammel::cam {

struct CorrectProgramOptions {
  std::string tool, payload;  ///< of the cell, as the user named them
  bool keep_digits = false;   ///< numbers keep their decimals, whatever rounding costs
  std::string version;        ///< version of this software, for the mark
  std::string date;           ///< for the mark
  std::optional<LeadInOptions> lead_in = {};  ///< empty: no point is inserted
  bool free_rz = false;  ///< the tool may turn about its axis: see free_turns.h
};

/// Refuses the same as choose_tools() and `ask`, and a file that is marked as corrected.
[[nodiscard]] Result<CorrectedProgram> correct_program(const Program& program, const Chain& robot,
                                                       const CellTools& cell,
                                                       const AskCorrections& ask,
                                                       const CorrectProgramOptions& options);

}  // namespace trammel::cam
