#pragma once

#include "server/base/result.h"
#include "server/error_sources/physical_model.h"
#include "server/measurement/measurement.h"

/// Where base and tools are: closed forms, before anything is refined.
namespace trammel {

[[nodiscard]] bool has_unknown_tool(const Cell& cell);
/// `sources`, with `tool` added where they have `geometry` and a tool of the cell is unknown.
[[nodiscard]] std::vector<std::string> with_unknown_tool(std::vector<std::string> sources,
                                                         const Cell& cell);

/// Finds base and tools that the cell calls unknown, from the nominal chain and `batch`, and writes
/// them into the model. Refuses a batch that does not determine them.
[[nodiscard]] Status locate_unknown_frames(PhysicalModel& model, const MeasurementBatch& batch);

/// Where the base may stand, as a start: the model's X_WB first. Positions at one place hardly tell
/// how it is turned; then it is turned about that place, too, to all sides. Of a cell that says its
/// base: X_WB alone.
[[nodiscard]] std::vector<Pose> likely_bases(const PhysicalModel& model,
                                             const MeasurementBatch& batch);
/// The turn that positions at one place do not tell of an unknown base, in words; empty where they
/// tell it.
[[nodiscard]] std::string untold_turn(const Cell& cell, const MeasurementBatch& batch);
/// Names of the numbers that say how the base is turned.
[[nodiscard]] std::vector<std::string> turn_of_base();

/// The six values with which the source of a frame moves it by `X`: x y z, then angles about z, y,
/// x, that about y below 90 degrees.
[[nodiscard]] Vector6 motion_values(const Pose& X);

/// Puts the model's `base` source where localisation of the nominal chain by singular values has
/// it, eqs. (3.8)-(3.10): identification starts there, and the priors are centred there. With too
/// few points the base stays nominal; where the nominal points are too near each other to tell a
/// turn, it is only shifted.
void localise_base(PhysicalModel& model, const MeasurementBatch& batch);

}  // namespace trammel
