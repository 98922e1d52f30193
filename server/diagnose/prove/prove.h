#pragma once

#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "server/diagnose/diagnose_options.h"
#include "server/diagnose/families/family.h"
#include "server/diagnose/search/surrogates.h"
#include "server/diagnose/tell/answers.h"
#include "server/measurement/checked_batch.h"

namespace trammel::cause_search {

/// The parts of a diagnosis that a proof needs.
struct ToProve {
  const std::shared_ptr<const Cell>& cell;
  const Explained& explained;
  const std::vector<FamilyPtr>& families;  ///< of the causes that `explained.after` lacks
  const std::vector<std::string>& best;    ///< error sources of the best model
  const Surrogates& surrogates;
  const std::vector<Unseen>& unseen;  ///< with the predicted sizes
  /// Diagnoses a batch up to findings and verdict.
  std::function<Result<Diagnosis>(const std::shared_ptr<const Cell>&, const CheckedBatch&,
                                  const DiagnoseOptions&)>
      answer;
};

/// Determines by trials the sizes from which these poses show effects. It adds effects of each
/// cause that could show to the residuals of the best model, diagnoses them with that model, and
/// counts. It ends when every cause is decided or the time is over. The same rounds give the same
/// proof, with any number of threads. If the time ends during a round, its finished diagnoses
/// count.
[[nodiscard]] Proof proof_of(const ToProve& what, const DiagnoseOptions& options);

}  // namespace trammel::cause_search
