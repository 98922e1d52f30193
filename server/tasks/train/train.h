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
  /// A model of this robot to start from: only `refit` is identified anew, and a bias only if
  /// `bias` names one.
  std::optional<CompensatedModel> from;
  std::vector<std::string> refit = {"base", "tool"};
  /// The prior of the arm's parameters that robots of this type share, except for parameters in
  /// which this robot differs from its twins. Empty: the drawing alone.
  std::optional<FleetPrior> fleet = {};
  std::uint64_t seed = 1;
  std::int64_t trained_at = 0;  ///< Unix time, s, as recorded
  /// A person who knows the batch has looked at it: positions are used as they are read.
  bool looked_at = false;
  /// Is told the present step and the share done of all in [0, 1]; return false to give up.
  std::function<bool(const std::string& stage, double share)> progress;
};

/// CheckedBatch -> calibrate -> fit bias -> CompensatedModel, learned from the training rows and
/// validated on the held-out ones. `batch` is checked against `cell`. Refuses positions and
/// orientations that do not follow the joints (batch_doubt()), and the same as calibrate() and
/// BiasModel::fit().
[[nodiscard]] Result<CompensatedModel> train(std::shared_ptr<const Cell> cell,
                                             const CheckedBatch& batch,
                                             const TrainOptions& options);

/// `calibrated` with a new bias, learned from the residuals of its physics on all rows of `batch`
/// (checked against its cell), whose poses become its domain. The physics is then valid wherever
/// the robot reaches, and the bias where it works. Of `options` only bias, seed, trained_at and
/// progress matter. Refusals as train().
[[nodiscard]] Result<CompensatedModel> learn_bias(const CompensatedModel& calibrated,
                                                  const CheckedBatch& batch,
                                                  const TrainOptions& options);

}  // namespace trammel
