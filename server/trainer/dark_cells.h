#pragma once

#include <string>
#include <vector>

#include "server/base/result.h"
#include "server/trainer/served_cells.h"

namespace trammel {

/// The state of a cell after a start of this program.
struct CellAtStart {
  enum class State {
    kServed,
    kCopyServed,  ///< served with the version in force, from its copy beside the store: the text in
                  ///< the store is bad
    kOlderServed,  ///< served with a version other than the one in force
    kUntrained,    ///< nothing was ever in force
    kDark          ///< something was in force, and this program would serve nothing
  };
  std::string cell;
  State state = State::kServed;
  int version = 0;  ///< in force; 0: none
  std::string why = {};
};

/// Every cell, by name, from the store at `path` and the copies beside it, which are only read,
/// even while a service uses them. For each cell: whether this program can read the model in force,
/// and whether it fits the present cell file.
[[nodiscard]] Result<std::vector<CellAtStart>> cells_at_start(const std::string& path,
                                                              const ServedCells& cells);

}  // namespace trammel
