#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "server/compensate/paired_gain.h"
#include "server/diagnose/diagnosis.h"
#include "server/tasks/accept/gate.h"
#include "server/tasks/accept/judging.h"
#include "server/tasks/train/another_day.h"
#include "server/tasks/train/supported.h"
#include "server/tasks/train/train.h"

/// From what a diagnosis found to a model that has it: the one way, for files and for the service.
namespace trammel {

/// The diagnosis' share of the progress where what it finds is applied; the rest is the training.
inline constexpr double kDiagnosisShare = 0.6;

/// Checks that the diagnosis found a cause that is accepted and unambiguous; else refuses, saying
/// why not. The batch is not named: each door has a name of its own for it.
[[nodiscard]] Status check_can_extend(const Diagnosis& diagnosis);

/// The sources that the diagnosis adds to the list `own`.
[[nodiscard]] std::vector<std::string> added_sources(const std::vector<std::string>& own,
                                                     const Diagnosis& diagnosis);

/// A model that has what a diagnosis found.
struct ExtendedModel {
  CompensatedModel model;
  std::vector<std::string> sources;   ///< all that it was trained with
  std::vector<Unsupported> left_out;  ///< found, but the poses held out do as well without
  std::optional<DayGain>
      day;  ///< what the causes are worth on another day; empty: too few rows to tell
};
/// Trains on the training rows of `batch` with the sources in `own` and with those of the diagnosis
/// that the rows held out speak for, cause by cause, first drawn at random, then in blocks of time.
/// `diagnosis` is of `batch` and `own`. Refuses a batch without rows held out, and what
/// check_can_extend(), supported_by() and train() refuse.
[[nodiscard]] Result<ExtendedModel> extended_model(const std::shared_ptr<const Cell>& cell,
                                                   const std::vector<std::string>& own,
                                                   const CheckedBatch& batch,
                                                   const Diagnosis& diagnosis,
                                                   const TrainOptions& options);

/// Rows that one model is judged against another by.
struct Judges {
  MeasurementBatch batch;
  std::vector<std::string> left_out;  ///< pose ids
};
/// The rows held out, without those that the diagnosis says fit neither model: they would judge
/// both by how badly they were measured. Where these are more than a tenth it is no matter of
/// single poses, and all of them judge.
[[nodiscard]] Judges judges_of(const Diagnosis& diagnosis, MeasurementBatch held_out);

/// The worth of extending a cell's error sources by what a diagnosis found: the same training
/// without and with them.
struct Extension {
  std::vector<std::string> sources;   ///< all that the extended model was trained with
  std::vector<std::string> lasting;   ///< of them, those that belong into the cell file
  CompensatedModel before, after;     ///< both with figures on the same poses held out
  PairedGain gain;                    ///< of the one over the other
  JudgingSession judges;              ///< the rows that judge both
  GateVerdict verdict;                ///< on the extended model by them, as a service judges it
  std::vector<Unsupported> left_out;  ///< found, but the poses held out do as well without
  std::optional<DayGain>
      day;  ///< what the causes are worth on another day; empty: too few rows to tell

  /// Why it is not to be applied: it would not go in force by itself, or is worse where blocks of
  /// time were held out. Empty: apply it.
  [[nodiscard]] std::string why_not() const;
};
/// Holds out what a service with its usual share does: held_out_by_service().
[[nodiscard]] HoldOut held_out_to_extend(std::uint64_t seed);
/// extended_model() of the cell's own sources, beside a model of them alone: where no other model
/// is in force, on files and in a service. Refusals as there.
[[nodiscard]] Result<Extension> extend(const std::shared_ptr<const Cell>& cell,
                                       const CheckedBatch& batch, const Diagnosis& diagnosis,
                                       const TrainOptions& options);

/// The outcome of a diagnosis' findings.
struct Applied {
  std::optional<Extension> extension;  ///< empty: there was nothing to extend by
  std::string
      why_not;  ///< why nothing is to be applied, in the words of every door; empty: apply it
};
/// extend(), where the diagnosis found something.
[[nodiscard]] Result<Applied> applied(const std::shared_ptr<const Cell>& cell,
                                      const CheckedBatch& batch, const Diagnosis& diagnosis,
                                      const TrainOptions& options);

/// `error` of diagnosing `batch`, and how many of its rows are set aside: they are not among those
/// diagnosed.
[[nodiscard]] Error with_rows_set_aside(Error error, const CheckedBatch& batch);

}  // namespace trammel
