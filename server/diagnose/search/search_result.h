#pragma once

#include <string>
#include <vector>

#include "server/diagnose/evidence/bounds.h"
#include "server/diagnose/evidence/play_sign.h"
#include "server/diagnose/evidence/refine.h"
#include "server/diagnose/search/scan.h"

namespace trammel::cause_search {

/// A cause that was accepted.
struct Accepted {
  Cause cause;
  std::string source;    ///< the spelling in a cell file; empty for an outlier
  std::string in_model;  ///< the name in the model
  Best best;
  double penalty = 0;  ///< nat: the score that its family reaches by chance
  double p_value = 1;
  double naming_frequency =
      1;  ///< share of simulated repetitions of the batch that name this cause
  std::vector<Cause> could_also_be;  ///< explain the data as well
  SuspectedPose pose;                ///< of an outlier

  [[nodiscard]] bool is_outlier() const { return source.empty(); }
};

/// A form of one of the model's own causes that another form replaced beside the findings.
struct Reformed {
  std::string from, to;
};

/// The result of forward and backward selection.
struct SearchResult {
  PriorModel before;       ///< calibrated, as the cell has it
  PriorModel after;        ///< with all accepted causes
  MeasurementBatch all;    ///< the poses that were searched
  MeasurementBatch batch;  ///< the same without outliers
  std::vector<Accepted> accepted;
  std::vector<Unnamed> unnamed;
  /// Joints with an impossible sign of `backlash`: they are among the unnamed functions, not among
  /// the accepted causes.
  std::vector<PlaySign> negative_play;
  /// Other causes with numbers beyond their bounds.
  std::vector<WrongSign> wrong_signs;
  Chance chance;
  std::vector<Reformed> reformed;
  bool too_many_outliers = false;  ///< more poses are out than may be; the rest stayed in
};

}  // namespace trammel::cause_search
