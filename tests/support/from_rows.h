#pragma once

#include "server/diagnose/diagnose.h"
#include "server/measurement/split.h"
#include "server/tasks/train/extend.h"
#include "server/tasks/train/train.h"

/// The functions for checked batches, for tests that begin with rows: each checks the rows first,
/// and holds out those that their `set` says.
namespace trammel {

[[nodiscard]] inline Result<CompensatedModel> train(const std::shared_ptr<const Cell>& cell,
                                                    const MeasurementBatch& batch,
                                                    const TrainOptions& options) {
  return check_against_cell(batch, *cell).and_then([&](const CheckedBatch& checked) {
    return train(cell, checked, options);
  });
}

[[nodiscard]] inline Result<CompensatedModel> learn_bias(const CompensatedModel& calibrated,
                                                         const MeasurementBatch& batch,
                                                         const TrainOptions& options) {
  return check_against_cell(batch, calibrated.cell()).and_then([&](const CheckedBatch& checked) {
    return learn_bias(calibrated, checked, options);
  });
}

[[nodiscard]] inline Result<Diagnosis> diagnose(const std::shared_ptr<const Cell>& cell,
                                                const MeasurementBatch& batch,
                                                const DiagnoseOptions& options) {
  return check_against_cell(batch, *cell).and_then([&](const CheckedBatch& checked) {
    return diagnose(cell, checked, options);
  });
}

[[nodiscard]] inline Result<Extension> extend(const std::shared_ptr<const Cell>& cell,
                                              const MeasurementBatch& batch,
                                              const Diagnosis& diagnosis,
                                              const TrainOptions& options) {
  return check_against_cell(batch, *cell).and_then([&](const CheckedBatch& checked) {
    return extend(cell, checked, diagnosis, options);
  });
}

namespace test {

/// `batch` with a set for every row: from its `set` column if it has one, otherwise `share` of the
/// rows drawn for validation.
[[nodiscard]] inline MeasurementBatch with_held_out(MeasurementBatch batch, double share,
                                                    std::uint64_t seed) {
  const std::vector<bool> held_out = rows_held_out(batch, share, seed);
  for (std::size_t i = 0; i < held_out.size(); ++i) {
    batch.measurements[i].set = held_out[i] ? MeasurementSet::kValidation : MeasurementSet::kTrain;
  }
  return batch;
}

}  // namespace test

}  // namespace trammel
