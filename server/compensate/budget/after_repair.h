#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "server/compensate/budget/between.h"

/// Checks whether a repair helped: compares the model of the measurements after it with the one
/// before.
namespace trammel {

/// The outcome of a line that was to be repaired.
struct LineOutcome {
  enum class Helped {
    kPutRight,    ///< no longer beyond its U, or beyond the usual size
    kPartly,      ///< nearer to the drawing than before
    kTooFar,      ///< beyond the drawing to the other side
    kNotMoved,    ///< it is where it was
    kWrongWay,    ///< farther off than before
    kCannotTell,  ///< these poses do not determine it precisely enough
  };
  std::string line, name, action;  ///< as the budget before had them
  BudgetNumber before, moved, now;
  double alone_before = 0;  ///< m rms, at the poses after the repair
  Helped helped = Helped::kCannotTell;
};
/// `put_right`, `partly`, `too_far`, `not_moved`, `wrong_way`, `cannot_tell`.
[[nodiscard]] std::string_view to_string(LineOutcome::Helped helped);

struct AfterRepair {
  std::string model;           ///< id of the one before
  ErrorBudget before, now;     ///< of both models, at the poses after the repair
  ModelDifference difference;  ///< now minus before
  std::vector<LineOutcome>
      lines;  ///< lines that stood out before, and lost zeros; the largest first
};

/// `before` and `now` are of one drawing; `poses` are not empty, and both models know their tools
/// and payloads.
[[nodiscard]] AfterRepair after_repair(const CompensatedModel& before, const CompensatedModel& now,
                                       const std::vector<PoseContext>& poses);

/// For people: the whole error before and now, the outcome of each line, and the other changes.
[[nodiscard]] std::vector<std::string> in_words(const AfterRepair& repair, int most = 6);

}  // namespace trammel
