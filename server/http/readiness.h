#pragma once

#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "server/http/watched.h"

namespace trammel {

/// Whether a cell is answered for, and if not, why. README.md of this folder has the table.
struct CellReadiness {
  enum class State {
    kServed,
    kOnDisk,         ///< served; a request loads its model
    kCopyServed,     ///< served, from the copy of a model whose text in the store is bad
    kFormerServed,   ///< served with files of the cell that the record no longer uses
    kOlderServed,    ///< served, with an older version than the one in force
    kLoading,        ///< dark: its model is not loaded yet
    kUntrained,      ///< dark: there is no model
    kInTraining,     ///< dark: the first model is being made
    kTrainingEnded,  ///< dark: a training has ended without a model in force
    kOfAnotherRobot,
    kUnreadable,
    kDescribedOtherwise  ///< dark here: another server of the record has other files of the cell
  };
  std::string cell;
  State state = State::kServed;
  int version = 0;  ///< in force; 0: none
  std::string why = {};

  [[nodiscard]] bool is_dark() const { return state > State::kOlderServed; }
};
/// `served`, `in_training`.
[[nodiscard]] const char* to_text(CellReadiness::State state);

/// The readiness of every cell, by name. Asks the store about at most a few dark cells.
[[nodiscard]] std::vector<CellReadiness> cells_readiness(const Watched& server);

/// The answer of /readyz: ready where every cell asked about is, and the server moves.
struct Readiness {
  bool ready = false;
  nlohmann::ordered_json told;
};
/// `cell`: this one only; empty: all.
[[nodiscard]] Readiness readiness(const Watched& server, ServerPhase phase,
                                  const std::string& cell);

}  // namespace trammel
