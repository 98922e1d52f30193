#pragma once

#include <vector>

#include "clients/cam/program.h"

/// Tables of targets that stay tables: only the numbers of poses change.
namespace trammel::cam {

/// KUKA CAMRob: lines `n;X;Y;Z;A;B;C;...`, mm and deg (A about Z), in the robot's base or the frame
/// `CAMROB` that the user gives.
[[nodiscard]] Program read_camrob(std::vector<SourceFile> files, const ReadOptions& options);

/// RoboDK targets: a header that names `X,Y,Z` and `RX,RY,RZ` (deg, about X, Y, Z as they stand),
/// `A,B,C` (KUKA) or `qw,qx,qy,qz`, in the robot's base or in the user's frame `ROBODK`. Without a
/// header: X,Y,Z,RX,RY,RZ.
[[nodiscard]] Program read_robodk(std::vector<SourceFile> files, const ReadOptions& options);

}  // namespace trammel::cam
