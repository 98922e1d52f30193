#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "server/compensate/compensated_model.h"

namespace trammel {

struct TrainOptions {
  std::optional<std::string> level;  ///< instead of the cell's error sources
  std::optional<std::string> bias;   ///< instead of the cell's: `none`, a kernel or `auto` (choose_bias())
  /// A model of this robot to start from: only `refit` is identified anew, and a bias only where `bias` names one.
  std::optional<CompensatedModel> from;
  std::vector<std::string> refit = {"base", "tool"};
  double validation_share = 0;  ///< of the rows, drawn, when the batch has no `set` column; 0 = train on all
  std::uint64_t seed = 1;
  std::int64_t trained_at = 0;  ///< Unix time, s, as recorded
  /// What is being done and the share done of all in [0, 1]; return false to give up.
  std::function<bool(const std::string& stage, double share)> progress;
};

/// MeasurementBatch -> calibrate -> fit bias -> CompensatedModel, validated on the rows held out.
/// `batch` is checked against the cell here; refusals as there and as calibrate() and BiasModel::fit() say.
[[nodiscard]] Result<CompensatedModel> train(std::shared_ptr<const Cell> cell, const MeasurementBatch& batch,
                                             const TrainOptions& options);

/// What `physics` leaves over of the measured positions, in B: what a bias is learned from.
[[nodiscard]] BiasProblem leftover(const PhysicalModel& physics, const MeasurementBatch& batch);

/// `calibrated` with a bias learned anew from what its physics leaves over of `batch`, whose poses become its domain:
/// calibrated wherever the robot reaches, learned where it works. Of `options` only bias, seed, trained_at and progress
/// matter. Refusals as train().
[[nodiscard]] Result<CompensatedModel> learn_bias(const CompensatedModel& calibrated, const MeasurementBatch& batch,
                                                  const TrainOptions& options);

}  // namespace trammel
