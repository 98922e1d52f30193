#pragma once

#include <functional>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include "clients/cam/program.h"

namespace trammel::cam {

/// A motion goes to a place with this tool in this frame.
struct SiteUse {
  std::size_t tool = 0, frame = 0;
  std::string motion;
  std::size_t file = 0;
  int line = 0;
  std::size_t move = 0;  ///< of Program::moves
  bool linear = false;
};

/// Bytes that hold a target, and what uses them.
struct Site {
  std::size_t file = 0, begin = 0;
  std::string name;
  std::vector<SiteUse> uses;
};

/// The places that motions of a program go to. One that is used with several tools or frames is
/// told apart.
class Sites {
 public:
  void add(std::size_t file, std::size_t begin, const std::string& name, SiteUse use);

  /// Says what stands at a site: fills coordinates, numbers, configuration, rewrites. Returns why
  /// it cannot be corrected; empty: it can.
  using Describe = std::function<std::string(const Site& site, ProgramTarget& target)>;
  /// Adds a target to the program for each site, or what is left and why.
  void finish(Program& program, const Describe& describe) const;

 private:
  std::map<std::pair<std::size_t, std::size_t>, Site> sites_;
};

/// `it is used in different ways: tool a in b (f.src line 3), ...`
[[nodiscard]] std::string used_differently(const Program& program,
                                           const std::vector<SiteUse>& ways);

}  // namespace trammel::cam
