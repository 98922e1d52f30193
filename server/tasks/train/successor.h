#pragma once

#include <memory>
#include <string>

#include "server/compensate/served_model.h"
#include "server/tasks/train/train.h"

namespace trammel {

/// The successor of the model in force, by one more batch.
struct Successor {
  CompensatedModel model;
  std::string note;  ///< for people; empty where the whole model was trained anew
};

/// Trains from `batch`. If the batch covers much less of the joint ranges than `present` (null:
/// none), or fewer of its tools, it only updates base and tool, and the rest of that model stays.
/// Refusals as train().
[[nodiscard]] Result<Successor> train_successor(const std::shared_ptr<const Cell>& cell,
                                                const CheckedBatch& batch,
                                                const ServedModel* present, TrainOptions options);

}  // namespace trammel
