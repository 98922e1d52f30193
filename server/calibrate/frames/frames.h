#pragma once

#include "server/base/result.h"
#include "server/error_sources/physical_model.h"
#include "server/measurement/measurement.h"

/// Where base and tool stand, in closed form, before anything is refined.
namespace trammel {

[[nodiscard]] bool has_unknown_tool(const Cell& cell);
/// `sources`, and the tool besides the geometry where nobody knows the tool.
[[nodiscard]] std::vector<std::string> with_unknown_tool(std::vector<std::string> sources, const Cell& cell);

/// Where the cell says unknown: base and tools from the nominal chain and `batch`, written into the model. Refuses a
/// batch that does not determine them.
[[nodiscard]] Status locate_unknown_frames(PhysicalModel& model, const MeasurementBatch& batch);

/// The six values of a frame's source that move it by `X`: x y z, then the angles about z, y, x (a turn about y by
/// less than 90 degrees).
[[nodiscard]] Vector6 motion_values(const Pose& X);

/// A known base to be corrected starts, and has its prior, where SVD localisation of the nominal chain puts it, eqs.
/// (3.8)-(3.10): the values of the model's `base` source. Too few points to localise leave it at nominal.
void localise_base(PhysicalModel& model, const MeasurementBatch& batch);

}  // namespace trammel
