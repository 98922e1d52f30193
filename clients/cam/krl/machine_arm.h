#pragma once

#include <string>
#include <utility>
#include <vector>

#include "clients/cam/krl/lines.h"
#include "clients/cam/krl/variables.h"
#include "server/robot/chain.h"

namespace trammel::cam::krl {

/// The arm that `$machine.dat` describes: six turning axes, of which three carry a wrist whose axes
/// meet (`$MAIN_AXIS=#NR`, `$WRIST_AXIS=#ZEH`). `limits`: rad, of each axis; empty: not known. If
/// the arm is of another kind, or the file lacks a value, the error is a clause that says so.
///
/// Its kinematics: `$TIRORO` Rz(A1) Tx(`$LENGTH_A`) Ry(A2) Tx(`$LENGTH_B`) Ry(A3) `$TX3P3` Rz(A4)
/// `$DH_4` Rz(A5) `$DH_5` Rz(A6) `$TFLWP`, each angle times its `$AXIS_DIR`.
[[nodiscard]] Told<Chain> machine_arm(const std::vector<std::vector<Line>>& lines,
                                      const Variables& names, const std::string& name,
                                      const std::vector<std::pair<double, double>>& limits);

}  // namespace trammel::cam::krl
