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

/// The parts of a diagnosis that a proof is made of.
struct ToProve {
  const std::shared_ptr<const Cell>& cell;
  const Explained& explained;
  const std::vector<FamilyPtr>& families;  ///< of what `explained.after` lacks
  const std::vector<std::string>& best;    ///< error sources of the best model
  const Surrogates& surrogates;
  const std::vector<Unseen>& unseen;  ///< with the sizes that are predicted
  /// Diagnoses a batch, as far as findings and verdict.
  std::function<Result<Diagnosis>(const std::shared_ptr<const Cell>&, const CheckedBatch&,
                                  const DiagnoseOptions&)>
      answer;
};

/// The sizes from which effects are named at these poses, by trying: effects of each cause that
/// could show are put into what the best model leaves over, diagnosed with that model, and counted.
/// Ends when every cause is decided or the time is over. The same rounds give the same proof,
/// however many threads there are; of a round that the time cuts short, what was done counts.
[[nodiscard]] Proof proof_of(const ToProve& what, const DiagnoseOptions& options);

}  // namespace trammel::cause_search
