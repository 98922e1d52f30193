#pragma once

#include <optional>
#include <vector>

#include "server/base/note.h"
#include "server/calibrate/calibration.h"
#include "server/measurement/resolution.h"

namespace trammel {

/// The note on a robot file that cannot be this robot's: no corrected pose can be promised.
constexpr const char* kOffDrawing = "robot_off_drawing";

/// The note on a base that the measurements place elsewhere than the cell file.
constexpr const char* kBaseElsewhere = "base_elsewhere";

/// The note on rows that were measured beside `others` and do not fit them, with the size of their
/// misfit. If these are more than a tenth, they are not single mistakes, and the note stops the
/// model. Empty if all rows fit.
[[nodiscard]] std::optional<Note> rows_that_do_not_fit(const std::vector<SuspectPose>& suspects,
                                                       int others);

/// True if `model` has a source for the lengths and zeros of the arm. Without one, the base and a
/// bias take up what is wrong with them.
[[nodiscard]] bool identifies_geometry(const PhysicalModel& model);

/// The note on a robot file with a number farther off than a real robot is from its drawing (3 mm,
/// 3 mrad, 1 degree of a zero), by the identified `parameters` of `model`. The note stops the
/// model. Trainings and diagnoses both ask here. `discrepancy`: m per axis, the model error beyond
/// the measurement's sigma. If it is large, the number may compensate for missing error sources.
[[nodiscard]] std::optional<Note> robot_off_drawing(
    const PhysicalModel& model, const std::vector<IdentifiedParameter>& parameters,
    double discrepancy);

/// The note on a base that the measurements place elsewhere than the cell file. It stops a model
/// whose robot file nobody confirmed if the first length of the arm (by more than 3 mm) or the zero
/// of joint 1 (by more than 1 degree) explains the shift alone. Else it is a warning beyond any
/// error of an installer (50 mm, 5 degrees), and below that information. Empty within 3 mm and half
/// a degree, and if the cell states no base.
[[nodiscard]] std::optional<Note> base_elsewhere(const PhysicalModel& model);

/// The note on measured numbers that are rounded more coarsely than their stated sigma.
[[nodiscard]] Note measurements_rounded(const Rounding& rounding);

/// The note on an arm with lengths that are all longer (or shorter) than drawn by one share. That
/// is one cause and not many errors of manufacture, and positions do not show which cause. The note
/// stops the model beyond what 50 K of warmth make.
/// `covariance`: of `parameters`, SI.
[[nodiscard]] std::optional<Note> lengths_scaled(const PhysicalModel& model,
                                                 const std::vector<IdentifiedParameter>& parameters,
                                                 const Eigen::MatrixXd& covariance);

}  // namespace trammel
