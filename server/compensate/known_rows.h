#pragma once

#include <set>
#include <vector>

#include "server/compensate/compensated_model.h"

namespace trammel {

/// True if the model was trained with the tool and the payload of this measurement, and its cell
/// still has both.
[[nodiscard]] bool knows(const CompensatedModel& model, const Measurement& m);

/// Tests whether the model learned from a row of a batch. This is so if the batch is one that it
/// was trained on or refitted with, except for rows that its column `set` holds out, or if its bias
/// was learned at these joints, to the last digit.
class LearnedFrom {
 public:
  /// `hash`: batch_hash() of the batch as it came.
  LearnedFrom(const CompensatedModel& model, const std::string& hash);
  [[nodiscard]] bool operator()(const Measurement& m) const;

 private:
  bool is_its_batch_ = false;
  std::set<std::vector<double>> joints_;  // rad
};

/// The rows that the model knows().
[[nodiscard]] MeasurementBatch known_rows(const CompensatedModel& model,
                                          const MeasurementBatch& batch);

}  // namespace trammel
