#pragma once

#include <string>
#include <vector>

#include "clients/cam/cell_tools.h"
#include "clients/cam/configuration.h"
#include "clients/cam/lead_ins.h"

/// The turn of each target about the tool's axis, if that turn is free.
namespace trammel::cam {

struct FreeTurns {
  Program program;          ///< with the numbers of its poses turned
  std::vector<double> deg;  ///< of each target
};

/// Turns poses to the angle with the smallest uncertainty of the model. Targets that lines and arcs
/// join turn together, so the tool keeps its way from one to the next. Targets of one motion also
/// turn together. A path stays unchanged if one of its targets stays uncorrected. It also stays if
/// a target would come near to a limit or a singular wrist, into another configuration than the
/// program states, or with longer ways of the joints. Joint targets stay unchanged.
[[nodiscard]] Result<FreeTurns> turn_freely(const Program& program, const ArmOfProgram& arm,
                                            const CellTools& cell, const AskCorrections& ask,
                                            const std::string& tool, const std::string& payload);

}  // namespace trammel::cam
