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
/// report them in the same words.
struct ToldByTraining {
  std::optional<Jump> jump;    ///< in a batch that somebody has looked at and learns from anyhow
  std::vector<Unlike> unlike;  ///< in what the robot is unlike its twins; empty without twins
  std::string
      unread;  ///< unread_columns() of the batch; a terminal reports them when it reads the file

  /// `changed_within_batch` and `unlike_twins`, warnings.
  [[nodiscard]] std::vector<Note> notes() const;
  /// Together with the notes of the model and `columns_not_read`, the gravest first.
  [[nodiscard]] std::vector<Note> beside(std::vector<Note> of_model) const;
};

/// The notes on a model that train() made of `batch` with `options`. A model to start from has
/// judged the batch: no jump is looked for then.
[[nodiscard]] ToldByTraining told_by_training(const CompensatedModel& model,
                                              const CheckedBatch& batch,
                                              const TrainOptions& options);

/// The prior shared by robots of the cell's type, if the cell file says `prior: fleet` or the
/// caller names twins; otherwise empty. Refuses a cell that needs twins if none are named.
[[nodiscard]] Result<std::optional<FleetPrior>> prior_of_twins(
    const Cell& cell, const std::vector<FleetMember>& twins);

}  // namespace trammel
