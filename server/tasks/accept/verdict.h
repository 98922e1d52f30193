#pragma once

#include <cstddef>
#include <optional>
#include <string>
#include <vector>

#include "server/tasks/accept/gate.h"

namespace trammel {

/// The record of a version that is marked in force and cannot be loaded.
struct RecordInForce {
  int version = 0;
  double validation_rms =
      0;  ///< m, on its own held-out poses when it was made; 0: nothing was held out
};

/// A version of a cell's model as the store has it.
struct ModelText {
  int version = 0;
  std::string text;
};

/// The model and poses that a candidate is held against.
struct Opponents {
  std::optional<ModelText>
      in_force;  ///< none: it is the first model of its cell, or that one cannot be loaded
  std::vector<ModelText>
      served_before;            ///< the last one first; versions that do not load are skipped
  std::size_t most_before = 0;  ///< the number of loadable ones that count
  std::optional<RecordInForce> record;  ///< of a version marked in force that does not load
};

/// Calls judge() for the candidate, with the sessions after `in_force` (null: none) separated from
/// those before. If the version marked in force cannot be loaded, it judges against its record. A
/// model with a stop_of() is never put in force: the verdict is undecided, so that a person
/// decides, or not better, and its HeldBack gives the reason in both cases. `sessions`: oldest
/// first.
[[nodiscard]] GateVerdict verdict_on(const CompensatedModel& candidate, const ServedModel* in_force,
                                     std::vector<ServedModel> served_before,
                                     const std::optional<RecordInForce>& record,
                                     const std::vector<JudgingSession>& sessions,
                                     const GateOptions& options);

}  // namespace trammel
