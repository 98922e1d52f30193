#pragma once

#include <cstddef>
#include <set>
#include <string>
#include <vector>

#include "clients/cam/flow.h"
#include "clients/cam/krl/lines.h"
#include "clients/cam/krl/variables.h"

/// Routines of KRL files, and what is handed over to them.
namespace trammel::cam::krl {

struct Routine {
  std::string name;
  std::size_t file = 0, first = 0, last = 0;  ///< lines
};

/// What a line does to the order. Calls are not in it.
[[nodiscard]] Step step_of(const std::vector<Token>& tokens);

/// `shift(XP2)`: a routine of these files that takes it without `:IN`, or one of others, may set
/// it. Returns the routines that are called and not in the files.
[[nodiscard]] std::set<std::string> note_handed_over(const std::vector<std::vector<Line>>& lines,
                                                     const std::vector<Routine>& routines,
                                                     Variables& names);

}  // namespace trammel::cam::krl
