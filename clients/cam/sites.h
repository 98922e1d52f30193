#pragma once

#include <functional>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include "clients/cam/program.h"

namespace trammel::cam {

/// A motion to a place, with its tool and its frame.
struct SiteUse {
  std::size_t tool = 0, frame = 0;
  std::string motion;
  std::size_t file = 0;
  int line = 0;
  std::size_t move = 0;  ///< of Program::moves
  bool linear = false;
};

/// The bytes of a target, and their uses.
struct Site {
  std::size_t file = 0, begin = 0;
  std::string name;
  std::vector<SiteUse> uses;
};

/// The target places of a program's motions. A place with several tools or frames is recorded once
/// for each.
class Sites {
 public:
  void add(std::size_t file, std::size_t begin, const std::string& name, SiteUse use);

  /// Describes the target at a site: fills coordinates, numbers, configuration, rewrites. Returns
  /// the reason why it cannot be corrected; empty: it can.
  using Describe = std::function<std::string(const Site& site, ProgramTarget& target)>;
  /// Adds a target to the program for each site, or an item left alone with its reason.
  void finish(Program& program, const Describe& describe) const;

 private:
  std::map<std::pair<std::size_t, std::size_t>, Site> sites_;
};

/// `it is used in different ways: tool a in b (f.src line 3), ...`
[[nodiscard]] std::string used_differently(const Program& program,
                                           const std::vector<SiteUse>& ways);

}  // namespace trammel::cam
