#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "server/compensate/compensated_model.h"

namespace trammel {

struct TrainOptions {
  std::optional<std::string> level;      ///< instead of the cell's error sources
  std::optional<std::string> bias;       ///< instead of the cell's bias
  std::optional<CompensatedModel> from;  ///< a model of this cell to start from: only `refit` is identified anew
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

}  // namespace trammel
