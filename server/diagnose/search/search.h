#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "server/diagnose/diagnose.h"
#include "server/diagnose/evidence/play_sign.h"
#include "server/diagnose/evidence/refine.h"
#include "server/diagnose/families/candidates.h"
#include "server/diagnose/search/scan.h"

namespace trammel {

/// A cause that was accepted.
struct Accepted {
  Cause cause;
  std::string source;    ///< as a cell file spells it; empty for an outlier
  std::string in_model;  ///< as the model names it
  Best best;
  double penalty = 0;  ///< nat: what its family reaches by chance
  double p_value = 1;
  double naming_frequency = 1;
  std::vector<Cause> could_also_be;
  SuspectedPose pose;  ///< of an outlier
};

/// What forward and backward selection ended with.
struct SearchResult {
  PriorModel before;       ///< calibrated, as the cell has it
  PriorModel after;        ///< with all that was accepted
  MeasurementBatch all;    ///< that was looked at
  MeasurementBatch batch;  ///< without outliers
  std::vector<Accepted> accepted;
  std::vector<Unnamed> unnamed;
  /// Joints whose `backlash` came out with the sign that play cannot have: among the unnamed, not among the accepted.
  std::vector<PlaySign> negative_play;
  Chance chance;
  /// The form of the model's own compliance that gave way to another beside what was found; empty where none did.
  std::string reformed_from, reformed_to;
  bool too_many_outliers = false;  ///< there are more than a tenth; the rest stayed in
};

/// Forward selection, one cause at a time, each on what the model found so far leaves over: the best candidate is
/// accepted if it passes the line that the best of all candidates reaches by chance in 3 of 1000 batches and, chosen
/// anew in every fold, lowers the error of poses held out. An anonymous function that explains more than any named
/// cause becomes part of the background. At the end everything must still pass beside all the rest.
[[nodiscard]] Result<SearchResult> search_causes(const std::shared_ptr<const Cell>& cell,
                                                 const std::vector<std::string>& sources, const MeasurementBatch& batch,
                                                 const DiagnoseOptions& options);

}  // namespace trammel
