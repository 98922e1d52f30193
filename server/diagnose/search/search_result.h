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
  std::string source;    ///< as a cell file spells it; empty for an outlier
  std::string in_model;  ///< as the model names it
  Best best;
  double penalty = 0;  ///< nat: what its family reaches by chance
  double p_value = 1;
  double naming_frequency =
      1;  ///< share of simulated repetitions of the batch that name this cause
  std::vector<Cause> could_also_be;  ///< explain the data as well
  SuspectedPose pose;                ///< of an outlier

  [[nodiscard]] bool is_outlier() const { return source.empty(); }
};

/// A form of a cause of the model's own that gave way to another beside what was found.
struct Reformed {
  std::string from, to;
};

/// The result of forward and backward selection.
struct SearchResult {
  PriorModel before;       ///< calibrated, as the cell has it
  PriorModel after;        ///< with all that was accepted
  MeasurementBatch all;    ///< the poses that were searched
  MeasurementBatch batch;  ///< the same without outliers
  std::vector<Accepted> accepted;
  std::vector<Unnamed> unnamed;
  /// Joints whose `backlash` came out with the sign that play cannot have: among the unnamed, not
  /// among the accepted.
  std::vector<PlaySign> negative_play;
  /// Other causes with numbers beyond their bounds.
  std::vector<WrongSign> wrong_signs;
  Chance chance;
  std::vector<Reformed> reformed;
  bool too_many_outliers = false;  ///< more poses are out than may be; the rest stayed in
};

}  // namespace trammel::cause_search
