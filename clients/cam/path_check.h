#pragma once

#include "clients/cam/nominal_targets.h"
#include "clients/cam/receipt.h"

namespace trammel::cam {

/// The effect of corrections along the straight motions of a program, from each target to the next.
/// - Axis speeds, if the robot file has limits: fills ReceiptRow::path_limit_before_mm_s and
///   `..._after_mm_s`, the speed of the tool at which the first axis reaches its limit on the way
///   from the previous target, averaged over that way. If the program commands a speed that was
///   possible before the correction but exceeds this limit, the row reports that and suggests a
///   speed.
/// - Steps: the largest change of the correction from one target to the next. An uncorrected target
///   between corrected ones is a step of the whole correction.
/// There is one row for each target of the program, in its order.
void check_path(const Program& program, const Chain& robot, const NominalTargets& nominal,
                std::vector<ReceiptRow>& rows, CorrectedProgram& result);

}  // namespace trammel::cam
