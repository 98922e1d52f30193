#pragma once

#include <string>
#include <vector>

#include "server/base/result.h"
#include "server/calibrate/calibration.h"

/// Where the anchors of instruments are, before anything is refined.
namespace trammel {

/// `specs`, with `anchors` where the batch has gauges, and `instrument_zero` where the cell file
/// says that the zero of one of their instruments is unknown.
[[nodiscard]] Result<std::vector<std::string>> with_instruments(std::vector<std::string> specs,
                                                                const Cell& cell,
                                                                const MeasurementBatch& batch);

/// Refuses what gauges do not tell: several set-ups of the instrument; a base or a tool that the
/// cell calls unknown, where no row has a position.
[[nodiscard]] Status check_gauges(const PhysicalModel& model, const MeasurementBatch& batch);

/// Writes into the values of `model` where its unknown anchors are, by the gauges told of
/// themselves and the tool points as the model has them: the linear equations of the squared
/// distances, refined. Refuses an anchor with fewer than 4 values, or whose tool points lie on one
/// line.
[[nodiscard]] Status locate_anchors(PhysicalModel& model, const MeasurementBatch& batch);

}  // namespace trammel
