#pragma once

#include <vector>

#include "clients/cam/program.h"

namespace trammel::cam {

/// Reads KUKA KRL (.src with its .dat, `$config.dat`) of one program: positions and axes in data
/// lists, in assignments and in motions, spline blocks, inline forms with their FDAT, `a:b` of
/// constant frames. Tools and bases come from
/// `$TOOL`, `$BASE`, `BAS(#TOOL,n)`, FDAT and `WITH`, followed through calls and branches.
/// `$machine.dat` says where the robot stands in $WORLD, and which robot it is.
[[nodiscard]] Program read_krl(std::vector<SourceFile> files, const ReadOptions& options);

}  // namespace trammel::cam
