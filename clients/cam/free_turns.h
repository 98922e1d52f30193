#pragma once

#include <string>
#include <vector>

#include "clients/cam/cell_tools.h"
#include "clients/cam/configuration.h"
#include "clients/cam/lead_ins.h"

/// The turn of each target about the tool's axis, where that is free.
namespace trammel::cam {

struct FreeTurns {
  Program program;          ///< with the numbers of its poses turned
  std::vector<double> deg;  ///< of each target
};

/// Turns poses to where the model knows most. Targets that lines and arcs join turn together, so
/// that the tool keeps its way from one to the next; so do those of one motion. A path stays as it
/// is where one of its targets is left, or would come near to a limit or a singular wrist, to
/// another configuration than the program says, or with longer ways of the joints. Joint targets
/// stay.
[[nodiscard]] Result<FreeTurns> turn_freely(const Program& program, const ArmOfProgram& arm,
                                            const CellTools& cell, const AskCorrections& ask,
                                            const std::string& tool, const std::string& payload);

}  // namespace trammel::cam
