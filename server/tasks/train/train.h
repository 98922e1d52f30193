#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "server/compensate/compensated_model.h"
#include "server/fleet/fleet_prior.h"
#include "server/measurement/checked_batch.h"

namespace trammel {

struct TrainOptions {
  std::optional<std::string> level;  ///< instead of the cell's error sources
  std::optional<std::string>
      bias;  ///< instead of the cell's: `none`, a kernel or `auto` (choose_bias())
  /// A model of this robot to start from: only `refit` is identified anew, and a bias only where
  /// `bias` names one.
  std::optional<CompensatedModel> from;
  std::vector<std::string> refit = {"base", "tool"};
  /// The prior of the arm's parameters that robots of this type have in common, but for those in
  /// which this robot is unlike its twins. Empty: the drawing alone.
  std::optional<FleetPrior> fleet = {};
  std::uint64_t seed = 1;
  std::int64_t trained_at = 0;  ///< Unix time, s, as recorded
  /// Somebody who knows the batch has looked at it: positions are learned from as they are read.
  bool looked_at = false;
  /// Is told the present step and the share done of all in [0, 1]; return false to give up.
  std::function<bool(const std::string& stage, double share)> progress;
};

/// CheckedBatch -> calibrate -> fit bias -> CompensatedModel, learned from the training rows and
/// validated on those held out. `batch` is checked against `cell`. Refuses positions and
/// orientations that do not follow the joints (batch_doubt()), and what calibrate() and
/// BiasModel::fit() refuse.
[[nodiscard]] Result<CompensatedModel> train(std::shared_ptr<const Cell> cell,
                                             const CheckedBatch& batch,
                                             const TrainOptions& options);

/// `calibrated` with a bias learned anew from what its physics leaves over of all rows of `batch`
/// (checked against its cell), whose poses become its domain: calibrated wherever the robot
/// reaches, learned where it works. Of `options` only bias, seed, trained_at and progress matter.
/// Refusals as train().
[[nodiscard]] Result<CompensatedModel> learn_bias(const CompensatedModel& calibrated,
                                                  const CheckedBatch& batch,
                                                  const TrainOptions& options);

}  // namespace trammel
