#pragma once

#include <memory>
#include <string>
#include <vector>

#include "server/compensate/paired_gain.h"
#include "server/diagnose/diagnosis.h"
#include "server/trainer/pipeline/supported.h"
#include "server/trainer/pipeline/train.h"

namespace trammel {

/// What extending a cell's error sources by what a diagnosis found is worth: the same training without and with them.
struct Extension {
  std::vector<std::string> sources;   ///< all that the extended model was trained with
  std::vector<std::string> lasting;   ///< of them, those that belong into the cell file
  CompensatedModel before, after;     ///< both with figures on the same poses held out
  PairedGain gain;                    ///< of the one over the other
  std::vector<Unsupported> left_out;  ///< found, but the poses held out do as well without
};

/// Whether the diagnosis found a cause that is accepted and unambiguous; else refuses, saying why not.
[[nodiscard]] Status check_can_extend(const Diagnosis& diagnosis);

/// The sources that hold beyond the batch: without those that begin at one of its poses, and without what the tracker
/// did meanwhile.
[[nodiscard]] std::vector<std::string> lasting_sources(const std::vector<std::string>& sources);

/// What the diagnosis adds to the cell's own list.
[[nodiscard]] std::vector<std::string> added_sources(const Cell& cell, const Diagnosis& diagnosis);

/// The sources that `model` was trained with, a compliance as `cell` spells it; those of one batch only where it is
/// `batch` that the model was trained from.
[[nodiscard]] std::vector<std::string> sources_in_force(const CompensatedModel& model, const Cell& cell,
                                                        const MeasurementBatch& batch);

/// `batch` with a set for every row: as its `set` column says, else `share` of the rows drawn for validation.
[[nodiscard]] MeasurementBatch with_held_out(MeasurementBatch batch, double share, std::uint64_t seed);

/// `error` of diagnosing `batch`, and how many of its rows are set aside: they are not among those diagnosed.
[[nodiscard]] Error with_rows_set_aside(Error error, const MeasurementBatch& batch);

/// Rows that one model is judged against another by.
struct Judges {
  MeasurementBatch batch;
  std::vector<std::string> left_out;  ///< pose ids
};
/// The rows held out, without those that the diagnosis says fit neither model: they would judge both by how badly they
/// were measured. Where these are more than a tenth it is no matter of single poses, and all of them judge.
[[nodiscard]] Judges judges_of(const Diagnosis& diagnosis, MeasurementBatch held_out);

/// Of what the diagnosis adds to the cell's own list, what the rows of `batch` held out speak for, cause by cause.
/// `seed`: of training. Refuses a batch without rows held out: nothing could be judged.
[[nodiscard]] Result<Supported> supported_sources(const std::shared_ptr<const Cell>& cell,
                                                  const MeasurementBatch& batch, const Diagnosis& diagnosis,
                                                  std::uint64_t seed,
                                                  const std::function<bool(double share)>& progress);

/// Trains on the training rows of `batch` with the cell's error sources and with those of the diagnosis that are
/// supported. Refuses what check_can_extend(), supported_sources() and train() refuse.
[[nodiscard]] Result<Extension> extend(const std::shared_ptr<const Cell>& cell, const MeasurementBatch& batch,
                                       const Diagnosis& diagnosis, TrainOptions options);

}  // namespace trammel
