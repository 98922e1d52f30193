#pragma once

#include <optional>
#include <vector>

#include "server/base/note.h"
#include "server/calibrate/calibration.h"

namespace trammel {

/// The note on a robot file that cannot be this robot's: no corrected pose can be promised.
constexpr const char* kOffDrawing = "robot_off_drawing";

/// The note on rows that were measured beside `others` and do not fit them: which, and by how much.
/// More than a tenth are no single mistakes, and stop a model. Empty where there are none.
[[nodiscard]] std::optional<Note> rows_that_do_not_fit(const std::vector<SuspectPose>& suspects,
                                                       int others);

/// The note on a robot file with a number that is farther off than a robot is off its drawing (3
/// mm, 3 mrad, 1 degree of a zero), by what was identified: `parameters` of `model`. It stops a
/// model. Whoever looks at a calibration asks here: a training, and a diagnosis. `discrepancy`: m
/// per axis, what the model leaves beyond the measurement's sigma. Beside much of it the number may
/// make up for what the error sources lack.
[[nodiscard]] std::optional<Note> robot_off_drawing(
    const PhysicalModel& model, const std::vector<IdentifiedParameter>& parameters,
    double discrepancy);

}  // namespace trammel
