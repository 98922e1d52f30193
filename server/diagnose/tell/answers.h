#pragma once

#include <string>
#include <vector>

#include "server/calibrate/sessions/session_setting.h"
#include "server/diagnose/diagnose_options.h"
#include "server/diagnose/search/search_result.h"
#include "server/diagnose/search/surrogates.h"
#include "server/diagnose/tell/findings.h"
#include "server/measurement/repeats.h"

/// The result of a search, in words: each function fills its part of a diagnosis.
namespace trammel::cause_search {

/// A batch made ready to be searched.
struct PreparedBatch {
  MeasurementBatch train, validation;  ///< in the order of measuring; repeats of the one merged
  RepeatStatistics repeats;
  double vouched =
      1;  ///< times the stated sigma: noise that the repeats vouch for; the rows have it
  Surrogates surrogates;  ///< substitutes for quantities that were not recorded
  std::vector<SessionSetting>
      sessions;         ///< for several sessions: each with the noise that its repeated poses show
  bool sorted = false;  ///< rows had to be moved into the order of their times
};

/// The findings about the searched poses, from which all reports are read. Before and after are
/// compared on the same poses, since leaving a pose out is not a gain.
struct Explained {
  Explained(const Cell& cell, SearchResult search);

  SearchResult found;
  LinearProblem before,
      after;       ///< about the cell's own model and about the extended one, with all candidates
  Background all;  ///< all that was found, named or not
  /// The problem of the extended model fitted by itself, as in a training: without nameless
  /// functions.
  LinearProblem served;
};

/// Noise, errors before and after, the waterfall from the one to the other.
void tell_errors(const Explained& explained, const PreparedBatch& prepared, Diagnosis& diagnosis);
/// Sets findings, the unexplained part, and suspects. `recorded`: the batch without surrogates.
void tell_findings(const Explained& explained, const PreparedBatch& prepared,
                   const MeasurementBatch& recorded, const Remainder& remainder,
                   Diagnosis& diagnosis);
/// Sets the verdict when all findings and the residual are known. Outliers are not a cause: if more
/// than noise is left beside them, the verdict is unknown.
void tell_verdict(Diagnosis& diagnosis);
/// Sets the sources before, and the extended list with the findings that are beyond doubt.
void tell_sources(const SearchResult& found, bool sorted, Diagnosis& diagnosis);
/// The findings by the size of their effects, single poses at the end.
void tell_largest_first(Diagnosis& diagnosis);
/// Errors on poses held out: the validation rows, or folds where there are none. Adds suspects
/// among them.
void tell_held_out(const Explained& explained, const PreparedBatch& prepared, Diagnosis& diagnosis);
/// Sets the causes that these poses could not have separated or shown.
void tell_blindness(const Explained& explained, const std::vector<FamilyPtr>& families,
                    const Cell& cell, const Surrogates& surrogates,
                    const MeasurementBatch& recorded, Diagnosis& diagnosis);
void tell_periodograms(const Explained& explained, Diagnosis& diagnosis);
/// The next poses to measure, or the reason why none would help.
void tell_next_poses(const Explained& explained, const DiagnoseOptions& options,
                     Diagnosis& diagnosis);
/// Sets the residual after all findings, and the quantities on which it still depends.
void tell_left_over(const Explained& explained, std::uint64_t seed, Diagnosis& diagnosis);
/// Sets the share of hidden effects that is found again in these poses, for the found causes and
/// some common ones.
void tell_recovery(const Explained& explained, const std::vector<FamilyPtr>& families,
                   std::uint64_t seed, Diagnosis& diagnosis);
/// The columns that the batch lacked or had wrong. `recorded`: all of its rows, without surrogates.
void tell_limits(const Explained& explained, const PreparedBatch& prepared,
                 const MeasurementBatch& recorded, Diagnosis& diagnosis);

}  // namespace trammel::cause_search
