#pragma once

#include <vector>

#include "clients/cam/krl/lines.h"
#include "clients/cam/krl/variables.h"
#include "clients/cam/program.h"

namespace trammel::cam::krl {

/// Gives the program the robot from `$machine.dat`: its place, lengths, axes and type. Defines the
/// value of `$ROBROOT` for names.
void read_stated(const std::vector<std::vector<Line>>& lines, const ReadOptions& options,
                 Variables& names, Program& program);

}  // namespace trammel::cam::krl
