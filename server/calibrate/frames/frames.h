#pragma once

#include "server/base/result.h"
#include "server/error_sources/physical_model.h"
#include "server/measurement/measurement.h"

/// Locates base and tools in closed form, before the refinement.
namespace trammel {

[[nodiscard]] bool has_unknown_tool(const Cell& cell);
/// `sources`, with `tool` added where they have `geometry` and a tool of the cell is unknown.
[[nodiscard]] std::vector<std::string> with_unknown_tool(std::vector<std::string> sources,
                                                         const Cell& cell);

/// Finds base and tools that the cell calls unknown, from the nominal chain and `batch`, and writes
/// them into the model. Refuses a batch that does not determine them.
[[nodiscard]] Status locate_unknown_frames(PhysicalModel& model, const MeasurementBatch& batch);

/// Starting values for the base, the model's X_WB first. Positions at one place hardly determine
/// its turn; then the list has turns about that place to all sides. If the cell states its base,
/// the list is X_WB alone.
[[nodiscard]] std::vector<Pose> likely_bases(const PhysicalModel& model,
                                             const MeasurementBatch& batch);
/// Names the turn of an unknown base that positions at one place do not determine. Empty if they
/// determine it.
[[nodiscard]] std::string untold_turn(const Cell& cell, const MeasurementBatch& batch);
/// The names of the parameters that turn the base.
[[nodiscard]] std::vector<std::string> turn_of_base();

/// The six values by which a frame's source moves the frame by `X`: x y z, then angles about z, y,
/// x. The angle about y stays below 90 degrees.
[[nodiscard]] Vector6 motion_values(const Pose& X);

/// Sets the model's `base` source by localisation of the nominal chain with singular values, eqs.
/// (3.8)-(3.10). Identification starts there, and the priors are centred there. With too few points
/// the base stays nominal. If the nominal points are too close together for a turn, the base is
/// only shifted.
void localise_base(PhysicalModel& model, const MeasurementBatch& batch);

}  // namespace trammel
