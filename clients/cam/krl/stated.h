#pragma once

#include <vector>

#include "clients/cam/krl/lines.h"
#include "clients/cam/krl/variables.h"
#include "clients/cam/program.h"

namespace trammel::cam::krl {

/// Gives the program what `$machine.dat` says of the robot: where it stands, its lengths, axes
/// and type. Tells the names what `$ROBROOT` stands for.
void read_stated(const std::vector<std::vector<Line>>& lines, const ReadOptions& options,
                 Variables& names, Program& program);

}  // namespace trammel::cam::krl
