#pragma once

#include "clients/cam/nominal_targets.h"
#include "clients/cam/receipt.h"

namespace trammel::cam {

/// The effect of corrections along the straight motions of a program, from each target to the next.
/// - Axis speeds, where the robot file tells limits: fills ReceiptRow::path_limit_before_mm_s and
/// `..._after_mm_s`, the
///   speed of the tool at which the first axis reaches its limit on the way from the target before,
///   in the mean over that way. Where the program commands more than that, but could before, the
///   row says so and suggests a speed.
/// - Steps: the largest change of the correction from a target to the next; a target that is left
/// between corrected
///   ones is a step of the whole correction.
/// Rows are those of the program's targets, in its order.
void check_path(const Program& program, const Chain& robot, const NominalTargets& nominal,
                std::vector<ReceiptRow>& rows, CorrectedProgram& result);

}  // namespace trammel::cam
