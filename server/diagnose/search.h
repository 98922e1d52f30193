#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "server/diagnose/candidates.h"
#include "server/diagnose/diagnose.h"
#include "server/diagnose/scan.h"

namespace trammel {

/// A cause that was accepted.
struct Accepted {
  Cause cause;
  std::string source;  ///< empty for an outlier
  Best best;
  double penalty = 0;  ///< nat: what its family reaches by chance
  double p_value = 1;
  double naming_frequency = 1;
  std::vector<Cause> could_also_be;
  SuspectedPose pose;  ///< of an outlier
};

/// A smooth function that no named cause beats.
struct Unnamed {
  std::vector<std::string> depends_on;
  Eigen::MatrixXd columns;  ///< R x m over all poses that are left, SI, of the fitted size
  double score = 0;
  double p_value = 1;
};

/// What forward and backward selection ended with.
struct SearchResult {
  PhysicalModel before;  ///< calibrated, as the cell has it
  std::vector<Parameter> before_priors;
  MeasurementBatch all;              ///< that was looked at
  std::vector<std::string> sources;  ///< of the cell, then those accepted
  PhysicalModel model;               ///< calibrated with all of them
  std::vector<Parameter> priors;
  MeasurementBatch batch;  ///< without outliers
  std::vector<Accepted> accepted;
  std::vector<Unnamed> unnamed;
  Chance chance;
};

/// Forward selection, one cause at a time, each on what the model found so far leaves over: the best candidate is
/// accepted if it passes the line that the best of all candidates reaches by chance in 1 of 100 batches and, chosen
/// anew in every fold, lowers the error of poses held out. An anonymous function that explains more than any named
/// cause becomes part of the background. At the end everything must still pass beside all the rest.
[[nodiscard]] Result<SearchResult> search_causes(const std::shared_ptr<const Cell>& cell,
                                                 const std::vector<std::string>& sources, const MeasurementBatch& batch,
                                                 const DiagnoseOptions& options);

/// All columns of a background: the model's own parameters, then what is unnamed.
[[nodiscard]] Eigen::MatrixXd background_columns(const LinearProblem& problem, const std::vector<Unnamed>& unnamed);

}  // namespace trammel
