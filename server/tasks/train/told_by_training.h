#pragma once

#include <optional>
#include <string>
#include <vector>

#include "server/base/note.h"
#include "server/calibrate/jump.h"
#include "server/compensate/compensated_model.h"
#include "server/measurement/checked_batch.h"
#include "server/tasks/train/train.h"

namespace trammel {

/// The notes of a training beside those of its model. The command line, the library and Python
/// tell it in the same words.
struct ToldByTraining {
  std::optional<Jump> jump;    ///< in a batch that somebody has looked at and learns from anyhow
  std::vector<Unlike> unlike;  ///< in what the robot is unlike its twins; empty without twins
  std::string
      unread;  ///< unread_columns() of the batch, which a terminal tells as it reads the file

  /// `changed_within_batch` and `unlike_twins`, warnings.
  [[nodiscard]] std::vector<Note> notes() const;
  /// Together with those of the model and `columns_not_read`, the gravest first.
  [[nodiscard]] std::vector<Note> beside(std::vector<Note> of_model) const;
};

/// The notes on a model that train() made of `batch` with `options`. A model to start from has
/// judged the batch: no jump is looked for then.
[[nodiscard]] ToldByTraining told_by_training(const CompensatedModel& model,
                                              const CheckedBatch& batch,
                                              const TrainOptions& options);

/// The prior that robots of the cell's type have in common, where the cell file says `prior: fleet`
/// or somebody names twins; empty where neither is so. Refuses a cell that asks for twins where
/// nobody names one.
[[nodiscard]] Result<std::optional<FleetPrior>> prior_of_twins(
    const Cell& cell, const std::vector<FleetMember>& twins);

}  // namespace trammel
