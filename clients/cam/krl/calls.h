#pragma once

#include <cstddef>
#include <functional>
#include <map>
#include <set>
#include <string>
#include <vector>

#include "clients/cam/krl/lines.h"
#include "clients/cam/krl/variables.h"

/// Routines of KRL files, and the variables that are passed to them.
namespace trammel::cam::krl {

struct Routine {
  std::string name;
  std::size_t file = 0, first = 0, last = 0;  ///< lines
};

class Routines {
 public:
  /// Adds a routine. The first of several with one name is meant.
  void add(Routine routine);
  [[nodiscard]] Routine& last() { return all_.back(); }
  [[nodiscard]] const std::vector<Routine>& all() const { return all_; }
  [[nodiscard]] const Routine& operator[](std::size_t number) const { return all_[number]; }
  /// nullptr: the files have none.
  [[nodiscard]] const Routine* find(const std::string& name) const;
  /// Procedures and functions, by their numbers, in their order.
  [[nodiscard]] std::vector<std::size_t> called_by(const Tokens& tokens) const;

 private:
  std::vector<Routine> all_;
  std::map<std::string, std::size_t, std::less<>> by_name_;
};

/// Records variables that a call may set. In `shift(XP2)` this is so if the routine is in these
/// files and takes the parameter without `:IN`, or if it is not in these files. Returns the called
/// routines that are missing.
[[nodiscard]] std::set<std::string> note_handed_over(const std::vector<std::vector<Line>>& lines,
                                                     const Routines& routines, Variables& names);

}  // namespace trammel::cam::krl
