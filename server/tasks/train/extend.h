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

/// Turns the findings of a diagnosis into an extended model, in the same way for files and for the
/// service.
namespace trammel {

/// The diagnosis' share of the progress when its findings are applied; the rest is the training.
inline constexpr double kDiagnosisShare = 0.6;

/// Checks that the diagnosis found an accepted and unambiguous cause; otherwise refuses with the
/// reason. The error does not name the batch, since callers name it differently.
[[nodiscard]] Status check_can_extend(const Diagnosis& diagnosis);

/// The sources that the diagnosis adds to the list `own`.
[[nodiscard]] std::vector<std::string> added_sources(const std::vector<std::string>& own,
                                                     const Diagnosis& diagnosis);

/// A model with the findings of a diagnosis.
struct ExtendedModel {
  CompensatedModel model;
  std::vector<std::string> sources;   ///< all that it was trained with
  std::vector<Unsupported> left_out;  ///< found, but the poses held out do as well without
  std::optional<DayGain> day;  ///< the gain of the causes on another day; empty: too few rows
};
/// Trains on the training rows of `batch` with the sources in `own`, and with those of the
/// diagnosis that held-out rows support, cause by cause: first rows drawn at random, then blocks of
/// time. `diagnosis` is of `batch` and `own`. Refuses a batch without held-out rows, and the same
/// as check_can_extend(), supported_by() and train().
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
/// The held-out rows, without those that fit neither model according to the diagnosis: these would
/// judge both models by bad measurements. If they are more than a tenth, the fault is not in single
/// poses, and all rows judge.
[[nodiscard]] Judges judges_of(const Diagnosis& diagnosis, MeasurementBatch held_out);

/// The gain of extending a cell's error sources by the findings of a diagnosis: the same training
/// without and with them.
struct Extension {
  std::vector<std::string> sources;  ///< all that the extended model was trained with
  std::vector<std::string> lasting;  ///< those of them that belong in the cell file
  CompensatedModel before, after;    ///< both with figures on the same poses held out
  PairedGain gain;                   ///< of the one over the other
  JudgingSession judges;             ///< the rows that judge both
  GateVerdict verdict;  ///< on the extended model against the other, as a service judges it
  std::vector<Unsupported> left_out;  ///< found, but the poses held out do as well without
  std::optional<DayGain> day;  ///< the gain of the causes on another day; empty: too few rows

  /// The reason not to apply it: it would not go in force automatically, or it is worse in blocks
  /// of time held out. Empty: apply it.
  [[nodiscard]] std::string why_not() const;
};
/// Holds out the rows that a service with its usual share would: held_out_by_service().
[[nodiscard]] HoldOut held_out_to_extend(std::uint64_t seed);
/// extended_model() of the cell's own sources, compared with a model of these sources alone. It is
/// for cells without another model in force, on files and in a service. Refusals as there.
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

/// Adds to `error`, from diagnosing `batch`, the number of rows that were set aside and not
/// diagnosed.
[[nodiscard]] Error with_rows_set_aside(Error error, const CheckedBatch& batch);

}  // namespace trammel
